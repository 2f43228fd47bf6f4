"""Metrics of a training, for TensorBoard."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.event_file_writer import EventFileWriter


class RunLog:
    """Writes metrics as they come, without torch.

    Args:
        folder: of the logs.
        since: the next step. Metrics that a killed process wrote for it and later steps are not
            shown any more.
    """

    def __init__(self, folder: Path, since: int = 0) -> None:
        self._writer = EventFileWriter(str(folder))
        begin = SessionLog(status=SessionLog.START)
        self._writer.add_event(Event(wall_time=time.time(), step=since, session_log=begin))

    def add(self, step: int, metrics: Mapping[str, float]) -> None:
        """Write the metrics of a step, by name."""
        scalars = [Summary.Value(tag=name, simple_value=value) for name, value in metrics.items()]
        self._writer.add_event(
            Event(wall_time=time.time(), step=step, summary=Summary(value=scalars))
        )
        self._writer.flush()

    def close(self) -> None:
        """End the log."""
        self._writer.close()
