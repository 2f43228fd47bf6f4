from __future__ import annotations

import json
import os
import socket
import threading
import time
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import pytest

import made_up_video as made_up
from pianomime import cli, local_server
from pianomime.video.film.film import Film
from pianomime.video.keyboard.pick_page import PickPage
from pianomime.video.keyboard.points import SUGGESTED, place_of, read_points

SIZE = (320, 180)


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    path = tmp_path_factory.mktemp("video") / "short.mp4"
    score = made_up.song(1.5)
    plane = made_up.camera(SIZE)
    made_up.write(path, plane, SIZE, score, made_up.plan_of(score), made_up.times(0.5, 20))
    return path


def seen(video):
    """The video, and a picture of it: it takes seconds to look for a clear one."""
    film = Film(video)
    return film, film.sample(1)[0]


@pytest.fixture
def out(tmp_path):
    return tmp_path / "points.json"


@pytest.fixture
def page(video, out, monkeypatch):
    monkeypatch.setattr(local_server, "_PATIENCE", 0.5)
    with PickPage(*seen(video), out) as page:
        yield page


def good_points():
    plane = made_up.camera(SIZE)
    points = {name: plane.to_pixels(place_of(name)).tolist() for name in SUGGESTED}
    return json.dumps({"points": points}).encode()


class Talk:
    """Requests to a page, byte by byte."""

    def __init__(self, page):
        self.address = urlsplit(page.url)
        self.place = (self.address.hostname, self.address.port)
        self.host = self.address.netloc

    def request(self, method="POST", name="points", body=b"", path=None, **headers):
        """The bytes of a request: by default one that the page itself might send."""
        path = self.address.path + name if path is None else path
        given = {
            "Host": self.host,
            "Origin": f"http://{self.host}",
            "Content-Type": "application/json",
            "Content-Length": len(body),
            "Connection": "close",
        } | {key.replace("_", "-"): value for key, value in headers.items()}
        lines = [f"{method} {path} HTTP/1.1"]
        lines += [f"{key}: {value}" for key, value in given.items() if value is not None]
        return "\r\n".join([*lines, "", ""]).encode() + body

    def send(self, *parts, pause=0.0):
        """Status of the answer and its text; (0, "") if the connection is closed without one."""
        with socket.create_connection(self.place, timeout=30) as line:
            answer = b""
            try:
                for part in parts:
                    line.sendall(part)
                    time.sleep(pause)
                while more := line.recv(65536):
                    answer += more
            except (ConnectionResetError, BrokenPipeError):
                pass
        head, _, text = answer.partition(b"\r\n\r\n")
        return (int(head.split()[1]) if head else 0), text.decode(errors="replace")


def test_points_are_clicked_and_saved(page, out):
    talk = Talk(page)
    html = urllib.request.urlopen(page.url).read().decode()
    assert "A0 front left" in html
    assert f'data-width="{SIZE[0]}"' in html
    assert urllib.request.urlopen(page.url + "frame.png").read().startswith(b"\x89PNG")
    assert b"onclick" in urllib.request.urlopen(page.url + "pick_page.js").read()
    code, why = talk.send(talk.request(body=b'{"points": {"A0 front left": [1, 2]}}'))
    assert code == 400
    assert "4 points" in why
    assert not out.exists()
    code, answer = talk.send(talk.request(body=good_points()))
    assert code == 200
    assert answer.startswith("Saved")
    assert page.wait() == read_points(out).describe()


def test_only_what_is_checked_is_saved(page, out):
    talk = Talk(page)
    content = {**json.loads(good_points()), "more": "of something else"}
    assert talk.send(talk.request(body=json.dumps(content).encode()))[0] == 400
    assert not out.exists()


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": None},
        {"Origin": "http://127.0.0.1:1"},
        {"Origin": "http://localhost"},
        {"Host": "evil.example"},
        {"Host": None},
        {"Host": "127.0.0.1"},
    ],
)
def test_pages_of_other_sites_are_refused(page, out, headers):
    talk = Talk(page)
    code, _ = talk.send(talk.request(body=good_points(), **headers))
    assert code in (400, 403)
    assert not out.exists()


def test_a_foreign_name_for_this_machine_is_refused(page, out):
    """DNS rebinding: to the browser all comes from one site, host and origin agree."""
    talk = Talk(page)
    name = f"evil.example:{talk.address.port}"
    foreign = {"Host": name, "Origin": f"http://{name}"}
    assert talk.send(talk.request("GET", "", **foreign))[0] == 403
    assert talk.send(talk.request("GET", "frame.png", **foreign))[0] == 403
    assert talk.send(talk.request(body=good_points(), **foreign))[0] == 403
    assert not out.exists()


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_browsers_leave_out_the_usual_port(video, out, monkeypatch, name):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    # As if it were 80, which not everybody may use.
    monkeypatch.setattr(local_server, "_USUAL_PORT", port)
    with PickPage(*seen(video), out, port) as page:
        talk = Talk(page)
        headers = {"Host": name, "Origin": f"http://{name}"}
        assert talk.send(talk.request(body=good_points(), **headers))[0] == 200
        headers["Origin"] = "http://evil.example"
        assert talk.send(talk.request(body=good_points(), **headers))[0] == 403


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/points",
        "/frame.png",
        "//points",
        "/wrong-secret/points",
        "/../points",
        "/%2e%2e/points",
        "http://127.0.0.1/points",
        "*",
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_without_the_secret_nothing_is_told_or_written(page, out, path, method):
    talk = Talk(page)
    code, text = talk.send(talk.request(method, path=path, body=good_points()))
    assert code in (400, 403)
    assert talk.address.path.strip("/") not in text
    assert not out.exists()


def test_paths_lead_to_no_files(page, out):
    talk = Talk(page)
    for name in ("../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "pick_page.py", "frameXpng"):
        assert talk.send(talk.request("GET", name))[0] == 404
    assert talk.send(talk.request("PUT", body=good_points()))[0] == 405
    assert talk.send(talk.request("GET"))[0] == 405
    assert talk.send(talk.request(body=good_points(), Content_Type="text/plain"))[0] == 415
    assert not out.exists()


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"nonsense",
        b"\xff\xfe",
        b"null",
        b'{"points": ' + b"[" * 40_000 + b"]" * 40_000 + b"}",
        b'{"points": {"A0 front left": [1' + b"0" * 4000 + b", 2]}}",
        b'{"points": {"../../x": [1, 2], "a": [1, 2], "b": [1, 3], "c": [3, 2]}}',
        good_points().replace(b"[", b"[1, ", 1),
    ],
)
def test_what_is_no_points_is_refused_in_one_line(page, out, body, capfd):
    talk = Talk(page)
    code, why = talk.send(talk.request(body=body))
    assert code == 400
    assert "\n" not in why.strip()
    assert not out.exists()
    assert capfd.readouterr() == ("", "")


def test_odd_requests_leave_no_trace(page, out, capfd):
    talk = Talk(page)
    whole = talk.request(body=good_points())
    odd = [
        b"\r\n\r\n",
        b"\x00\x01\x02\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",  # a browser that tries https
        os.urandom(2000) + b"\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /\xff\xfe HTTP/1.1\r\nHost: \xff\r\n\r\n",
        b"GET " + b"/" * 50_000 + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 20_000 + b"\r\n",
        talk.request(body=good_points(), Content_Length="-5"),
        talk.request(body=good_points(), Content_Length="1, 2"),
        talk.request(body=good_points(), Content_Length="abc"),
        talk.request(body=b"zz\r\n", Content_Length=None, Transfer_Encoding="chunked"),
        talk.request(body=b" " * 200_000),
        talk.request(Content_Length=10**12),
        whole[:-10],
    ]
    for request in odd:
        talk.send(request)
        assert not out.exists()
    for end in range(0, len(whole) - 1, 97):
        with socket.create_connection(talk.place) as line:
            line.sendall(whole[:end])
    assert talk.send(whole)[0] == 200
    assert capfd.readouterr() == ("", "")


def test_a_slow_client_holds_up_nobody_and_is_sent_away(page, out):
    talk = Talk(page)
    whole = talk.request(body=good_points())
    with (
        socket.create_connection(talk.place, timeout=60) as silent,
        socket.create_connection(talk.place, timeout=60) as slow_headers,
        socket.create_connection(talk.place, timeout=60) as slow_body,
        socket.create_connection(talk.place, timeout=60) as deaf,
    ):
        slow_headers.sendall(whole[:20])
        slow_body.sendall(whole[:-10])
        for _ in range(50):
            deaf.sendall(talk.request("GET", "frame.png", Connection="keep-alive"))
        assert talk.send(talk.request("GET", ""))[0] == 200
        for line in (silent, slow_headers, slow_body):
            assert line.recv(1000) == b""
    assert not out.exists()


def test_two_clients_at_once(page, out):
    talk = Talk(page)
    answers = []
    clients = [
        threading.Thread(target=lambda: answers.append(talk.send(talk.request(body=good_points()))))
        for _ in range(2)
    ]
    for client in clients:
        client.start()
    for client in clients:
        client.join()
    assert [code for code, _ in answers] == [200, 200]
    assert page.wait() == read_points(out).describe()


def test_points_that_cannot_be_written_can_be_sent_again(video, tmp_path):
    out = tmp_path / "gone" / "points.json"
    with PickPage(*seen(video), out) as page:
        talk = Talk(page)
        code, why = talk.send(talk.request(body=good_points()))
        assert code == 500
        assert "cannot be saved" in why
        out.parent.mkdir()
        assert talk.send(talk.request(body=good_points()))[0] == 200
        assert page.wait()


def test_no_other_machine_is_served(page):
    assert urlsplit(page.url).hostname == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", urlsplit(page.url).port), timeout=5)


def test_every_page_has_its_own_secret(video, out):
    with PickPage(*seen(video), out) as one, PickPage(*seen(video), out) as other:
        assert urlsplit(one.url).path != urlsplit(other.url).path
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(other.url.replace(other.url[-10:], one.url[-10:]))


@pytest.mark.parametrize("wrong", ["port", "port in use", "video", "nothing"])
def test_what_is_wrong_is_said_and_nothing_written(video, tmp_path, monkeypatch, capsys, wrong):
    before = video.read_bytes()
    out = tmp_path / "out" / "points.json"
    given = ["pick", str(video), "--no-browser", "-o", str(out)]
    with socket.create_server(("127.0.0.1", 0)) as taken:
        if wrong == "port":
            given += ["--port", "99999"]
        elif wrong == "port in use":
            given += ["--port", str(taken.getsockname()[1])]
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
