"""The evaluations of a run, for TensorBoard."""

from __future__ import annotations

import time

from tensorboard.compat.proto.event_pb2 import Event
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.event_file_writer import EventFileWriter

from pianomime.learn.run_folder import Evaluation, RunFolder


class RunLog:
    """Writes what PPO's logger writes of a song, without torch.

    Args:
        run: whose; the log is in its folder.
    """

    def __init__(self, run: RunFolder) -> None:
        self._writer = EventFileWriter(str(run.tensorboard))

    def add(self, made: Evaluation) -> None:
        """Write an evaluation, at the steps that were spent by then."""
        scalars = [
            Summary.Value(tag=f"song/{name}", simple_value=getattr(made, name))
            for name in ("precision", "recall", "f1")
        ]
        event = Event(wall_time=time.time(), step=made.steps, summary=Summary(value=scalars))
        self._writer.add_event(event)
        self._writer.flush()

    def close(self) -> None:
        """End the log."""
        self._writer.close()
