"""Controllers: they give the controls of one performance, and hold all its state."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.world import World


class Controller(Protocol):
    """Gives the controls of one performance, frame after frame."""

    @property
    def replayable(self) -> bool:
        """Whether the control depends on plan, frame and world alone.

        Such a controller may be asked for any frame, more than once, on copies of the world. One
        that is not replayable keeps a memory: it must be asked for every frame once, in order.
        """
        ...

    @property
    def plan(self) -> FingertipPlan | None:
        """What is to be played, a row for each frame; None where nothing is planned.

        A controller that plans while it plays knows the frames that it was asked for; the rest are
        at rest.
        """
        ...

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """The control for `World.step` in one frame.

        Args:
            frame: 0 for the first. For a `FineController` it is the number of the control.
            world: as it is before the frame, or before that control; it must not be changed.

        Returns:
            (46,) targets of the position actuators, right then left hand [rad, m]; or (S, 46),
            which follow one another within the frame, as many in every frame.
        """
        ...


@runtime_checkable
class PedalController(Controller, Protocol):
    """A controller that works the sustain pedal as well; for all others the score does."""

    def pedal(self, frame: int) -> bool:
        """Whether the pedal is down in the frame whose control was asked for last."""
        ...


@runtime_checkable
class FineController(Controller, Protocol):
    """A controller that looks at the world several times a frame, and gives a control each time.

    With S controls a frame, `control` is asked for the controls 0, 1, ... of the whole performance:
    number n is held in part n % S of frame n // S, with `World.step(ctrl, parts=S)`, and gets the
    world as it is before that part. Each control is (46,).
    """

    @property
    def controls_per_frame(self) -> int:
        """S, the number of controls that follow one another in a frame; it divides 10."""
        ...


def controls_per_frame(controller: Controller) -> int:
    """How many times a frame a controller is to be asked; 1 for all but a `FineController`."""
    return controller.controls_per_frame if isinstance(controller, FineController) else 1


class BatchController(Controller, Protocol):
    """A replayable controller of many worlds at once, each at its own frame of one plan."""

    def controls(
        self, frames: NDArray[np.int64], qpos: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The controls of n worlds, each bit for bit what `control` gives for it.

        Args:
            frames: (n,) of the plan.
            qpos: (n, 142) positions before them, as in `World.qpos` [rad, m].

        Returns:
            The controls (n, 46) [rad, m], and the points of the hands (n, 2, 6, 3) [m] at these
            positions: hands (left, right), wrist and fingertips, thumb first.
        """
        ...
