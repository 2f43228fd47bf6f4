"""Events of a MIDI file, read as forgivingly as it can be told what was meant.

Public files are often damaged in small ways: a wrong track count, a length that is one too long, a
byte over 127, an end in the middle of a track. Synthesizers play such files, and so they are read
here, with a word on each repair. Libraries are not enough: mido, pretty_midi and symusic refuse
most of these files, and lose notes of others without a word (docs/results.md compares them). The
format is that of "Standard MIDI Files 1.0" (RP-001) of the MIDI Association.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

META = 0xFF
SYSTEM_EXCLUSIVE = 0xF0
TEMPO, PORT = 0x51, 0x21
"""Types of meta events."""

_END_OF_TRACK = 0x2F
_CONTINUED = 0xF7
_ONE_BYTE = (0xC0, 0xD0)
"""Channel messages with one data byte instead of two."""
_SYSTEM_BYTES = {0xF1: 1, 0xF2: 2, 0xF3: 1}
"""Number of data bytes of system messages, where there are some. None of them belongs in a file."""
_LARGEST_NUMBER = 0x0FFFFFFF
"""Largest number of variable length: 28 bits in four bytes."""


class MidiFormatError(ValueError):
    """A file cannot be read at all; the message is what follows its name in a sentence."""


class MidiEvent(NamedTuple):
    """One event of a track.

    Attributes:
        tick: when, from the beginning of the track.
        status: status byte: `META`, `SYSTEM_EXCLUSIVE`, or that of a channel message.
        data: the two data bytes of a channel message, the second 0 where there is only one; of a
            META event the type and what follows the length; of a SYSTEM_EXCLUSIVE message what
            stands between F0 and F7, its packets joined.
    """

    tick: int
    status: int
    data: bytes


@dataclass(frozen=True)
class MidiEvents:
    """What a MIDI file holds.

    Attributes:
        sequential: whether the tracks are patterns that follow one another (format 2).
        ticks_per_beat: ticks of a quarter note, or None where a tick has a fixed length.
        tick_seconds: length of a tick [s], or None where it depends on the tempo.
        tracks: events of each track, in order.
        ends: tick at which each track ends.
        repairs: how often each kind of repair was made.
    """

    sequential: bool
    ticks_per_beat: int | None
    tick_seconds: float | None
    tracks: list[list[MidiEvent]]
    ends: list[int]
    repairs: Counter[str]


def read_events(content: bytes) -> MidiEvents:
    """Read the events of a MIDI file.

    Args:
        content: all bytes of the file.

    Raises:
        MidiFormatError: it has no header or no track, or its ticks have no length.
    """
    # A wrapper (RIFF, MacBinary) may stand before the header.
    start = content.find(b"MThd")
    if start < 0:
        raise MidiFormatError("is not a MIDI file")
    if len(content) < start + 14:
        raise MidiFormatError("is damaged: its header is incomplete")
    size, kind, count = (
        int.from_bytes(content[start + first : start + end], "big")
        for first, end in ((4, 8), (8, 10), (10, 12))
    )
    ticks_per_beat, tick_seconds = _division(content[start + 12 : start + 14])
    # The length of the header may be wrong too.
    first = start + 8 + size
    first = first if content.startswith(b"MTrk", first) else start + 14
    repairs: Counter[str] = Counter()
    tracks = list(_tracks(content, first, repairs))
    if not tracks:
        raise MidiFormatError("is damaged: it has no tracks")
    if count != len(tracks):
        repairs[f"tracks in spite of {count} in the header"] = len(tracks)
    return MidiEvents(
        sequential=kind == 2,
        ticks_per_beat=ticks_per_beat,
        tick_seconds=tick_seconds,
        tracks=[events for events, _ in tracks],
        ends=[tick for _, tick in tracks],
        repairs=repairs,
    )


def _division(division: bytes) -> tuple[int | None, float | None]:
    """Ticks of a beat, or length of a tick [s]: the header tells one of the two."""
    if division[0] < 0x80:
        ticks = int.from_bytes(division, "big")
        if ticks == 0:
            raise MidiFormatError("is damaged: it has no ticks in a beat")
        return ticks, None
    frames, ticks = 256 - division[0], division[1]
    if ticks == 0:
        raise MidiFormatError("is damaged: it has no ticks in a frame")
    # 29 stands for the 29.97 frames of "drop frame" time.
    return None, 1 / (ticks * (30_000 / 1001 if frames == 29 else frames))


def _tracks(
    content: bytes, position: int, repairs: Counter[str]
) -> Iterator[tuple[list[MidiEvent], int]]:
    """The events of each track, and the tick at which it ends."""
    while (found := content.find(b"MTrk", position)) >= 0:
        if not _are_chunks(content, position, found):
            repairs["bytes between tracks, skipped"] += found - position
        first = found + 8
        end = first + int.from_bytes(content[found + 4 : first], "big")
        following = content.find(b"MTrk", first)
        # A length is believed if the file ends or another chunk begins where it says.
        believed = end == len(content) or (end < len(content) and _chunk_begins(content, end))
        limit = end if believed else following if following >= 0 else len(content)
        events, tick, used = _read_track(content[first:limit], believed, repairs)
        position = limit if believed else first + used
        if position != end:
            repairs["tracks of a wrong length"] += 1
        yield events, tick


def _chunk_begins(content: bytes, position: int) -> bool:
    """Whether a chunk stands here that does not go beyond the end of the file."""
    name, size = content[position : position + 4], content[position + 4 : position + 8]
    if name == b"MTrk":
        return True
    return name.isalnum() and position + 8 + int.from_bytes(size, "big") <= len(content)


def _are_chunks(content: bytes, position: int, end: int) -> bool:
    """Whether chunks of other kinds, which readers shall ignore, fill a stretch of the file."""
    while position < end and _chunk_begins(content, position):
        position += 8 + int.from_bytes(content[position + 4 : position + 8], "big")
    return position == end


def _read_track(
    track: bytes, believed: bool, repairs: Counter[str]
) -> tuple[list[MidiEvent], int, int]:
    """Read one track.

    Args:
        track: its bytes, and what stands between it and the next where its length is wrong.
        believed: whether its length is right, so that an end before the last byte is not its end.
        repairs: counts of what was repaired, to be added to.

    Returns:
        Its events, the tick at which it ends, and the number of its bytes.
    """
    events: list[MidiEvent] = []
    at = tick = status = 0
    packets = b""
    ended = False
    # Some writers fill a track up with zeros.
    filled = len(track.rstrip(b"\0"))
    try:
        while at < len(track):
            if ended:
                if not believed or at >= filled:
                    break
                repairs["ends in the middle of a track, passed over"] += 1
                ended = False
            delta, at = _number(track, at)
            tick += delta
            while track[at] < 0x80 and not status:
                repairs["bytes without a status, skipped"] += 1
                at += 1
            byte = track[at]
            if byte < 0xF0:
                # Without a status of its own, it has that of the message before it.
                if byte >= 0x80:
                    status = byte
                    at += 1
                size = 1 if status & 0xF0 in _ONE_BYTE else 2
                data = bytes((track[at], track[at + 1] if size == 2 else 0))
                at += size
                if not data.isascii():
                    repairs["data bytes over 127, read as 127"] += sum(each > 127 for each in data)
                    data = bytes(min(each, 127) for each in data)
                events.append(MidiEvent(tick, status, data))
            elif byte == META:
                kind = track[at + 1]
                data, at = _block(track, at + 2)
                ended = kind == _END_OF_TRACK
                events.append(MidiEvent(tick, META, bytes((kind,)) + data))
            elif byte in (SYSTEM_EXCLUSIVE, _CONTINUED):
                data, at = _block(track, at + 1)
                # F7 without a message to go on with carries bytes that mean nothing here.
                packets = data if byte == SYSTEM_EXCLUSIVE else packets and packets + data
                if packets.endswith(bytes((_CONTINUED,))):
                    events.append(MidiEvent(tick, SYSTEM_EXCLUSIVE, packets[:-1]))
                    packets = b""
            else:
                repairs["system messages that do not belong in a file, skipped"] += 1
                at += 1 + _SYSTEM_BYTES.get(byte, 0)
    except (IndexError, OverflowError):
        if not ended:
            repairs["tracks that can be read only in part"] += 1
        at = len(track)
    else:
        if not ended:
            repairs["tracks without an end"] += 1
    return events, tick, at


def _number(track: bytes, at: int) -> tuple[int, int]:
    """A number of variable length, and the index after it.

    Raises:
        IndexError: the track ends before.
        OverflowError: it is longer than numbers can be.
    """
    number = track[at] & 0x7F
    while track[at] >= 0x80:
        at += 1
        number = number << 7 | track[at] & 0x7F
        if number > _LARGEST_NUMBER:
            raise OverflowError
    return number, at + 1


def _block(track: bytes, at: int) -> tuple[bytes, int]:
    """The bytes that follow their number, and the index after them.

    Raises:
        IndexError: the track ends before.
        OverflowError: the number is longer than numbers can be.
    """
    size, at = _number(track, at)
    if at + size > len(track):
        raise IndexError
    return track[at : at + size], at + size
