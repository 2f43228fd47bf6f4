from __future__ import annotations

import json
import threading
import urllib.error
import urllib.request

import made_up_video as made_up
import pytest

from pianomime.video.film import Film
from pianomime.video.pick_page import PickPage
from pianomime.video.points import SUGGESTED, place_of, read_points

SIZE = (320, 180)


@pytest.fixture
def video(tmp_path):
    path = tmp_path / "short.mp4"
    score = made_up.song(1.5)
    plane = made_up.camera(SIZE)
    made_up.write(path, plane, SIZE, score, made_up.plan_of(score), made_up.times(0.5, 20))
    return path


def test_points_are_clicked_and_saved(video, tmp_path):
    out = tmp_path / "points.json"
    plane = made_up.camera(SIZE)
    points = {name: plane.to_pixels(place_of(name)).tolist() for name in SUGGESTED}
    with PickPage(Film(video), out) as page:
        told = []
        waiting = threading.Thread(target=lambda: told.append(page.wait()))
        waiting.start()
        html = urllib.request.urlopen(page.url).read().decode()
        assert "A0 front left" in html
        assert f"width = {SIZE[0]}" in html
        picture = urllib.request.urlopen(page.url + "frame.png").read()
        assert picture.startswith(b"\x89PNG")

        def post(content):
            return urllib.request.urlopen(page.url + "points", json.dumps(content).encode())

        with pytest.raises(urllib.error.HTTPError) as refused:
            post({"points": {"A0 front left": [1, 2]}})
        assert "4 points" in refused.value.read().decode()
        assert not out.exists()
        assert b"Saved" in post({"points": points}).read()
        waiting.join(10)
    assert told == [read_points(out).describe()]
