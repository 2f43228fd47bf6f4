from __future__ import annotations

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.plan import LEFT, RIGHT
from pianomime.video.hands.sightings import Sighting
from pianomime.video.hands.tracks import follow
from pianomime.video.keyboard.track import KeyboardTrack
from pianomime.video.remarks import poorly_seen

SIZE = (1280, 720)


@pytest.fixture(scope="module")
def truth():
    """(T, 2, 6, 2) two hands that move smoothly."""
    time = np.arange(200)[:, None, None, None] / 20
    plan = made_up.plan_of(made_up.song())
    pose = plan.fingertips[30, :, :, :2]
    sway = np.stack((0.02 * np.sin(time[..., 0]), 0.12 * np.sin(0.7 * time[..., 0])), axis=-1)
    return pose + sway


def still():
    return KeyboardTrack.still(made_up.camera())


def seen(truth, plane=None):
    plane = plane or made_up.camera()
    places = plane.to_pixels(truth) / SIZE
    return [[Sighting(left, 0.05), Sighting(right, 0.95)] for left, right in places]


def test_clean_sightings_come_back(truth):
    tracks = follow(seen(truth), SIZE, still())
    assert tracks.found.all()
    assert not tracks.mended.any()
    assert (tracks.ghosts, tracks.swaps) == (0, 0)
    np.testing.assert_allclose(tracks.points, truth, atol=2e-4)


def test_wrong_labels_and_order_are_put_right(truth):
    sightings = seen(truth)
    for frame in (20, 21, 22, 90, 150):
        left, right = sightings[frame]
        sightings[frame] = [Sighting(right.points, 0.2), Sighting(left.points, 0.8)]
    tracks = follow(sightings, SIZE, still())
    assert tracks.swaps == 5
    np.testing.assert_allclose(tracks.points, truth, atol=2e-4)


def test_labels_in_a_mirror(truth):
    plane = made_up.camera(mirrored=True)
    sightings = [
        [Sighting(hand.points, 1 - hand.right) for hand in frame] for frame in seen(truth, plane)
    ]
    tracks = follow(sightings, SIZE, KeyboardTrack.still(plane))
    assert tracks.swaps == 0
    np.testing.assert_allclose(tracks.points, truth, atol=2e-4)


def test_gaps_are_filled_between(truth):
    sightings = seen(truth)
    for frame in range(60, 66):
        sightings[frame] = sightings[frame][1:]
    tracks = follow(sightings, SIZE, still())
    assert np.flatnonzero(~tracks.found[:, LEFT]).tolist() == list(range(60, 66))
    assert tracks.found[:, RIGHT].all()
    np.testing.assert_allclose(tracks.points, truth, atol=0.003)


def test_a_hand_that_is_lost_for_long_is_reported(truth):
    sightings = seen(truth)
    for frame in range(100, 140):
        sightings[frame] = sightings[frame][:1]
    tracks = follow(sightings, SIZE, still())
    missing = np.zeros(len(tracks), bool)
    assert poorly_seen(tracks, missing) == [(5.0, 7.0, RIGHT)]
    missing[90:120] = True
    assert poorly_seen(tracks, missing) == [(6.0, 7.0, RIGHT)]


def test_ghosts_are_left_out(truth):
    sightings = seen(truth)
    for frame in (50, 51):  # the right hand twice, and the left one not at all
        sightings[frame] = [sightings[frame][1], Sighting(sightings[frame][1].points + 0.002, 0.6)]
    tracks = follow(sightings, SIZE, still())
    assert tracks.ghosts == 2
    np.testing.assert_allclose(tracks.points, truth, atol=0.003)


def test_single_wild_points_are_mended_and_quick_moves_kept(truth):
    wild = truth.copy()
    wild[80, LEFT, 3] += [0.0, 0.08]
    wild[120:, RIGHT] += [0.0, 0.10]  # a leap, not a mistake
    tracks = follow(seen(wild), SIZE, still())
    assert np.argwhere(tracks.mended).tolist() == [[80, LEFT, 3]]
    np.testing.assert_allclose(tracks.points[75:85, LEFT], truth[75:85, LEFT], atol=0.003)
    np.testing.assert_allclose(tracks.points[125:], wild[125:], atol=1e-3)


def test_smoothing_has_no_lag(truth):
    noisy = truth + np.random.default_rng(0).normal(0, 0.002, truth.shape)
    tracks = follow(seen(noisy), SIZE, still())

    def off(late):
        return np.abs(tracks.points[10:-10] - truth[10 + late : len(truth) - 10 + late]).mean()

    assert off(0) < np.abs(noisy - truth).mean() * 0.85
    assert off(0) < min(off(-1), off(1))


def test_no_hands_and_one_hand(truth):
    nothing = follow([[] for _ in range(30)], SIZE, still())
    assert not nothing.found.any()
    assert np.isfinite(nothing.points).all()
    one = follow([frame[:1] for frame in seen(truth)], SIZE, still())
    assert one.found.all(axis=0).tolist() == [True, False]
    assert (one.points[:, RIGHT, :, 1] > one.points[:, LEFT, :, 1].mean()).any()
    assert one.seen_points().shape[1] == 1


def test_a_hand_that_flashes_up_is_a_ghost(truth):
    sightings = seen(truth)
    for frame in range(len(sightings)):
        if frame not in (20, 150):
            sightings[frame] = sightings[frame][1:]
    tracks = follow(sightings, SIZE, still())
    assert tracks.seen.tolist() == [False, True]
    assert tracks.ghosts == 2
    assert not tracks.found[:, LEFT].any()
    assert np.ptp(tracks.points[:, LEFT], axis=0).max() == 0
