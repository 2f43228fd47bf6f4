"""Whether the tests notice when what makes the F1 is changed: mutation testing of four rooms.

A mutant is the program with one small change, such as another operator or number. It is killed if
the tests of its room fail or do not end in time. The mutants are cosmic-ray's; of the thousands
that there are a sample is drawn, first a place in the room at random, then a change of that place.
Changes of type annotations are left out, for they do nothing. Each mutant is tried in a copy of
the repository, without reference data.

    python benchmarks/mutation.py                       # 30 mutants of each room
    python benchmarks/mutation.py --rooms plan --count 100 --seed 1
    python benchmarks/mutation.py --again               # those that survived the last time

Survivors that change nothing that can be observed are listed in mutation.json, with the reason, and
do not count.
"""

from __future__ import annotations

import ast
import contextlib
import difflib
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue

from cosmic_ray import plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code

from common import ROOT, machine, parser, report, show_machine, table

ROOMS = {
    "plan": ("src/pianomime/plan", "tests/plan/test_*.py"),
    "track": ("src/pianomime/track", "tests/track/test_*.py"),
    "evaluation": ("src/pianomime/evaluation", "tests/evaluation/test_*.py"),
    "metrics": ("src/pianomime/music/metrics.py", "tests/music/test_metrics*.py"),
}
"""What is changed in each room, and the tests that should notice."""
FIRST = {
    "plan": ["test_fingering_costs.py", "test_stored_fingerings.py"],
    "track": ["test_stored_controls.py", "test_dynamic_control.py", "test_sampling_by_hand.py"],
    "evaluation": ["test_diagnose.py", "test_reuse.py"],
    "metrics": [],
}
"""The tests that are tried first, for they are quick and notice most."""
EQUIVALENT = Path(__file__).with_suffix(".json")
JOBS = 2
SLOWEST = 4.0
"""Unless told otherwise, a mutant's tests may take this many times as long as the program's."""


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Attributes:
        room: of the file.
        file: path within the repository.
        line: where, 1 for the first.
        operator: what cosmic-ray calls the change.
        occurrence: which of the places in the file where it can be made.
        diff: the lines taken away and added.
    """

    room: str
    file: str
    line: int
    operator: str
    occurrence: int
    diff: str

    @property
    def name(self) -> str:
        """Stays the same when other lines of the file change."""
        return f"{Path(self.file).name}-{hashlib.sha256(self.diff.encode()).hexdigest()[:10]}"


def sample(room: str, count: int, seed: int) -> list[Mutant]:
    """Mutants of a room, drawn at random."""
    place = ROOT / ROOMS[room][0]
    places: dict[tuple[str, tuple[int, int]], list[tuple[str, int]]] = {}
    codes = {}
    for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
        name = file.relative_to(ROOT).as_posix()
        codes[name] = file.read_text("utf-8")
        for spot, change in _changes(codes[name]):
            places.setdefault((name, spot), []).append(change)
    rng = random.Random(f"{room} {seed}")
    order = sorted(places)
    rng.shuffle(order)
    drawn: list[Mutant] = []
    for name, spot in order:
        operator, occurrence = rng.choice(places[name, spot])
        changed = mutate_code(codes[name], plugins.get_operator(operator)(), occurrence)
        if changed is None or changed == codes[name]:
            continue
        diff = [
            line
            for line in difflib.unified_diff(codes[name].split("\n"), changed.split("\n"), n=0)
            if line[0] in "+-" and line[:3] not in ("+++", "---")
        ]
        drawn.append(Mutant(room, name, spot[0], operator, occurrence, "\n".join(diff)))
        if len(drawn) == count:
            break
    return drawn


def _changes(code: str) -> Iterator[tuple[tuple[int, int], tuple[str, int]]]:
    """Line and column, operator and occurrence of every change that can be made."""
    silent = _annotations(code)
    nodes = list(ast_nodes(get_ast(code)))
    for name in sorted(plugins.operator_names()):
        operator = plugins.get_operator(name)
        if operator.arguments() or name == "core/NoOp":
            continue
        spots = (spot for node in nodes for spot in operator().mutation_positions(node))
        for occurrence, (start, _) in enumerate(spots):
            if not any(first <= start < last for first, last in silent):
                yield start, (name, occurrence)


def _annotations(code: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where the type annotations are, from and to (line, column)."""
    found = []
    for node in ast.walk(ast.parse(code)):
        for name in ("annotation", "returns"):
            inner = getattr(node, name, None)
            if inner is not None:
                start = inner.lineno, inner.col_offset
                found.append((start, (inner.end_lineno, inner.end_col_offset)))
    return found


def copies(folder: Path) -> Queue[Path]:
    """Copies of what the tests of the rooms need, one for each job."""
    made: Queue[Path] = Queue()
    for job in range(JOBS):
        copy = folder / str(job) / "repository"
        copy.mkdir(parents=True)
        for name in ("src", "tests", "docs"):
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, copy / name, ignore=ignored)
        shutil.copy(ROOT / "pyproject.toml", copy)
        made.put(copy)
    return made


def failing(copy: Path, room: str, limit: float) -> str:
    """Run the tests of a room.

    Returns:
        "" if they pass, the first test that fails, or "timeout".
    """
    environment = {
        **os.environ,
        "PYTHONPATH": str(copy / "src"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
    }
    environment.pop("PIANOMIME_SHARED", None)
    known = sorted(copy.glob(ROOMS[room][1]))
    order = sorted(known, key=lambda path: (path.name not in FIRST[room], path.name))
    tests = [str(path.relative_to(copy)) for path in order]
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    process = subprocess.Popen(
        [*command, "--hypothesis-seed=0", *tests],
        cwd=copy,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        output, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        output = "timeout"
    finally:
        # Tests may have started processes of their own.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if process.returncode == 0:
        return ""
    wrong = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return wrong[0][:160] if wrong else output.strip()[-160:]


def try_out(mutant: Mutant, free: Queue[Path], limit: float) -> str:
    """What `failing` says of a mutant."""
    copy = free.get()
    file = copy / mutant.file
    code = file.read_text("utf-8")
    try:
        changed = mutate_code(code, plugins.get_operator(mutant.operator)(), mutant.occurrence)
        file.write_text(changed, "utf-8")
        return failing(copy, mutant.room, limit)
    finally:
        file.write_text(code, "utf-8")
        free.put(copy)


def main() -> None:
    """Draw the mutants, try them, and write the score."""
    arguments = parser("mutation", __doc__)
    arguments.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS))
    arguments.add_argument("--count", type=int, default=30, help="mutants of each room")
    arguments.add_argument("--seed", type=int, default=0, help="of the sample")
    arguments.add_argument("--again", action="store_true", help="try the last survivors alone")
    arguments.add_argument("--limit", type=float, help="time for the tests of one mutant [s]")
    asked = arguments.parse_args()
    facts = machine()
    show_machine(facts)
    known = json.loads(asked.output.read_text("utf-8"))["mutants"] if asked.again else []
    killed = {row["name"] for row in known if row["killed_by"]}
    equivalent = json.loads(EQUIVALENT.read_text("utf-8")) if EQUIVALENT.exists() else {}
    mutants = [mutant for room in asked.rooms for mutant in sample(room, asked.count, asked.seed)]
    verdict = {row["name"]: row["killed_by"] for row in known}
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        free = copies(Path(folder))
        limits = dict.fromkeys(asked.rooms, asked.limit)
        for room in asked.rooms if asked.limit is None else ():
            began = time.monotonic()
            copy = free.get()
            wrong = failing(copy, room, 1200.0)
            free.put(copy)
            if wrong:
                raise SystemExit(f"{room}: tests fail without any change: {wrong}")
            limits[room] = 20.0 + SLOWEST * (time.monotonic() - began)
            print(f"{room}: tests take {time.monotonic() - began:.0f} s", flush=True)
        todo = [mutant for mutant in mutants if mutant.name not in killed]
        with ThreadPoolExecutor(JOBS) as pool:
            results = pool.map(lambda each: try_out(each, free, limits[each.room]), todo)
            for mutant, result in zip(todo, results, strict=True):
                verdict[mutant.name] = result
                alike = mutant.name in equivalent
                word = f"killed: {result}" if result else "equivalent" if alike else "SURVIVED"
                print(f"{mutant.name} {mutant.file}:{mutant.line}\n{mutant.diff}\n    {word}")
                sys.stdout.flush()
    rows = []
    for room in asked.rooms:
        mine = [mutant for mutant in mutants if mutant.room == room]
        dead = sum(bool(verdict[mutant.name]) for mutant in mine)
        late = sum(verdict[mutant.name] == "timeout" for mutant in mine)
        same = sum(not verdict[mutant.name] and mutant.name in equivalent for mutant in mine)
        rows.append([room, len(mine), dead, late, same, dead / (len(mine) - same)])
    total = [sum(row[column] for row in rows) for column in range(1, 5)]
    rows.append(["all", *total, total[1] / (total[0] - total[3])])
    print()
    table(
        ["room", "mutants", "killed", "of them by time", "equivalent", "score"],
        [[*row[:-1], f"{row[-1]:.0%}"] for row in rows],
    )
    listed = [
        {"name": mutant.name, **asdict(mutant), "killed_by": verdict[mutant.name]}
        for mutant in mutants
    ]
    report(asked.output, facts, {"seed": asked.seed, "rows": rows, "mutants": listed})


if __name__ == "__main__":
    main()
