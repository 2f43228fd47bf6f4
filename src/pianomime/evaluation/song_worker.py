"""The process in which `evaluate` plays songs: paths in, a line each; rows out, a line each.

A process of its own, rather than a fork or a `multiprocessing` child, so that a crash costs one
song and a script that calls `evaluate` needs no `if __name__ == "__main__"`. It ends when its
input does, and so does not outlive the process that asked.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import traceback
import warnings
from pathlib import Path
from types import TracebackType
from typing import Any

from pianomime.errors import InputError
from pianomime.evaluation.diagnose import diagnose, frames_by_cause
from pianomime.evaluation.summary import summarize
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.players.player import Player


class SongWorker:
    """A handle on such a process, which starts at once, and again after a crash.

    Args:
        player: name of the player.
        effort: how hard it tries, 0 to 3.
        seconds: how much of a song to play at most [s].
        seed: of what it draws.
    """

    def __init__(self, player: str, effort: int, seconds: float, seed: int = 0) -> None:
        self._arguments = [player, str(effort), str(seconds), str(seed)]
        # One thread may wait for a song in `play` while another calls `close`.
        self._lock = threading.Lock()
        self._closed = False
        self._process = self._start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def play(self, song: Path) -> dict[str, Any]:
        """The row of one song: its summarize, or `song` and `error`."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(json.dumps(str(song)), file=self._process.stdin, flush=True)
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if line.endswith("\n"):
            row: dict[str, Any] = json.loads(line)
            return row
        code = self._process.wait()
        with self._lock:
            if not self._closed:
                self._process = self._start()
        return {"song": song.stem, "error": f"its process died (exit code {code})"}

    def close(self) -> None:
        """End the process, also in the middle of a song, for good."""
        with self._lock:
            self._closed = True
        self._process.kill()
        self._process.wait()

    def _start(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "pianomime.evaluation.song_worker", *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            # One song a core: more threads in each would only get in each other's way.
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            # Ctrl-C is for the process that asked, which then stops this one.
            start_new_session=True,
        )

    def __enter__(self) -> SongWorker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _row(song: Path, player: Player, seconds: float) -> dict[str, Any]:
    try:
        score = excerpt(Score.from_midi(song), seconds=seconds)
        performance = player.play(score)
        # Two files can bear one title, but not one name in a folder.
        row: dict[str, Any] = {**summarize(performance), "song": song.stem}
        if performance.plan is not None:
            row["causes"] = frames_by_cause(diagnose(performance))
        return row
    except (InputError, OSError) as error:
        return {"song": song.stem, "error": str(error)}
    except Exception as error:  # A bug of ours must not cost the other songs either.
        where = traceback.extract_tb(error.__traceback__)[-1]
        reason = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return {"song": song.stem, "error": reason}


def main() -> None:
    """Answer until the input ends."""
    name, effort, seconds, seed = sys.argv[1:]
    # Anything that a library prints must not get between the rows.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # What warnings tell, such as that the physics broke, is counted in the row.
    warnings.simplefilter("ignore")
    player = Player.from_name(name, int(effort), int(seed))
    for line in sys.stdin:
        row = _row(Path(json.loads(line)), player, float(seconds))
        print(json.dumps(row, allow_nan=False), file=answers, flush=True)


if __name__ == "__main__":
    main()
