"""The gallery: a site of performances whose pages need nothing else."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import made_up
from browser import browsers
from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.report.gallery import page_maker, performances_of, write_gallery

HOSTILE = '</h2><script>document.title = "hacked"</script>'


def save(path: Path, title: str, mistakes: float) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    made_up.performance(made_up.score(notes=12, title=title), mistakes=mistakes).save(path)
    return path


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    save(folder / "played" / "performance.npz", HOSTILE, 0.0)
    for name, mistakes in (("b", 0.4), ("a", 0.2)):
        save(folder / "all" / "songs" / f"{name}.npz", name, mistakes)
    return folder


@pytest.fixture(scope="module")
def site(results: Path) -> Path:
    out = results.parent / "site"
    notes: list[str] = []
    rows = write_gallery(performances_of([results]), out, "<Études>", 2, note=notes.append)
    assert [row["song"] for row in rows] == ["a", "b", HOSTILE]
    # The script of the page may not be built here.
    assert len(notes) <= 1
    return out


def test_each_performance_has_its_page(site: Path) -> None:
    index = (site / "index.html").read_text(encoding="utf-8")
    assert "&lt;Études&gt;" in index
    assert HOSTILE not in index
    for name in ("all-songs-a", "all-songs-b", "played"):
        page, midi = (f"performances/{name}/{file}" for file in ("report.html", f"{name}.mid"))
        assert f'href="{page}"' in index
        assert f'href="{midi}" download>' in index
        assert (site / page).stat().st_size > 10_000
        assert (site / midi).read_bytes().startswith(b"MThd")
        # A short one needs nothing else, and the index needs no more.
        assert len(list((site / page).parent.iterdir())) == 3


def test_what_a_long_page_needs_lies_beside_it(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pianomime.report.write.page_script", lambda: "made_up()")
    make = page_maker({"pages": str(tmp_path), "made_by": "us"})
    request = {"performance": str(results / "played" / "performance.npz"), "name": "long"}
    with monkeypatch.context() as small:
        small.setattr("pianomime.report.page.MOST_EMBEDDED", 0)
        make(request)
    html = (tmp_path / "long" / "report.html").read_text(encoding="utf-8")
    named = re.findall(r'(?:src|srcset)="([^":]+)"', html)
    assert {"performance.mp3", "score.mp3", "performance.replay.gz"} < {*named}
    for name in named:
        assert (tmp_path / "long" / name).stat().st_size > 0
    # Nothing of it stays when it is made anew, and short.
    make(request)
    assert {file.name for file in (tmp_path / "long").iterdir()} == {
        "card.json", "long.mid", "report.html",
    }  # fmt: skip


def test_a_performance_given_twice_is_shown_once(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(results)
    given = Path("all", "songs", "a.npz")
    assert performances_of([given, results / given, Path("all")]) == [
        given, Path("all", "songs", "b.npz"),
    ]  # fmt: skip


def test_performances_of_one_name_have_folders_of_their_own(results: Path, tmp_path: Path) -> None:
    for name in ("X.npz", "X/performance.npz"):
        save(tmp_path / "songs" / name, name, 0.0)
    shown = performances_of([tmp_path / "songs"])
    rows = write_gallery(shown, tmp_path / "site", "some", 1, note=str)
    titles = [row["song"] for row in rows]
    pages = sorted((tmp_path / "site" / "performances").glob("*/report.html"))
    assert [page.parent.name for page in pages] == ["X", "X-performance"]
    for page in pages:
        found = [title for title in titles if f"<h1>{title}</h1>" in page.read_text("utf-8")]
        assert len(found) == 1
        titles.remove(found[0])


def test_a_site_goes_on_where_it_was(results: Path, tmp_path: Path) -> None:
    first = performances_of([results / "all"])
    assert len(write_gallery(first[:1], tmp_path, "some", 1, note=str)) == 1
    (card,) = (tmp_path / "performances").glob("*/card.json")
    page, midi = (card.with_name(name) for name in ("report.html", f"{card.parent.name}.mid"))
    # A page that stands for what is there is left alone, one of another performance is not.
    page.write_text("left alone")
    write_gallery(first[:1], tmp_path, "some", 1, note=str)
    assert page.read_text() == "left alone"
    card.write_text(json.dumps(json.loads(card.read_text()) | {"of": "another"}))
    write_gallery(first[:1], tmp_path, "some", 1, note=str)
    assert page.read_text() != "left alone"
    # Nor is one that lacks a part.
    midi.unlink()
    write_gallery(first[:1], tmp_path, "some", 1, note=str)
    assert midi.exists()


@pytest.mark.parametrize("changed", ["page_script", "program_hash"])
def test_pages_are_made_again_when_what_makes_them_changes(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    performance = performances_of([results / "played"])
    write_gallery(performance, tmp_path, "some", 1, note=str)
    page = next(tmp_path.glob("performances/*/report.html"))
    page.write_text("older")
    monkeypatch.setattr(f"pianomime.report.gallery.{changed}", lambda: "another")
    write_gallery(performance, tmp_path, "some", 1, note=str)
    assert page.read_text() != "older"


def test_what_is_damaged_is_told_and_the_rest_is_shown(results: Path, tmp_path: Path) -> None:
    good = results / "all" / "songs" / "a.npz"
    bad = tmp_path / "bad.npz"
    bad.write_bytes(good.read_bytes()[:3000])
    notes: list[str] = []
    assert len(write_gallery([good, bad], tmp_path / "site", "some", 2, note=notes.append)) == 1
    (told,) = [note for note in notes if str(bad) in note]
    assert told.count(str(bad)) == 1
    with pytest.raises(InputError, match="none of the performances"):
        write_gallery([bad], tmp_path / "other", "some", 1, note=str)
    assert not (tmp_path / "other" / "index.html").exists()


@pytest.mark.parametrize("given", [[], ["nothing"], ["."], ["empty"]])
def test_bad_input_is_one_line(
    given: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(SystemExit) as ended:
        main(["gallery", *given, "-o", "site"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "site").exists()


def test_cards_are_sorted_and_found(site: Path) -> None:
    with browsers() as started, started.chromium() as chromium:
        page = chromium.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto((site / "index.html").as_uri())
        titles = page.locator(".card:visible h2")
        page.select_option("select", "frame F1")
        # The one without mistakes is the best.
        assert titles.all_text_contents() == [HOSTILE, "a", "b"]
        values = [float(value) for value in page.locator("dd.sorted").all_text_contents()]
        assert values == sorted(values, reverse=True)
        page.get_by_role("button", name="largest first").click()
        assert titles.all_text_contents() == ["b", "a", HOSTILE]
        page.get_by_role("button", name="smallest first").click()
        assert titles.all_text_contents() == [HOSTILE, "a", "b"]
        page.select_option("select", "song")
        page.get_by_role("button", name="A to Z").click()
        assert titles.all_text_contents() == ["b", "a", HOSTILE]
        page.fill("input", "SCRIPT")
        assert titles.all_text_contents() == [HOSTILE]
        assert page.title() == "<Études>"
        with page.expect_download() as download:
            page.get_by_role("link", name="MIDI").locator("visible=true").click()
        assert download.value.suggested_filename == "played.mid"
        page.get_by_role("link", name=HOSTILE).click()
        page.wait_for_selector("h1")
        assert page.url == (site / "performances" / "played" / "report.html").as_uri()
        assert not errors
