"""Interfaces of policies' networks: names and shapes of their inputs and outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pianomime.keyboard import KEYS
from pianomime.policies.finger_residual import ACTIONS, SIZE
from pianomime.policies.horizon import CHUNK, GOAL_HORIZON
from pianomime.world.layout import LAYOUT, POINTS_SIZE

if TYPE_CHECKING:
    from pianomime.policies.policy import PolicyInfo

Shapes = dict[str, tuple[int | None, ...]]
"""Shapes by name, but for the batch that comes first; None is any size."""

ACTION_SIZES = {
    "high": POINTS_SIZE,
    "low": LAYOUT.ctrl_size,
    "end-to-end": LAYOUT.ctrl_size,
    "finger": ACTIONS,
}
"""Numbers of the action for one frame, by level."""


def inputs_of(info: PolicyInfo) -> Shapes:
    """What the network of a policy is called with."""
    if info.level == "finger":
        return {"observation": (SIZE,)}
    high = info.level == "high"
    inputs: Shapes = {"goal": (GOAL_HORIZON if high else CHUNK, KEYS)}
    if info.level == "low":
        inputs["frames"] = (CHUNK, 2 * POINTS_SIZE)
    state = 2 * LAYOUT.hands_size + KEYS + POINTS_SIZE
    inputs["vector"] = (POINTS_SIZE if high else state + info.residual * LAYOUT.ctrl_size,)
    if info.network == "diffusion":
        inputs |= {"noisy": (info.chunk, info.action_size), "step": ()}
    return inputs


def outputs_of(info: PolicyInfo) -> Shapes:
    """What the network of a policy gives, in this order."""
    if info.level == "finger":
        return {"action": (info.action_size,)}
    if info.network == "bet":
        bins = {"probability": (info.chunk, None)}
        return {**bins, "actions": (info.chunk, None, info.action_size)}
    return {"action": (info.chunk, info.action_size)}
