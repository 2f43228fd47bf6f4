"""The paper's tables, ours beside theirs: every generalist on modern test12 and Etude-12.

    PIANOMIME_WEIGHTS=out/generalist python benchmarks/paper_tables.py -o out/tables
    python benchmarks/paper_tables.py --weights out/one out/two out/three --headline two-stage-diff

Plays all songs of both sets with every method whose weights are there, with three seeds if it is
stochastic, and the headline method with the weights of several trainings. OUT then holds songs.csv
(a row for each performance), tables.md (the main comparison, tables 9 and 10, and F1 of all songs
and players) and methods.png. Songs that the same program and weights played before are not played
again. Figure 8 of the paper is drawn by `pianomime train-experts`.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import os
import statistics
from pathlib import Path
from typing import Any

import common
from pianomime.errors import InputError
from pianomime.evaluation.evaluation import evaluate
from pianomime.files import atomic
from pianomime.players.builtin import ZERO_SHOT_20HZ
from pianomime.policies.methods import FINGERS, GENERALISTS, THREE_STAGE, WEIGHTS, weight_files

METRICS = ("precision", "recall", "f1")
SETS = {"modern test12": "modern/test12", "Etude-12": "etude12"}

# Table 1 of the paper, and the means of its table 10: precision, recall and F1 of each set.
PAPER: dict[str, dict[str, tuple[float, float, float]]] = {
    "two-stage-diff": {"modern test12": (0.69, 0.54, 0.56), "Etude-12": (0.42, 0.31, 0.33)},
    "two-stage-diff-res": {"modern test12": (0.71, 0.55, 0.57), "Etude-12": (0.43, 0.30, 0.32)},
    "two-stage-diff-no-sdf": {"modern test12": (0.66, 0.49, 0.51)},
    "two-stage-bet": {"modern test12": (0.53, 0.30, 0.31)},
    "one-stage-diff": {"modern test12": (0.58, 0.27, 0.26)},
    "bc-mse": {"modern test12": (0.54, 0.22, 0.21)},
    "multi-task-sac": {"modern test12": (0.95, 0.18, 0.13)},
}
# Tables 9 and 10: precision, recall and F1 of two-stage-diff, and of two-stage-diff-res.
PAPER_SONGS: dict[str, dict[str, str]] = {
    "modern test12": {
        "Forester": "0.81 0.70 0.68 0.79 0.71 0.67",
        "Wednesday": "0.66 0.57 0.58 0.67 0.54 0.55",
        "Alone": "0.80 0.62 0.66 0.83 0.65 0.67",
        "Somewhere Only We Know": "0.63 0.53 0.58 0.67 0.57 0.59",
        "Eyes Closed": "0.60 0.52 0.53 0.61 0.45 0.50",
        "Pedro": "0.70 0.58 0.60 0.67 0.56 0.47",
        "Ohne Dich": "0.73 0.55 0.58 0.75 0.56 0.62",
        "Paradise": "0.66 0.42 0.43 0.68 0.45 0.47",
        "Hope": "0.74 0.55 0.57 0.76 0.58 0.62",
        "No Time To Die": "0.77 0.53 0.55 0.79 0.57 0.60",
        "The Spectre": "0.64 0.52 0.54 0.67 0.50 0.52",
        "Numb": "0.55 0.44 0.45 0.57 0.47 0.48",
    },
    "Etude-12": {
        "FrenchSuiteNo1Allemande": "0.45 0.31 0.34 0.39 0.27 0.30",
        "FrenchSuiteNo5Sarabande": "0.29 0.23 0.24 0.24 0.18 0.19",
        "PianoSonataD8451StMov": "0.58 0.52 0.52 0.60 0.50 0.51",
        "PartitaNo26": "0.35 0.22 0.24 0.40 0.24 0.26",
        "WaltzOp64No1": "0.44 0.31 0.33 0.43 0.28 0.31",
        "BagatelleOp3No4": "0.45 0.30 0.33 0.45 0.28 0.32",
        "KreislerianaOp16No8": "0.43 0.34 0.36 0.49 0.34 0.36",
        "FrenchSuiteNo5Gavotte": "0.34 0.29 0.33 0.41 0.31 0.33",
        "PianoSonataNo232NdMov": "0.35 0.24 0.25 0.29 0.19 0.21",
        "GolliwoggsCakewalk": "0.60 0.43 0.45 0.57 0.40 0.42",
        "PianoSonataNo21StMov": "0.32 0.22 0.25 0.36 0.23 0.25",
        "PianoSonataK279InCMajor1StMov": "0.43 0.35 0.35 0.53 0.38 0.39",
    },
}
PAPER_PLAYERS = ("two-stage-diff", "two-stage-diff-res")

Row = dict[str, Any]


def play(
    method: str, weights: Path | None, seed: int, effort: int, songs: str, arguments: Any
) -> list[Row]:
    """A row for each song of a set.

    Args:
        method: name of the player.
        weights: folder of its weights; None for the usual one.
        seed: of the player.
        effort: of the player.
        songs: name of the set.
        arguments: of the command line.
    """
    if weights is not None:
        os.environ[WEIGHTS] = str(weights)
    results = evaluate(
        common.shared() / "data" / SETS[songs],
        method,
        jobs=arguments.jobs,
        out=arguments.output / "played",
        effort=effort,
        seed=seed,
    )
    for song in results["songs"]:
        if "error" in song:
            raise SystemExit(f"{method}, {song['song']}: {song['error']}")
    mean = results["mean"]
    print(f"{method} effort {effort} seed {seed} {songs}: F1 {mean['f1']:.3f}", flush=True)
    return [
        {
            "method": method,
            "effort": effort,
            "weights": "" if weights is None else str(weights),
            "seed": seed,
            "set": songs,
            "song": song["song"],
            **{name: song[name] for name in (*METRICS, "realtime_factor")},
        }
        for song in results["songs"]
    ]


def available(method: str) -> bool:
    """Whether the weights of a method are there; prints so if not."""
    try:
        weight_files(method)
    except InputError as error:
        print(f"left out: {method} ({error})")
        return False
    return True


def seeds_of(method: str, effort: int, arguments: Any) -> tuple[int, ...]:
    """Seeds of a player: of its diffusion, or of its predictive sampling."""
    if method in GENERALISTS:
        stochastic = GENERALISTS[method] not in (("bc-mse",), ("multi-task-sac",))
        return tuple(arguments.seeds) if stochastic else (0,)
    return tuple(arguments.search_seeds) if effort and method != THREE_STAGE else (0,)


def some(rows: list[Row], **wanted: Any) -> list[Row]:
    """The rows that have these values."""
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def means(rows: list[Row], metric: str) -> list[list[float]]:
    """Means over the songs of a set: one for each training and seed."""
    trainings: dict[str, dict[int, list[float]]] = {}
    for row in rows:
        seeds = trainings.setdefault(row["weights"], {})
        seeds.setdefault(row["seed"], []).append(row[metric])
    return [[statistics.mean(songs) for songs in seeds.values()] for seeds in trainings.values()]


def overall(trainings: list[list[float]]) -> float:
    """The mean; each training counts alike."""
    return statistics.mean(map(statistics.mean, trainings))


def spread(trainings: list[list[float]]) -> str:
    """Mean, and standard deviations over seeds and over trainings, where there are several."""
    text = f"{overall(trainings):.3f}"
    if len(trainings[0]) > 1:
        text += f" ± {statistics.mean(map(statistics.stdev, trainings)):.3f}"
    if len(trainings) > 1:
        text += f" ± {statistics.stdev(map(statistics.mean, trainings)):.3f}"
    return text


def comparison(rows: list[Row], players: list[tuple[str, int]]) -> str:
    """The main table."""
    lines = [
        "| player | set | trainings x seeds | precision | recall | F1 | the paper's P / R / F1 "
        "| real time |",
        "| --- | --- | --- | ---: | ---: | ---: | --- | ---: |",
    ]
    for method, effort in players:
        for songs in SETS:
            mine = some(rows, method=method, effort=effort, set=songs)
            cells = [spread(means(mine, metric)) for metric in METRICS]
            theirs = " / ".join(f"{value:.2f}" for value in PAPER.get(method, {}).get(songs, ()))
            trainings = means(mine, "f1")
            count = f"{len(trainings)} x {len(trainings[0])}"
            name = f"{method}, effort {effort}"
            speed = statistics.median(row["realtime_factor"] for row in mine)
            cells += [theirs, f"{speed:.1f}x"]
            lines.append(f"| {name} | {songs} | {count} | {' | '.join(cells)} |")
    return "\n".join(lines)


def papers_table(rows: list[Row], songs: str, players: list[tuple[str, int]]) -> str:
    """Table 9 or 10: precision, recall and F1 of each song, ours and the paper's.

    Songs with other names in the paper, of which it is unknown which is which, have their own rows.
    """
    mine = [player for player in players if player[0] in PAPER_PLAYERS]
    names = sorted({row["song"] for row in rows if row["set"] == songs})
    theirs = PAPER_SONGS[songs]
    head = [f"{name} {short}" for name, _ in mine for short in ("P", "R", "F1")]
    head += [f"the paper's {short}" for short in ("P", "R", "F1", "res P", "res R", "res F1")]
    lines = [f"| song | {' | '.join(head)} |", f"| --- |{' ---: |' * len(head)}"]
    for name in [*names, *(other for other in theirs if other not in names)]:
        cells = [name]
        for method, effort in mine:
            played = some(rows, method=method, effort=effort, song=name)
            cells += [
                f"{statistics.mean(row[metric] for row in played):.2f}" if played else ""
                for metric in METRICS
            ]
        lines.append(f"| {' | '.join([*cells, *theirs.get(name, ' ' * 5).split(' ')])} |")
    return "\n".join(lines)


def by_song(rows: list[Row], songs: str, players: list[tuple[str, int]]) -> str:
    """F1 of each song, of all players."""
    head = ["song", *(f"{method}, {effort}" for method, effort in players)]
    lines = [f"| {' | '.join(head)} |", f"| --- |{' ---: |' * (len(head) - 1)}"]
    for name in sorted({row["song"] for row in rows if row["set"] == songs}):
        cells = [name]
        for method, effort in players:
            mine = some(rows, method=method, effort=effort, song=name)
            cells.append(f"{statistics.mean(row['f1'] for row in mine):.2f}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def picture(rows: list[Row], players: list[tuple[str, int]], path: Path) -> None:
    """Bars of F1 for each method, the paper's beside them."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), sharey=True, layout="constrained")
    for axis, songs in zip(axes, SETS, strict=True):
        for at, (method, effort) in enumerate(players):
            mine = some(rows, method=method, effort=effort, set=songs)
            ours = overall(means(mine, "f1"))
            axis.barh(at - 0.2, ours, 0.4, color="tab:blue", label="ours" if not at else None)
            axis.text(ours + 0.01, at - 0.2, f"{ours:.2f}", va="center", fontsize=8)
            theirs = PAPER.get(method, {}).get(songs)
            if theirs is not None:
                label = "the paper's" if not at else None
                axis.barh(at + 0.2, theirs[2], 0.4, color="lightgray", label=label)
        axis.set(title=songs, xlim=(0, 1.08), xlabel="F1")
        axis.set_yticks(range(len(players)), [f"{name} ({effort})" for name, effort in players])
    axes[0].invert_yaxis()
    axes[0].legend(loc="center right")
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=120)
    plt.close(figure)


def main() -> None:
    """Play, and write the tables."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("-o", "--output", type=Path, default=common.ROOT / "out" / "tables")
    options.add_argument(
        "--weights", type=Path, nargs="+", help="folders of weights, one for each training"
    )
    options.add_argument(
        "--headline",
        default="two-stage-diff",
        choices=GENERALISTS,
        help="method that is played with all of them",
    )
    options.add_argument(
        "--seeds", type=int, nargs="+", default=(0, 1, 2), help="of stochastic policies"
    )
    options.add_argument(
        "--search-seeds",
        type=int,
        nargs="+",
        default=(0, 1, 2),
        help="of players with predictive sampling",
    )
    options.add_argument("--effort", type=int, default=0, help="effort of methods that imitate")
    options.add_argument(
        "--efforts", type=int, nargs="+", default=(0, 1), help="efforts of the others"
    )
    options.add_argument("--jobs", type=int, default=None, help="songs played at the same time")
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    first, *others = arguments.weights or [None]
    for weights in others:
        os.environ[WEIGHTS] = str(weights)
        try:
            weight_files(arguments.headline)
        except InputError as error:
            raise SystemExit(str(error)) from None
    if first is not None:
        os.environ[WEIGHTS] = str(first)
    learned = (*GENERALISTS, THREE_STAGE, FINGERS)
    methods = [name for name in learned if available(name)]
    missing = [name for name in learned if name not in methods]
    players = [(method, arguments.effort) for method in methods if method != FINGERS]
    ours = [ZERO_SHOT_20HZ, *(name for name in methods if name == FINGERS)]
    players += [(name, effort) for effort in arguments.efforts for name in ours]
    rows = []
    for method, effort in players:
        seeds = seeds_of(method, effort, arguments)
        trainings = [first, *(others if method == arguments.headline else ())]
        for songs, weights, seed in itertools.product(SETS, trainings, seeds):
            rows += play(method, weights, seed, effort, songs, arguments)
    arguments.output.mkdir(parents=True, exist_ok=True)
    with (
        atomic(arguments.output / "songs.csv") as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    parts = [comparison(rows, players)]
    if missing:
        parts.append(f"Not played, because their weights are missing: {', '.join(missing)}.")
    for table in (papers_table, by_song):
        parts += [table(rows, songs, players) for songs in SETS]
    tables = "\n\n".join(parts)
    with atomic(arguments.output / "tables.md") as temporary:
        temporary.write_text(tables + "\n", encoding="utf-8")
    picture(rows, players, arguments.output / "methods.png")
    print(f"\n{tables}\n\nwritten: {arguments.output}")


if __name__ == "__main__":
    main()
