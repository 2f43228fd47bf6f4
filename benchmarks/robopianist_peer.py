"""RoboPianist in a process of its own: each request and each answer is one line of JSON."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any


class RobopianistPeer:
    """A worker script that runs in RoboPianist's environment.

    Args:
        python: the Python of that environment, see `install_robopianist.py`.
        worker: name of the script beside this file.
        arguments: arguments of the script.

    Attributes:
        facts: its first answer, when it is ready.
    """

    def __init__(self, python: Path, worker: str, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [str(python), str(Path(__file__).with_name(worker)), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "MUJOCO_GL": "disable", "PYTHONWARNINGS": "ignore"},
        )
        self.facts = self._answer()

    def ask(self, mode: str) -> dict[str, Any]:
        """Let it work in a mode, and wait for its answer."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"mode": mode}) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def pin(self, core: int) -> None:
        """Restrict it to one core."""
        os.sched_setaffinity(self._process.pid, {core})

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("RoboPianist's process has ended; its error is above")
        answer: dict[str, Any] = json.loads(line)
        return answer
