"""What each part of the zero-shot player of frames is worth: F1 minus F1 without the part.

Costs of the fingering and parts of the dynamic tracker are tried at effort 0, settings of
predictive sampling at effort 1, on songs of the reference data (PIANOMIME_SHARED). The fingering
and the effort were chosen on no song of `pop` and `repertoire`; the tracker long ago on some of
Etude-12 and `modern`, among others. A part is taken out by a setting where there is one that
does it, else by one of the factories below. Songs that were finished are not played again.

A finger that is caught between keys costs a whole song much, and any change may free it. So the
table has the median over all songs beside the mean, and on how many the part helps and harms.

    python benchmarks/ablation.py              # every third song
    python benchmarks/ablation.py --every 1    # all: worth an hour where a few songs leave it open
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from common import ROOT, cores, machine, parser, report, shared, show_machine, table
from pianomime import Performance, Player, Score, evaluate, load_player
from pianomime.players.builtin import ZERO_SHOT_20HZ
from pianomime.players.registry import player_settings
from pianomime.progress import Progress, no_progress
from pianomime.track import Controller, dynamic
from pianomime.track.sampling import rollouts
from pianomime.world import WorldBatch

SETS = {
    "pop": ("pop/test12", 0, 1),
    "modern": ("modern/test12", 0, 1),
    "Etude-12": ("etude12", 0, 1),
    # Every twelfth has had a part in choosing settings.
    "repertoire": ("repertoire", 6, 8),
}
"""Folder of each set, its first file that is played, and how much larger its steps are."""
EVERY = 3
"""Of a set of twelve, every third file is played unless told otherwise."""
SECONDS = 15.0
SAMPLING_SONGS = 2
"""Songs of each set that are played at effort 1."""
NEVER = 1e6
"""A length [m] or speed [m/s] that is not reached."""


@dataclass(frozen=True)
class Part:
    """What is taken out.

    Attributes:
        name: what the table calls it.
        without: how it is taken out.
        settings: of the player without it.
        player: that plays without it.
        effort: at which it is tried.
    """

    name: str
    without: str
    settings: dict[str, Any]
    player: str = ZERO_SHOT_20HZ
    effort: int = 0


def by_settings(name: str, effort: int = 0, **settings: Any) -> Part:
    """A part that settings take out, named "group.field" with "__" for the dot."""
    dotted = {key.replace("__", "."): value for key, value in settings.items()}
    known = player_settings(ZERO_SHOT_20HZ)
    changes = [
        f"{key.partition('.')[2]} {known[key]:g} -> {'never' if value == NEVER else f'{value:g}'}"
        for key, value in dotted.items()
    ]
    return Part(name, ", ".join(changes), dotted, effort=effort)


def parts() -> list[Part]:
    """All parts, in the order of the table."""
    sampling = {
        "half the variations": {"variations": 8},
        "one round": {"rounds": 1},
        "one round of twice as many": {"rounds": 1, "variations": 32},
        "twice the rounds, of half as many": {"rounds": 4, "variations": 8},
        "looking again sooner": {"commit": 8},
        "looking far ahead": {"ahead": 5},
        "smooth variations": {"knots": 1},
        "variations that bend": {"knots": 8},
        "fingers vary": {"joint": 0.0},
        "wrists vary": {"wrist": 0.0},
        "forearms vary": {"slide": 0.0},
        "fingers to blame vary the most": {"blamed": 0.3, "others": 0.3},
        "some of their actuators stay": {"blamed": 1.0},
        "arms of fingers to blame vary": {"arm": 0.0},
        "other fingers vary": {"others": 0.0},
    }
    patched = "ablation:{}".format
    return [
        *(by_settings(name, **{f"planner__{name}": 0.0}) for name in ("drop", "cut", "late")),
        # Nothing times the stretch of keys out of reach, which is infinite, is no number.
        *(by_settings(name, **{f"planner__{name}": 1e-9}) for name in ("stretch", "strain")),
        by_settings("travel", planner__travel_speed=NEVER),
        by_settings("hop", planner__hop_speed=NEVER),
        *(
            by_settings(name, **{f"planner__{name}": 0.0})
            for name in ("reuse", "thumb_on_black", "weak_finger", "crossed")
        ),
        by_settings("beam", planner__beam=1),
        Part("forearm helps", "it does not", {}, patched("without_forearm")),
        by_settings("lift", tracker__astray=NEVER, tracker__sunk=NEVER),
        by_settings("lift of pressing fingers", tracker__astray=NEVER),
        by_settings("lift of idle fingers", tracker__sunk=NEVER),
        by_settings("joint feedback", tracker__joint_feedback=0.0),
        by_settings("fingertip feedback", tracker__tip_feedback=0.0),
        by_settings("press force", tracker__force=0.0),
        Part("feed-forward torque", "none", {}, patched("without_feedforward")),
        Part("predictive sampling", "effort 0", {}, "ablation:without_sampling", 1),
        *(
            by_settings(name, 1, **{f"sampling__{key}": value for key, value in change.items()})
            for name, change in sampling.items()
        ),
        Part("keys that are nearly right", "count as wrong", {}, patched("without_nearly"), 1),
        Part("penalty of blow-ups", "none", {}, patched("without_penalty"), 1),
    ]


class Ablated(Player):
    """The zero-shot player of frames, with a name of a module replaced while it plays."""

    def __init__(self, effort: int, seed: int, module: Any, name: str, instead: Any) -> None:
        self.name, self.effort = ZERO_SHOT_20HZ, effort
        self._player = load_player(ZERO_SHOT_20HZ, effort, seed)
        self._replaced = module, name, instead

    def start(self, score: Score) -> Controller:
        """As that player, without the part where it matters at the start."""
        with patch.object(*self._replaced):
            return self._player.start(score)

    def play(self, score: Score, progress: Progress = no_progress) -> Performance:
        """As that player, without the part."""
        with patch.object(*self._replaced):
            return super().play(score, progress)


def without_forearm(effort: int, seed: int) -> Player:
    """The forearm does not correct what pressing fingers miss alike."""
    return Ablated(effort, seed, dynamic, "shared", lambda error: 0.0)


def without_feedforward(effort: int, seed: int) -> Player:
    """Actuators aim at the wanted joint positions themselves."""
    return Ablated(effort, seed, dynamic, "motion_torque", lambda hand, path: 0.0 * path[1:])


def without_sampling(effort: int, seed: int) -> Player:
    """Predictive sampling does nothing."""
    return load_player(ZERO_SHOT_20HZ, 0, seed)


def without_nearly(effort: int, seed: int) -> Player:
    """A key counts by whether it is pressed, not by how far down it is."""

    class Batch(WorldBatch):
        @property
        def key_state(self) -> NDArray[np.float64]:
            return self.pressed.astype(float)

    return Ablated(effort, seed, rollouts, "WorldBatch", Batch)


def without_penalty(effort: int, seed: int) -> Player:
    """Variations in which the physics breaks cost no more than their keys."""

    class Batch(WorldBatch):
        def __setattr__(self, name: str, value: Any) -> None:
            super().__setattr__(name, _Nothing(value) if name == "blow_ups" else value)

    return Ablated(effort, seed, rollouts, "WorldBatch", Batch)


class _Nothing:
    """Counts that are always 0."""

    def __init__(self, counts: NDArray[np.int64]) -> None:
        self._zeros = np.zeros_like(counts)

    def __getitem__(self, which: Any) -> Any:
        return self._zeros[which]

    def __setitem__(self, which: Any, value: Any) -> None:
        pass

    def __rmul__(self, factor: float) -> NDArray[np.float64]:
        return factor * self._zeros


def files(every: int, songs_each: int | None = None) -> dict[str, list[Path]]:
    """The files of each set."""
    data = shared() / "data"
    return {
        name: sorted((data / folder).glob("*.mid"))[first :: every * share][:songs_each]
        for name, (folder, first, share) in SETS.items()
    }


def measure(part: Part, songs: dict[str, list[Path]], out: Path, jobs: int) -> list[float]:
    """F1 of every song, set after set."""
    paths = [path for each in songs.values() for path in each]
    results = evaluate(
        paths,
        part.player,
        effort=part.effort,
        settings=part.settings,
        seconds=SECONDS,
        jobs=jobs,
        out=out,
    )
    failed = [row for row in results["songs"] if "error" in row]
    if failed:
        raise SystemExit(f"{part.name}: {failed[0]}")
    return [row["f1"] for row in results["songs"]]


def main() -> None:
    """Play, and write the tables."""
    arguments = parser("ablation", __doc__)
    arguments.add_argument("--jobs", type=int, default=len(cores()))
    arguments.add_argument(
        "--every", type=int, default=EVERY, help="1 for whole sets (%(default)s)"
    )
    asked = arguments.parse_args()
    facts = machine()
    show_machine(facts)
    played = {0: files(asked.every), 1: files(asked.every, SAMPLING_SONGS)}
    folder = ROOT / "out" / "benchmarks" / "ablation"

    def f1(part: Part) -> NDArray[np.float64]:
        return np.array(measure(part, played[part.effort], folder, asked.jobs))

    whole = {effort: f1(Part("as it is", "", {}, effort=effort)) for effort in played}
    rows: dict[int, list[list[Any]]] = {0: [], 1: []}
    signed: Callable[[float], str] = "{:+.4f}".format
    for effort, songs in played.items():
        sizes = [len(each) for each in songs.values()]
        sets = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes), strict=True)]
        rows[effort].append(
            [
                "F1 as it is",
                "",
                *(f"{whole[effort][each].mean():.4f}" for each in sets),
                f"{whole[effort].mean():.4f}",
                "",
                f"{np.median(whole[effort]):.4f}",
                "",
            ]
        )
        for part in parts():
            if part.effort == effort:
                worth = whole[effort] - f1(part)
                error = worth.std(ddof=1) / np.sqrt(len(worth))
                means = [signed(worth[each].mean()) for each in sets]
                overall = [signed(worth.mean()), f"{error:.4f}", signed(np.median(worth))]
                count = f"{(worth > 0).sum()} : {(worth < 0).sum()}"
                row = [part.name, part.without, *means, *overall, count]
                rows[effort].append(row)
                print(*row, flush=True)
    for effort, songs in played.items():
        counts = [f"{name} ({len(each)})" for name, each in songs.items()]
        print(f"\nEffort {effort}\n")
        head = ["part", "without it", *counts, "mean", "standard error", "median", "helps : harms"]
        table(head, rows[effort])
    report(asked.output, facts, {"seconds": SECONDS, "effort 0": rows[0], "effort 1": rows[1]})


if __name__ == "__main__":
    main()
