"""Interfaces of policies' networks: names and shapes of their inputs and outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pianomime.keyboard import KEYS
from pianomime.policies import finger_residual
from pianomime.policies.horizon import CHUNK, GOAL_HORIZON
from pianomime.policies.three_stage import fingering, hand_controls, hand_motion
from pianomime.world.layout import LAYOUT, POINTS_SIZE

if TYPE_CHECKING:
    from pianomime.policies.policy import PolicyInfo

Shapes = dict[str, tuple[int | None, ...]]
"""Shapes by name, but for the batch that comes first; None is any size."""

ACTION_SIZES = {
    "high": POINTS_SIZE,
    "low": LAYOUT.ctrl_size,
    "end-to-end": LAYOUT.ctrl_size,
    "finger": finger_residual.ACTIONS,
    "fingering": fingering.CHOICES,
    "hand-motion": hand_motion.PLANE,
    "hand-controls": hand_controls.ACTIONS,
}
"""Numbers of the action for one frame, by level."""

STAGES = ("fingering", "hand-motion", "hand-controls")
"""Levels of the player of three stages, in order."""

_OBSERVATIONS = {
    "finger": finger_residual.SIZE,
    "fingering": fingering.SIZE,
    "hand-motion": hand_motion.SIZE,
    "hand-controls": hand_controls.SIZE,
}
"""Numbers of an observation, where that is all there is."""


def inputs_of(info: PolicyInfo) -> Shapes:
    """What the network of a policy is called with."""
    if info.level in _OBSERVATIONS:
        return {"observation": (_OBSERVATIONS[info.level],)}
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
    if info.level in STAGES:
        return {"action": (CHUNK if info.level == "hand-motion" else 1, info.action_size)}
    if info.network == "bet":
        bins = {"probability": (info.chunk, None)}
        return {**bins, "actions": (info.chunk, None, info.action_size)}
    return {"action": (info.chunk, info.action_size)}
