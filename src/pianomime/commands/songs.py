"""`pianomime songs`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Songs:
    """List the bundled songs.

    They can be played by name, or by a part of it.

    Examples:
      pianomime songs
      pianomime play fur-elise
    """

    def run(self) -> None:
        """Print one name a line."""
        from pianomime import songs

        print("\n".join(songs.names()))
