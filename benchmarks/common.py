"""Common parts of the benchmarks: facts about the machine, tables, and the JSON file."""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pianomime.files import atomic

ROOT = Path(__file__).resolve().parents[1]


def parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """A command line with the options that every benchmark has."""
    made = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument(
        "-o",
        "--output",
        type=Path,
        default=ROOT / "out" / "benchmarks" / f"{name}.json",
        help="JSON file to write (%(default)s)",
    )
    return made


def cores() -> list[int]:
    """The cores that this process may run on."""
    return sorted(os.sched_getaffinity(0))


def shared() -> Path:
    """The folder of reference data, which is not part of the repository.

    Raises:
        SystemExit: PIANOMIME_SHARED names no such folder.
    """
    name = os.environ.get("PIANOMIME_SHARED")
    if not name or not Path(name).is_dir():
        raise SystemExit("skipped: PIANOMIME_SHARED names no folder of reference data")
    return Path(name)


def machine() -> dict[str, Any]:
    """Facts about the machine and the program that a timing depends on."""
    import mujoco
    import numpy as np

    commit = _git("rev-parse", "--short", "HEAD")
    if commit and _git("status", "--porcelain", "--untracked-files=no"):
        commit += " with changes"
    return {
        "cpu": _cpu(),
        "cores": len(cores()),
        "load_before": round(os.getloadavg()[0], 2),
        "system": platform.platform(),
        "python": platform.python_version(),
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "commit": commit or "unknown",
    }


def report(path: Path, facts: dict[str, Any], results: dict[str, Any]) -> None:
    """Write the JSON file, and print its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic(path) as temporary:
        temporary.write_text(json.dumps({"machine": facts, **results}, indent=2) + "\n", "utf-8")
    print(f"\nwritten: {path}")


def show_machine(facts: dict[str, Any]) -> None:
    """Print the facts, and a warning if the machine is busy."""
    print("  ".join(f"{name}: {value}" for name, value in facts.items()), end="\n\n")
    if facts["load_before"] > 0.5:
        print("this machine is busy: timings are too slow, those on all cores meaningless\n")


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a Markdown table: text to the left, numbers to the right."""
    cells = [[_cell(value) for value in row] for row in rows]
    widths = [max(len(line[column]) for line in [head, *cells]) for column in range(len(head))]
    numeric = [
        all(isinstance(row[column], int | float) for row in rows) for column in range(len(head))
    ]

    def line(values: Sequence[str]) -> str:
        padded = (
            value.rjust(width) if right else value.ljust(width)
            for value, width, right in zip(values, widths, numeric, strict=True)
        )
        return f"| {' | '.join(padded)} |"

    print(line(head))
    rules = ["-" * (w - 1) + (":" if n else "-") for w, n in zip(widths, numeric, strict=True)]
    print(line(rules))
    for row in cells:
        print(line(row))


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    return str(value)


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _git(*arguments: str) -> str:
    try:
        run = subprocess.run(
            ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    return run.stdout.strip() if run.returncode == 0 else ""
