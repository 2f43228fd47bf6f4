"""Files with the faults of public ones: each is read as it was meant, and says what was mended."""

import re
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

from pianomime.music import Score, ScoreError

END = b"\x00\xff\x2f\x00"
BEAT = b"\x83\x60"
"""480 ticks: half a second at the usual tempo."""
C4 = b"\x00\x90\x3c\x50" + BEAT + b"\x80\x3c\x40"
E4 = b"\x00\x90\x40\x50" + BEAT + b"\x80\x40\x40"
ON, OFF = b"\x90\x3c\x50", b"\x80\x3c\x40"
DOWN, UP = b"\xb0\x40\x7f", b"\xb0\x40\x00"
BOTH = "60:0-0.5 64:0.5-1"


def header(tracks: int = 1, kind: int = 1, division: int = 480) -> bytes:
    return b"MThd" + struct.pack(">IHHH", 6, kind, tracks, division)


def track(content: bytes, longer: int = 0) -> bytes:
    return b"MTrk" + struct.pack(">I", len(content) + longer) + content


def gs(address: bytes, value: int) -> bytes:
    return b"\x00\xf0\x0a\x41\x10\x42\x12" + address + bytes([value]) + b"\x00\xf7"


def read(path: Path) -> tuple[Score, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        score = Score.from_midi(path)
    return score, [str(each.message) for each in caught]


def notes(score: Score) -> str:
    spans = zip(score.key + 21, score.onset, score.offset, strict=True)
    return " ".join(f"{key}:{on:.4g}-{off:.4g}" for key, on, off in spans)


@pytest.mark.parametrize(
    ("content", "wanted", "remark"),
    [
        pytest.param(
            header() + track(b"\x00" + ON + BEAT + ON + BEAT + OFF + END),
            "60:0-1 60:0.5-1",
            "notes without an end, held until another on their key ends: 1",
            id="an end is missing",
        ),
        pytest.param(
            header() + track(b"\x00" + ON + (BEAT + ON + BEAT + OFF) * 5 + END),
            "60:0-1 60:0.5-1 60:1.5-2 60:2.5-3 60:3.5-4 60:4.5-5",
            "notes without an end, held until another on their key ends: 1",
            id="an end is missing long before",
        ),
        pytest.param(
            header() + track(b"\x00" + ON + BEAT + ON + BEAT + OFF + BEAT + OFF + END),
            "60:0-1 60:0.5-1",
            "",
            id="two notes of one key overlap",
        ),
        pytest.param(
            header() + track(b"\x00" + ON + BEAT + ON + b"\x00" + OFF + BEAT + OFF + END),
            "60:0-0.5 60:0.5-1",
            "",
            id="struck before it ends, in one instant",
        ),
        pytest.param(
            header() + track(b"\x00" + ON + BEAT + b"\x90\x40\x50" + BEAT + b"\xff\x01\x00" + END),
            "60:0-1 64:0.5-1",
            "notes without an end, held until their track ends: 2",
            id="no end at all",
        ),
        pytest.param(
            header() + track(b"\x00" + ON + BEAT + b"\xb0\x7b\x00" + E4 + END),
            BOTH,
            "",
            id="all notes off",
        ),
        pytest.param(
            header() + track(b"\x00\xf0\x03\x43\x12\x00\x0a\xf7\x03\x43\x12\xf7" + C4 + END),
            "60:0.01042-0.5104",
            "",
            id="exclusive message in packets",
        ),
        pytest.param(
            header() + track(b"\x00\xf7\x02\xf3\x01" + C4 + E4 + END), BOTH, "", id="escape"
        ),
        pytest.param(
            header()
            + track(
                b"\x00" + ON + BEAT + b"\x3c\x00\x00\xf0\x05\x7e\x7f\x06\x01\xf7"
                b"\x00\x40\x50" + BEAT + b"\x40\x00" + END
            ),
            BOTH,
            "",
            id="running status after an exclusive message",
        ),
        pytest.param(
            header() + track(C4 + END + E4 + END),
            BOTH,
            "ends in the middle of a track, passed over: 1",
            id="end of track in mid-track",
        ),
        pytest.param(
            header() + track(C4 + E4 + END + b"\x00" * 40), BOTH, "", id="zeros after the end"
        ),
        pytest.param(
            header(2, kind=2)
            + track(b"\x00\xff\x51\x03\x0f\x42\x40" + C4 + END)
            + track(b"\x00\xff\x51\x03\x03\xd0\x90" + E4 + END),
            "60:0-1 64:1-1.25",
            "patterns, one after the other: 2",
            id="format 2",
        ),
        pytest.param(
            header() + track(C4 + b"\x00\x90\x40\xc8" + BEAT + b"\x80\x40\x40" + END),
            BOTH,
            "data bytes over 127, read as 127: 1",
            id="velocity over 127",
        ),
        pytest.param(
            header() + track(b"\x00\xf4" + C4 + E4 + END),
            BOTH,
            "system messages that do not belong in a file, skipped: 1",
            id="undefined status",
        ),
        pytest.param(
            header() + track(b"\x00\x30\x40" + C4 + E4 + END),
            BOTH,
            "bytes without a status, skipped: 3",
            id="data before any status",
        ),
        pytest.param(
            b"RIFF\x00\x00\x00\x00RMIDdata\x00\x00\x00\x00" + header() + track(C4 + E4 + END),
            BOTH,
            "",
            id="RIFF wrapper",
        ),
        pytest.param(
            header(division=0xE728) + track(b"\x00" + ON + b"\x87\x68" + OFF + END),
            "60:0-1",
            "",
            id="25 frames a second",
        ),
        pytest.param(
            header(division=0xE364) + track(b"\x00" + ON + b"\x97\x35" + OFF + END),
            "60:0-1",
            "",
            id="29.97 frames a second",
        ),
        pytest.param(
            header(1) + track(b"\x00\xff\x01\x00" + END) + track(C4 + E4 + END),
            BOTH,
            "tracks in spite of 1 in the header: 2",
            id="more tracks than told",
        ),
        pytest.param(
            header(2) + track(C4 + E4 + END),
            BOTH,
            "tracks in spite of 2 in the header: 1",
            id="fewer tracks than told",
        ),
        pytest.param(
            header(2) + track(C4 + END) + b"\x85\x00\x00" + track(b"\x83\x60" + E4[1:] + END),
            BOTH,
            "bytes between tracks, skipped: 3",
            id="bytes between tracks",
        ),
        pytest.param(
            header(2)
            + track(C4 + END)
            + b"XFIH\x00\x00\x00\x02\x01\x02"
            + track(b"\x83\x60" + E4[1:] + END),
            BOTH,
            "",
            id="a chunk of another kind",
        ),
        pytest.param(
            header(2) + track(C4 + END, longer=1) + track(b"\x83\x60" + E4[1:] + END, longer=-2),
            BOTH,
            "tracks of a wrong length: 2",
            id="wrong lengths",
        ),
        pytest.param(
            header() + track(C4 + E4), BOTH, "tracks without an end: 1", id="no end of track"
        ),
        pytest.param(
            header() + track(C4 + E4 + b"\x00\x90\x43", longer=9),
            BOTH,
            "tracks that can be read only in part: 1; tracks of a wrong length: 1",
            id="cut off",
        ),
        pytest.param(
            header() + track(C4 + b"\x00\xff\x51\x03\x00\x00\x00" + E4 + END),
            BOTH,
            "tempos of zero, ignored: 1",
            id="tempo of zero",
        ),
        pytest.param(
            header() + track(C4 + E4 + b"\x00\x99\x24\x50" + BEAT + b"\x89\x24\x40" + END),
            BOTH,
            "notes of drums, left out: 1",
            id="drums on channel 10",
        ),
        pytest.param(
            header()
            + track(gs(b"\x40\x1a\x15", 1) + b"\x00\x9a\x24\x50\x00\x8a\x24\x40" + C4 + E4 + END),
            BOTH,
            "notes of drums, left out: 1",
            id="drums by GS",
        ),
        pytest.param(
            header()
            + track(
                b"\x00\xf0\x08\x43\x10\x4c\x00\x00\x7e\x00\xf7\x00\xb3\x00\x7f\x00\xc3\x00"
                b"\x00\x93\x24\x50\x00\x83\x24\x40" + C4 + E4 + END
            ),
            BOTH,
            "notes of drums, left out: 1",
            id="drums by an XG bank",
        ),
        pytest.param(
            header() + track(b"\x00\xb0\x00\x7f\x00\xc0\x00" + C4 + E4 + END),
            BOTH,
            "",
            id="that bank without XG",
        ),
        pytest.param(
            header() + track(b"\x00\xb0\x65\x00\x00\xb0\x64\x02\x00\xb0\x06\x4c" + C4 + E4 + END),
            "72:0-0.5 76:0.5-1",
            "notes transposed, as the file asks: 2",
            id="coarse tuning",
        ),
        pytest.param(
            header() + track(b"\x00\xf0\x07\x7f\x7f\x04\x04\x00\x3f\xf7" + C4 + E4 + END),
            "59:0-0.5 63:0.5-1",
            "notes transposed, as the file asks: 2",
            id="master tuning",
        ),
        pytest.param(
            header() + track(gs(b"\x40\x11\x16", 0x41) + gs(b"\x40\x00\x05", 0x41) + C4 + END),
            "62:0-0.5",
            "notes transposed, as the file asks: 1",
            id="key shift by GS",
        ),
    ],
)
def test_is_read_as_meant(tmp_path: Path, content: bytes, wanted: str, remark: str) -> None:
    path = tmp_path / "song.mid"
    path.write_bytes(content)
    score, told = read(path)
    assert notes(score) == wanted
    assert "; ".join(score.remarks) == remark
    assert told == ([f"{path}: {remark}"] if remark else [])


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        pytest.param(
            header(2) + track(C4 + E4 + END) + track(b"\x00" + DOWN + BEAT + UP + END),
            [[0, 0.5]],
            id="on a track of its own",
        ),
        pytest.param(
            header() + track(b"\x00\xb9\x40\x7f" + C4 + E4 + END), [], id="on the channel of drums"
        ),
        pytest.param(
            header() + track(b"\x00" + DOWN + C4 + b"\x00\xb0\x79\x00" + E4 + END),
            [[0, 0.5]],
            id="reset of all controllers",
        ),
        pytest.param(
            header() + track(b"\x00" + DOWN + C4 + b"\x00\xb3\x79\x00" + E4 + END),
            [[0, 1]],
            id="reset of another channel",
        ),
        pytest.param(
            header() + track(b"\x00" + DOWN + C4 + b"\x00" + UP + b"\x00" + DOWN + E4 + END),
            [[0, 0.5 - 1 / 960], [0.5, 1]],
            id="up and down in one instant",
        ),
        pytest.param(
            header() + track(b"\x00" + DOWN + C4 + b"\x00\xb1\x40\x7f" + E4 + b"\x00" + UP + END),
            [[0, 1]],
            id="two channels, one pedal",
        ),
        pytest.param(
            header() + track(b"\x00" + DOWN + C4 + b"\xff\xff\xff\x7f" + UP + END),
            [[0, 4 * 3600]],
            id="lifted after days",
        ),
    ],
)
def test_pedal_is_read_as_meant(tmp_path: Path, content: bytes, wanted: list[list[float]]) -> None:
    path = tmp_path / "song.mid"
    path.write_bytes(content)
    score, told = read(path)
    assert score.pedal == pytest.approx(np.reshape(wanted, (-1, 2)))
    assert told == []


def test_what_is_not_music_is_refused_with_what_was_left_out(tmp_path: Path) -> None:
    path = tmp_path / "song.mid"
    path.write_bytes(header() + track(b"\x00\x99\x24\x50" + BEAT + b"\x89\x24\x40" + END))
    with pytest.raises(ScoreError, match="no piano notes; notes of drums, left out: 1"):
        Score.from_midi(path)


def test_an_endless_device_is_refused() -> None:
    device = Path("/dev/zero")
    if not device.exists():
        pytest.skip("there is no endless device here")
    with pytest.raises(ScoreError, match="larger than"):
        Score.from_midi(device)


def test_reference_files_are_read_right(shared: Path) -> None:
    folder = shared / "data/midi-faults"
    pedal = {
        "pedal-3ms": [[0, 0.503571], [0.506771, 1.506771]],
        "pedal-own-track": [[0, 1]],
        "pedal-reset-cc121": [[0, 0.5]],
    }
    usual = "60:0-0.5 64:0.5-1"
    wanted = {
        "gs-drum-ch11": "60:0.5-1 64:1-1.5",
        "hanging-all": "60:0-1 64:0.5-1",
        "hanging-cc123": "60:0-0.5 64:1-1.5",
        "hanging-first": "60:0-1 60:0.5-1 60:1-1.5",
        "hanging-late": "60:0-1 60:0.5-1 60:1.5-2 60:2.5-3 60:3.5-4 60:4.5-5 60:5.5-6",
        "hanging-overlap": "60:0-1 60:0.5-1",
        "pedal-3ms": "60:0-0.5 64:0.5068-1.007",
        "rpn-coarse-tune+12": "72:0-0.5 76:0.5-1",
        "running-after-sysex-own-status": "60:0-0.5 64:0.5-1 67:1-1.5",
        "smpte25x40": "60:0-1",
        "sysex-split": "60:0.01042-0.5104 64:0.5104-1.01",
        "type2-tempo": "60:0-1 64:1-1.25",
        "velocity-128": "60:0-0.5 64:0.5-1 67:1-1.5",
    }
    files = sorted(folder.glob("*.mid"))
    assert files
    for file in files:
        score, told = read(file)
        assert notes(score) == wanted.get(file.stem, usual), file.stem
        assert score.pedal == pytest.approx(np.reshape(pedal.get(file.stem, []), (-1, 2)), abs=1e-3)
        assert len(told) == bool(score.remarks)
        assert not told or re.search(r": \d+", told[0])


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(header() + track(C4 + END * 200_000), id="many ends"),
        pytest.param(
            header(3000)
            + track(b"\x00" + ON + END) * 3000
            + track(b"\x00\xb1\x7b\x00" * 20_000 + END),
            id="all notes off, where another channel holds many",
        ),
    ],
)
def test_work_is_in_proportion_to_the_size(tmp_path: Path, content: bytes) -> None:
    """Done in a second; where each event looked at all before it, in minutes."""
    path = tmp_path / "song.mid"
    path.write_bytes(content)
    assert len(read(path)[0]) >= 1
