"""`pianomime songs`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Songs:
    """List the bundled songs.

    Each can be played by its name or a part of it.

    Examples:
      pianomime songs
      pianomime play fur-elise
    """

    def run(self) -> None:
        """Print one name per line."""
        from pianomime import songs

        print("\n".join(songs.names()))
