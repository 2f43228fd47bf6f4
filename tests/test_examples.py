from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
# What each has to print, or else it did not do what it is named after.
PRINTS = {
    "compare_players.py": "zero-shot-ik",
    "my_planner.py": "high-fingers F1",
    "play_a_song.py": "onset_f1",
    "reward_term.py": "reward/stillness",
}
LEAVES = {
    "compare_players.py": "out/compare/zero-shot/results.json",
    "play_a_song.py": "performance.npz",
}
PLUGIN = "my_player_plugin.py"
EXPERT = "train_and_plot_an_expert.py"


def run(command: list[str], folder: Path) -> str:
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        # As in a user's shell, where nothing makes modules known.
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_example_is_tested_and_short() -> None:
    assert {file.name for file in EXAMPLES.glob("*.py")} == {*PRINTS, PLUGIN, EXPERT}
    for file in EXAMPLES.glob("*.py"):
        assert len(file.read_text(encoding="utf-8").splitlines()) <= 60


@pytest.mark.parametrize("name", PRINTS)
def test_the_example_runs(name: str, tmp_path: Path) -> None:
    assert PRINTS[name] in run([sys.executable, str(EXAMPLES / name)], tmp_path)
    if name in LEAVES:
        assert (tmp_path / LEAVES[name]).exists()


def test_an_expert_is_trained_into_a_folder_as_the_reference_has_it(tmp_path: Path) -> None:
    assert "F1" in run([sys.executable, str(EXAMPLES / EXPERT)], tmp_path)
    assert (tmp_path / "out" / "expert.png").exists()
    page = EXAMPLES.parent / "docs" / "reference" / "file-formats.md"
    text = page.read_text(encoding="utf-8").split("## The folder of a run\n")[1].split("\n## ")[0]
    shown = re.findall(r"^\| `([^`]+)`", text, flags=re.MULTILINE)
    assert sorted(name.strip("/") for name in shown) == sorted(os.listdir(tmp_path / "out/expert"))


def test_a_player_of_ones_own_takes_25_lines_to_a_row_of_evaluate(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / PLUGIN, tmp_path)
    assert len((tmp_path / PLUGIN).read_text(encoding="utf-8").splitlines()) <= 25
    # The command as it is installed: unlike `python -m`, it does not look into the present folder.
    command = Path(sys.executable).with_name("pianomime")
    player = f"{Path(PLUGIN).stem}:make_player"
    options = ["--seconds", "1", "-o", "out"]
    run([str(command), "evaluate", "twinkle-twinkle", "--player", player, *options], tmp_path)
    results = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    (row,) = results["songs"]
    assert row["player"] == "high-fingers"
    assert row["f1"] > 0.5


def test_the_page_on_players_shows_the_example() -> None:
    page = EXAMPLES.parent / "docs" / "how-to" / "own-player.md"
    assert (EXAMPLES / PLUGIN).read_text(encoding="utf-8") in page.read_text(encoding="utf-8")
