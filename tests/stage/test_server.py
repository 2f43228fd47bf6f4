"""The server of the stage: what it gives, to whom, and what it refuses."""

from __future__ import annotations

import http.client
import json
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import numpy as np
import pytest

from pianomime import Performance, Score, load_player, songs
from pianomime.keyboard import LEAD_IN_SECONDS
from pianomime.music.excerpt import excerpt
from pianomime.stage.jobs import Job
from pianomime.stage.library import Library
from pianomime.stage.server import LARGEST_SONG, Stage

SECONDS = 2.0


class Client:
    """A page of the stage."""

    def __init__(self, stage: Stage, page: str = "one") -> None:
        address = urlsplit(stage.url)
        self.host, self.secret, self.page = address.netloc, address.path, page

    def open(
        self, method: str, path: str, body: bytes = b"", **headers: str
    ) -> http.client.HTTPResponse:
        connection = http.client.HTTPConnection(self.host, timeout=60)
        own = {"Origin": f"http://{self.host}", "X-Page": self.page}
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, self.secret + path, body or None, {**own, **given})
        return connection.getresponse()

    def json(self, method: str, path: str, body: Any = None, **headers: str) -> Any:
        content = body if isinstance(body, bytes) else json.dumps(body).encode() if body else b""
        answer = self.open(method, path, content, **headers)
        text = answer.read()
        assert answer.status == 200, text
        return json.loads(text)

    def refused(self, method: str, path: str, body: bytes = b"", **headers: str) -> tuple[int, str]:
        answer = self.open(method, path, body, **headers)
        assert answer.status >= 400
        return answer.status, answer.read().decode().strip()

    def play(self, title: str = "beethoven-ode-to-joy", **more: Any) -> str:
        (song,) = [song for song in self.json("GET", "library")["songs"] if song["title"] == title]
        asked = {"song": song["id"], "player": "zero-shot", "effort": 0, "seconds": SECONDS}
        return str(self.json("POST", "jobs", {**asked, **more})["id"])


def blocks(replay: bytes) -> list[tuple[str, bytes]]:
    found = []
    while replay:
        length = struct.unpack("<I", replay[4:8])[0]
        found.append((replay[:4].decode(), replay[8 : 8 + length]))
        replay = replay[8 + length :]
    return found


def last(found: list[tuple[str, bytes]], tag: str) -> Any:
    return json.loads([content for name, content in found if name == tag][-1])


def long_job(client: Client, stage: Stage) -> tuple[http.client.HTTPResponse, Job]:
    """A job that would take minutes, and its replay, which is being read."""
    number = client.play(effort=3, seconds=None)
    replay = client.open("GET", f"jobs/{number}/replay")
    assert replay.read(4) == b"HEAD"
    job = stage.jobs.get(number)
    assert job is not None
    return replay, job


def wait_for(what: Callable[[], bool]) -> None:
    for _ in range(600):
        if what():
            return
        time.sleep(0.05)
    pytest.fail("it does not come")


def test_a_song_is_played_as_play_would_and_kept(stage: Stage, tmp_path: Path) -> None:
    client = Client(stage)
    job = client.play()
    first = client.open("GET", f"jobs/{job}/replay")
    second = client.open("GET", f"jobs/{job}/replay")
    sound = client.open("GET", f"jobs/{job}/sound").read()
    found = blocks(first.read())
    assert blocks(second.read()) == found
    tags = [tag for tag, _ in found]
    assert tags[:2] == ["HEAD", "SCEN"]
    assert tags[-1] == "DONE"
    # What comes while it is played is not all at once.
    assert tags.count("MOVE") > 2

    score = Score.from_midi(songs.path("beethoven-ode-to-joy"))
    wanted = load_player("zero-shot", effort=0).play(excerpt(score, 0.0, SECONDS, LEAD_IN_SECONDS))
    kept = Performance.load(tmp_path / "out" / "beethoven-ode-to-joy" / "performance.npz")
    for name in ("ctrl", "qpos", "event_key", "event_on", "event_off", "event_speed"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(wanted, name), err_msg=name)
    heard = last(found, "HEAR")
    np.testing.assert_allclose(heard["on"], wanted.event_on, atol=1e-4)
    assert {*heard["verdict"]} <= {"right", "wrong"}
    poses = sum(struct.unpack("<II", content[:8])[1] for tag, content in found if tag == "MOVE")
    assert poses == 1 + 5 * len(wanted)

    # The sound that came while it was played is as long as the music.
    assert len(sound) * 8 / 320_000 == pytest.approx(wanted.song_seconds, abs=0.2)
    finished = client.open("GET", f"jobs/{job}/sound").read()
    part = client.open("GET", f"jobs/{job}/sound", Range="bytes=100-199")
    assert part.status == 206
    assert part.read() == finished[100:200]
    assert client.open("GET", f"jobs/{job}/files/performance.mid").read().startswith(b"MThd")
    (listed,) = client.json("GET", "library")["performances"]
    assert listed["title"] == "beethoven-ode-to-joy"
    shown = client.json("POST", "jobs", {"performance": listed["id"]})["id"]
    again = blocks(client.open("GET", f"jobs/{shown}/replay").read())
    assert last(again, "HEAR") == heard


@pytest.mark.parametrize(
    ("method", "path", "headers"),
    [
        ("GET", "library", {"Origin": "http://elsewhere"}),
        ("POST", "jobs", {"Origin": "http://elsewhere"}),
        ("GET", "library", {"Host": "elsewhere:80"}),
    ],
)
def test_strangers_get_nothing(
    stage: Stage, method: str, path: str, headers: dict[str, str]
) -> None:
    assert Client(stage).refused(method, path, b"{}" * (method == "POST"), **headers)[0] == 403


def test_without_the_secret_there_is_nothing(stage: Stage) -> None:
    client = Client(stage)
    client.secret = "/guessed/"
    for method, path in (("GET", "library"), ("GET", ""), ("POST", "songs"), ("POST", "jobs")):
        assert client.refused(method, path)[0] == 403


@pytest.mark.parametrize(
    ("content", "status", "reason"),
    [
        (b"", 400, "empty"),
        (b"MThd but not really", 400, "evil"),
        (b"<html>no music</html>", 400, "evil"),
    ],
)
def test_what_is_no_song_is_refused_in_one_line(
    stage: Stage, tmp_path: Path, content: bytes, status: int, reason: str
) -> None:
    name = quote("../../evil<img src=x>.mid")
    told = Client(stage).refused("POST", "songs", content, X_File_Name=name)
    assert told[0] == status
    assert reason in told[1]
    assert "\n" not in told[1]
    # Where it lay meanwhile is nobody's business, and nothing of it is left.
    assert str(tmp_path) not in told[1]
    assert not list(tmp_path.rglob("*evil*"))


def test_a_large_file_is_refused_before_it_is_sent(stage: Stage) -> None:
    client = Client(stage)
    connection = http.client.HTTPConnection(client.host, timeout=60)
    connection.putrequest("POST", f"{client.secret}songs")
    connection.putheader("Origin", f"http://{client.host}")
    connection.putheader("Content-Length", str(LARGEST_SONG + 1))
    connection.endheaders()
    answer = connection.getresponse()
    assert (answer.status, b"larger than 4 MB" in answer.read()) == (413, True)


def test_a_song_that_is_dropped_is_kept_under_a_name_of_ours(stage: Stage, tmp_path: Path) -> None:
    client = Client(stage)
    content = songs.path("petzold-minuet-g").read_bytes()
    name = quote("../../my <b>song</b>.mid")
    song = client.json("POST", "songs", content, X_File_Name=name)
    again = client.json("POST", "songs", content, X_File_Name=name)
    assert song == again
    (kept,) = (tmp_path / "out" / "songs").iterdir()
    assert kept.read_bytes() == content
    other = client.json(
        "POST", "songs", songs.path("satie-gymnopedie-1").read_bytes(), X_File_Name=name
    )
    assert other["id"] != song["id"]
    assert kept.read_bytes() == content


@pytest.mark.parametrize(
    "asked",
    [
        b"no json",
        b"[]",
        b'{"song": "s0"}',
        b'{"song": "../../etc/passwd", "player": "zero-shot"}',
        b'{"performance": "p0"}',
    ],
)
def test_what_cannot_be_played_is_refused(stage: Stage, asked: bytes) -> None:
    assert Client(stage).refused("POST", "jobs", asked)[0] == 400


@pytest.mark.parametrize("more", [{"player": "nobody"}, {"effort": 9}, {"world": "flat"}])
def test_settings_that_are_not_there_are_refused(stage: Stage, more: dict[str, Any]) -> None:
    client = Client(stage)
    song = client.json("GET", "library")["songs"][0]["id"]
    asked = {"song": song, "player": "zero-shot", **more}
    assert client.refused("POST", "jobs", json.dumps(asked).encode())[0] == 400


def test_files_are_those_of_the_report_alone(stage: Stage) -> None:
    client = Client(stage)
    job = client.play(seconds=0.5)
    client.open("GET", f"jobs/{job}/replay").read()
    for name in ("report.json", "..", "../live.replay", "%2e%2e%2flive.replay", "nothing"):
        assert client.refused("GET", f"jobs/{job}/files/{name}")[0] == 404
    assert client.refused("GET", "jobs/none/replay")[0] == 404


def test_a_page_has_one_job_and_another_page_its_own(stage: Stage) -> None:
    client, other = Client(stage), Client(stage, "two")
    first = client.play(effort=3, seconds=None)
    apart = other.open("GET", f"jobs/{other.play(seconds=1.0)}/replay")
    replay = client.open("GET", f"jobs/{first}/replay")
    second = client.play(seconds=1.0)
    assert "Stopped" in last(blocks(replay.read()), "FAIL")["message"]
    for answer in (client.open("GET", f"jobs/{second}/replay"), apart):
        assert blocks(answer.read())[-1][0] == "DONE"


def test_what_is_stopped_ends_its_process_and_leaves_nothing(stage: Stage, tmp_path: Path) -> None:
    client = Client(stage)
    _, job = long_job(client, stage)
    pid = job.pid
    assert client.open("DELETE", f"jobs/{job.number}").status == 200
    wait_for(lambda: not _alive(pid))
    assert [path.name for path in (tmp_path / "out").iterdir() if path.name != "songs"] == []


def test_a_page_that_is_closed_stops_its_job(stage: Stage) -> None:
    client = Client(stage)
    replay, job = long_job(client, stage)
    replay.close()
    wait_for(lambda: job.done)
    assert not _alive(job.pid)


def test_a_page_that_is_closed_stops_a_job_that_says_nothing(
    stage: Stage,
) -> None:
    client = Client(stage)
    replay, job = long_job(client, stage)
    # What is not written cannot fail to be sent.
    os.kill(job.pid, signal.SIGSTOP)
    try:
        time.sleep(0.2)
        replay.close()
        wait_for(lambda: job._readers == 0)
    finally:
        os.kill(job.pid, signal.SIGCONT)
    wait_for(lambda: job.done)


def test_a_process_that_is_killed_is_told(stage: Stage) -> None:
    client = Client(stage)
    replay, job = long_job(client, stage)
    os.kill(job.pid, 9)
    rest = replay.read()
    assert rest[-200:].count(b"FAIL") == 1
    assert b"process died" in rest[-200:]
    # The next one plays.
    assert blocks(client.open("GET", f"jobs/{client.play()}/replay").read())[-1][0] == "DONE"


def test_the_sound_that_is_asked_for_at_the_end_is_the_whole_one(stage: Stage) -> None:
    """Law: also in the moment in which the replay says that it is done."""
    client = Client(stage)
    job = client.play()
    client.open("GET", f"jobs/{job}/replay").read()
    whole = client.open("GET", f"jobs/{job}/sound?whole")
    assert whole.headers["Content-Length"] is not None
    assert whole.read() == client.open("GET", f"jobs/{job}/sound").read()
    assert client.open("GET", f"jobs/{job}/wanted").status == 200


@pytest.mark.parametrize(
    ("asked", "status", "span"),
    [
        ("bytes=0-9", 206, (0, 10)),
        ("bytes=-10", 206, (-10, None)),
        ("bytes=5-", 206, (5, None)),
        ("bytes=5-2", 200, (0, None)),
        ("bytes=-0", 200, (0, None)),
        ("bytes=\xb2-\xb2", 200, (0, None)),
        ("bytes=99999999-", 200, (0, None)),
        ("lines=1-2", 200, (0, None)),
        ("bytes=-99999999", 200, (0, None)),
        ("bytes=" + "9" * 5000 + "-", 200, (0, None)),
    ],
)
def test_parts_of_a_file(
    stage: Stage, tmp_path: Path, asked: str, status: int, span: tuple[int, int | None]
) -> None:
    content = bytes(range(256)) * 4
    report = tmp_path / "report"
    report.mkdir()
    (report / "performance.mp3").write_bytes(content)
    client = Client(stage)
    number = client.play()
    client.open("GET", f"jobs/{number}/replay").read()
    job = stage.jobs.get(number)
    assert job is not None
    wait_for(lambda: job.done)
    job.report = report
    answer = client.open("GET", f"jobs/{number}/sound", Range=asked)
    assert (answer.status, answer.read()) == (status, content[slice(*span)])


def test_the_page_of_a_long_report_reads_its_parts_from_a_sandbox(stage: Stage) -> None:
    client = Client(stage)
    job = client.play()
    client.open("GET", f"jobs/{job}/replay").read()
    page = client.open("GET", f"jobs/{job}/files/report.html")
    policy = page.headers["Content-Security-Policy"]
    page.read()
    assert "sandbox allow-scripts allow-downloads" in policy
    assert "allow-same-origin" not in policy
    part = client.open("GET", f"jobs/{job}/files/performance.mp3", Origin="null")
    assert part.status == 200
    assert part.headers["Access-Control-Allow-Origin"] == "null"
    # Sound is asked for without an origin.
    assert part.headers["Cross-Origin-Resource-Policy"] == "cross-origin"
    assert client.open("GET", "library").headers["Cross-Origin-Resource-Policy"] == "same-origin"
    for path in ("library", f"jobs/{job}/replay"):
        assert client.refused("GET", path, Origin="null")[0] == 403
    assert client.refused("POST", "jobs", b"{}", Origin="null")[0] == 403


def test_two_songs_of_one_title_are_kept_apart(stage: Stage, tmp_path: Path) -> None:
    """Also where they come to their ends together, as two that are compared."""
    clients = [Client(stage, "one"), Client(stage, "two")]
    jobs = [client.play(seconds=1.0) for client in clients]
    replays = [
        client.open("GET", f"jobs/{job}/replay") for client, job in zip(clients, jobs, strict=True)
    ]
    for replay in replays:
        assert blocks(replay.read())[-1][0] == "DONE"
    kept = sorted(path.name for path in (tmp_path / "out").glob("beethoven*"))
    assert kept == ["beethoven-ode-to-joy", "beethoven-ode-to-joy-2"]


def test_no_command_line_has_the_secret(
    stage: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    left = tmp_path / "out" / ".pianomime-open-of-one-that-was-killed.html"
    left.touch()
    with Stage(tmp_path / "out", []) as other:
        other.open_browser()
        (address,) = opened
        assert other.url not in address
        door = Path(address.removeprefix("file://"))
        assert other.url in door.read_text(encoding="utf-8")
        assert door.stat().st_mode & 0o077 == 0
        assert not left.exists()
    assert not door.exists()


def test_songs_beside_performances_are_listed(tmp_path: Path) -> None:
    folder = tmp_path / "given"
    player = load_player("zero-shot", effort=0)
    score = excerpt(Score.from_midi(songs.path("beethoven-ode-to-joy")), seconds=1.0)
    (folder / "played").mkdir(parents=True)
    player.play(score).save(folder / "played" / "performance.npz")
    score.to_midi(folder / "played" / "performance.mid")
    score.to_midi(folder / "mine.mid")
    listed = Library(tmp_path / "out", [folder]).listed()
    assert len(listed["performances"]) == 1
    assert len(listed["songs"]) == len(songs.names()) + 1


def test_two_songs_of_one_name_are_both_kept(tmp_path: Path) -> None:
    library = Library(tmp_path / "out", [])
    contents = []
    for number in range(6):
        Score([40 + number], [0.0], [0.5], [64]).to_midi(tmp_path / "song.mid")
        contents.append((tmp_path / "song.mid").read_bytes())
    with ThreadPoolExecutor(6) as pool:
        kept = list(pool.map(lambda content: library.upload("song.mid", content), contents))
    for content, song in zip(contents, kept, strict=True):
        path = library.path(song["id"])
        assert path is not None
        assert path.read_bytes() == content


def test_what_a_full_disk_cannot_hold_is_left_out_whole(tmp_path: Path) -> None:
    """Half of a block would be read as a damaged one."""
    path = tmp_path / "live.replay"
    # A limit on the size of files does to them what a full disk does: of a part some is written.
    program = f"""
import resource
from pianomime.stage.playing import WholeParts
resource.setrlimit(resource.RLIMIT_FSIZE, (10, 10))
with WholeParts({os.fspath(path)!r}, "wb") as file:
    file.write(b"123456")
    try:
        file.write(b"abcdefgh")
    except OSError:
        file.write(b"789")
"""
    subprocess.run([sys.executable, "-c", program], check=True)
    assert path.read_bytes() == b"123456789"


def test_a_stage_that_is_closed_meanwhile_closes(tmp_path: Path, stage: Stage) -> None:
    with Stage(tmp_path / "other", []) as closing:
        client = Client(closing)
        _, job = long_job(client, closing)
    assert not _alive(job.pid)


def _alive(pid: int) -> bool:
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except FileNotFoundError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"
