"""RoboPianist's side of `speed_world.py`, which starts it in RoboPianist's own Python.

Messages are lines of JSON: first its versions, then, for each request of a mode ("environment",
"physics" or "census"), the result of running all controls in that mode.

RoboPianist's suite loads its environment with the options and ranges of PianoMime's published code,
so that the controls given to `World` move its hands in the same way over the same keys: a third
forearm slide, gravity compensation, no collisions between hands, a longer reach, and forearm
actuators three times as stiff.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from typing import Any

import mujoco
import numpy as np
from robopianist import suite
from robopianist.models.hands import shadow_hand

SUBSTEPS = 10
FOREARM = ("forearm_tx", "forearm_ty", "forearm_tz")
FOREARM_STIFFER = 3.0


def load() -> Any:
    dofs = shadow_hand._FOREARM_DOFS
    dofs["forearm_ty"] = dataclasses.replace(dofs["forearm_ty"], joint_range=(-0.1, 0.1))
    return suite.load(
        "RoboPianist-debug-TwinkleTwinkleRousseau-v0",
        seed=0,
        # Long enough for any benchmark: an episode ends with its song.
        stretch=20.0,
        task_kwargs={
            "control_timestep": 0.05,
            "gravity_compensation": True,
            "forearm_dofs": FOREARM,
            "disable_hand_collisions": True,
            "primitive_fingertip_collisions": "--primitive-tips" in sys.argv,
        },
    )


def stiffen(model: mujoco.MjModel) -> None:
    for actuator in range(model.nu):
        if "forearm_t" in model.actuator(actuator).name:
            model.actuator_gainprm[actuator, 0] *= FOREARM_STIFFER
            model.actuator_biasprm[actuator, 1] *= FOREARM_STIFFER


class Worker:
    """The environment, and the plain simulation of its model."""

    def __init__(self, controls: np.ndarray) -> None:
        self.environment = load()
        self.environment.reset()
        self.model = self.environment.physics.model.ptr
        stiffen(self.model)
        spec = self.environment.action_spec()
        # One more action for the pedal.
        actions = np.column_stack((controls, np.zeros(len(controls))))
        self.actions = np.clip(actions, spec.minimum, spec.maximum)
        self.data = mujoco.MjData(self.model)
        self.hands = self.hand_actuators()

    def hand_actuators(self) -> np.ndarray:
        """Where the model keeps the controls that the actions' order gives."""
        names = [self.model.actuator(index).name for index in range(self.model.nu)]
        task = self.environment.task
        order = [
            actuator.full_identifier
            for hand in (task.right_hand, task.left_hand)
            for actuator in hand.actuators
        ]
        return np.array([names.index(name) for name in order])

    def run_environment(self) -> float:
        """Seconds that the environment takes for all controls."""
        self.environment.reset()
        start = time.perf_counter()
        for action in self.actions:
            self.environment.step(action)
        return time.perf_counter() - start

    def run_physics(self) -> float:
        """Seconds that the plain simulation of its model takes for all controls."""
        mujoco.mj_resetData(self.model, self.data)
        controls = np.empty((len(self.actions), self.model.nu))
        controls[:, self.hands] = self.actions[:, :-1]
        start = time.perf_counter()
        for control in controls:
            self.data.ctrl[:] = control
            mujoco.mj_step(self.model, self.data, nstep=SUBSTEPS)
        return time.perf_counter() - start

    def census(self) -> dict[str, float]:
        """What the hands do in the environment: mean keys pressed and contacts."""
        self.environment.reset()
        pressed, contacts = [], []
        for action in self.actions:
            if self.environment.step(action).last():
                raise RuntimeError("the episode ended before the controls did")
            pressed.append(self.environment.task.piano.activation.sum())
            contacts.append(self.environment.physics.data.ncon)
        return {"keys_pressed": float(np.mean(pressed)), "contacts": float(np.mean(contacts))}


def main() -> None:
    worker = Worker(np.load(sys.argv[1]))

    def send(**message: Any) -> None:
        print(json.dumps(message), flush=True)

    send(
        mujoco=mujoco.__version__,
        nq=int(worker.model.nq),
        nu=int(worker.model.nu),
        actuators=[
            name.rpartition("/")[2] for name in worker.environment.action_spec().name.split("\t")
        ],
    )
    modes = {"environment": worker.run_environment, "physics": worker.run_physics}
    for line in sys.stdin:
        mode = json.loads(line)["mode"]
        if mode == "census":
            send(**worker.census())
        else:
            send(seconds=modes[mode]())


if __name__ == "__main__":
    main()
