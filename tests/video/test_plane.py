from __future__ import annotations

import json

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.errors import InputError
from pianomime.video.keyboard.plane import fit_plane, fit_plane_robustly
from pianomime.video.keyboard.points import SUGGESTED, place_of, read_points


def some_points(count=12, seed=0):
    world = np.random.default_rng(seed).uniform([-0.08, -0.6], [0.08, 0.6], (count, 2))
    plane = made_up.camera(turned=3, tilt=0.5)
    return plane, plane.to_pixels(world), world


def test_there_and_back():
    plane, pixels, world = some_points()
    np.testing.assert_allclose(plane.to_world(pixels), world, atol=1e-12)


def test_fit_is_exact_on_exact_points():
    plane, pixels, world = some_points()
    fitted = fit_plane(pixels, world)
    np.testing.assert_allclose(fitted.to_pixels(world), plane.to_pixels(world), atol=1e-6)


def test_outliers_are_left_out():
    _, pixels, world = some_points()
    wrong = pixels.copy()
    wrong[[2, 7]] += [90, -60]
    fitted, good = fit_plane_robustly(wrong, world)
    assert np.flatnonzero(~good).tolist() == [2, 7]
    np.testing.assert_allclose(fitted.to_world(pixels), world, atol=1e-9)


def test_points_in_a_line_are_refused():
    line = np.stack((np.arange(5), 2 * np.arange(5)), axis=1)
    with pytest.raises(ValueError, match=r"line|same"):
        fit_plane(line, line)


def test_zoom():
    plane, pixels, world = some_points()
    np.testing.assert_allclose(plane.zoomed(2).to_world(pixels * 2), world, atol=1e-12)


def test_named_points(tmp_path):
    plane = made_up.camera(turned=1)
    points = {name: plane.to_pixels(place_of(name)).tolist() for name in SUGGESTED}
    points["C4 front left"][0] += 200  # a slip
    file = tmp_path / "points.json"
    file.write_text(json.dumps({"points": points}))
    named = read_points(file)
    assert named.left_out == ["C4 front left"]
    assert "left out: C4 front left" in named.describe()
    place = place_of("G#5 front")
    np.testing.assert_allclose(named.plane.to_world(plane.to_pixels(place)), place, atol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"points": {}}',
        '{"points": {"H9 front left": [1, 2]}}',
        '{"points": {"A0 front left": [1, 2], "C8 front left": [1], "B0 front left": 3}}',
        '{"points": {"A0 front left": [1, 2], "A1 front left": [1, 2], '
        '"A2 front left": [1, 2], "A3 front left": [1, 2]}}',
    ],
)
def test_bad_points_are_one_line(tmp_path, text):
    file = tmp_path / "points.json"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        read_points(file)
    assert "\n" not in str(caught.value)


def test_white_keys_have_no_front_alone():
    with pytest.raises(InputError, match="not a point"):
        place_of("C4 front")
