"""The gallery: a site of performances whose pages need nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import made_up
from browser import browsers
from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.report.gallery import performances_of, write_gallery

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
        assert f'href="performances/{name}.html"' in index
        assert (site / "performances" / f"{name}.html").stat().st_size > 10_000
        assert (site / "performances" / f"{name}.mid").read_bytes().startswith(b"MThd")


def test_a_site_goes_on_where_it_was(results: Path, tmp_path: Path) -> None:
    first = performances_of([results / "all"])
    assert len(write_gallery(first[:1], tmp_path, "some", 1, note=str)) == 1
    pages = tmp_path / "performances"
    card = next(pages.glob("*.json"))
    # A page that stands for what is there is left alone, one of another performance is not.
    whole = json.loads(card.read_text()) | {"notes": []}
    card.write_text(json.dumps(whole))
    (old,) = pages.glob("*.html")
    old.write_text("left alone")
    write_gallery(first[:1], tmp_path, "some", 1, note=str)
    assert old.read_text() == "left alone"
    card.write_text(json.dumps(whole | {"of": "another"}))
    write_gallery(first[:1], tmp_path, "some", 1, note=str)
    assert old.read_text() != "left alone"


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
        page.fill("input", "SCRIPT")
        assert titles.all_text_contents() == [HOSTILE]
        assert page.title() == "<Études>"
        assert not errors
