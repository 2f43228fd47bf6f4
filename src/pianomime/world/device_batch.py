"""Batches of worlds on a device that is given by its name."""

from __future__ import annotations

from importlib.util import find_spec

import mujoco

from pianomime.device_names import CPU, DEVICES, DeviceName
from pianomime.errors import InputError, unknown_name
from pianomime.installation import install_command
from pianomime.shown import shown
from pianomime.world.batch import WorldBatch
from pianomime.world.batch_base import WorldBatchBase
from pianomime.world_names import PAPER

_PACKAGES = ("warp", "mujoco_warp")
"""What the extra "gpu" installs."""


def device_batch(
    worlds: int,
    device: DeviceName = CPU,
    threads: int = 0,
    quiet: bool = False,
    model: str | mujoco.MjModel = PAPER,
) -> WorldBatchBase:
    """Worlds at rest on a device.

    Args:
        worlds: number of worlds, B.
        device: "cpu" for a `WorldBatch`, another for a `WarpBatch`.
        threads: of "cpu" that step the worlds; 0 for one per core.
        quiet: do not warn when the physics becomes unstable.
        model: name of the world, or its model, as of `world_model`.

    Raises:
        InputError: there is no such world, or the device cannot be used (see `check_device`).
        ValueError: there are no worlds, or a negative number of threads.
    """
    check_device(device)
    if device == CPU:
        return WorldBatch(worlds, threads, quiet, model)
    from pianomime.world.warp_batch import WarpBatch

    return WarpBatch(worlds, device, quiet, model)


def check_device(device: str) -> None:
    """Refuse a device that cannot step worlds here.

    All but "cpu" import what the extra "gpu" installs, which takes some seconds.

    Args:
        device: one of `DEVICES`.

    Raises:
        InputError: there is no device of that name, or none such in this machine; or its packages
            are missing or damaged, and the message says how to install them.
    """
    if device not in DEVICES:
        raise unknown_name("device", device, DEVICES)
    if device == CPU:
        return
    for package in _PACKAGES:
        if find_spec(package) is None:
            raise InputError(
                f"the device {device} needs the package {package}: {install_command('gpu')}"
            )
    try:
        from pianomime.world.warp_batch import warp_device

        warp_device(device)
    except InputError:
        raise
    except Exception as damage:
        # Packages of which a part is missing, as after an interrupted installation, raise anything.
        raise InputError(
            f"the device {device} cannot be used: {type(damage).__name__}: {shown(damage)}. If a "
            f"package is damaged: {install_command('gpu')} --force-reinstall"
        ) from damage
