"""Music: scores, MIDI files, piano rolls, excerpts, metrics and sound. Nothing of robots."""

from pianomime.music.excerpt import excerpt
from pianomime.music.metrics import FrameMetrics, frame_metrics, onset_f1, pedal_f1
from pianomime.music.notes import notes_from_roll
from pianomime.music.protocol import MusicMetrics, match_notes, music_metrics, protocol_digest
from pianomime.music.score import Score, ScoreError
from pianomime.music.sound import render_audio
from pianomime.music.wav import write_wav

__all__ = [
    "FrameMetrics",
    "MusicMetrics",
    "Score",
    "ScoreError",
    "excerpt",
    "frame_metrics",
    "match_notes",
    "music_metrics",
    "notes_from_roll",
    "onset_f1",
    "pedal_f1",
    "protocol_digest",
    "render_audio",
    "write_wav",
]
