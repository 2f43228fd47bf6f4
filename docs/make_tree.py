"""Updates the tree of files in architecture.md from the first lines of their docstrings.

Run it with `./do run python docs/make_tree.py` after a file was added, moved or removed.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "pianomime"
PAGE = ROOT / "docs" / "architecture.md"
BLOCK = re.compile(r"^```\w*\nsrc/pianomime/.*?^```\n", re.M | re.S)
# Rooms from the ground up; other files come first, by name.
ORDER = (
    "media", "music", "songs", "world", "plan", "track", "policies", "players", "export",
    "transcription", "video", "learn", "evaluation", "replay", "report", "stage", "commands",
    "cli.py",
    "film", "keyboard", "hands", "notes",
    "runs", "envs", "expert", "data", "goal", "imitation", "fingers", "sac", "three_stage",
)  # fmt: skip


def main() -> None:
    """Write the new tree in place of the old one."""
    lines = [*_lines(SOURCE, 1)]
    width = max(len(name) for name, _ in lines) + 2
    tree = "\n".join(f"{name:{width}}{text}" for name, text in lines)
    block = f"```text\nsrc/pianomime/\n{tree}\n```\n"
    text, count = BLOCK.subn(lambda _: block, PAGE.read_text("utf-8"))
    if count != 1:
        raise SystemExit(f"{PAGE}: has {count} trees, not one")
    PAGE.write_text(text, "utf-8")


def _lines(folder: Path, depth: int) -> list[tuple[str, str]]:
    """Indented name and description of all that is in a folder, files first."""
    lines = []
    for path in sorted(folder.iterdir(), key=_place):
        if path.is_dir() and any(path.glob("*.py")):
            lines.append((f"{'  ' * depth}{path.name}/", _first_line(path / "__init__.py")))
            lines.extend(_lines(path, depth + 1))
        elif path.suffix == ".py" and path.stem not in ("__init__", "__main__"):
            lines.append((f"{'  ' * depth}{path.name}", _first_line(path)))
    return lines


def _place(path: Path) -> tuple[int, bool, str]:
    return ORDER.index(path.name) if path.name in ORDER else -1, path.is_dir(), path.name


def _first_line(file: Path) -> str:
    """The first sentence of a file's docstring, in one line."""
    docstring = ast.get_docstring(ast.parse(file.read_text("utf-8"))) or ""
    first = " ".join(docstring.partition("\n\n")[0].split())
    return first.partition(". ")[0].rstrip(".")


if __name__ == "__main__":
    main()
