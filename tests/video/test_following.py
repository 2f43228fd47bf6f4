"""Keyboards of cameras that move: found again in every frame, or said not to be seen."""

from __future__ import annotations

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.progress import no_progress
from pianomime.video.advice import RETARGET
from pianomime.video.film.background import median_of, sampled
from pianomime.video.film.film import Film
from pianomime.video.keyboard import views
from pianomime.video.keyboard.following import Stretch, follow_keyboard, stands_still
from pianomime.video.keyboard.registration import Pyramid, Template
from pianomime.video.keyboard.views import find_views
from pianomime.video.remarks import on_stretches
from pianomime.world.parameters import key_centres

SIZE = (640, 360)
PLANE = made_up.camera(SIZE, turned=1.0)
KEYS = key_centres()[:, :2]
MOST = 10_000


def film_of(path, moved, seconds=4.0, plane=PLANE):
    score = made_up.song(seconds)
    plan = made_up.plan_of(score)
    made_up.write(path, plane, SIZE, score, plan, made_up.times(seconds, 20), False, moved)
    return Film(path)


def error(track, moved, frames):
    """[m] Greatest error of a key in a frame."""
    worst = 0.0
    for frame in frames:
        pixels = made_up.after(PLANE, moved(frame / 20)).to_pixels(KEYS)
        inside = ((pixels > 0) & (pixels < SIZE)).all(axis=1)
        off = track.at(frame).to_world(pixels[inside]) - KEYS[inside]
        worst = max(worst, float(np.linalg.norm(off, axis=1).max()))
    return worst


def swaying(at):
    return made_up.turn(2 * np.sin(2 * at), 15 * np.sin(3 * at), SIZE)


@pytest.mark.parametrize("gain", [1.0, 0.5])
def test_a_moved_picture_is_registered_to_a_fraction_of_a_pixel(gain):
    moved = made_up.turn(1.5, 4.0, SIZE)
    hands = made_up.plan_of(made_up.song()).fingertips[30, :, :, :2]
    before = made_up.picture(PLANE, SIZE)
    after = made_up.picture(made_up.after(PLANE, moved), SIZE, hands=hands)
    template = Template(Pyramid(before), PLANE)
    found = template.find(Pyramid((after * gain).astype(np.uint8)), np.eye(3))
    pixels = PLANE.to_pixels(KEYS)
    known = pixels @ moved[:2, :2].T + moved[:2, 2]
    lifted = np.column_stack((pixels, np.ones(len(pixels)))) @ found.matrix.T
    assert np.abs(lifted[:, :2] / lifted[:, 2:] - known).max() < 0.4
    assert found.likeness > 0.7


def test_another_picture_is_not_like_it():
    template = Template(Pyramid(made_up.picture(PLANE, SIZE)), PLANE)
    noise = np.random.default_rng(0).integers(0, 255, (*SIZE[::-1], 3), np.uint8)
    for other in (noise, np.full_like(noise, 200)):
        found = template.find(Pyramid(other), np.eye(3))
        assert found is None or found.likeness < 0.5


def test_a_camera_that_stands_still_is_told_from_one_that_moves(tmp_path):
    for name, moved, still in (("still", lambda _: np.eye(3), True), ("moving", swaying, False)):
        film = film_of(tmp_path / f"{name}.mp4", moved, 2.0)
        pictures = sampled(film)
        assert stands_still(pictures, median_of(pictures), PLANE) == still


def test_a_hand_held_camera_is_followed(tmp_path):
    film = film_of(tmp_path / "film.mp4", swaying)
    (view,) = find_views(film, MOST, None, None, no_progress)
    assert not view.track.missing(80).any()
    assert error(view.track, swaying, range(80)) < 0.004


def test_titles_are_left_out_and_what_was_seen_before_is_known_again(tmp_path):
    def moved(at):
        return None if 1.0 <= at < 2.0 else swaying(min(at, 1.0))

    stretches, frames = follow_keyboard(film_of(tmp_path / "film.mp4", moved), MOST, no_progress)
    assert frames == 80
    (stretch,) = stretches
    assert stretch.frames.tolist() == [*range(20), *range(40, 80)]


def test_after_a_cut_the_part_that_is_seen_is_named_like_the_whole(tmp_path):
    def moved(at):
        return np.eye(3) if at < 2.0 else np.array([[1.5, 0, -300], [0, 1.5, -80], [0, 0, 1]])

    film = film_of(tmp_path / "film.mp4", moved)
    (view,) = find_views(film, MOST, None, None, no_progress)
    assert error(view.track, moved, range(80)) < 0.006


WHOLE = made_up.picture(PLANE, SIZE)
PART = made_up.picture(made_up.camera(SIZE, span=(-0.25, 0.2)), SIZE)
"""A part of the keyboard on which no end is seen."""


@pytest.fixture
def shown(tmp_path, monkeypatch):
    """The views of a film that shows pictures, each for a number of frames."""
    film = film_of(tmp_path / "film.mp4", lambda _: None, 0.2)

    def shown(*pictures):
        stretches, first = [], 0
        for picture, count in pictures:
            where = np.broadcast_to(np.eye(3), (count, 3, 3))
            stretches.append(Stretch(np.arange(first, first + count), where, picture, ()))
            first += count
        monkeypatch.setattr(views, "follow_keyboard", lambda *_: (stretches, first))
        return find_views(film, MOST, None, None, no_progress)

    return shown


def test_stretches_that_are_guessed_or_contradict_the_others_are_told(shown):
    (view,) = shown((WHOLE, 60), (PART, 40), (WHOLE[:, ::-1], 50))
    assert "followed through 3 stretches" in view.description
    assert view.frame == 0
    part, mirrored = on_stretches(view, RETARGET)
    assert part.text.startswith("from 3.0 s on the camera shows a part of the keyboard whose")
    assert mirrored.text == "from 5.0 s on the keyboard is mirrored unlike elsewhere"
    assert (part.weight, mirrored.weight) == ("check", "check")
    assert (part.action, mirrored.action) == (RETARGET.stretch, RETARGET.stretch)


def test_a_part_with_something_beside_it_is_named_like_the_whole(shown):
    """What lies on some keys in both tells which they are."""
    lamp = (27, 29, 31, 32)
    whole = made_up.picture(PLANE, SIZE, lamp)
    part = made_up.picture(made_up.camera(SIZE, span=(-0.35, 0.1)), SIZE, lamp)
    (view,) = shown((whole, 60), (part, 40))
    assert view.guessed == ()
    seen = made_up.camera(SIZE, span=(-0.35, 0.1)).to_pixels(KEYS[20:40])
    off = view.track.at(80).to_world(seen) - KEYS[20:40]
    assert np.abs(off).max() < 0.004


def test_a_brief_stretch_does_not_name_a_long_one(shown):
    """Hands may hide as much of it in all its pictures."""
    many = shown((WHOLE, 30), (PART, 100))
    assert len(many) > 1
    assert many[0].frame == 30
    (one,) = shown((WHOLE, 60), (PART, 100))
    assert one.frame == 0


@pytest.mark.parametrize("moved", [lambda _: np.eye(3), swaying], ids=["still", "moving"])
def test_what_cannot_be_is_refused_before_a_film_is_followed(tmp_path, monkeypatch, moved):
    def follow(*_):
        pytest.fail("followed the keyboard")

    monkeypatch.setattr(views, "follow_keyboard", follow)
    monkeypatch.setattr(views, "_TRIED", 1)  # it takes seconds each
    film = film_of(tmp_path / "film.mp4", moved, 1.5)
    assert find_views(film, MOST, 9, None, no_progress) == []


def test_without_a_keyboard_there_is_none(tmp_path):
    film = film_of(tmp_path / "film.mp4", lambda _: None, 2.0)
    assert find_views(film, MOST, None, None, no_progress) == []
