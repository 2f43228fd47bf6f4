"""MIDI files: what is read, what comes back, and what is refused."""

import struct
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import mido
import numpy as np
import pretty_midi
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pianomime import songs
from pianomime.music import Score, ScoreError

ETUDE12_AND_STAN = 13


def note(pitch: int, on: int, off: int, channel: int = 0) -> list[tuple[int, mido.Message]]:
    return [
        (on, mido.Message("note_on", note=pitch, velocity=70, channel=channel)),
        (off, mido.Message("note_off", note=pitch, velocity=0, channel=channel)),
    ]


def pedal(tick: int, value: int) -> tuple[int, mido.Message]:
    return tick, mido.Message("control_change", control=64, value=value)


def tempo(tick: int, micros: int) -> tuple[int, mido.MetaMessage]:
    return tick, mido.MetaMessage("set_tempo", tempo=micros)


def midi_file(path: Path, *tracks: list[tuple[int, object]]) -> Path:
    """A file of 480 ticks a beat, so 960 a second at the usual tempo."""
    file = mido.MidiFile(ticks_per_beat=480)
    for events in tracks:
        track = mido.MidiTrack()
        now = 0
        for tick, message in sorted(events, key=lambda event: event[0]):
            track.append(message.copy(time=tick - now))
            now = tick
        file.tracks.append(track)
    file.save(path)
    return path


def same(one: Score, other: Score) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("key", "onset", "offset", "velocity", "pedal")
    )


def test_notes_of_all_tracks_but_drums(tmp_path: Path) -> None:
    path = midi_file(
        tmp_path / "song.mid", note(60, 0, 960), note(21, 480, 960, 1), note(40, 0, 960, 9)
    )
    score = Score.from_midi(path)
    assert score.key.tolist() == [39, 0]
    assert score.onset.tolist() == [0.0, 0.5]
    assert score.offset.tolist() == [1.0, 1.0]
    assert score.velocity.tolist() == [70, 70]
    assert score.title == "song"
    assert same(Score.from_midi(str(path)), score)


def test_tempo_changes(tmp_path: Path) -> None:
    path = midi_file(
        tmp_path / "song.mid",
        [tempo(480, 1_000_000), tempo(960, 250_000)],
        note(60, 0, 480) + note(62, 480, 960) + note(64, 960, 1440),
    )
    score = Score.from_midi(path)
    assert score.onset == pytest.approx([0, 0.5, 1.5])
    assert score.offset == pytest.approx([0.5, 1.5, 1.75])


def test_pedal_thresholds_and_a_pedal_never_lifted(tmp_path: Path) -> None:
    path = midi_file(
        tmp_path / "song.mid",
        [
            *note(60, 0, 1920),
            *(pedal(96, 64), pedal(192, 63), pedal(288, 127), pedal(384, 64), pedal(480, 0)),
            pedal(960, 100),
        ],
    )
    score = Score.from_midi(path)
    assert score.pedal == pytest.approx(np.array([[0.1, 0.2], [0.3, 0.5], [1.0, 2.0]]))


def test_two_tracks_move_one_pedal(tmp_path: Path) -> None:
    right = [*note(60, 0, 960), pedal(0, 127), pedal(480, 0)]
    left = [*note(40, 0, 960), pedal(0, 127), pedal(480, 0)]
    score = Score.from_midi(midi_file(tmp_path / "song.mid", right, left))
    assert score.pedal.tolist() == [[0.0, 0.5]]


def test_notes_off_the_keyboard_give_one_warning(tmp_path: Path) -> None:
    path = midi_file(
        tmp_path / "song.mid", note(20, 0, 10) + note(109, 0, 10) + note(21, 0, 10), note(5, 3, 5)
    )
    with pytest.warns(UserWarning, match="3 of 4 notes") as caught:
        assert len(Score.from_midi(path)) == 1
    assert len(caught) == 1
    path = midi_file(tmp_path / "low.mid", note(5, 0, 10))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ScoreError, match="range of a piano"):
            Score.from_midi(path)


def test_zero_length_notes_are_kept(tmp_path: Path) -> None:
    score = Score.from_midi(midi_file(tmp_path / "song.mid", note(60, 96, 96) + note(62, 0, 960)))
    assert len(score) == 2
    assert np.flatnonzero(score.roll()[:, 39]).tolist() == [2]


def test_a_lost_note_end_does_not_delay_all_later_ones(tmp_path: Path) -> None:
    events = [event for beat in range(4) for event in note(60, 960 * beat, 960 * beat + 480)]
    del events[1]
    score = Score.from_midi(midi_file(tmp_path / "song.mid", events))
    assert score.offset.tolist() == [1.5, 1.5, 2.5, 3.5]


def test_key_doubled_by_two_tracks_is_one_note(tmp_path: Path) -> None:
    path = midi_file(tmp_path / "song.mid", note(60, 0, 480), note(60, 0, 960, 1))
    score = Score.from_midi(path)
    assert len(score) == 1
    assert score.duration == 1.0


@pytest.mark.parametrize("name", songs.names())
def test_writing_and_reading_bundled_songs(name: str, tmp_path: Path) -> None:
    score = Score.from_midi(songs.path(name))
    score.to_midi(tmp_path / "copy.mid")
    copy = Score.from_midi(tmp_path / "copy.mid")
    assert same(copy, score)
    assert (copy.roll() == score.roll()).all()
    assert (tmp_path / "copy.mid").stat().st_size > 0
    assert [file.name for file in tmp_path.iterdir()] == ["copy.mid"]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_rolls_survive_writing_and_reading(seed: int) -> None:
    roll = np.random.default_rng(seed).random((50, 88)) < 0.2
    score = Score.from_roll(roll)
    with TemporaryDirectory() as folder:
        path = Path(folder, "roll.mid")
        score.to_midi(path)
        first = path.read_bytes()
        assert (Score.from_midi(path).roll() == score.roll()).all()
        score.to_midi(path)
        assert path.read_bytes() == first


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_notes_that_overlap_on_one_key_survive(seed: int) -> None:
    generator = np.random.default_rng(seed)
    # Times that a file holds exactly; no key is struck twice at one instant.
    place = np.unique(generator.integers(0, [40, 3], (60, 2)), axis=0)
    offset = place[:, 0] + generator.integers(0, 60, len(place))
    velocity = generator.integers(1, 128, len(place))
    pedal = np.sort(generator.choice(100, (6,), replace=False)).reshape(-1, 2) / 20
    score = Score(place[:, 1], place[:, 0] / 20, offset / 20, velocity, pedal)
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        score.to_midi(Path(folder, "song.mid"))
        copy = Score.from_midi(Path(folder, "song.mid"))
        assert np.array_equal(copy.key, score.key)
        assert np.array_equal(copy.velocity, score.velocity)
        for name in ("onset", "offset", "pedal"):
            assert getattr(copy, name) == pytest.approx(getattr(score, name), abs=1e-9)
        assert copy.remarks == ()


def test_zero_length_and_touching_notes_survive(tmp_path: Path) -> None:
    score = Score(
        [5, 5, 5, 6], [0.0, 0.5, 1.0, 1.0], [0.5, 0.5, 2.0, 3.0], [1, 127, 64, 64], [[0.0, 0.5]]
    )
    score.to_midi(tmp_path / "song.mid")
    assert same(Score.from_midi(tmp_path / "song.mid"), score)


def test_reads_what_pretty_midi_reads(tmp_path: Path) -> None:
    generator = np.random.default_rng(7)
    events = [
        tempo(int(t), int(m))
        for t, m in zip((0, 700, 4000), (400_000, 810_811, 333_333), strict=True)
    ]
    now = 0
    # No key is struck again while it sounds: there the two pair ends with beginnings differently.
    for index in range(200):
        now += int(generator.integers(0, 300))
        events += note(21 + 7 * index % 88, now, now + int(generator.integers(1, 90)))
    path = midi_file(tmp_path / "song.mid", events)
    score = Score.from_midi(path)
    theirs = pretty_midi.PrettyMIDI(str(path)).instruments[0].notes
    ours = sorted(zip(score.key + 21, score.onset, score.offset, strict=True))
    assert np.array(ours) == pytest.approx(
        np.array(sorted((n.pitch, n.start, n.end) for n in theirs))
    )


# What is refused -------------------------------------------------------------------------------


def header(division: int = 480, tracks: int = 1, kind: int = 1) -> bytes:
    return b"MThd" + struct.pack(">IHHH", 6, kind, tracks, division)


def track(content: bytes) -> bytes:
    return b"MTrk" + struct.pack(">I", len(content)) + content


END = b"\x00\xff\x2f\x00"
NOTE = b"\x00\x90\x3c\x40\x60\x80\x3c\x00"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"Twinkle twinkle little star\n", "not a MIDI file"),
        (b"\x00" * 100, "not a MIDI file"),
        (b"MThd", "damaged"),
        (header() + track(END), "no piano notes"),
        (header(division=0) + track(NOTE + END), "damaged"),
        (header(division=0xE700) + track(NOTE + END), "no ticks in a frame"),
        (header(), "no tracks"),
        (header() + track(b"\x00\x99\x3c\x40\x60\x89\x3c\x00" + END), "no piano notes"),
        (header(1) + track(b"\xff\xff\xff\x7f\x90\x3c\x40\x60\x80\x3c\x00" + END), "4 hours"),
    ],
)
def test_bad_content_is_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.mid"
    path.write_bytes(content)
    with pytest.raises(ScoreError, match=message) as caught:
        Score.from_midi(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bad_paths_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScoreError, match="does not exist"):
        Score.from_midi(tmp_path / "nothing.mid")
    with pytest.raises(ScoreError, match="folder"):
        Score.from_midi(tmp_path)
    (tmp_path / "file").write_bytes(b"x")
    with pytest.raises(ScoreError, match="cannot be read"):
        Score.from_midi(tmp_path / "file" / "song.mid")


@given(
    st.sampled_from(songs.names()),
    st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=12),
    st.floats(0.01, 1),
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_damaged_files_are_read_or_refused(
    name: str, changes: list[tuple[float, int]], kept: float
) -> None:
    content = bytearray(songs.path(name).read_bytes())
    for where, value in changes:
        content[int(where * len(content))] = value
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(folder, "song.mid")
        path.write_bytes(content[: int(kept * len(content)) + 1])
        try:
            score = Score.from_midi(path)
        except ScoreError:
            return
        assert len(score) > 0
        assert score.note_frames().shape == (len(score), 2)


# Size ------------------------------------------------------------------------------------------


def test_large_files_are_read_back(tmp_path: Path) -> None:
    generator = np.random.default_rng(0)
    onset = generator.uniform(0, 3 * 3600, 30_000)
    score = Score(
        generator.integers(0, 88, 30_000), onset, onset + 0.2, generator.integers(1, 128, 30_000)
    )
    score.to_midi(tmp_path / "large.mid")
    copy = Score.from_midi(tmp_path / "large.mid")
    assert np.array_equal(np.sort(copy.key), np.sort(score.key))
    assert copy.onset == pytest.approx(score.onset, abs=1 / 15360)


# RoboPianist -----------------------------------------------------------------------------------


def test_rolls_equal_robopianists_cell_for_cell(shared: Path) -> None:
    references = np.load(shared / "data/etude12/reference_rolls.npz")
    assert len(references) == ETUDE12_AND_STAN
    for name, packed in references.items():
        wanted = np.unpackbits(packed, axis=1)[:, :88].astype(bool)
        if name == "Stan_1":
            score = Score.from_midi(shared / "data/stan/Stan_1.mid")
        else:
            score = Score.from_midi(shared / f"data/etude12/{name}.mid").trim_silence()
        assert np.array_equal(score.roll(), wanted), name


def test_pedal_equals_pianomimes(shared: Path) -> None:
    reference = np.load(shared / "data/stan/reference.npz")
    score = Score.from_midi(shared / "data/stan/Stan_1.mid")
    skipped = len(score.pedal_roll()) - len(reference["sustain"])
    assert np.array_equal(score.pedal_roll()[skipped:], reference["sustain"].astype(bool))
    assert np.array_equal(score.roll()[skipped:], reference["goal"].astype(bool))


@pytest.mark.parametrize("folder", ["repertoire", "pop/test12", "modern/test12"])
def test_real_files_are_read(shared: Path, folder: str) -> None:
    files = sorted((shared / "data" / folder).glob("*.mid"))
    assert files
    for file in files[:40]:
        assert len(Score.from_midi(file)) > 0


def test_parsers_messages_do_not_leak(tmp_path: Path) -> None:
    path = tmp_path / "bad.mid"
    path.write_bytes(header() + b"junk" * 5)
    with pytest.raises(ScoreError) as caught:
        Score.from_midi(path)
    assert "MiniMidi" not in str(caught.value)
