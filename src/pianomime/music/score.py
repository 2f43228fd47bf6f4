"""Score: the notes and pedal of a piece in seconds, and its piano roll in frames."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE, FRAME_SECONDS, KEYS
from pianomime.short_repr import count, short_repr
from pianomime.shown import shown

MAX_SECONDS = 4 * 3600.0
"""[s] Longest score. A damaged MIDI file can last years, and its roll would not fit in memory."""


class ScoreError(InputError):
    """Music that cannot be read or is inconsistent; the message is one line."""


@dataclass(frozen=True, eq=False)
class Score:
    """Notes and pedal of a piece; N notes sorted by (onset, key), P pedal intervals.

    The arrays are copied, sorted and made read-only, so a score never changes.

    Attributes:
        key: (N,) int64, 0..87 from the bass end of the keyboard.
        onset: (N,) float64 [s], when the key goes down.
        offset: (N,) float64 [s], when it comes up; never before the onset.
        velocity: (N,) int64, 1..127, how hard it is struck (MIDI).
        pedal: (P, 2) float64 [s], intervals [on, off) with the sustain pedal down, in order and
            apart from each other.
        title: name of the piece.
        remarks: what was mended or left out when its file was read, with counts.

    Raises:
        ScoreError: shapes do not match, or keys, velocities or times are out of range.
    """

    key: NDArray[np.int64]
    onset: NDArray[np.float64]
    offset: NDArray[np.float64]
    velocity: NDArray[np.int64]
    pedal: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    title: str = ""
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        key = np.array(self.key, np.int64)
        onset = np.array(self.onset, np.float64)
        offset = np.array(self.offset, np.float64)
        velocity = np.array(self.velocity, np.int64)
        if key.ndim != 1 or not key.shape == onset.shape == offset.shape == velocity.shape:
            raise ScoreError("key, onset, offset and velocity must each be (N,)")
        if key.size and not (key.min() >= 0 and key.max() < KEYS):
            raise ScoreError(f"keys must be 0..{KEYS - 1}")
        if velocity.size and not (velocity.min() >= 1 and velocity.max() <= 127):
            raise ScoreError("velocities must be 1..127")
        # Written so that NaN fails too.
        if not ((onset >= 0) & (offset >= onset) & (offset <= MAX_SECONDS)).all():
            raise ScoreError(
                f"notes must begin at 0 s or later, end no earlier than they begin, "
                f"and end within {MAX_SECONDS / 3600:.0f} hours"
            )
        order = np.lexsort((key, onset))
        for name, array in (
            ("key", key[order]),
            ("onset", onset[order]),
            ("offset", offset[order]),
            ("velocity", velocity[order]),
            ("pedal", _tidy_pedal(self.pedal)),
        ):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "title", shown(self.title))
        object.__setattr__(self, "remarks", tuple(self.remarks))

    def __repr__(self) -> str:
        return short_repr(
            self, repr(self.title), f"{self.duration:.1f} s", count(len(self), "note")
        )

    @classmethod
    def from_midi(cls, path: str | os.PathLike[str]) -> Score:
        """Read a MIDI file: all tracks except drums, tempo changes, sustain pedal (CC64 >= 64).

        Files that are damaged are read as far as it can be told what was meant. Notes outside the
        range of a piano (MIDI pitch 21..108) are left out. What was mended or left out is told in
        one warning, with counts, and stands in `remarks`. Notes of two tracks that strike one key
        at the same instant become one. The title is the file's name without suffix.

        Args:
            path: the file; a RIFF wrapper (.rmi) is taken off.

        Raises:
            ScoreError: the file does not exist, is not a MIDI file, or has no piano notes.
        """
        from pianomime.music.midi import read_midi

        return read_midi(Path(path))

    def to_midi(self, path: str | os.PathLike[str]) -> None:
        """Write a MIDI file; times are rounded to 1/15360 s.

        Times that are multiples of 0.05 s, and therefore rolls, are read back unchanged. Notes that
        overlap on one key are on channels of their own, for an end would end all of a channel.

        Args:
            path: the file; it is written in one step.

        Raises:
            OSError: the file cannot be written.
        """
        from pianomime.music.midi import write_midi

        write_midi(self, Path(path))

    @classmethod
    def from_roll(cls, roll: ArrayLike, dt: float = FRAME_SECONDS, title: str = "") -> Score:
        """Make a score from a piano roll, without pedal; its roll is the same again.

        Args:
            roll: (T, 88) bool.
            dt: length of a frame [s].
            title: name of the piece.

        Raises:
            ScoreError: the roll has another shape.
        """
        from pianomime.music.notes import notes_from_roll

        key, onset, offset = notes_from_roll(roll, dt)
        return cls(key, onset, offset, np.full(len(key), 80), title=title)

    def __len__(self) -> int:
        """Number of notes."""
        return len(self.key)

    @property
    def duration(self) -> float:
        """End of the last note [s]; 0 without notes."""
        return float(self.offset.max(initial=0.0))

    def clip(self, start: float, end: float) -> Score:
        """Cut out all that sounds between two times; notes and pedal are cut at both ends.

        Args:
            start: beginning [s], which becomes time 0.
            end: end [s]; may be infinite.

        Raises:
            ScoreError: `start` is not before `end`, or nothing sounds between them.
        """
        if not 0 <= start < end:
            raise ScoreError(f"cannot clip from {start:g} s to {end:g} s")
        inside = (self.onset < end) & ((self.offset > start) | (self.onset >= start))
        if not inside.any():
            raise ScoreError(
                f"no notes between {start:g} s and {end:g} s: the piece lasts {self.duration:.1f} s"
            )
        return replace(
            self,
            key=self.key[inside],
            onset=np.maximum(self.onset[inside], start) - start,
            offset=np.minimum(self.offset[inside], end) - start,
            velocity=self.velocity[inside],
            pedal=_cut_pedal(self.pedal, start, end),
        )

    def trim_silence(self) -> Score:
        """The same music, shifted so that its first note begins at 0 s."""
        if not len(self):
            return self
        start = self.onset[0]
        return replace(
            self,
            onset=self.onset - start,
            offset=self.offset - start,
            pedal=_cut_pedal(self.pedal, start, math.inf),
        )

    def delay(self, seconds: float) -> Score:
        """The same music after some silence.

        Where the silence is whole frames, the rolls are the same after as many silent frames:
        times that are a rounding error off the edge of a frame stay on their side of it.

        Args:
            seconds: of silence; 0 gives this very score.

        Raises:
            ScoreError: the silence is negative or no number, or the score gets too long.
        """
        if not 0 <= seconds <= MAX_SECONDS:
            raise ScoreError(f"cannot delay music by {seconds:g} s")
        if not seconds:
            return self
        return replace(
            self,
            onset=_later(self.onset, seconds),
            offset=_later(self.offset, seconds),
            pedal=_later(self.pedal, seconds),
        )

    def transpose(self, semitones: int) -> Score:
        """The same music transposed.

        Args:
            semitones: distance along the keyboard; positive is upward.

        Raises:
            ScoreError: a note would leave the keyboard.
        """
        return replace(self, key=self.key + semitones)

    def frames(self, dt: float = FRAME_SECONDS) -> int:
        """Number of frames T of the roll: floor(duration / dt) + 1.

        A piece that ends exactly on a frame boundary therefore has one silent frame after it, as
        in RoboPianist's rolls.

        Args:
            dt: length of a frame [s].
        """
        return math.floor(self.duration * _rate(dt)) + 1

    def note_frames(self, dt: float = FRAME_SECONDS) -> NDArray[np.int64]:
        """Frames in which each note holds its key down.

        A note begins in frame floor(onset / dt) and ends before frame ceil(offset / dt), but
        lasts at least one frame. A key struck again while it is down is up for that frame, and
        down from the next one on (RoboPianist's rule); it stays down until every note on it has
        ended. The frames of two notes on one key never overlap; together they are the roll.

        Args:
            dt: length of a frame [s].

        Returns:
            (N, 2) int64: first frame, and frame after the last. They are equal for a note without
            a frame of its own: its key is struck again before it could come up and go down, or
            the piece ends before that.
        """
        rate = _rate(dt)
        # Products are rounded without a tolerance: only then are rolls equal to RoboPianist's
        # cell for cell, its rounding errors included.
        begins = np.floor(self.onset * rate).astype(np.int64)
        ends = np.maximum(np.ceil(self.offset * rate).astype(np.int64), begins + 1)
        order = np.lexsort((begins, self.key))
        # Each note depends on the one before it on the same key: a loop over Python ints.
        spans: list[list[int]] = []
        last_key, held = -1, 0
        for key, begin, end in zip(
            self.key[order].tolist(), begins[order].tolist(), ends[order].tolist(), strict=True
        ):
            first = begin
            if key != last_key:
                last_key, held = key, end
            else:
                held = max(held, end)
                before = spans[-1]
                if before[0] >= begin:  # not down yet: this note takes its place
                    first = before[0]
                    before[1] = first
                elif before[1] >= begin:  # down: release it for one frame
                    first = begin + 1
                    before[1] = begin
            spans.append([first, max(held, first + 1)])
        frames = np.empty((len(self), 2), np.int64)
        frames[order] = np.reshape(np.array(spans, np.int64), (-1, 2))
        return np.minimum(frames, self.frames(dt))

    def roll(self, dt: float = FRAME_SECONDS) -> NDArray[np.bool_]:
        """Piano roll: the keys that are down in each frame, see `note_frames`.

        Args:
            dt: length of a frame [s].

        Returns:
            (T, 88) bool, T as in `frames`.
        """
        spans = self.note_frames(dt)
        down = np.zeros((self.frames(dt), KEYS), bool)
        for key, (first, stop) in zip(self.key.tolist(), spans.tolist(), strict=True):
            down[first:stop, key] = True
        return down

    def pedal_roll(self, dt: float = FRAME_SECONDS) -> NDArray[np.bool_]:
        """Whether the sustain pedal is down in each frame.

        It goes down in frame floor(on / dt) and comes up in frame floor(off / dt), but stays up for
        at least one frame between two presses, and down for at least one in each, as far as there
        are frames enough: a lift of a few milliseconds damps the strings too. A pedal that is down
        when the last note ends stays down until the last frame.

        Args:
            dt: length of a frame [s].

        Returns:
            (T,) bool, one entry for each frame of `roll`.
        """
        spans = np.floor(self.pedal * _rate(dt)).astype(np.int64)
        down = np.zeros(self.frames(dt), bool)
        spans[self.pedal[:, 1] >= self.duration, 1] = len(down)
        free = 0
        # Each press depends on the one before it.
        for first, stop in spans.tolist():
            begin = max(first, free)
            if begin <= max(first, stop):
                end = max(stop, begin + 1)
                down[begin:end] = True
                free = end + 1
        return down


def _rate(dt: float) -> float:
    """Frame rate [Hz]. Multiplying by 20.0 is exact where dividing by 0.05 is not."""
    if not dt > 0:
        raise ValueError(f"dt must be positive, not {dt}")
    return 1.0 / dt


def _later(times: NDArray[np.float64], seconds: float) -> NDArray[np.float64]:
    """Times after a delay [s]; if that is whole frames, each has the same place in its frame."""
    later, frames = times + seconds, seconds * FRAME_RATE
    if not frames.is_integer():
        return later
    first = np.floor(times * FRAME_RATE) + frames
    last = np.ceil(times * FRAME_RATE) + frames
    on_edge = first == last
    later[on_edge] = first[on_edge] / FRAME_RATE
    # The sum was rounded to the nearest number, so a few steps lead off an edge that it fell on.
    while (low := ~on_edge & (later * FRAME_RATE <= first)).any():
        later[low] = np.nextafter(later[low], np.inf)
    while (high := ~on_edge & (later * FRAME_RATE >= last)).any():
        later[high] = np.nextafter(later[high], 0.0)
    return later


def _tidy_pedal(pedal: ArrayLike) -> NDArray[np.float64]:
    """Sort intervals, merge those that touch or overlap, and cut off what no score reaches."""
    given = np.array(pedal, np.float64)
    if given.size == 0:
        return np.zeros((0, 2))
    if given.ndim != 2 or given.shape[1] != 2:
        raise ScoreError(f"pedal must be (P, 2), not {given.shape}")
    if not ((given[:, 0] >= 0) & (given[:, 1] >= given[:, 0]) & np.isfinite(given[:, 1])).all():
        raise ScoreError("pedal intervals must begin at 0 s or later and end after they begin")
    # After the longest score it holds nothing.
    given = np.minimum(given, MAX_SECONDS)
    given = given[given[:, 1] > given[:, 0]]
    given = given[np.argsort(given[:, 0], kind="stable")]
    if len(given) == 0:
        return given
    latest = np.maximum.accumulate(given[:, 1])
    begins = np.append(True, given[1:, 0] > latest[:-1])
    ends = np.append(begins[1:], True)
    return np.column_stack((given[begins, 0], latest[ends]))


def _cut_pedal(pedal: NDArray[np.float64], start: float, end: float) -> NDArray[np.float64]:
    return np.asarray(np.maximum(np.clip(pedal, start, end) - start, 0.0))
