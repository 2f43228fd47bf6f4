from __future__ import annotations

import importlib
import inspect
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import pianomime
from pianomime.cli import COMMANDS, main
from pianomime.learn.data.episode import COLUMNS, EVENTS
from pianomime.plan import ZeroShotPlanner

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
REPLAYS = DOCS / "replays"
DOCUMENTS = sorted([*ROOT.glob("*.md"), *DOCS.rglob("*.md")])
# The others show what needs data or hours.
RUN = [
    "README.md",
    "docs/extending.md",
    *sorted(str(page.relative_to(ROOT)) for page in DOCS.glob("tutorials/*.md")),
    "docs/how-to/observation-term.md",
    "docs/how-to/own-player.md",
    "docs/how-to/real-hands.md",
    "docs/how-to/reward-term.md",
]


def name_of(document: Path) -> str:
    return str(document.relative_to(ROOT))


def python_blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("name", RUN)
def test_the_examples_run(name: str, tmp_path: Path) -> None:
    blocks = python_blocks((ROOT / name).read_text(encoding="utf-8"))
    assert blocks
    script = tmp_path / "example.py"
    script.write_text("\n".join(blocks), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def commands_in(text: str) -> list[str]:
    """Every call of `pianomime` in the blocks of a page, in one line each."""
    shown = re.sub(r"^```(?!sh|text|bash)\w+\n.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = re.sub(r"\\\n\s*", " ", shown).splitlines()
    block = re.compile(r"    (?:\./do run )?(?:[A-Z_]+=\S+ )*(pianomime .*)")
    return [found[1] for line in lines if (found := block.fullmatch(line))]


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_commands_in_documents_are_understood(
    document: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for shown in commands_in(document.read_text(encoding="utf-8")):
        _, command, *arguments = shlex.split(shown, comments=True)
        if command.startswith("--") or "--help" in arguments:
            continue
        assert command in COMMANDS, shown
        kind = getattr(importlib.import_module(COMMANDS[command].module), COMMANDS[command].config)
        done: list[Any] = []
        monkeypatch.setattr(kind, "run", lambda command, done=done: done.append(command))
        try:
            main([command, *arguments])
        except SystemExit as stopped:
            pytest.fail(f"{shown}: exit code {stopped.code}")
        assert len(done) == 1, shown


def anchors(document: Path) -> set[str]:
    """What headings are called in links, on GitHub and on the site alike."""
    headings = re.findall(r"^#+ (.+)$", document.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_links_between_documents_lead_somewhere(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)", text):
        if target.startswith(("https://", "http://")):
            continue
        file = document if not target else document.parent / target
        if file.is_relative_to(REPLAYS) and not REPLAYS.exists():
            continue  # `./do docs` makes them.
        assert file.exists(), target
        if anchor:
            assert anchor in anchors(file), f"{target}#{anchor}"
        if document.is_relative_to(DOCS):
            assert file.resolve().is_relative_to(DOCS), f"{target} is not on the site"


def test_the_site_has_every_page_and_no_other() -> None:
    def pages(nav: list[Any]) -> list[str]:
        found = []
        for entry in nav:
            (target,) = entry.values()
            found += pages(target) if isinstance(target, list) else [target]
        return found

    site = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    there = [str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")]
    assert sorted(pages(site["nav"])) == sorted(there)


def resolve(identifier: str) -> Any:
    """The object that a dotted name stands for."""
    module, _, name = identifier.rpartition(".")
    try:
        return getattr(importlib.import_module(module), name)
    except AttributeError:
        return importlib.import_module(identifier)


def documented(page: str) -> list[str]:
    text = (DOCS / "reference" / page).read_text(encoding="utf-8")
    return re.findall(r"^::: (\S+)$", text, flags=re.MULTILINE)


def test_every_public_name_is_in_the_reference() -> None:
    # Those that are called like their modules are named in full.
    shown = [identifier.split(".")[-1] for identifier in documented("api.md")]
    assert sorted(shown) == sorted({*pianomime.__all__} - {"__version__"})


@pytest.mark.parametrize("identifier", [*documented("api.md"), *documented("rooms.md")])
def test_what_the_reference_names_is_there_and_says_what_it_is(identifier: str) -> None:
    found = resolve(identifier)
    # Not a docstring that dataclasses or protocols make of themselves.
    assert inspect.getdoc(found)
    assert not inspect.getdoc(found).startswith(f"{identifier.split('.')[-1]}(")


def section(page: str, title: str) -> str:
    text = (DOCS / "reference" / page).read_text(encoding="utf-8")
    return text.split(f"\n## {title}\n")[1].split("\n## ")[0]


def named(text: str) -> set[str]:
    """Everything in the first column of tables."""
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row)}


@pytest.fixture(scope="module")
def performance() -> pianomime.Performance:
    score = pianomime.Score(
        np.array([40, 44]),
        np.array([0.0, 0.1]),
        np.array([0.2, 0.3]),
        np.array([64, 64]),
        remarks=("left out: 1",),
    )
    return pianomime.load_player("zero-shot", effort=0).play(score)


def test_the_reference_names_every_array_of_a_performance(
    performance: pianomime.Performance, tmp_path: Path
) -> None:
    performance.save(tmp_path / "performance.npz")
    with np.load(tmp_path / "performance.npz") as file:
        assert named(section("file-formats.md", "performance.npz")) == set(file)


def test_the_reference_names_every_array_of_a_demonstration(
    performance: pianomime.Performance, tmp_path: Path
) -> None:
    score = performance.score
    pianomime.Demonstration(score, ZeroShotPlanner().plan(score)).save(tmp_path / "demo.npz")
    with np.load(tmp_path / "demo.npz") as file:
        assert named(section("file-formats.md", "Demonstration (.npz)")) == set(file)


def test_the_reference_names_every_array_of_a_data_set() -> None:
    shown = named(section("file-formats.md", "Experts' data set (zarr)"))
    assert shown == {*COLUMNS, *EVENTS, "episode_end", "event_end"}


def test_the_reference_names_everything_in_results() -> None:
    results = pianomime.evaluate("twinkle-twinkle", effort=0, seconds=0.5)
    assert named(section("file-formats.md", "results.json")) == set(results)
    row = results["songs"][0]
    shown = section("file-formats.md", "report.json")
    assert set(re.findall(r"`(\w+)`", shown)) == {*row, "pedal_f1"} - {"causes"}
    for name in ("music", "body"):
        shown = section("file-formats.md", f"The object {name}")
        cells = "".join(line for line in shown.splitlines() if line.startswith("|"))
        inner = {"share"} if name == "music" else set()
        assert set(re.findall(r"`(\w+)`", cells)) == {*row[name], *inner}


def argument_docs(owner: Any, name: str) -> str:
    """What a method, or one that it overrides, says of its arguments."""
    return "".join(inspect.getdoc(vars(base).get(name)) or "" for base in owner.__mro__)


def test_public_functions_say_what_their_arguments_are() -> None:
    silent = []
    for name in pianomime.__all__:
        found = getattr(pianomime, name)
        if inspect.isfunction(found) and inspect.signature(found).parameters:
            silent += [name] * ("Args:" not in (inspect.getdoc(found) or ""))
        if not inspect.isclass(found):
            continue
        for method, function in inspect.getmembers(found, inspect.isroutine):
            if method.startswith("_") or not hasattr(function, "__code__"):
                continue
            arguments = {*inspect.signature(function).parameters} - {"self"}
            if arguments and "Args:" not in argument_docs(found, method):
                silent.append(f"{name}.{method}")
    assert silent == []
