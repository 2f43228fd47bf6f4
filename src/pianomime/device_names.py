"""Names of the devices that step the physics of many worlds; cheap to import."""

from __future__ import annotations

from typing import Literal, get_args

DeviceName = Literal["cpu", "cuda", "warp-cpu"]

DEVICES: tuple[DeviceName, ...] = get_args(DeviceName)
"""MuJoCo on the cores of this machine; MuJoCo Warp on its GPU; and MuJoCo Warp on one core, which
is for tests of what the GPU does, and slow."""
CPU: DeviceName = "cpu"
"""The device of everything that is to be the same bit for bit as one `World`."""
CUDA: DeviceName = "cuda"
"""The first GPU of NVIDIA."""
