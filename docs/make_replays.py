"""Makes the replays that the documentation shows: a gallery of three bundled songs.

    ./do run python docs/make_replays.py

`./do docs` does so first. Songs are played again when our code has changed, and pages are made
again when what they are made of has: the performances, our code, or the script of web/.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from pianomime import Score, excerpt, load_player, songs
from pianomime.evaluation.evaluation import program_hash
from pianomime.files import files_digest
from pianomime.keyboard import LEAD_IN_SECONDS
from pianomime.players.performance import Performance
from pianomime.report.gallery import write_gallery

SONGS = ("bach-prelude-c", "beethoven-fur-elise", "satie-gymnopedie-1")
SECONDS = 20.0
ROOT = Path(__file__).parents[1]
PLAYED = ROOT / "build" / "replays"
SITE = ROOT / "docs" / "replays"


def main() -> None:
    """Play what was not played yet, and write the gallery."""
    PLAYED.mkdir(parents=True, exist_ok=True)
    performances = [PLAYED / f"{song}.npz" for song in SONGS]
    _drop_older(performances)
    for song, path in zip(SONGS, performances, strict=True):
        if not path.exists():
            _play(song).save(path)
    write_gallery(performances, SITE, "Three songs", jobs=2)


def _drop_older(performances: list[Path]) -> None:
    """Remove performances and pages of other code, songs or settings, which stand in this file."""
    stamp = PLAYED / "made-by"
    made_by = f"{program_hash()} {files_digest([Path(__file__), *map(songs.path, SONGS)])}"
    if stamp.exists() and stamp.read_text() == made_by:
        return
    for path in performances:
        path.unlink(missing_ok=True)
    shutil.rmtree(SITE, ignore_errors=True)
    # Last: a run that is stopped before finds no stamp of what it has not removed.
    stamp.write_text(made_by)


def _play(song: str) -> Performance:
    score = excerpt(Score.from_midi(songs.path(song)), seconds=SECONDS, lead_in=LEAD_IN_SECONDS)
    return load_player("zero-shot").play(score)


if __name__ == "__main__":
    main()
