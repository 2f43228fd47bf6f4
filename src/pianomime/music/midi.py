"""MIDI files to and from scores.

Seconds are float64, computed in the order in which pretty_midi computes them. That decides on which
side of a frame boundary a note falls, and makes rolls equal to RoboPianist's cell for cell.
"""

from __future__ import annotations

import io
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.files import atomic
from pianomime.keyboard import KEYS, LOWEST_PITCH
from pianomime.music.midi_channels import sounds
from pianomime.music.midi_events import (
    META,
    TEMPO,
    MidiEvent,
    MidiEvents,
    MidiFormatError,
    read_events,
)
from pianomime.music.other_kinds import advice
from pianomime.music.score import MAX_SECONDS, Score, ScoreError
from pianomime.shown import title_of

_MOST_BYTES = 8 << 20
"""Largest file that is read; four hours of music take less than a megabyte."""

_MICROS_PER_BEAT = 500_000.0
"""Tempo until the first change: the standard's 120 beats a minute."""

_WRITTEN_TICKS_PER_BEAT = 7680
_WRITTEN_BEATS_PER_MINUTE = 120
"""A frame of 0.05 s is 768 ticks, a power of two times the usual 48. So frame boundaries survive
rounding, and rolls are read back from a file cell for cell. Ticks are also fine enough for other
times, and coarse enough that a silence as long as the longest score fits in MIDI's 28 bits."""
_SUSTAIN_PEDAL = 64
_WRITTEN_CHANNELS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13, 14, 15)
"""All but that of drums."""


def read_midi(path: Path) -> Score:
    """Read a MIDI file, see `Score.from_midi`."""
    try:
        file = read_events(_content(path))
    except MidiFormatError as error:
        instead = advice(path)
        raise ScoreError(f"{path} {error}{instead and f'; {instead}'}") from None
    counts = Counter(file.repairs)
    if file.sequential:
        counts["patterns, one after the other"] = len(file.tracks)
    columns, pedals, start = [], [], 0.0
    for tracks, ends in _parts(file):
        clock = _Clock(tracks, file, counts)
        heard = sounds(tracks, ends)
        counts.update(heard.counts)
        ticks = np.array(heard.notes, np.int64).reshape(-1, 4)
        key, begin, end, velocity = _join_doubled(
            ticks[:, 2] - LOWEST_PITCH, ticks[:, 0], ticks[:, 1], ticks[:, 3]
        )
        columns.append((key, start + clock.seconds(begin), start + clock.seconds(end), velocity))
        pedals.append(start + clock.seconds(np.array(heard.pedal, np.int64).reshape(-1, 2)))
        start += float(clock.seconds(np.array(max(ends))))
    key, onset, offset, velocity = map(np.concatenate, zip(*columns, strict=True))
    if not len(key):
        told = "".join(f"; {what}: {count}" for what, count in counts.items())
        raise ScoreError(f"{path} has no piano notes{told}")
    on_piano = (key >= 0) & (key < KEYS)
    if not on_piano.any():
        raise ScoreError(f"{path} has no notes within the range of a piano")
    if offset.max() > MAX_SECONDS:
        raise ScoreError(f"{path} is damaged, or longer than {MAX_SECONDS / 3600:.0f} hours")
    remarks = [f"{what}: {count}" for what, count in counts.items()]
    if left_out := int((~on_piano).sum()):
        remarks.append(
            f"{left_out} of {len(key)} notes are outside the range of a piano and left out"
        )
    if remarks:
        warnings.warn(f"{path}: {'; '.join(remarks)}", stacklevel=3)
    return Score(
        key=key[on_piano],
        onset=onset[on_piano],
        offset=offset[on_piano],
        velocity=velocity[on_piano],
        pedal=np.concatenate(pedals),
        title=title_of(path),
        remarks=tuple(remarks),
    )


def write_midi(score: Score, path: Path) -> None:
    """Write a MIDI file, see `Score.to_midi`."""
    with atomic(path) as temporary:
        temporary.write_bytes(midi_bytes(score))


def midi_bytes(score: Score) -> bytes:
    """The bytes of a MIDI file, see `Score.to_midi`."""
    import mido

    rate = _WRITTEN_TICKS_PER_BEAT * _WRITTEN_BEATS_PER_MINUTE / 60
    begin = np.rint(score.onset * rate).astype(int).tolist()
    end = np.rint(score.offset * rate).astype(int).tolist()
    voice = _voices(score.key.tolist(), begin, end)
    tracks = [mido.MidiTrack() for _ in range(max(voice, default=0) // len(_WRITTEN_CHANNELS) + 1)]
    # (track, tick, rank at that tick, message)
    events: list[tuple[int, int, int, mido.Message]] = []
    for note in range(len(score)):
        track, index = divmod(voice[note], len(_WRITTEN_CHANNELS))
        where = {
            "channel": _WRITTEN_CHANNELS[index],
            "note": int(score.key[note]) + LOWEST_PITCH,
        }
        strike = mido.Message("note_on", velocity=int(score.velocity[note]), **where)
        release = mido.Message("note_off", velocity=0, **where)
        # Earlier notes end before new ones begin; a note of length zero ends after it has begun.
        events.append((track, begin[note], 2, strike))
        events.append((track, end[note], 3 if end[note] == begin[note] else 0, release))
    for on, off in np.rint(score.pedal * rate).astype(int).tolist():
        for channel in _WRITTEN_CHANNELS[: min(max(voice, default=0) + 1, len(_WRITTEN_CHANNELS))]:
            pedal = {"channel": channel, "control": _SUSTAIN_PEDAL}
            events.append((0, on, 1, mido.Message("control_change", value=127, **pedal)))
            events.append((0, off, 1, mido.Message("control_change", value=0, **pedal)))
    events.sort(key=lambda event: event[:3])
    tempo = mido.bpm2tempo(_WRITTEN_BEATS_PER_MINUTE)
    tracks[0].append(mido.MetaMessage("track_name", name=score.title))
    tracks[0].append(mido.MetaMessage("set_tempo", tempo=tempo))
    now = [0] * len(tracks)
    for track, tick, _, message in events:
        message.time = tick - now[track]
        now[track] = tick
        tracks[track].append(message)
    file = mido.MidiFile(
        type=min(len(tracks) - 1, 1),
        ticks_per_beat=_WRITTEN_TICKS_PER_BEAT,
        charset="utf-8",
        tracks=tracks,
    )
    content = io.BytesIO()
    file.save(file=content)
    return content.getvalue()


def _voices(key: list[int], begin: list[int], end: list[int]) -> list[int]:
    """A number for each note such that notes of one number and key do not overlap.

    Notes are sorted by beginning. In a file they get a channel each: on one channel, the end of
    the first of two notes would end both.
    """
    # The last note of each voice of a key.
    last: dict[int, list[int]] = {}
    voice = []
    for note in range(len(key)):
        voices = last.setdefault(key[note], [])
        free = next(
            (
                index
                for index, other in enumerate(voices)
                if end[other] <= begin[note] and begin[other] < begin[note]
            ),
            len(voices),
        )
        voices[free : free + 1] = [note]
        voice.append(free)
    return voice


def _parts(file: MidiEvents) -> list[tuple[list[list[MidiEvent]], list[int]]]:
    """Tracks that sound together, with their ends; patterns follow one another."""
    if not file.sequential:
        return [(file.tracks, file.ends)]
    return [([track], [end]) for track, end in zip(file.tracks, file.ends, strict=True)]


def _content(path: Path) -> bytes:
    """All bytes of the file."""
    try:
        with path.open("rb") as file:
            # Not its size, which a device does not tell.
            content = file.read(_MOST_BYTES + 1)
    except FileNotFoundError:
        raise ScoreError(f"{path} does not exist") from None
    except IsADirectoryError:
        raise ScoreError(f"{path} is a folder, not a MIDI file") from None
    except OSError as error:
        raise ScoreError(f"{path} cannot be read: {error.strerror}") from error
    if not content:
        raise ScoreError(f"{path} is empty")
    if len(content) > _MOST_BYTES:
        raise ScoreError(f"{path} is larger than {_MOST_BYTES >> 20} MiB, so it is not music")
    return content


class _Clock:
    """Converts ticks to seconds with the tempo changes of tracks that sound together.

    Args:
        tracks: events of each track.
        file: the file, which may fix the length of a tick.
        counts: tempos that cannot be are counted here.
    """

    def __init__(
        self, tracks: list[list[MidiEvent]], file: MidiEvents, counts: Counter[str]
    ) -> None:
        changes = [
            (event.tick, int.from_bytes(event.data[1:4], "big"))
            for track in tracks
            for event in track
            if event.status == META and event.data[0] == TEMPO
        ]
        changes.sort(key=lambda change: change[0])
        possible = [(0, _MICROS_PER_BEAT), *(change for change in changes if change[1])]
        if impossible := len(changes) + 1 - len(possible):
            counts["tempos of zero, ignored"] += impossible
        if file.ticks_per_beat is None:
            possible = possible[:1]
        tick, micros_per_beat = zip(*possible, strict=True)
        self.tick = np.array(tick, np.int64)
        # In the order in which pretty_midi computes it: see the top of this file.
        self.tick_seconds = (
            np.array([file.tick_seconds])
            if file.ticks_per_beat is None
            else 60.0 / ((6e7 / np.array(micros_per_beat, np.float64)) * file.ticks_per_beat)
        )
        self.second = np.append(0.0, np.cumsum(np.diff(self.tick) * self.tick_seconds[:-1]))

    def seconds(self, tick: NDArray[np.int64]) -> NDArray[np.float64]:
        """Seconds at each tick, any shape."""
        tempo = np.maximum(np.searchsorted(self.tick, tick, side="left") - 1, 0)
        return np.asarray(
            self.second[tempo] + (tick - self.tick[tempo]) * self.tick_seconds[tempo], np.float64
        )


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
    first = first[: len(key)]
    return (
        key[first],
        begin[first],
        np.maximum.reduceat(end, first) if len(first) else end,
        np.maximum.reduceat(velocity, first) if len(first) else velocity,
    )
