"""A planner of one's own: idle fingers are lifted higher. Compares F1 with and without it."""

from dataclasses import dataclass, replace

import pianomime
from pianomime.keyboard import NO_KEY
from pianomime.plan import ZeroShotPlanner
from pianomime.track import DynamicTracker


@dataclass(frozen=True)
class HighFingers:
    """Lifts idle fingers above where another planner wants them.

    Attributes:
        planner: whose plan to start from.
        lift: how much higher [m].
    """

    planner: pianomime.Planner
    lift: float = 0.005

    def plan(self, score: pianomime.Score) -> pianomime.FingertipPlan:
        plan = self.planner.plan(score)
        fingertips = plan.fingertips.copy()  # (T, 2, 6, 3) m; point 0 is the wrist
        fingertips[:, :, 1:, 2] += self.lift * (plan.finger_key == NO_KEY)
        return replace(plan, fingertips=fingertips)


def main() -> None:
    midi = pianomime.songs.path("twinkle-twinkle")
    score = pianomime.excerpt(pianomime.Score.from_midi(midi), seconds=3)
    plain = ZeroShotPlanner()
    for name, planner in (("plain", plain), ("high-fingers", HighFingers(plain))):
        player = pianomime.PlannedPlayer(name, planner, DynamicTracker())
        print(f"{name:12} F1 {player.play(score).metrics()['f1']:.3f}")


if __name__ == "__main__":
    main()
