"""A player of one's own: pianomime evaluate SONGS --player my_player_plugin:make_player."""

from dataclasses import replace

from pianomime import PlannedPlayer
from pianomime.keyboard import NO_KEY
from pianomime.plan import ZeroShotPlanner
from pianomime.track import DynamicTracker


class HighFingers:
    def plan(self, score):
        plan = ZeroShotPlanner().plan(score)
        fingertips = plan.fingertips.copy()
        fingertips[:, :, 1:, 2] += 0.005 * (plan.finger_key == NO_KEY)  # [m], idle fingers
        return replace(plan, fingertips=fingertips)


def make_player(effort, seed):
    return PlannedPlayer("high-fingers", HighFingers(), DynamicTracker())
