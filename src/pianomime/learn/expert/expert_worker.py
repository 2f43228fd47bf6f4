"""The process in which one expert of many is trained: a request in, a row out, as JSON.

A process of its own, so that a crash costs one song; what it had is in the folder of its run. It
ends when its input does, and so does not outlive the process that asked, however that ends.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
import traceback
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.learn.expert.config import ExpertConfig, from_json
from pianomime.learn.expert.expert import train_expert

Row = dict[str, Any]
"""What became of one song: `song`, and `f1`, `precision`, `recall`, `steps`, `seconds` of this
call; or `song` and `error`."""


@dataclass(frozen=True)
class Request:
    """One expert to train.

    Attributes:
        song: a demonstration or a MIDI file.
        out: folder of its run.
        config: how.
        start, seconds: the excerpt [s].
    """

    song: str
    out: str
    config: ExpertConfig
    start: float
    seconds: float

    @classmethod
    def from_text(cls, text: str) -> Request:
        """What `text` was."""
        content = json.loads(text)
        return cls(**{**content, "config": from_json(ExpertConfig, content["config"])})

    @property
    def text(self) -> str:
        """As JSON."""
        return json.dumps(asdict(self))


def train_one(request: Request) -> Row:
    """Train an expert in this process, with one thread; the row of it, whatever happens."""
    song = Path(request.song).stem
    began = time.perf_counter()
    try:
        run = train_expert(
            request.song,
            Path(request.out),
            request.config,
            request.start,
            request.seconds,
            threads=1,
        )
        best = run.best()[1]
    except (InputError, OSError) as error:
        return {"song": song, "error": str(error)}
    except Exception as error:  # A bug of ours must not cost the other songs either.
        where = traceback.extract_tb(error.__traceback__)[-1]
        reason = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return {"song": song, "error": reason}
    spent = {"steps": run.steps_done, "seconds": round(time.perf_counter() - began, 1)}
    return {"song": song, **best, **spent}


class ExpertProcess:
    """A process that trains one expert, started at once.

    Args:
        request: what to train.
    """

    def __init__(self, request: Request) -> None:
        self._song = Path(request.song).stem
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pianomime.learn.expert.expert_worker", request.text],
            stdout=subprocess.PIPE,
            # Nothing is ever written to it; it ends with this process.
            stdin=subprocess.PIPE,
            encoding="utf-8",
            # One song a core: more threads in each would only get in each other's way.
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            # Ctrl-C is for the process that asked, which then ends this one.
            start_new_session=True,
        )

    def row(self) -> Row:
        """Wait for the row."""
        assert self._process.stdout is not None
        said = self._process.stdout.read()
        code = self._process.wait()
        if code or not said.endswith("\n"):
            return {"song": self._song, "error": f"its process died (exit code {code})"}
        row: Row = json.loads(said)
        return row

    def close(self) -> None:
        """End it, also in the middle of a song."""
        self._process.kill()
        self._process.wait()


def _end_with_input() -> None:
    """End this process where it stands when its input ends, as after a kill of who asked."""
    while os.read(0, 4096):
        pass
    os._exit(1)


def main() -> None:
    """Train what the only argument asks for."""
    threading.Thread(target=_end_with_input, daemon=True).start()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    # Anything that a library prints must not get into the row.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    warnings.simplefilter("ignore")
    print(json.dumps(train_one(Request.from_text(sys.argv[1]))), file=answers, flush=True)


if __name__ == "__main__":
    main()
