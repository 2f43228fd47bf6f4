"""MIDI files to and from scores.

Files are parsed by symusic 0.6 or later (0.5 crashes the process on damaged files). Compared with
mido, which pretty_midi uses, it is strict (a truncated or altered file is an error), keeps notes
of length zero, and takes milliseconds instead of seconds. Only its ticks are used: its seconds are
float32, while here they are float64 and computed as pretty_midi does, which decides on which side
of a frame boundary a note falls and makes rolls equal to RoboPianist's cell for cell. One
difference remains: where the end of a note is missing from a file, symusic drops the last note on
that key, which pretty_midi rightly keeps (14 notes in 6 of 114 real files, 138 of 257,390 roll
cells).
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.files import atomic
from pianomime.keyboard import KEYS, LOWEST_PITCH
from pianomime.music.score import MAX_SECONDS, Score, ScoreError

SUSTAIN_PEDAL = 64
PEDAL_DOWN = 64
"""Controller number of the sustain pedal, and the lowest value at which it is down."""

WRITTEN_TICKS_PER_BEAT = 7680
WRITTEN_BEATS_PER_MINUTE = 120
"""A frame of 0.05 s is 768 ticks, a power of two times the usual 48. So frame boundaries survive
rounding, and rolls are read back from a file cell for cell. Ticks are also fine enough for other
times, and coarse enough that a silence as long as the longest score fits in MIDI's 28 bits."""


def read_midi(path: Path) -> Score:
    """Read a MIDI file, see `Score.from_midi`."""
    midi = _parse(path)
    clock = _Clock(midi, path)
    # Drums are left out; their channel has no pitches.
    tracks = [track for track in midi.tracks if not track.is_drum]
    notes = [track.notes.numpy() for track in tracks if len(track.notes)]
    if not notes:
        raise ScoreError(f"{path} has no piano notes")
    begin = np.concatenate([each["time"] for each in notes]).astype(np.int64)
    end = np.concatenate([_first_ends(each) for each in notes])
    key = np.concatenate([each["pitch"] for each in notes]).astype(np.int64) - LOWEST_PITCH
    velocity = np.concatenate([each["velocity"] for each in notes]).astype(np.int64)

    on_piano = (key >= 0) & (key < KEYS)
    left_out = int((~on_piano).sum())
    if left_out == len(key):
        raise ScoreError(f"{path} has no notes within the range of a piano")
    if left_out:
        warnings.warn(
            f"{path}: {left_out} of {len(key)} notes are outside the range of a piano and left out",
            stacklevel=3,
        )
    key, begin, end, velocity = _join_doubled(
        key[on_piano], begin[on_piano], end[on_piano], velocity[on_piano]
    )
    if begin.min() < 0 or (end < begin).any() or clock.seconds(end).max() > MAX_SECONDS:
        raise ScoreError(f"{path} is damaged, or longer than {MAX_SECONDS / 3600:.0f} hours")
    return Score(
        key=key,
        onset=clock.seconds(begin),
        offset=clock.seconds(end),
        velocity=velocity,
        pedal=clock.seconds(_pedal_ticks(tracks, int(end.max()))),
        title=path.stem,
    )


def write_midi(score: Score, path: Path) -> None:
    """Write a MIDI file, see `Score.to_midi`."""
    with atomic(path) as temporary:
        temporary.write_bytes(midi_bytes(score))


def midi_bytes(score: Score) -> bytes:
    """The bytes of a MIDI file, see `Score.to_midi`."""
    import symusic

    rate = WRITTEN_TICKS_PER_BEAT * WRITTEN_BEATS_PER_MINUTE / 60
    begin = np.rint(score.onset * rate).astype(np.int32)
    end = np.rint(score.offset * rate).astype(np.int32)
    piano: Any = symusic.Track(name=score.title, program=0, is_drum=False)
    piano.notes = symusic.Note.from_numpy(
        time=begin,
        duration=end - begin,
        pitch=(score.key + LOWEST_PITCH).astype(np.int8),
        velocity=score.velocity.astype(np.int8),
    )
    for on, off in np.rint(score.pedal * rate).astype(int).tolist():
        piano.controls.append(symusic.ControlChange(on, SUSTAIN_PEDAL, 127))
        piano.controls.append(symusic.ControlChange(off, SUSTAIN_PEDAL, 0))
    midi: Any = symusic.Score(WRITTEN_TICKS_PER_BEAT)
    midi.tempos.append(symusic.Tempo(0, WRITTEN_BEATS_PER_MINUTE))
    midi.tracks.append(piano)
    content: bytes = midi.dumps_midi()
    return content


def _parse(path: Path) -> Any:
    """The file as a `symusic.Score` in ticks."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise ScoreError(f"{path} does not exist") from None
    except IsADirectoryError:
        raise ScoreError(f"{path} is a folder, not a MIDI file") from None
    except OSError as error:
        raise ScoreError(f"{path} cannot be read: {error.strerror}") from error
    if not content:
        raise ScoreError(f"{path} is empty")
    if not content.startswith(b"MThd"):
        raise ScoreError(f"{path} is not a MIDI file")
    if len(content) >= 14 and content[12] >= 0x80:
        raise ScoreError(f"{path} is timed by SMPTE codes; only beats are supported")

    import symusic

    try:
        midi: Any = symusic.Score.from_midi(content)
    except (RuntimeError, ValueError) as error:
        raise ScoreError(f"{path} is a damaged or incomplete MIDI file") from error
    if midi.ticks_per_quarter < 1:
        raise ScoreError(f"{path} is damaged: it has no ticks in a beat")
    return midi


class _Clock:
    """Converts ticks to seconds with the tempo changes of one file."""

    def __init__(self, midi: Any, path: Path) -> None:
        changes = midi.tempos.numpy()
        tick = changes["time"].astype(np.int64)
        micros_per_beat = changes["mspq"].astype(np.float64)
        if (micros_per_beat <= 0).any():
            raise ScoreError(f"{path} is damaged: it has a tempo of zero")
        # The MIDI standard's default is 120 beats per minute.
        tick = np.append(0, tick)
        micros_per_beat = np.append(500_000.0, micros_per_beat)
        # In the order in which pretty_midi computes it: see the top of this file.
        self.tick_seconds = 60.0 / ((6e7 / micros_per_beat) * midi.ticks_per_quarter)
        self.tick = tick
        self.second = np.append(0.0, np.cumsum(np.diff(tick) * self.tick_seconds[:-1]))

    def seconds(self, tick: NDArray[np.int64]) -> NDArray[np.float64]:
        """Seconds at each tick, any shape."""
        tempo = np.maximum(np.searchsorted(self.tick, tick, side="left") - 1, 0)
        return np.asarray(
            self.second[tempo] + (tick - self.tick[tempo]) * self.tick_seconds[tempo], np.float64
        )


def _first_ends(notes: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
    """(N,) Tick at which each note of a track ends: the first end on its key after its beginning.

    symusic pairs the first beginning on a key with the first end, the second with the second, so
    that after one missing end every later note on the key would last too long. In pretty_midi, and
    therefore in RoboPianist, an end ends all notes on the key.
    """
    begin = notes["time"].astype(np.int64)
    end: NDArray[np.int64] = begin + notes["duration"]
    # All keys share one axis, far enough apart that a search cannot reach the next key.
    start_of_key = notes["pitch"].astype(np.int64) * (end.max() + 1)
    ends = np.sort(start_of_key + end)
    first: NDArray[np.int64] = ends[
        np.searchsorted(ends, start_of_key + begin, side="right") % len(ends)
    ]
    # A note of length zero stays so.
    first = np.where(end > begin, first - start_of_key, end)
    return first


def _join_doubled(
    key: NDArray[np.int64],
    begin: NDArray[np.int64],
    end: NDArray[np.int64],
    velocity: NDArray[np.int64],
) -> tuple[NDArray[np.int64], ...]:
    """Merge notes that strike one key at one instant into one, the longest and loudest."""
    order = np.lexsort((key, begin))
    key, begin, end, velocity = key[order], begin[order], end[order], velocity[order]
    first = np.flatnonzero(np.append(True, (np.diff(key) != 0) | (np.diff(begin) != 0)))
    return (
        key[first],
        begin[first],
        np.maximum.reduceat(end, first),
        np.maximum.reduceat(velocity, first),
    )


def _pedal_ticks(tracks: list[Any], last_tick: int) -> NDArray[np.int64]:
    """(P, 2) Ticks at which the sustain pedal goes down and up, whichever track moves it."""
    controls = [track.controls.numpy() for track in tracks if len(track.controls)]
    if not controls:
        return np.zeros((0, 2), np.int64)
    tick = np.concatenate([each["time"] for each in controls]).astype(np.int64)
    number = np.concatenate([each["number"] for each in controls])
    down = np.concatenate([each["value"] for each in controls]) >= PEDAL_DOWN
    tick, down = tick[number == SUSTAIN_PEDAL], down[number == SUSTAIN_PEDAL]
    order = np.argsort(tick, kind="stable")
    tick, down = tick[order], down[order]
    moves = np.flatnonzero(np.diff(np.append(False, down)))
    # A pedal that never comes up is held until the last note ends.
    end = np.append(tick[moves], last_tick)
    pedal: NDArray[np.int64] = end[: len(end) // 2 * 2].reshape(-1, 2)
    return np.maximum(pedal, pedal[:, :1])
