"""The fingertips of a whole song before it is played, as a high-level policy predicts them.

The policy draws at random, and each prediction leads to the next. So several candidates are
predicted side by side, and now and then the half whose hands fit their keys worse goes on from the
other half instead: a particle filter (Gordon, Salmond and Smith, 1993) that looks at fingertips and
goals alone. The world is not asked.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.policies.features import rest_points
from pianomime.policies.finger_assignment import assign_fingers
from pianomime.policies.fingertip_policy import PlanRecord, goals_ahead, no_keys, predict_points
from pianomime.policies.horizon import GOAL_HORIZON
from pianomime.policies.policy import Policy
from pianomime.progress import Steps
from pianomime.validation import within
from pianomime.world.layout import POINT_COUNT
from pianomime.world.parameters import key_centres

CANDIDATES = 4
"""Predictions that are made side by side."""
_SELECT_FRAMES = 2
"""Frames between selections among candidates."""
_SPAN_FREE, _SPAN_UNIT = 0.005, 0.01
"""[m] How far a hand's fingers may be from where they were predicted, relative to each other and
along the keyboard, at no cost; and how much more costs as much as a key without a finger."""


def predicted_plan(
    score: Score, policy: Policy, seed: int = 0, candidates: int = CANDIDATES
) -> FingertipPlan:
    """Predict the fingertips of a song, each frame from the prediction for the frame before.

    Args:
        score: what is to be played.
        policy: the fingertip policy.
        seed: of its sampling.
        candidates: how many, of which the best is taken.

    Returns:
        A plan with one row for each frame of `score.roll()`, see `assign_fingers`.

    Raises:
        InputError: there are no candidates.
    """
    within("candidates", candidates, 1)
    goals, frames, rng = goals_ahead(score), score.frames(), np.random.default_rng(seed)
    points = np.tile(rest_points(), (candidates, 1, 1, 1))
    pressing = np.tile(no_keys(), (candidates, 1, 1))
    all_points = np.empty((frames, candidates, 2, POINT_COUNT, 3))
    all_keys = np.empty((frames, *pressing.shape), np.int8)
    # Which candidate of the frame before each goes on from.
    parents = np.tile(np.arange(candidates), (frames, 1))
    misfits = np.zeros(candidates)
    told = Steps("fingertips", frames)
    for frame in range(frames):
        if candidates > 1 and frame % _SELECT_FRAMES == 0:
            order = np.argsort(misfits, kind="stable")
            chosen = np.resize(order[: -(-candidates // 2)], candidates)
            points, pressing, misfits = points[chosen], pressing[chosen], misfits[chosen]
            parents[frame] = chosen
        predicted = predict_points(policy, goals[frame : frame + GOAL_HORIZON], points, rng)[:, 0]
        for each in range(candidates):
            points[each], pressing[each] = assign_fingers(
                predicted[each], goals[frame], pressing[each]
            )
            misfits[each] += misfit(predicted[each], pressing[each], goals[frame])
        all_points[frame], all_keys[frame] = points, pressing
        told.advance(1)
    record, best = PlanRecord(score), int(np.argmin(misfits))
    for frame in reversed(range(frames)):
        record.write(frame, all_points[frame, best], all_keys[frame, best])
        best = parents[frame, best]
    return record.plan()


def misfit(
    predicted: NDArray[np.float64], finger_key: NDArray[np.int8], goal: NDArray[np.bool_]
) -> float:
    """What is wrong with a candidate in a frame, in keys that no finger was given.

    Args:
        predicted: (2, 6, 3) as the policy predicts them [m].
        finger_key: (2, 5) the key of each finger, -1 for none.
        goal: (88,) keys that should be down.
    """
    cost = float(goal.sum() - (finger_key >= 0).sum())
    for hand, presses in enumerate(finger_key >= 0):
        if presses.any():
            away = key_centres()[finger_key[hand, presses], 1] - predicted[hand, 1:][presses, 1]
            spread = np.abs(away - away.mean())
            cost += float(np.maximum(spread - _SPAN_FREE, 0.0).sum()) / _SPAN_UNIT
    return cost
