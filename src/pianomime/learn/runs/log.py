"""Figures of a training, for TensorBoard."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.event_file_writer import EventFileWriter


class RunLog:
    """Writes figures as they come, without torch.

    Args:
        folder: of the logs.
        since: the step that comes next. What a process that was killed wrote of that and later
            ones is not shown any more.
    """

    def __init__(self, folder: Path, since: int = 0) -> None:
        self._writer = EventFileWriter(str(folder))
        begin = SessionLog(status=SessionLog.START)
        self._writer.add_event(Event(wall_time=time.time(), step=since, session_log=begin))

    def add(self, step: int, figures: Mapping[str, float]) -> None:
        """Write figures, each with its name, at a step."""
        scalars = [Summary.Value(tag=name, simple_value=figure) for name, figure in figures.items()]
        self._writer.add_event(
            Event(wall_time=time.time(), step=step, summary=Summary(value=scalars))
        )
        self._writer.flush()

    def close(self) -> None:
        """End the log."""
        self._writer.close()
