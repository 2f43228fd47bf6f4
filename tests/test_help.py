"""Help of the commands, as a newcomer reads it: at 80 columns, with examples."""

import importlib.metadata
import re
from itertools import pairwise
from pathlib import Path

import pytest

from pianomime.cli import COMMANDS, main
from pianomime.players import registry
from pianomime.players.builtin import FACTORIES


def _printed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert not stopped.value.code
    return capsys.readouterr().out


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_a_terminal_and_has_examples(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = _printed([command, "--help"], capsys)
    assert max(map(len, text.splitlines())) <= 80
    assert f"Examples:\n  pianomime {command}" in text
    words = re.sub(r"[│\s]+", " ", text)
    assert "(default: )" not in words
    assert "(default: None)" not in words
    # Of a paragraph, no line ends far from the margin but the last.
    described = text.partition("Examples:")[0].split("\n\n")[1:]
    for paragraph in described:
        lines = paragraph.splitlines()
        for line, following in pairwise(lines):
            if not following.startswith(" ") and not line.endswith(":"):
                assert len(line) + 1 + len(following.split()[0]) > 80, line


@pytest.mark.parametrize("command", ["play", "evaluate"])
def test_help_lists_the_players(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    listed = re.findall(r"[\w-]+", _printed([command, "--help"], capsys))
    assert set(FACTORIES) <= set(listed)


def test_players_says_what_each_needs(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    main(["players"])
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    rows = {line.split()[0]: line.split() for line in text.partition("\n\n")[0].splitlines()}
    assert set(rows) == {"player", *registry.player_names()}
    assert "another package" not in text
    assert rows["zero-shot"][-1] == rows["demonstration"][-1] == "yes"
    assert rows["two-stage-diff"][-3:] == ["learned", "weights", "yes"]
    assert rows["expert"][-3:-1] == ["train", "RUN"]
    assert rows["multi-task-sac"][-1] == "no"
    assert "multi-task-sac: pianomime train-sac\n" in text
    monkeypatch.setenv("PIANOMIME_WEIGHTS", str(tmp_path))
    main(["players"])
    assert "two-stage-diff: pianomime train low-diff\n" in capsys.readouterr().out


def test_players_without_the_extra_are_not_usable(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pianomime.commands.needs.find_spec", lambda package: None)
    main(["players"])
    text = capsys.readouterr().out
    assert re.search(r"fingers: .*onnxruntime: .*pip install .*\[learned\]", text)
    assert re.search(r"expert: .*pip install .*\[train\]", text)
    assert re.search(r"zero-shot .* yes", text)


def test_players_of_others_are_shown_as_text(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    points = [
        importlib.metadata.EntryPoint(name, "nothing.there:make", registry.GROUP)
        for name in ("\x1b[31mred", "[bold]loud")
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: points)
    registry._entry_points.cache_clear()
    try:
        main(["players"])
    finally:
        registry._entry_points.cache_clear()
    text = capsys.readouterr().out
    assert "\x1b" not in text
    assert re.search(r"^\\x1b\[31mred .* no", text, re.MULTILINE)
    assert re.search(r"^\[bold\]loud .* no", text, re.MULTILINE)
    assert "No module named 'nothing'" in text
