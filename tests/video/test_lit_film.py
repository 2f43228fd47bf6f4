"""Films whose keys light up, without hands: of a drawn keyboard of which everything is known."""

from __future__ import annotations

import json
from fractions import Fraction
from typing import Any

import av
import pytest

import made_up_video as made_up
from pianomime.errors import InputError
from pianomime.music import onset_f1
from pianomime.video.keyboard.points import place_of, read_points
from pianomime.video.lit_film import notes_of_lit_film

SIZE = (640, 360)


@pytest.fixture(scope="module")
def score():
    return made_up.song(5.0)


def write(path, score, light_up=True, span=(-0.63, 0.63)):
    """A film of a keyboard without hands; returns its plane."""
    plane = made_up.camera(SIZE, span=span)
    with av.open(str(path), "w") as film:
        stream: Any = film.add_stream("libx264", rate=20)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for number in range(100):
            at = number / 20
            sounding = score.key[(score.onset <= at) & (at < score.offset)] if light_up else ()
            seen = made_up.picture(plane, SIZE, sounding)
            frame = av.VideoFrame.from_ndarray(seen, format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 20)
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    return plane


def test_falling_notes_without_hands(tmp_path, score):
    path = tmp_path / "falling.mp4"
    write(path, score)
    phases = set()
    read = notes_of_lit_film(path, progress=lambda phase, _done, _of: phases.add(phase))
    assert onset_f1((score.key, score.onset), (read.key, read.onset), 0.1) > 0.97
    assert phases == {"keyboard", "keys", "notes"}
    assert read.title == "falling"
    assert read.remarks == ()


def test_an_open_octave_is_said(tmp_path, score):
    path = tmp_path / "part.mp4"
    write(path, score, span=(-0.35, 0.25))
    read = notes_of_lit_film(path)
    assert (read.key.min() - score.key.min()) % 12 == 0
    assert "octave open" in read.remarks[0]


def test_named_points_in_place_of_a_search(tmp_path, score):
    path, points = tmp_path / "falling.mp4", tmp_path / "points.json"
    plane = write(path, score, span=(-0.35, 0.25))
    names = ("C3 front left", "C3 back left", "C5 front left", "C5 back left")
    places = {name: plane.to_pixels(place_of(name)).tolist() for name in names}
    points.write_text(json.dumps({"points": places}))
    read = notes_of_lit_film(path, read_points(points))
    assert onset_f1((score.key, score.onset), (read.key, read.onset), 0.1) > 0.97


def test_keys_that_do_not_light_up(tmp_path, score):
    path = tmp_path / "unlit.mp4"
    write(path, score, light_up=False)
    with pytest.raises(InputError, match="keys do not light up"):
        notes_of_lit_film(path)
