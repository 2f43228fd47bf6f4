"""Make the pages of the reference that are read off the program: `python docs/make_reference.py`.

Writes Markdown into build/reference/, which the pages in docs/reference/ include when the site is
built: the help of every command, and the model cards of the weights.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import textwrap
from pathlib import Path

from pianomime.cli import COMMANDS, main

ROOT = Path(__file__).parents[1]
OUT = ROOT / "build" / "reference"
WEIGHTS = ROOT / "src" / "pianomime" / "policies" / "weights"
_WIDTH = 86
"""Columns that fit into a page of the site."""


def command_help(name: str) -> str:
    """What `pianomime NAME --help` prints where there is no terminal, in lines that fit a page."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
        main([name, "--help"])
    lines: list[str] = []
    for line in re.sub(r"\x1b\[[0-9;]*m", "", printed.getvalue()).strip().splitlines():
        margin = len(line) - len(line.lstrip())
        # Help of an option goes on in the column in which it began; there its lines are joined.
        if lines and margin > 4 and _column(lines[-1]) == margin:
            lines[-1] += " " + line.strip()
        else:
            lines.append(line)
    wrapped = (
        textwrap.wrap(line, _WIDTH, subsequent_indent=" " * _column(line)) or [""] for line in lines
    )
    return "\n".join(line for part in wrapped for line in part)


def _column(line: str) -> int:
    """Where the text of a line begins: behind the names of the option, if there are any."""
    option = re.match(r"  \S.*?\s{2,}(?=\S)|\s*", line)
    return option.end() if option else 0


def commands() -> str:
    """A section for each command."""
    return "\n\n".join(
        f"## pianomime {name}\n\n{command.summary.capitalize()}.\n\n"
        f"```text\n{command_help(name)}\n```"
        for name, command in COMMANDS.items()
    )


def weights() -> str:
    """The model cards, without the heads in YAML that hubs read."""
    cards = []
    for card in sorted(WEIGHTS.rglob("*.md")):
        text = re.sub(r"\A---\n.*?\n---\n", "", card.read_text(encoding="utf-8"), flags=re.DOTALL)
        cards.append(re.sub(r"^#", "##", text.strip(), flags=re.MULTILINE))
    return "\n\n".join(cards)


def write() -> None:
    """Write both files."""
    # Help is laid out for the terminal that it finds.
    os.environ["COLUMNS"] = str(_WIDTH)
    OUT.mkdir(parents=True, exist_ok=True)
    for name, text in (("commands.md", commands()), ("weights.md", weights())):
        (OUT / name).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    write()
