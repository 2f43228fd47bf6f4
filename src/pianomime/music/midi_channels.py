"""Notes and pedal from the events of a MIDI file: what the sixteen channels of a synthesizer do.

A note lasts until the first end on its key, which ends all notes on the key, as in pretty_midi and
therefore in RoboPianist. What a channel is (drums or not, transposed or not) follows General MIDI,
and the messages of GS and XG for the same; controllers are those of MIDI 1.0 and RP-015.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field

from pianomime.music.midi_events import META, PORT, SYSTEM_EXCLUSIVE, MidiEvent

_NOTE_OFF, _NOTE_ON, _CONTROL, _PROGRAM = 0x80, 0x90, 0xB0, 0xC0
_CHANNELS = 16
_DRUM_CHANNEL = 9
"""Channel 10, counted from 0."""

_BANK, _DATA, _SUSTAIN_PEDAL, _RESET_CONTROLLERS = 0, 6, 64, 121
_NO_PARAMETER, _PARAMETER = (98, 99), (100, 101)
_ALL_OFF = (120, 123, 124, 125, 126, 127)
"""Controllers that end all notes of a channel: all sound off, all notes off, and modes."""
_COARSE_TUNING = (0, 2)
_MIDDLE = 64
"""Numbers of controllers, of a registered parameter, and the value that means no transposition."""
PEDAL_DOWN = 64
"""Lowest value at which the sustain pedal is down (MIDI 1.0)."""

_GENERAL_MIDI, _GS, _XG = b"\x7e\x7f\x09", b"\x41\x10\x42\x12", b"\x43\x10\x4c"
"""How messages of these standards begin; the second byte, a device, may be another."""
_DRUM_BANKS = {b"": (), _GENERAL_MIDI: (120,), _GS: (), _XG: (126, 127)}
"""Banks that make a channel one of drums, by standard: General MIDI 2 and XG."""


_Place = tuple[int, int]
"""Track and pitch of a key."""


@dataclass
class Sounds:
    """What sounds, in ticks from the beginning.

    Attributes:
        notes: begin, end, MIDI pitch and velocity of each note.
        pedal: when the sustain pedal goes down and up. A pedal that is never lifted ends with the
            last note.
        counts: how often each kind of thing was mended or left out.
    """

    notes: list[tuple[int, int, int, int]] = field(default_factory=list)
    pedal: list[tuple[int, int]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)


def sounds(tracks: list[list[MidiEvent]], ends: list[int]) -> Sounds:
    """Play tracks together.

    Args:
        tracks: events of each track, in order.
        ends: tick at which each track ends, and with it notes that have no end.
    """
    events = [(event, track) for track, part in enumerate(tracks) for event in part]
    # System messages tell what channels are, so they come before notes of the same instant.
    events.sort(key=lambda each: (each[0].tick, each[0].status != SYSTEM_EXCLUSIVE))
    channels = _Channels()
    for event, track in events:
        channels.take(event, track)
    return channels.finish(ends)


class _Channels:
    """The state of all channels, each with a port of its own if the file has several."""

    def __init__(self) -> None:
        self.sounds = Sounds()
        self.port: defaultdict[int, int] = defaultdict(int)
        # By channel, then by track and pitch: begin, pitch that sounds, velocity.
        self.held: defaultdict[int, dict[_Place, list[tuple[int, int, int]]]] = defaultdict(dict)
        self.missing_ends: Counter[tuple[int, _Place]] = Counter()
        # When the pedal went down, and the channel that moved it.
        self.pedal: tuple[int, int] | None = None
        self.bank: dict[int, int] = {}
        self.parameter: dict[int, tuple[int, int]] = {}
        self._reset(b"")

    def _reset(self, standard: bytes) -> None:
        """Be as a synthesizer of a standard is when it is switched on."""
        self.standard = standard
        self.drums: dict[int, bool] = {}
        self.part_shift: dict[int, int] = {}
        self.tuning: dict[int, int] = {}
        self.master_shift = 0

    def _is_drums(self, channel: int) -> bool:
        return self.drums.get(channel, channel % _CHANNELS == _DRUM_CHANNEL)

    def take(self, event: MidiEvent, track: int) -> None:
        """Do what an event says."""
        tick, status, data = event
        kind = status & 0xF0
        if status == META:
            if data[0] == PORT and len(data) > 1:
                self.port[track] = data[1]
            return
        if status == SYSTEM_EXCLUSIVE:
            self._system(self.port[track] * _CHANNELS, data)
            return
        channel = self.port[track] * _CHANNELS + (status & 0x0F)
        if kind == _NOTE_ON and data[1]:
            self._strike(tick, track, channel, *data)
        elif kind in (_NOTE_OFF, _NOTE_ON):
            self._release(tick, channel, (track, data[0]))
        elif kind == _CONTROL:
            self._control(tick, channel, *data)
        elif kind == _PROGRAM and channel in self.bank and _DRUM_BANKS[self.standard]:
            self.drums[channel] = self.bank[channel] in _DRUM_BANKS[self.standard]

    def _strike(self, tick: int, track: int, channel: int, pitch: int, velocity: int) -> None:
        if self._is_drums(channel):
            self.sounds.counts["notes of drums, left out"] += 1
            return
        shift = self.master_shift + self.part_shift.get(channel, 0) + self.tuning.get(channel, 0)
        if shift:
            self.sounds.counts["notes transposed, as the file asks"] += 1
        held = self.held[channel].setdefault((track, pitch), [])
        held.append((tick, pitch + shift, velocity))

    def _release(self, tick: int, channel: int, place: _Place) -> None:
        held = self.held[channel].pop(place, None)
        if held is None:
            # Of two notes on one key that overlap, the end of the first has ended both.
            if self.missing_ends[channel, place]:
                self.missing_ends[channel, place] -= 1
            return
        # An end at the very beginning of a note is that of the note before it, if there is one.
        before = [note for note in held if note[0] < tick]
        if before and len(before) < len(held):
            self.held[channel][place] = held[len(before) :]
        ended = before or held
        self._end(ended, tick)
        self.missing_ends[channel, place] += len(ended) - 1

    def _end(self, notes: list[tuple[int, int, int]], tick: int) -> None:
        self.sounds.notes += [(begin, tick, pitch, velocity) for begin, pitch, velocity in notes]

    def _control(self, tick: int, channel: int, number: int, value: int) -> None:
        if number == _SUSTAIN_PEDAL:
            # One piano has one pedal, whichever channel moves it; that of drums is another thing.
            if not self._is_drums(channel):
                self._move_pedal(tick, channel, down=value >= PEDAL_DOWN)
        elif number == _RESET_CONTROLLERS:
            if self.pedal is not None and self.pedal[1] == channel:
                self._move_pedal(tick, channel, down=False)
            self.parameter.pop(channel, None)
        elif number in _ALL_OFF:
            for place in list(self.held[channel]):
                self._release(tick, channel, place)
        elif number == _BANK:
            self.bank[channel] = value
        elif number in _NO_PARAMETER:
            self.parameter.pop(channel, None)
        elif number in _PARAMETER:
            high, low = self.parameter.get(channel, (127, 127))
            self.parameter[channel] = (value, low) if number == _PARAMETER[1] else (high, value)
        elif number == _DATA and self.parameter.get(channel) == _COARSE_TUNING:
            self.tuning[channel] = value - _MIDDLE

    def _move_pedal(self, tick: int, channel: int, *, down: bool) -> None:
        presses = self.sounds.pedal
        if down and self.pedal is None:
            if presses and presses[-1][1] == tick > presses[-1][0]:
                # Up and down in one instant: it has been up, if only for a tick.
                presses[-1] = presses[-1][0], tick - 1
            self.pedal = tick, channel
        elif not down and self.pedal is not None:
            presses.append((self.pedal[0], tick))
            self.pedal = None

    def _system(self, first_channel: int, message: bytes) -> None:
        """Do what a system-exclusive message says: see the manuals of GM, GS and XG."""
        match list(message):
            case [0x7E, _, 0x09, 0x01 | 0x03]:
                self._reset(_GENERAL_MIDI)
            case [0x41, _, 0x42, 0x12, 0x00 | 0x40, 0x00, 0x7F, *_]:
                self._reset(_GS)
            case [0x43, _, 0x4C, 0x00, 0x00, 0x7E, *_]:
                self._reset(_XG)
            case [0x7F, _, 0x04, 0x04, _, semitones] | [
                0x41, _, 0x42, 0x12, 0x40, 0x00, 0x05, semitones, *_
            ] | [0x43, _, 0x4C, 0x00, 0x00, 0x06, semitones, *_]:  # fmt: skip
                self.master_shift = semitones - _MIDDLE
            case [0x41, _, 0x42, 0x12, 0x40, part, 0x15, mode, *_] if part >> 4 == 1:
                self.drums[first_channel + _gs_channel(part)] = mode > 0
            case [0x41, _, 0x42, 0x12, 0x40, part, 0x16, semitones, *_] if part >> 4 == 1:
                self.part_shift[first_channel + _gs_channel(part)] = semitones - _MIDDLE
            case [0x43, _, 0x4C, 0x08, part, 0x07, mode, *_] if part < _CHANNELS:
                self.drums[first_channel + part] = mode > 0
            case [0x43, _, 0x4C, 0x08, part, 0x08, semitones, *_] if part < _CHANNELS:
                self.part_shift[first_channel + part] = semitones - _MIDDLE

    def finish(self, ends: list[int]) -> Sounds:
        """What has sounded, after all tracks have ended."""
        made = self.sounds
        for places in self.held.values():
            for (track, _), held in places.items():
                self._end(held, ends[track])
                made.counts["notes without an end, held until their track ends"] += len(held)
        if missing := sum(self.missing_ends.values()):
            made.counts["notes without an end, held until another on their key ends"] = missing
        if self.pedal is not None:
            last = max((end for _, end, _, _ in made.notes), default=0)
            made.pedal.append((self.pedal[0], max(self.pedal[0], last)))
        return made


def _gs_channel(part: int) -> int:
    """Channel of a GS part: blocks are 10, 1 to 9, 11 to 16."""
    block = part & 0x0F
    return _DRUM_CHANNEL if block == 0 else block - 1 if block <= _DRUM_CHANNEL else block
