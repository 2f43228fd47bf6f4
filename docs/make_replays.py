"""Makes the replays that the documentation shows: a gallery of three bundled songs.

    ./do run python docs/make_replays.py

`./do docs` does so first. What is there and was made of the same performances stays.
"""

from __future__ import annotations

from pathlib import Path

from pianomime import Score, excerpt, load_player, songs
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
    for song, path in zip(SONGS, performances, strict=True):
        if not path.exists():
            _play(song).save(path)
    write_gallery(performances, SITE, "Three songs", jobs=2)


def _play(song: str) -> Performance:
    score = excerpt(Score.from_midi(songs.path(song)), seconds=SECONDS, lead_in=LEAD_IN_SECONDS)
    return load_player("zero-shot").play(score)


if __name__ == "__main__":
    main()
