"""The grid of `evaluate --robust`: how worlds differ from the one that players know."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.world.perturbation import Perturbation


@dataclass(frozen=True)
class Case:
    """A way in which the world differs.

    Attributes:
        name: for tables.
        perturbation: how it differs.
        summed_up: whether it counts for the worst change of controls that are replayed.
    """

    name: str
    perturbation: Perturbation
    summed_up: bool = False

    @property
    def sensed(self) -> bool:
        """Whether it differs in what is sensed alone, which nobody minds who looks at nothing."""
        blind = Perturbation(
            joint_noise=self.perturbation.joint_noise, slide_noise=self.perturbation.slide_noise
        )
        return self.perturbation == blind != Perturbation()


NOMINAL = Case("nominal", Perturbation())
"""The world that players know."""

GRID = (
    NOMINAL,
    Case("friction -30 %", Perturbation(friction=0.7), summed_up=True),
    Case("friction +30 %", Perturbation(friction=1.3), summed_up=True),
    Case("hands 10 % heavier", Perturbation(hand_mass=1.1), summed_up=True),
    Case("actuator gain -10 %", Perturbation(gain=0.9), summed_up=True),
    Case("actuator gain +10 %", Perturbation(gain=1.1), summed_up=True),
    Case("key stiffness -20 %", Perturbation(key_stiffness=0.8), summed_up=True),
    Case("key stiffness +20 %", Perturbation(key_stiffness=1.2), summed_up=True),
    Case("keys 2 mm aside", Perturbation(keys_aside=0.002), summed_up=True),
    Case("keys 5 mm aside", Perturbation(keys_aside=0.005)),
    Case("noise 0.01 rad, 1 mm", Perturbation(joint_noise=0.01, slide_noise=0.001)),
    Case("noise 0.03 rad, 3 mm", Perturbation(joint_noise=0.03, slide_noise=0.003)),
    Case("delay 25 ms", Perturbation(delay=0.025)),
    Case("delay 50 ms", Perturbation(delay=0.05)),
    Case(
        "all mild ones",
        Perturbation(
            friction=0.7,
            hand_mass=1.1,
            gain=0.9,
            key_stiffness=1.2,
            keys_aside=0.002,
            joint_noise=0.01,
            slide_noise=0.001,
        ),
    ),
)
"""All cases, the nominal one first. The last has one of each kind but a delay."""
