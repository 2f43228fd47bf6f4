"""The bundled songs and their notation."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pianomime import songs
from pianomime.errors import InputError
from pianomime.music import Score, ScoreError
from pianomime.songs.find import find_song
from pianomime.songs.notation import SONGS, Piece, Voice, to_score


def test_names_and_paths() -> None:
    assert songs.names() == sorted(SONGS)
    assert len(songs.names()) >= 6
    assert all(songs.path(name).is_file() for name in songs.names())
    with pytest.raises(InputError, match=r"no bundled song 'smoke'; there are: bach"):
        songs.path("smoke")


@pytest.mark.parametrize("name", sorted(SONGS))
def test_files_are_what_the_notation_says(name: str, tmp_path: Path) -> None:
    to_score(SONGS[name]).to_midi(tmp_path / "song.mid")
    assert (tmp_path / "song.mid").read_bytes() == songs.path(name).read_bytes()


@pytest.mark.parametrize("name", sorted(SONGS))
def test_songs_can_be_played_by_ten_fingers(name: str) -> None:
    score = Score.from_midi(songs.path(name))
    frames = score.note_frames()
    assert (frames[:, 1] > frames[:, 0]).all()
    assert score.roll().sum(axis=1).max() <= 10
    assert score.onset[0] == 0


def test_voices_end_together() -> None:
    for song in SONGS.values():
        ends = set()
        for voice in song.voices:
            alone = Piece(song.title, song.tempo, song.bar, (voice,), upbeat=song.upbeat)
            ends.add(round(to_score(alone).duration / (60 / song.tempo) / song.bar))
        assert len(ends) == 1, song.title


def test_notation() -> None:
    song = Piece("t", 60, 2, (Voice("C4 r*.5 F#4+Bb3*.5 | A0*2 |"),), pedal="P r |")
    with pytest.raises(ScoreError, match="bar ends at beat 4"):
        to_score(song)
    score = to_score(Piece("t", 60, 2, (Voice("C4 r*.5 F#4+Bb3*.5 | A0*2 |"),), pedal="P | r |"))
    assert score.key.tolist() == [39, 37, 45, 0]
    assert score.onset.tolist() == [0, 1.5, 1.5, 2]
    assert score.offset == pytest.approx(np.array([0.95, 1.95, 1.95, 3.95]))
    assert score.velocity.tolist() == [72, 64, 64, 72]
    assert score.pedal == pytest.approx(np.array([[0, 1.95]]))
    with pytest.raises(ScoreError, match="no such note"):
        to_score(Piece("t", 60, 2, (Voice("H4*2 |"),)))


def test_music_is_imported_without_heavy_libraries() -> None:
    heavy = {"pretty_midi", "mido", "mir_eval", "torch"}
    code = f"import pianomime.music, sys; print({heavy} & set(sys.modules))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "set()"


@pytest.mark.parametrize(
    ("name", "song"),
    [("ode to joy", "beethoven-ode-to-joy"), ("Twinkle", "twinkle-twinkle")],
)
def test_a_part_of_the_name_will_do(name: str, song: str) -> None:
    assert find_song(name) == songs.path(song)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("twinkel", "twinkel: no such file or bundled song; did you mean 'twinkle-twinkle'?"),
        ("my/gymnopedi.mid", "did you mean 'satie-gymnopedie-1'?"),
        ("fur-elize", "did you mean 'beethoven-fur-elise'?"),
        ("oed to joy", "did you mean 'beethoven-ode-to-joy'?"),
        ("e", "e: is part of more than one bundled song: bach"),
        (" ", "the name of a song is empty"),
        ("zzz", "zzz: no such file or bundled song; bundled are: bach"),
    ],
)
def test_unknown_songs_get_the_closest_names(name: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        find_song(name)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_unknown_files_get_the_closest_files(tmp_path: Path) -> None:
    (tmp_path / "nocturne-op9.mid").touch()
    with pytest.raises(InputError, match=r"did you mean 'nocturne-op9.mid'\?"):
        find_song(str(tmp_path / "nocturn-op9.mid"))
