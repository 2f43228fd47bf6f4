from __future__ import annotations

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.keyboard import key_name
from pianomime.video.keyboard.keyboard import find_keyboards
from pianomime.world.parameters import key_centres

VIEWS = {
    "whole": ((1280, 720), {}),
    "small": ((640, 360), {}),
    "turned": ((1280, 720), {"turned": -5}),
    "from the other side": ((1280, 720), {"turned": 180}),
    "upright": ((720, 1280), {"turned": 90, "span": (-0.36, 0.36)}),
    "mirrored": ((1280, 720), {"mirrored": True}),
    "tilted": ((1280, 720), {"tilt": 0.8}),
    "letterbox": ((1280, 720), {"span": (-0.8, 0.8)}),
    "lower half": ((1280, 720), {"span": (-0.63, 0.05)}),
    "middle": ((1280, 720), {"span": (-0.3, 0.3)}),
}


@pytest.mark.parametrize("view", VIEWS)
def test_finds_the_plane(view):
    size, options = VIEWS[view]
    plane = made_up.camera(size, **options)
    found = find_keyboards(made_up.picture(plane, size).mean(axis=2, dtype=np.float32) / 255)
    keys = key_centres()[:, :2]
    pixels = plane.to_pixels(keys)
    visible = ((pixels >= 0) & (pixels < size)).all(axis=1)
    off = np.linalg.norm(found[0].plane.to_world(pixels) - keys, axis=1)[visible]
    assert np.median(off) < 0.002
    assert off.max() < 0.005
    assert found[0].mirrored == (view == "mirrored")
    assert found[0].seen[visible].mean() > 0.5
    assert found[0].error_metres < 0.001
    # Where an end is seen there is no doubt; in the middle each octave is possible.
    assert (len(found) == 1) == (view != "middle")
    assert key_name(int(np.flatnonzero(found[0].seen)[-1])) in found[0].describe()


def test_light_and_hands_do_not_disturb():
    size = (1280, 720)
    plane = made_up.camera(size)
    hands = made_up.plan_of(made_up.song()).fingertips[20, :, :, :2]
    picture = made_up.picture(plane, size, [20, 39, 44], hands)
    found = find_keyboards(picture.mean(axis=2, dtype=np.float32) / 255)
    keys = key_centres()[:, :2]
    off = np.linalg.norm(found[0].plane.to_world(plane.to_pixels(keys)) - keys, axis=1)
    assert off.max() < 0.005


def grey(plane, size):
    return made_up.picture(plane, size).mean(axis=2, dtype=np.float32) / 255


def named_right(found, plane):
    """Whether each key has its name."""
    keys = key_centres()[:, :2]
    off = np.linalg.norm(found.plane.to_world(plane.to_pixels(keys)) - keys, axis=1)
    return off.max() < 0.006


@pytest.mark.parametrize("side", [-1, 1])
def test_an_octave_in_shade_is_no_end(side):
    size = (1280, 720)
    plane = made_up.camera(size)
    picture = grey(plane, size)
    picture[:, ::side][:, 1080:] *= 0.12
    found = find_keyboards(picture)
    assert len(found) == 1
    assert named_right(found[0], plane)


@pytest.mark.parametrize("cover", ["sleeve", "shirt"])
def test_a_hidden_end_does_not_move_the_octave(cover):
    size = (1280, 720)
    plane = made_up.camera(size)
    picture = grey(plane, size)
    # From the low end to A1, where a keyboard could begin.
    checks = np.indices((720, 188)).sum(axis=0) // 9 % 2
    picture[:, :188] = 0.3 if cover == "sleeve" else 0.3 + 0.4 * checks
    found = find_keyboards(picture)
    assert len(found) > 1 or named_right(found[0], plane)


def test_a_cut_end_is_not_taken_for_a_mirror():
    size = (1280, 720)
    plane = made_up.camera(size, span=(-0.56, 0.56))
    found = find_keyboards(grey(plane, size))
    assert len(found) == 1
    assert not found[0].mirrored
    assert named_right(found[0], plane)


@pytest.mark.parametrize("end", ["low", "high"])
def test_a_part_up_to_an_end_is_known_by_the_black_key_that_is_missing_there(end):
    # A0 has none at its left and C8 none at its right, though nothing beyond them is seen.
    size = (1280, 720)
    whole = made_up.camera(size)
    picture = grey(whole, size)
    first, last = np.sort(whole.to_pixels(key_centres()[[0, -1], :2])[:, 0])
    width = (last - first) / 51
    left = round(first - 0.35 * width) if end == "low" else round(first + 21 * width)
    part = picture[:, left : left + round(31 * width)]
    found = find_keyboards(part)
    assert len(found) == 1
    pixels = whole.to_pixels(key_centres()[:, :2]) - [left, 0]
    seen = (pixels[:, 0] > 0) & (pixels[:, 0] < part.shape[1])
    off = found[0].plane.to_world(pixels) - key_centres()[:, :2]
    assert np.linalg.norm(off[seen], axis=1).max() < 0.006


@pytest.mark.parametrize("light", [0.15, 0.35])
def test_dark_pictures(light):
    size = (1280, 720)
    plane = made_up.camera(size)
    found = find_keyboards(grey(plane, size) * np.float32(light))
    assert len(found) == 1
    assert named_right(found[0], plane)


def test_turned_by_any_angle():
    size = (1280, 1280)
    plane = made_up.camera(size, turned=37)
    found = find_keyboards(grey(plane, size))
    assert len(found) == 1
    assert named_right(found[0], plane)


def test_what_is_known_decides():
    size = (1280, 720)
    plane = made_up.camera(size, span=(-0.3, 0.3))
    picture = grey(plane, size)
    likeliest = find_keyboards(picture)[0]
    other = find_keyboards(picture, octave=likeliest.lowest_c + 1)
    assert [each.lowest_c for each in other] == [likeliest.lowest_c + 1]
    middle = [[640, 330]]
    up = other[0].plane.to_world(middle) - likeliest.plane.to_world(middle)
    assert up[0, 1] == pytest.approx(7 * 0.0235, abs=0.002)
    assert all(each.mirrored for each in find_keyboards(picture, mirrored=True))
    assert find_keyboards(picture, octave=8) == []


def _bricks():
    rows, columns = np.mgrid[:180, :320]
    shifted = columns + 30 * (rows // 30 % 2)
    return np.where((rows % 30 < 4) | (shifted % 60 < 4), 0.8, 0.35)


def _zebra():
    rows, columns = np.mgrid[:180, :320]
    return (np.sin((columns + 12 * np.sin(rows / 40)) / 5 + rows / 60) > 0).astype(float)


NO_KEYBOARD = {
    "black": np.zeros((180, 320)),
    "noise": np.random.default_rng(0).random((180, 320)),
    "stripes": np.tile(np.arange(320) // 12 % 2, (180, 1)),
    "zebra": _zebra(),
    "bricks": _bricks(),
    "grey": np.full((180, 320), 0.5),
    "ramp": np.linspace(0, 1, 320)[None].repeat(180, axis=0),
    "one pixel": np.ones((1, 1)),
    "one row": np.random.default_rng(0).random((1, 320)),
    "tiny": np.random.default_rng(0).random((9, 16)),
}


@pytest.mark.parametrize("name", NO_KEYBOARD)
def test_finds_none_where_there_is_none(name):
    assert find_keyboards(NO_KEYBOARD[name].astype(np.float32)) == []
