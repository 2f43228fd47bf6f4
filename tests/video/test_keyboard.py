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
    # Where the ends are seen there is no doubt; in the middle each octave is possible.
    whole = view not in ("middle", "lower half", "upright")
    assert (len(found) == 1) == whole or view == "upright"
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


def test_finds_none_where_there_is_none():
    draw = np.random.default_rng(0)
    stripes = np.tile((np.arange(640) // 12 % 2).astype(np.float32), (360, 1))
    for picture in (
        np.zeros((360, 640), np.float32),
        draw.random((360, 640)).astype(np.float32),
        stripes,
        np.linspace(0, 1, 640, dtype=np.float32)[None].repeat(360, axis=0),
    ):
        assert find_keyboards(picture) == []
