from __future__ import annotations

import json
import socket
import threading
import urllib.error
import urllib.request

import pytest

import made_up_video as made_up
from pianomime import cli
from pianomime.video.film.film import Film
from pianomime.video.keyboard import pick_page
from pianomime.video.keyboard.pick_page import PickPage
from pianomime.video.keyboard.points import SUGGESTED, place_of, read_points

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
        saved = []
        waiting = threading.Thread(target=lambda: saved.append(page.wait()))
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
        told_why = refused.value.read().decode()
        assert "4 points" in told_why
        assert told_why.startswith(f"{out}:")
        assert not out.exists()
        assert b"Saved" in post({"points": points}).read()
        waiting.join(10)
    assert saved == [read_points(out).describe()]


def test_a_browser_that_says_nothing_does_not_hold_up_the_others(video, tmp_path, monkeypatch):
    monkeypatch.setattr(pick_page, "_TIMEOUT", 0.2)
    with PickPage(Film(video), tmp_path / "points.json") as page:
        place = ("127.0.0.1", int(page.url.rsplit(":", 1)[1].strip("/")))
        with socket.create_connection(place):
            answer_two = [page._server.handle_request] * 2
            serve = threading.Thread(target=lambda: [answer() for answer in answer_two])
            serve.start()
            assert b"keyboard" in urllib.request.urlopen(page.url, timeout=60).read()
        serve.join()


@pytest.mark.parametrize("wrong", ["port", "video", "nothing"])
def test_what_is_wrong_is_said_and_nothing_written(video, tmp_path, monkeypatch, capsys, wrong):
    before = video.read_bytes()
    out = tmp_path / "out" / "points.json"
    given = ["pick", str(video), "--no-browser", "-o", str(out)]
    if wrong == "port":
        given += ["--port", "99999"]
    elif wrong == "video":
        given[-1] = str(video)
    else:
        monkeypatch.setattr(Film, "sample", lambda *_: [])
    with pytest.raises(SystemExit) as stopped:
        cli.main(given)
    assert stopped.value.code == 2
    assert "\n" not in capsys.readouterr().err.strip()
    assert video.read_bytes() == before
    assert not out.parent.exists()
