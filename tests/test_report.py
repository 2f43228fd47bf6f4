from __future__ import annotations

import base64
import errno
import gzip
import io
import json
import os
import re
import tracemalloc
from collections.abc import Iterable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import made_up
from pianomime import Performance
from pianomime.errors import InputError
from pianomime.evaluation.measures import BODY, FRAMES, MORE_MUSIC, MUSIC
from pianomime.evaluation.summary import summarize
from pianomime.files import staged
from pianomime.music import Score
from pianomime.music.sound import Sound
from pianomime.players.motion import motion
from pianomime.replay import PageMissing, Poses
from pianomime.replay.replay import replay_blocks
from pianomime.report import DARK, FILES, LIGHT, Theme, draw, write_report
from pianomime.report.mp3 import Mp3, write_mp3
from pianomime.world.render import RenderUnavailable

PROTOCOL = (
    "song", "player", "effort", "song_seconds", "frames", "protocol", "touch", "world",
    "music", "body", "precision", "recall", "f1", "onset_f1", "plan_seconds", "simulate_seconds",
    "realtime_factor",
)  # fmt: skip


@pytest.fixture(autouse=True)
def script(monkeypatch: pytest.MonkeyPatch) -> None:
    """A script of the page, which may not be built here."""
    monkeypatch.setattr("pianomime.report.write.page_script", lambda: "made_up_script()")


def quiet(*_: object) -> None:
    pass


def test_numbers_hold_what_was_agreed() -> None:
    score = made_up.score()
    performance = made_up.performance(score)
    row = summarize(performance)
    # It would be that of the score: nobody played it.
    pedalled = summarize(replace(performance, works_pedal=True))
    assert set(pedalled) == {*row, "pedal_f1"}
    assert set(row) == {*PROTOCOL, "notes", "dropped_notes", "blow_ups", "remarks"}
    assert row["frames"] == len(score.roll())
    assert row["dropped_notes"] == 1
    assert row["blow_ups"] == 1
    assert row["effort"] == 2
    assert row["realtime_factor"] == pytest.approx(row["song_seconds"] / 0.75, abs=1e-3)


class Page(HTMLParser):
    """Collects the addresses that a page refers to."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag != "link":
            self.sources += [
                value or "" for name, value in attrs if name in ("src", "srcset", "href")
            ]


def test_a_report_is_complete_and_its_page_needs_nothing_else(tmp_path: Path) -> None:
    performance = made_up.performance(made_up.score(title="<b>Bach & Söhne</b>"))
    row = write_report(performance, tmp_path, False, lambda *_: None, pytest.fail)

    assert {file.name for file in tmp_path.iterdir()} == set(FILES) - {
        "performance.mp4",
        "performance.mp3",
        "performance.replay.gz",
        "score.mp3",
    }
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8")) == row
    np.testing.assert_array_equal(
        Performance.load(tmp_path / "performance.npz").pressed, performance.pressed
    )
    played = Score.from_midi(tmp_path / "performance.mid").roll()
    np.testing.assert_array_equal(played, performance.pressed[: len(played)])
    assert not performance.pressed[len(played) :].any()

    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "&lt;b&gt;Bach &amp; Söhne" in html
    assert "effort 2" in html
    assert row["protocol"] in html
    # What an ear would judge leads.
    ear = f"{row['music']['note_f1_50']:.3f}"
    assert html.index(ear) < html.index("frame F1")
    for measure in (*MUSIC, *MORE_MUSIC, *FRAMES, *BODY):
        assert f"<tr><td>{measure.label}</td><td>{measure.show(row)}</td></tr>" in html
    sources = Page(html).sources
    assert len(sources) == 4
    assert all(source.startswith("data:") for source in sources)
    ((kind, embedded),) = re.findall(
        r'<script type="(application/octet-stream)" id="replay-data">([^<]*)<', html
    )
    poses = Poses(performance)
    blocks = replay_blocks(
        performance, summarize(performance, poses.of(motion(performance))), poses
    )
    assert kind == "application/octet-stream"
    assert gzip.decompress(base64.b64decode(embedded)) == b"".join(blocks)
    assert html.count("made_up_script") == 1


def test_a_script_cannot_end_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "pianomime.report.write.page_script", lambda: "text = '</script><b id=\"out\">'"
    )
    write_report(made_up.performance(made_up.score(notes=3)), tmp_path, False, quiet, pytest.fail)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "text = '<\\/script><b id=" in html


def test_without_the_script_one_line_says_so_and_the_rest_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> str:
        raise PageMissing("no hands in the page")

    monkeypatch.setattr("pianomime.report.write.page_script", missing)
    notes: list[str] = []
    write_report(made_up.performance(made_up.score(notes=3)), tmp_path, False, quiet, notes.append)
    assert notes == ["no hands in the page"]
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script" not in html
    assert len(Page(html).sources) == 4


def test_large_files_stand_beside_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pianomime.report.page.MOST_EMBEDDED", 0)
    write_report(
        made_up.performance(made_up.score(notes=3)), tmp_path, False, lambda *_: None, pytest.fail
    )
    sources = Page((tmp_path / "report.html").read_text(encoding="utf-8")).sources
    assert sources == [
        "performance.replay.gz", "piano_roll_dark.png", "piano_roll.png", "performance.mp3",
        "score.mp3",
    ]  # fmt: skip
    assert {file.name for file in tmp_path.iterdir()} == set(FILES) - {"performance.mp4"}
    for name in ("performance.mp3", "score.mp3"):
        with av.open(str(tmp_path / name)) as file:
            assert sum(frame.samples for frame in file.decode(audio=0)) > 44100


@pytest.fixture
def cheap_sound(monkeypatch: pytest.MonkeyPatch) -> None:
    """No synthesizer and no encoder, and sound in blocks of two seconds."""

    def synthesizer(score: Score, sample_rate: int) -> np.ndarray:
        return np.ones((round(score.pedal[-1, 1] * sample_rate), 2), np.int16)

    def encoder(path: Path, blocks: Iterable[np.ndarray], sample_rate: int) -> None:
        path.write_bytes(bytes(sum(len(block) for block in blocks) // 3))

    monkeypatch.setattr("pianomime.music.sound.BLOCK_SECONDS", 2)
    monkeypatch.setattr("pianomime.report.write.BLOCK_SECONDS", 2)
    monkeypatch.setattr("pianomime.music.sound._synthesized", synthesizer)
    monkeypatch.setattr("pianomime.report.write.write_mp3", encoder)


@pytest.mark.usefixtures("cheap_sound")
def test_the_parts_of_a_report_say_how_far_they_are(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []

    def progress(phase: str, done: int, total: int, remark: str = "") -> None:
        told.append((phase, done, total))

    performance = made_up.performance(made_up.score(notes=20, seconds=5.0))
    write_report(performance, tmp_path, False, progress, pytest.fail)
    assert list(dict.fromkeys(phase for phase, _, _ in told)) == [
        "saving", "pictures", "sound", "page",
    ]  # fmt: skip
    for part in ("sound", "pictures"):
        steps = [done for phase, done, _ in told if phase == part]
        (total,) = {total for phase, _, total in told if phase == part}
        assert steps == sorted(steps)
        # Sounds are made aside, while pictures are.
        assert steps[0] == 0 or part == "sound"
        assert steps[-1] == total
    # Each block of both sounds is made twice and encoded once, which takes as long as three times.
    blocks = sum(Sound(score).block_count for score in (performance.played(), performance.score))
    assert told[-2] == ("sound", 5 * blocks, 5 * blocks)


@pytest.mark.usefixtures("cheap_sound")
def test_a_minute_more_of_music_takes_little_memory_to_report_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def picture(performance: Performance, path: Path, theme: Theme) -> None:
        path.touch()  # of bounded size, see `test_an_hour_is_drawn_too`

    monkeypatch.setattr("pianomime.report.write.draw", picture)
    monkeypatch.setattr("pianomime.report.page.MOST_EMBEDDED", 0)
    peaks = []
    for minutes in (1, 3):
        performance = made_up.performance(made_up.score(notes=50, seconds=60.0 * minutes))
        tracemalloc.start()
        write_report(performance, tmp_path, False, lambda *_: None, pytest.fail)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # A minute of sound as numbers would take 23 MB.
    assert (peaks[1] - peaks[0]) / 2 < 3e6


def test_silence_can_be_reported(tmp_path: Path) -> None:
    performance = made_up.performance(made_up.score(notes=3), mistakes=1.1, planned=False)
    write_report(performance, tmp_path, False, lambda *_: None, pytest.fail)
    assert (tmp_path / "report.html").exists()


def test_without_opengl_one_line_says_so_and_the_rest_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(*_: object, **__: object) -> None:
        raise RenderUnavailable("no film: install OpenGL")

    monkeypatch.setattr("pianomime.report.write.write_video", nothing)
    notes: list[str] = []
    write_report(
        made_up.performance(made_up.score(notes=3)), tmp_path, True, lambda *_: None, notes.append
    )
    assert notes == ["no film: install OpenGL"]
    assert (tmp_path / "report.html").exists()
    assert not (tmp_path / "performance.mp4").exists()


def test_the_film_lights_what_sounds_and_tells_phantoms_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    score = Score(
        np.array([40, 44]), np.array([0.0, 1.0]), np.array([0.5, 2.0]), np.array([64, 64])
    )
    # One is played late, one beside its key, for less than a frame of the player's.
    performance = replace(
        made_up.performance(score),
        event_key=np.array([40, 45]),
        event_on=np.array([0.06, 1.01]),
        event_off=np.array([0.5, 1.04]),
        event_speed=np.array([0.3, 0.3]),
    )
    films: list[tuple[np.ndarray, np.ndarray]] = []

    def film(path: Path, qpos: np.ndarray, sounding: np.ndarray, *_: object, **more: Any) -> None:
        colours = [more["colours"](frame) for frame in range(len(sounding))]
        films.append((sounding, np.array(colours)))

    monkeypatch.setattr("pianomime.report.write.write_video", film)
    write_report(performance, tmp_path, True, lambda *_: None, pytest.fail)
    ((sounding, colours),) = films
    lit = np.argwhere(sounding).tolist()
    assert lit == [[picture, 40] for picture in range(3, 30)] + [[60, 45], [61, 45], [62, 45]]
    red = (colours[..., :3] == np.float32(to_rgb(LIGHT.wrong))).all(axis=-1)
    assert np.argwhere(red).tolist() == [[60, 45], [61, 45], [62, 45]]


@pytest.mark.parametrize("seconds", [1.0, 60.0])
def test_pictures_show_every_kind_of_note(tmp_path: Path, seconds: float) -> None:
    performance = made_up.performance(made_up.score(notes=100, seconds=seconds), mistakes=0.2)
    draw(performance, tmp_path / "roll.png", DARK)
    pixels = (imread(tmp_path / "roll.png")[..., :3] * 255).round().astype(int)
    colours = {f"#{colour:06x}" for colour in np.unique(pixels @ [65536, 256, 1])}
    assert {*DARK.hands[:2], DARK.wrong, *DARK.wanted[:2], DARK.paper} <= colours


def test_an_hour_is_drawn_too(tmp_path: Path) -> None:
    score = made_up.score(notes=50, seconds=3600.0)
    draw(made_up.performance(score), tmp_path / "roll.png")
    assert imread(tmp_path / "roll.png").shape[0] < 12_000


def test_mp3_has_the_length_of_the_sound(tmp_path: Path) -> None:
    seconds = 2.0
    sound = np.sin(np.arange(int(44100 * seconds))[:, None] * 0.06 * np.ones(2)).astype(np.float32)
    blocks = (sound[first : first + 30_000] for first in range(0, len(sound), 30_000))
    write_mp3(tmp_path / "sound.mp3", blocks, 44100)
    with av.open(str(tmp_path / "sound.mp3")) as file:
        decoded = sum(frame.samples for frame in file.decode(audio=0))
    assert decoded / 44100 == pytest.approx(seconds, abs=0.1)


def test_mp3_that_is_heard_while_it_comes_is_in_time() -> None:
    class Wire(io.BytesIO):
        def seekable(self) -> bool:
            return False

    rate, wire, sizes = 48_000, Wire(), []
    sound = np.zeros((4 * rate, 2), np.float32)
    clicks = np.array([1, 2, 3]) * rate
    for click in clicks:
        sound[click : click + 200] = 0.9 * np.sin(np.arange(200) * 0.5)[:, None]
    with Mp3(wire, rate) as file:
        for second in range(4):
            file.add(sound[second * rate :][:rate])
            sizes.append(len(wire.getvalue()))
    # What was encoded is there at once.
    assert np.diff(sizes).min() > 0.9 * 320_000 / 8
    with av.open(io.BytesIO(wire.getvalue())) as opened:
        level = np.abs(np.hstack([part.to_ndarray() for part in opened.decode(audio=0)])[0])
    for click in clicks:
        apart = np.argmax(level[click - 4800 : click + 4800] > 0.2) - 4800
        assert abs(apart) / rate < 0.003


def test_staged_files_appear_together(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    with staged(out, ["a", "b"]) as folder:
        (folder / "a").write_text("new")
        assert not out.exists()
    assert {file.name for file in out.iterdir()} == {"a"}
    assert os.listdir(tmp_path) == ["deep"]


def test_staging_replaces_what_is_ours_and_nothing_else(tmp_path: Path) -> None:
    for name in ("a", "b", "theirs"):
        (tmp_path / name).write_text("old")
    with staged(tmp_path, ["a", "b"]) as folder:
        (folder / "a").write_text("new")
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {
        "a": "new",
        "theirs": "old",
    }


def test_a_new_folder_has_the_permissions_of_any_other(tmp_path: Path) -> None:
    with staged(tmp_path / "out", []):
        pass
    (tmp_path / "other").mkdir()
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_the_folder_of_another_run_is_left_alone(tmp_path: Path) -> None:
    other = tmp_path / f".pianomime-{os.getpid()}"
    other.mkdir()
    (other / "a").write_text("theirs")
    with staged(tmp_path / "out", ["a"]) as folder:
        (folder / "a").write_text("ours")
    assert (other / "a").read_text() == "theirs"
    assert (tmp_path / "out" / "a").read_text() == "ours"


def test_a_folder_that_cannot_be_written_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path / "temporary"))

    for module, function in (("pathlib.Path", "mkdir"), ("os", "replace")):
        out.mkdir(exist_ok=True)
        with monkeypatch.context() as patch:
            patch.setattr(f"{module}.{function}", refuse)
            with (
                pytest.raises(InputError, match=rf"^{out}: cannot be written: Permission denied$"),
                staged(out, []) as folder,
            ):
                (folder / "a").write_text("new")
        assert list(out.iterdir()) == []


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_stopped_staging_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    out = tmp_path / "deep" / "out"

    def write() -> None:
        with staged(out, ["a"]) as folder:
            (folder / "a").write_text("half")
            raise error

    with pytest.raises(error):
        write()
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_no_place_for_a_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="is a file"), staged(out, []):
            pytest.fail("should not get here")


def test_a_film_is_made_where_there_is_opengl(tmp_path: Path) -> None:
    performance = made_up.performance(made_up.score(notes=2, seconds=0.6))
    notes: list[str] = []
    write_report(performance, tmp_path, True, lambda *_: None, notes.append)
    if notes:
        pytest.skip(notes[0])
    with av.open(str(tmp_path / "performance.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == 3 * len(performance)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert sum(source.startswith("data:video/mp4") for source in Page(html).sources) == 1
