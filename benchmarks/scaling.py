"""How well generalists play unseen songs, by how many songs they learned from.

    python benchmarks/scaling.py three-stage 100=out/w100 300=out/w300 1000=out/w1000 \
        --sets modern/test12 etude12 giantmidi:50 --picture docs/images/scaling.png

plays the songs of each set, first 30 s of each at effort 0, with the weights in each folder, and
prints a table: a row for each number of songs. A set is a folder of reference data, with the number
of its first files that are played where not all are.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import common
from pianomime.evaluation.evaluation import evaluate
from pianomime.files import atomic
from pianomime.policies.methods import WEIGHTS
from pianomime.songs.find import find_songs

OMNIPIANIST = 0.55
"""F1 of OmniPianist on unseen songs (its paper's), which learned from a million trajectories."""


def songs_of(name: str) -> list[Path]:
    """The files of a set, such as "giantmidi:50"."""
    folder, _, number = name.partition(":")
    files = find_songs([common.shared() / "data" / folder])
    return files[: int(number)] if number else files


def picture(sets: list[str], found: dict[str, dict[int, float]], path: Path) -> None:
    """F1 by the number of songs, a line for each set."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for name in sets:
        axis.plot(list(found[name]), list(found[name].values()), "o-", label=name)
    axis.axhline(OMNIPIANIST, color="gray", linestyle="--", label="OmniPianist, unseen songs")
    axis.set(xscale="log", xlabel="songs learned from", ylabel="F1 on unseen songs", ylim=(0, 1))
    counts = sorted(found[sets[0]])
    axis.set_xticks(counts, [str(count) for count in counts])
    axis.minorticks_off()
    axis.legend()
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=120, format="png")
    plt.close(figure)


def main() -> None:
    """Play, and print the table."""
    options = common.parser("scaling", __doc__)
    options.add_argument("player")
    options.add_argument("weights", nargs="+", metavar="SONGS=FOLDER")
    options.add_argument("--sets", nargs="+", required=True)
    options.add_argument("--picture", type=Path)
    options.add_argument("--jobs", type=int, default=len(common.cores()))
    options.add_argument("--played", type=Path, default=common.ROOT / "out" / "scaling")
    arguments: argparse.Namespace = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    found: dict[str, dict[int, float]] = {name: {} for name in arguments.sets}
    rows = []
    for entry in arguments.weights:
        count, _, folder = entry.partition("=")
        os.environ[WEIGHTS] = str(Path(folder).resolve())
        if not (count.isdigit() and folder):
            raise SystemExit(f"{entry}: not a number of songs and a folder, such as 300=out/w300")
        row: list[object] = [int(count)]
        for name in arguments.sets:
            results = evaluate(
                songs_of(name),
                arguments.player,
                effort=0,
                jobs=arguments.jobs,
                out=arguments.played,
            )
            failed = [song for song in results["songs"] if "error" in song]
            if failed:
                raise SystemExit(f"{failed[0]['song']}: {failed[0]['error']}")
            mean = results["mean"]
            found[name][int(count)] = mean["f1"]
            row += [round(mean[metric], 3) for metric in ("precision", "recall", "f1")]
        rows.append(row)
        print(row, flush=True)
    head = [f"{name} {metric}" for name in arguments.sets for metric in ("P", "R", "F1")]
    common.table(["songs", *head], rows)
    common.report(arguments.output, facts, {"player": arguments.player, "rows": rows})
    if arguments.picture:
        picture(arguments.sets, found, arguments.picture)


if __name__ == "__main__":
    main()
