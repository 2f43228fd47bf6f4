"""Music: scores, MIDI files, rolls, metrics and sound. It knows nothing of robots."""

from pianomime.music.notes import notes_from_roll
from pianomime.music.score import KEYS, LOWEST_PITCH, Score, ScoreError

__all__ = [
    "KEYS",
    "LOWEST_PITCH",
    "Score",
    "ScoreError",
    "notes_from_roll",
]
