"""Files of other kinds: those of music get the command that helps, and a folder's are counted."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pianomime import songs
from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.learn.expert.many import find_experts_songs
from pianomime.music import Score
from pianomime.songs.find import find_song, find_songs

_MUSIC = songs.path("twinkle-twinkle").read_bytes()

_RECORDINGS = {
    "a song.mp3": "`pianomime transcribe {quoted}`",
    "a song.WAV": "`pianomime transcribe {quoted}`",
    "a song.mp4": "`pianomime retarget {quoted}`",
    "song.webm": "and `pianomime transcribe {path}` makes MIDI of its sound",
}
"""These are played by `pianomime play`, which transcribes them."""
_HELPS = {
    **_RECORDINGS,
    "song.musicxml": "File > Export, or `mscore -o song.mid {path}`",
    "song.MXL": "mscore -o song.mid",
    "song.xml": "mscore -o song.mid",
    "song.gp5": "mscore -o song.mid",
    "song.sib": "Sibelius",
    "song.abc": "`abc2midi {path} -o song.mid`",
    "song.ly": r"\midi { }",
    "song.pdf": "Audiveris",
}


@pytest.mark.parametrize(
    ("command", "name"),
    [("play", name) for name in _HELPS if name not in _RECORDINGS]
    + [("evaluate", name) for name in _RECORDINGS]
    + [
        (command, "song.abc")
        for command in ("evaluate", "train-expert", "train-goal", "train-sac", "train-fingers")
    ],
)
def test_music_of_other_kinds_gets_what_helps(
    command: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_bytes(b"\x01 something else")
    with pytest.raises(SystemExit) as stopped:
        main([command, str(path), "-o", str(tmp_path / "out")])
    assert stopped.value.code == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert f"{path}: is not a MIDI file; " in message
    assert _HELPS[name].replace("{path}", str(path)).replace("{quoted}", f"'{path}'") in message


def test_a_reader_says_what_helps_too(tmp_path: Path) -> None:
    (tmp_path / "song.abc").write_text("X:1")
    with pytest.raises(InputError, match="is not a MIDI file; `abc2midi "):
        Score.from_midi(tmp_path / "song.abc")


def test_midi_is_midi_by_what_it_holds(tmp_path: Path) -> None:
    path = tmp_path / "song.xml"
    path.write_bytes(_MUSIC)
    assert find_song(str(path)) == path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with three songs, one of them a link that leads nowhere, and much else."""
    for name in ("b.KAR", "deep/er/a.Rmi", ".hidden/c.mid", ".pianomime-0123/d.mid", "._b.mid"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(_MUSIC)
    (tmp_path / "lost.mid").symlink_to(tmp_path / "nowhere.mid")
    (tmp_path / "folder.mid").mkdir()
    os.mkfifo(tmp_path / "pipe.mid")
    for name in ("1.musicxml", "deep/2.MusicXML", "3.mp3", "4.txt", "5.png", ".hidden/6.mp3"):
        (tmp_path / name).touch()
    return tmp_path


def test_folders_are_searched_for_files_alone(folder: Path) -> None:
    with pytest.warns(UserWarning, match=r"MIDI files: 2 \.musicxml, 1 \.mp3$") as told:
        found = find_songs([folder])
    assert [str(path.relative_to(folder)) for path in found] == [
        "b.KAR",
        "deep/er/a.Rmi",
        "lost.mid",
    ]
    assert len(told) == 1


@pytest.mark.parametrize("suffix", [".mid", ".midi", ".kar", ".rmi", ".rmid", ".smf", ".MID"])
def test_every_search_knows_every_suffix(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"song{suffix}"
    path.write_bytes(_MUSIC)
    assert find_songs([tmp_path]) == [path]
    assert list(find_experts_songs(tmp_path).values()) == [path]


def test_experts_are_trained_on_demonstrations_too(folder: Path) -> None:
    (folder / "demo.npz").touch()
    with pytest.warns(UserWarning, match=r"demonstrations or MIDI files: 2 \.musicxml, 1 \.mp3$"):
        assert folder / "demo.npz" in find_experts_songs(folder).values()


def test_a_folder_of_other_kinds_gets_what_helps_most_of_them(tmp_path: Path) -> None:
    for name in ("1.abc", "2.abc", "3.mp3"):
        (tmp_path / name).touch()
    message = f"no MIDI files in this folder; of other kinds: 2 .abc, 1 .mp3; `abc2midi {tmp_path}"
    with pytest.raises(InputError, match=re.escape(message)):
        find_songs([tmp_path])


def test_a_folder_that_cannot_be_read_is_told(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = os.scandir

    def refuse(path: str) -> Iterator[Any]:
        # Not by its permissions: root may read every folder.
        if path == str(folder / "deep"):
            raise PermissionError(13, "Permission denied", path)
        return scan(path)

    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.warns(UserWarning, match=r"deep: cannot be read, and is passed over: Permission"):
        found = find_songs([folder])
    assert [path.name for path in found] == ["b.KAR", "lost.mid"]
