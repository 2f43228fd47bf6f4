from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

import made_up_video as made_up
from pianomime.cli import main
from pianomime.keyboard import BLACK
from pianomime.video.film.film import Film
from pianomime.video.keyboard.clear_picture import clear_picture
from pianomime.video.keyboard.geometry import BLACK_FRONT, FRONT
from pianomime.world.parameters import key_centres

SIZE = (640, 360)


@pytest.fixture
def path(tmp_path):
    """A picture in which every octave of the middle of a keyboard is possible."""
    path = tmp_path / "seen.png"
    plane = made_up.camera(SIZE, span=(-0.3, 0.3))
    Image.fromarray(made_up.picture(plane, SIZE)).save(path)
    return path


def test_writes_where_the_keys_are(tmp_path, capsys):
    plane = made_up.camera(SIZE)
    # Larger than pictures are searched at: pixels are those of the picture as it is given.
    given = Image.fromarray(made_up.picture(plane, SIZE)).resize((2560, 1440))
    given.save(tmp_path / "large.jpg")
    out, drawn = tmp_path / "new" / "KEYBOARD.json", tmp_path / "drawn.png"
    main(["keyboard", str(tmp_path / "large.jpg"), "-o", str(out), "--picture", str(drawn)])
    found = json.loads(out.read_text("utf-8"))
    assert (found["found"], found["sure"], found["mirrored"]) == (True, True, False)
    assert (found["lowest"], found["highest"]) == (0, 87)
    keys = np.array([int(key) for key in found["keys"]])
    assert np.array_equal(keys, np.flatnonzero(~BLACK))
    world = np.stack((np.full(52, (BLACK_FRONT + FRONT) / 2), key_centres()[keys, 1]), axis=1)
    off = np.linalg.norm(list(found["keys"].values()) - 4 * plane.to_pixels(world), axis=1)
    assert off.max() < 6
    assert Image.open(drawn).size == (1280, 720)
    lines = capsys.readouterr().out.splitlines()
    assert found["second"] is None
    assert lines[0].startswith("keys A")
    assert "doubt" not in lines[0]


def test_says_what_is_open_and_is_told(path, tmp_path, capsys):
    out = tmp_path / "k.json"
    main(["keyboard", str(path), "-o", str(out)])
    line = capsys.readouterr().out.splitlines()[0]
    assert "in doubt: the video leaves the octave open" in line
    assert "--octave" in line
    assert not json.loads(out.read_text("utf-8"))["sure"]
    main(["keyboard", str(path), "--octave", "2", "--not-mirrored", "-o", str(out)])
    assert "doubt" not in capsys.readouterr().out
    found = json.loads(out.read_text("utf-8"))
    assert found["sure"]
    # Not a whole octave below C2, which is key 15.
    assert 4 <= found["lowest"] <= 15


def test_what_is_told_against_the_picture_is_not_sure(tmp_path, capsys):
    whole, out = tmp_path / "whole.png", tmp_path / "k.json"
    Image.fromarray(made_up.picture(made_up.camera(SIZE), SIZE)).save(whole)
    main(["keyboard", str(whole), "--octave", "2", "-o", str(out)])
    line = capsys.readouterr().out.splitlines()[0]
    assert "contradicts the names" in line
    found = json.loads(out.read_text("utf-8"))
    assert (found["found"], found["sure"]) == (True, False)
    main(["keyboard", str(whole), "--octave", "1", "--not-mirrored", "-o", str(out)])
    assert "doubt" not in capsys.readouterr().out
    assert json.loads(out.read_text("utf-8"))["sure"]


def swaying(at):
    return made_up.turn(2 * np.sin(2 * at), 15 * np.sin(3 * at), SIZE)


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """A film whose camera moves, after half a second of something else."""
    path = tmp_path_factory.mktemp("moving") / "moving.mp4"
    score = made_up.song(2.5)
    made_up.write(
        path,
        made_up.camera(SIZE),
        SIZE,
        score,
        made_up.plan_of(score),
        made_up.times(2.5, 20),
        False,
        lambda at: None if at < 0.5 else swaying(at),
    )
    return path


def test_a_film_whose_camera_moves(moving, tmp_path, capsys):
    out, drawn = tmp_path / "k.json", tmp_path / "drawn.png"
    main(["keyboard", str(moving), "-o", str(out), "--picture", str(drawn)])
    found = json.loads(out.read_text("utf-8"))
    assert (found["found"], found["sure"]) == (True, True)
    assert found["second"] == pytest.approx(0.5, abs=0.1)
    assert Image.open(drawn).size == SIZE
    line = capsys.readouterr().out.splitlines()[0]
    assert "followed through moving pictures" in line
    assert f"at {found['second']:.2f} s" in line
    plane = made_up.after(made_up.camera(SIZE), swaying(found["second"]))
    keys = np.array([int(key) for key in found["keys"]])
    world = np.stack((np.full(len(keys), (BLACK_FRONT + FRONT) / 2), key_centres()[keys, 1]), 1)
    off = np.linalg.norm(list(found["keys"].values()) - plane.to_pixels(world), axis=1)
    assert off.max() < 2


def test_a_picture_of_a_film_whose_camera_moves_is_marked(moving):
    film = Film(moving)
    picture, second = clear_picture(film)
    assert second >= 0.5
    shown = next(film.frames(20.0, round(20 * second))).picture
    np.testing.assert_array_equal(picture, shown)


def test_no_keyboard(tmp_path, capsys):
    Image.new("RGB", SIZE).save(tmp_path / "black.png")
    main(["keyboard", str(tmp_path / "black.png"), "-o", str(tmp_path / "k.json")])
    assert capsys.readouterr().out.startswith("no keyboard found")
    found = json.loads((tmp_path / "k.json").read_text("utf-8"))
    assert (found["found"], found["sure"], found["keys"]) == (False, False, {})


def test_bad_input(tmp_path, capsys):
    path = tmp_path / "a.json"
    path.write_text("{}", "utf-8")
    for arguments in (
        [str(tmp_path / "missing.png")],
        [str(tmp_path)],
        [str(path)],
        [str(path), "-o", "k.txt"],
        [str(path), "-o", str(path)],
        [str(path), "--mirrored", "--not-mirrored"],
    ):
        with pytest.raises(SystemExit) as stopped:
            main(["keyboard", *arguments])
        assert stopped.value.code == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
