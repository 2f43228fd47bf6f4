"""The page of a report in a real browser: what it shows is what the performance holds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import made_up
from browser import Browsers, browsers
from pianomime import load_player
from pianomime.players.performance import Performance
from pianomime.progress import no_progress
from pianomime.replay import PageMissing, page_script
from pianomime.report import write_report
from pianomime.world.model import world_model

HOSTILE = "</script><img src=x onerror=\"document.title='hacked'\">"
REPLAY = "document.querySelector('pianomime-replay')"


@pytest.fixture(scope="module")
def performance() -> Performance:
    score = made_up.score(notes=24, seconds=8.0, title=HOSTILE)
    return load_player("zero-shot", effort=0).play(score)


@pytest.fixture(scope="module")
def report(performance: Performance, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of the page of a report."""
    try:
        page_script()
    except PageMissing as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("report")
    write_report(performance, folder, False, no_progress, pytest.fail)
    return (folder / "report.html").as_uri()


@pytest.fixture(scope="module")
def started() -> Iterator[Browsers]:
    with browsers() as given:
        yield given


@pytest.fixture(scope="module")
def chromium(started: Browsers) -> Iterator[Any]:
    with started.chromium() as launched:
        yield launched


@pytest.fixture
def page(chromium: Any, report: str) -> Iterator[Any]:
    """The open page; nothing may go wrong in it."""
    opened = chromium.new_page(viewport={"width": 960, "height": 900})
    wrong: list[str] = []
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
    # The sound that the page makes for itself, for tests to listen to.
    opened.add_init_script(
        "window.sounds = []; const Native = Audio;"
        "window.Audio = function (...given) {"
        "  const made = new Native(...given); window.sounds.push(made); return made; };"
    )
    opened.goto(report)
    opened.evaluate(f"{REPLAY}.ready")
    yield opened
    assert not wrong
    assert not opened.title().startswith("hacked")
    opened.close()


def test_bodies_are_where_mujoco_has_them(page: Any, performance: Performance) -> None:
    model = world_model(performance.world)
    data = mujoco.MjData(model)
    names = [model.body(body).name for body in range(1, model.nbody)]
    for frame in np.linspace(0, len(performance) - 1, 10).astype(int).tolist():
        data.qpos[:] = performance.qpos[frame]
        mujoco.mj_kinematics(model, data)
        shown = page.evaluate(
            f"([names, time]) => names.map((name) => {REPLAY}.bodyPose(name, time).pos)",
            [names, (frame + 1) / 20],
        )
        np.testing.assert_allclose(shown, data.xpos[1:], atol=5e-4)


def test_sound_and_hands_are_in_step_after_a_seek(page: Any, performance: Performance) -> None:
    for seconds in (1.5, 0.5):
        apart = page.evaluate(
            f"""async (seconds) => {{
              const replay = {REPLAY};
              const [sound] = window.sounds;
              replay.currentTime = seconds;
              replay.play();
              // What is shown is shown picture by picture, and may take long where pictures do.
              const apart = [];
              let before = replay.currentTime;
              while (apart.length < 5) {{
                await new Promise((done) => requestAnimationFrame(done));
                if (replay.currentTime !== before && !sound.paused) {{
                  apart.push(Math.abs(replay.currentTime - sound.currentTime));
                }}
                before = replay.currentTime;
              }}
              replay.pause();
              return apart;
            }}""",
            seconds,
        )
        assert np.median(apart) < 0.04
    assert page.evaluate(f"{REPLAY}.duration") == pytest.approx(performance.song_seconds, abs=0.1)


def test_titles_are_text(page: Any) -> None:
    assert page.locator("h1").text_content() == HOSTILE
    assert page.locator("img[src=x]").count() == 0


def test_the_keyboard_alone_plays_and_seeks(page: Any) -> None:
    page.locator("pianomime-replay").focus()
    page.keyboard.press("Space")
    page.wait_for_function(f"{REPLAY}.currentTime > 0.2")
    page.keyboard.press("Space")
    stopped = page.evaluate(f"{REPLAY}.currentTime")
    page.wait_for_timeout(200)
    assert page.evaluate(f"{REPLAY}.currentTime") == stopped
    page.keyboard.press(".")
    assert page.evaluate(f"{REPLAY}.currentTime") == pytest.approx(stopped + 1 / 60, abs=0.02)


def test_a_key_that_is_pointed_at_tells_why_its_note_was_missed(page: Any) -> None:
    page.locator("pianomime-replay").focus()
    page.keyboard.press("3")  # from above
    in_roll, in_picture = page.locator(".roll .tip.seen"), page.locator(".view .tip.seen")
    told = ""
    while "missed: " not in told:
        page.keyboard.press("x")
        told = in_roll.text_content()
    page.wait_for_timeout(1500)  # The camera is there.
    box = page.locator(".view canvas").bounding_box()
    across = box["y"] + 0.36 * box["height"]
    steps = np.arange(0.03, 0.97, 0.005) * box["width"] + box["x"]

    def seen() -> str | None:
        page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
        return in_picture.text_content() if in_picture.count() else None

    def find(x: float) -> bool:
        page.mouse.move(x, across)
        return seen() == told

    place = next(x for x in steps if find(x))
    # A click does not seek or turn the picture, and a drag hides what is told.
    page.mouse.click(place, across)
    assert seen() == told
    page.mouse.down()
    page.mouse.move(place + 20, across)
    assert seen() is None
    page.mouse.up()


def test_the_roll_has_fingers_where_there_is_room(page: Any) -> None:
    page.evaluate(
        """() => {
          window.written = [];
          const { fillText } = CanvasRenderingContext2D.prototype;
          CanvasRenderingContext2D.prototype.fillText = function (text, ...place) {
            if (/^[1-5]$/.test(text)) window.written.push([text, this.fillStyle]);
            fillText.call(this, text, ...place);
          };
        }"""
    )

    def written(height: str) -> list[list[str]]:
        page.evaluate("() => { window.written = []; }")
        page.locator(".roll").evaluate("(roll, height) => { roll.style.height = height; }", height)
        page.wait_for_timeout(300)
        numbers: list[list[str]] = page.evaluate("window.written")
        return numbers

    assert not written("6rem")
    assert len({number for number, _ in written("40rem")}) > 2
    page.get_by_label("Finger numbers").click()
    assert not written("38rem")


def test_a_long_report_opened_from_a_disk_says_what_to_do(
    chromium: Any, performance: Performance, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pianomime.report.page.MOST_EMBEDDED", 0)
    write_report(performance, tmp_path, False, no_progress, pytest.fail)
    page = chromium.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    page.get_by_role("alert").filter(has_text="python -m http.server").wait_for()
    page.close()


def test_without_webgl_the_picture_is_shown_and_a_line_says_why(
    started: Browsers, report: str
) -> None:
    with started.chromium("--disable-3d-apis") as chromium:
        page = chromium.new_page()
        page.goto(report)
        page.locator("pianomime-replay .fallback img").wait_for(state="visible")
        assert page.get_by_text("WebGL").is_visible()
        assert page.get_by_label("Play").first.is_visible()
