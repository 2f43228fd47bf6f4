"""The page of the stage in a real browser: what is dropped is played."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from browser import Browsers, browsers
from pianomime import Score, songs
from pianomime.music.excerpt import excerpt
from pianomime.replay import PageMissing, page_script
from pianomime.stage.server import LARGEST_SONG, Stage

FIRST = "document.querySelector('pianomime-replay')"
SECOND = "document.querySelectorAll('pianomime-replay')[1]"
HOSTILE = "<img src=x onerror=document.title='hacked'>.mid"


@pytest.fixture(scope="module")
def started() -> Iterator[Browsers]:
    try:
        page_script("stage.js")
    except PageMissing as error:
        pytest.skip(str(error))
    with browsers() as given:
        yield given


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    with Stage(tmp_path / "out", []) as opened:
        yield opened


@pytest.fixture
def chromium(started: Browsers) -> Iterator[Any]:
    with started.chromium() as launched:
        yield launched


@pytest.fixture(scope="module")
def song(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A MIDI file of three seconds."""
    path = tmp_path_factory.mktemp("song") / "song.mid"
    excerpt(Score.from_midi(songs.path("beethoven-ode-to-joy")), seconds=3.0).to_midi(path)
    return path.read_bytes()


def open_page(chromium: Any, stage: Stage, **options: str) -> Any:
    page = chromium.new_page(viewport={"width": 1000, "height": 800}, **options)
    page.wrong = []
    page.on("pageerror", lambda error: page.wrong.append(str(error)))
    page.on("console", lambda said: page.wrong.append(said.text) if said.type == "error" else None)
    page.goto(stage.url)
    page.wait_for_selector("nav li")
    return page


def drop(page: Any, name: str, content: bytes) -> None:
    drop_all(page, {name: content})


def drop_all(page: Any, files: dict[str, bytes]) -> None:
    page.evaluate(
        """(files) => {
          const data = new DataTransfer();
          for (const [name, bytes] of files) {
            data.items.add(new File([new Uint8Array(bytes)], name));
          }
          const more = { dataTransfer: data, bubbles: true, cancelable: true };
          document.body.dispatchEvent(new DragEvent("drop", more));
        }""",
        [[name, list(content)] for name, content in files.items()],
    )


def drop_from_disk(page: Any, *paths: Path) -> None:
    """As a file manager does it."""
    chrome = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        chrome.send("Input.dispatchDragEvent", {"type": kind, "x": 400, "y": 400, "data": data})


def wait(page: Any, what: str) -> None:
    """Until something is true; the page's content policy forbids Playwright's own way."""
    end = time.monotonic() + 90
    while not page.evaluate(what):
        assert time.monotonic() < end, f"{what} does not come"
        page.wait_for_timeout(100)


def test_what_is_dropped_is_played_while_it_is_made(
    chromium: Any, stage: Stage, song: bytes
) -> None:
    page = open_page(chromium, stage)
    drop(page, HOSTILE, song)
    wait(page, f"{FIRST}.currentTime > 0.1")
    wait(page, f"{FIRST}.state === 'done'")
    heard = page.evaluate(f"{FIRST}.metrics.length")
    assert heard > 5
    page.get_by_role("link", name="MIDI").wait_for()
    # Its name is text, and it is in the library.
    assert "hacked" not in page.title()
    assert page.locator("img[src=x]").count() == 0
    wait(page, "document.querySelectorAll('nav ul')[1].children.length === 1")
    with page.expect_download() as download:
        page.get_by_role("link", name="MIDI").click()
    assert Path(download.value.path()).read_bytes().startswith(b"MThd")
    assert not page.wrong


def test_two_are_compared_on_one_clock(chromium: Any, stage: Stage, song: bytes) -> None:
    page = open_page(chromium, stage, reduced_motion="reduce")
    drop(page, "one.mid", song)
    wait(page, f"{FIRST}.state === 'done'")
    page.get_by_role("button", name="Compare").click()
    page.get_by_label("World").select_option("solid")
    page.get_by_role("button", name="Try again").click()
    wait(page, f"{SECOND}.state === 'done'")
    # Nothing moves by itself where that is not wanted.
    assert page.evaluate(f"[{FIRST}.playing, {FIRST}.currentTime]") == [False, 0]
    page.evaluate(f"{FIRST}.currentTime = 1.25")
    assert page.evaluate(f"{SECOND}.currentTime") == 1.25
    rows, cells = (
        f"document.querySelectorAll('.show > table {tag}').length" for tag in ("tr", "td")
    )
    wait(page, f"{rows} > 0 && {cells} === 2 * {rows}")
    # What is compared next begins with nothing.
    page.get_by_role("button", name="Compare").click()
    page.get_by_role("button", name="Compare").click()
    wait(page, f"{SECOND}.state === 'empty'")
    assert page.evaluate(f"[{SECOND}.duration, {SECOND}.metrics, {SECOND}.head]") == [0, None, None]
    assert page.locator(".seat:nth-child(3) .downloads").is_hidden()
    assert page.evaluate(f"{FIRST}.state") == "done"
    assert not page.wrong


def test_bad_files_are_one_line_on_the_page(chromium: Any, stage: Stage, song: bytes) -> None:
    page = open_page(chromium, stage)
    message = page.locator(".stage > .message:visible")
    for name, content, told in (
        ("no.mid", b"not music at all", "no.mid"),
        ("empty.mid", b"", "empty"),
        ("large.mid", bytes(LARGEST_SONG + 1), "larger than 4 MB"),
        ("silent.mid", song[:14] + b"MTrk\x00\x00\x00\x04\x00\xff\x2f\x00", "silent"),
    ):
        drop(page, name, content)
        message.filter(has_text=told).wait_for()
        assert message.count() == 1
    # The next good one is played.
    drop(page, "good.mid", song)
    wait(page, f"{FIRST}.state === 'done'")
    # A request that is refused is told in the console by the browser itself.
    assert all("status of 400" in wrong for wrong in page.wrong)


def test_a_message_stays_until_it_is_dismissed(chromium: Any, stage: Stage, song: bytes) -> None:
    page = open_page(chromium, stage)
    drop(page, "good.mid", song)
    drop(page, "no.mid", b"not music at all")
    message = page.locator(".stage > .message:visible").filter(has_text="no.mid")
    message.wait_for()
    # The library is read again when the song is done.
    wait(page, "document.querySelectorAll('nav ul')[1].children.length === 1")
    assert message.is_visible()
    message.get_by_role("button", name="Dismiss").click()
    assert message.count() == 0


def test_all_that_is_dropped_is_taken_or_told(
    chromium: Any, stage: Stage, song: bytes, tmp_path: Path
) -> None:
    page = open_page(chromium, stage)
    songs = page.locator("nav ul").nth(0).locator("li")
    before = songs.count()
    drop_all(page, {"one.mid": song, "no.mid": b"no", "two.mid": song})
    message = page.locator(".stage > .message:visible")
    message.filter(has_text="Taken: one, two. one is played.").filter(has_text="no.mid").wait_for()
    wait(page, f"{FIRST}.head?.title === 'one'")
    assert songs.count() == before + 2
    folder = tmp_path / "album"
    folder.mkdir()
    drop_from_disk(page, folder)
    message.filter(has_text="album is a folder").wait_for()
    assert page.get_by_text("The stage does not answer").is_hidden()


def test_playing_begins_long_before_it_is_all_made(chromium: Any, stage: Stage) -> None:
    page = open_page(chromium, stage)
    page.get_by_label("Length").select_option("1")
    page.get_by_role("button", name="bach-prelude-c").click()
    wait(page, f"{FIRST}.currentTime > 0.6")
    assert page.evaluate(f"{FIRST}.state") == "growing"
    assert page.evaluate(f"{FIRST}.available") < 0.5 * page.evaluate(f"{FIRST}.duration")
    page.get_by_role("button", name="Stop").click()


def test_a_connection_that_is_lost_leaves_what_has_come(chromium: Any, tmp_path: Path) -> None:
    with Stage(tmp_path / "out", []) as stage:
        page = open_page(chromium, stage)
        page.get_by_label("Length").select_option("1")
        page.get_by_role("button", name="bach-prelude-c").click()
        wait(page, f"{FIRST}.available > 1")
    wait(page, f"{FIRST}.state === 'failed'")
    page.get_by_text("The connection was lost").wait_for()
    page.evaluate(f"{FIRST}.currentTime = 0.8")
    assert page.evaluate(f"{FIRST}.bodyPose('world', 0.8).pos") == [0, 0, 0]


def test_two_tabs_play_apart_and_stop_alone(chromium: Any, stage: Stage, song: bytes) -> None:
    one, other = open_page(chromium, stage), open_page(chromium, stage)
    one.get_by_label("Effort").select_option("3")
    one.get_by_label("Length").select_option("2")
    one.get_by_role("button", name="bach-prelude-c").click()
    wait(one, f"{FIRST}.state === 'planning'")
    drop(other, "song.mid", song)
    wait(other, f"{FIRST}.state === 'done'")
    assert one.evaluate(f"{FIRST}.state") in ("planning", "growing")
    one.get_by_role("button", name="Stop").click()
    wait(one, f"{FIRST}.state === 'failed'")
    assert not one.wrong
    assert not other.wrong


def test_a_stage_that_is_gone_is_told(chromium: Any, tmp_path: Path, song: bytes) -> None:
    with Stage(tmp_path / "out", []) as stage:
        page = open_page(chromium, stage)
        port = int(stage.url.split(":")[2].split("/")[0])
        drop(page, "song.mid", song)
        wait(page, f"{FIRST}.state === 'done'")
    page.get_by_role("button", name="Try again").click()
    page.get_by_text("The stage does not answer").wait_for()
    # One that is started again at the same port has another secret.
    with Stage(tmp_path / "out", [], port) as again:
        fresh = open_page(chromium, again)
        assert fresh.locator("nav ul").nth(1).locator("li").count() == 1
