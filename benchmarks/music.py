"""What an ear would judge: both protocols on all sets, and what each part of the player is worth.

Plays the first 30 s of the songs of the reference data (PIANOMIME_SHARED names its folder), and
prints tables for docs/results.md. Songs that were finished are not played again, so a run that was
stopped goes on where it was.

    python benchmarks/music.py --players zero-shot:0 zero-shot:1 --lead-in 0 0.5
    python benchmarks/music.py --sets GiantMIDI-100 --players zero-shot:1
    python benchmarks/music.py --players zero-shot:1 --rtf     # on an idle machine
    python benchmarks/music.py --ablate

The set `touch` has pieces whose velocities vary: of the songs of pop and of the first 100 files of
GiantMIDI, the six each whose velocities have the greatest standard deviation in the excerpt.

`--ablate` plays with and without each part of the player, the first 20 s of songs on which settings
may be chosen, and of which none is reported.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from common import ROOT, cores, machine, report, shared, show_machine
from pianomime import Player, Score, evaluate, excerpt, load_player
from pianomime.errors import InputError
from pianomime.evaluation.mean import mean
from pianomime.evaluation.measures import FRAMES, MUSIC, Measure
from pianomime.evaluation.summary import ROW_SCHEMA, Row
from pianomime.file_names import file_name
from pianomime.files import atomic
from pianomime.plan import FingertipPlan, Planner
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.players import PlannedPlayer
from pianomime.shown import markdown_cell
from pianomime.world_names import PAPER, WORLDS

SECONDS = 30.0
LEAD_IN = 0.5
"""[s] Time in which the hands get to their first keys, for all that is not the paper's protocol."""

SETS = {
    "modern": ("modern/test12", None),
    "Etude-12": ("etude12", None),
    "pop": ("pop/test12", None),
    "GiantMIDI": ("giantmidi", 12),
    "GiantMIDI-100": ("giantmidi", 100),
}
"""Folder of each set, and how many of its files it has, in the order of their names."""
TOUCH = "touch"
TOUCH_SETS, TOUCH_SONGS = ("pop", "GiantMIDI-100"), 6
"""The set of pieces whose velocities vary: so many songs of each of these."""
DEFAULT_SETS = ("modern", "Etude-12", "pop", "GiantMIDI", TOUCH)

ALONE = ("modern/test12/clip061.mid", "etude12/PartitaNo26.mid", "pop/test12/pop310.mid")
"""Songs whose real-time factor is measured."""

DEVELOPMENT = {
    "pop": ("pop/train", slice(0, None, 32), 3),
    "GiantMIDI": ("giantmidi", slice(100, None, 400), 2),
    "repertoire": ("repertoire", slice(0, None, 48), 2),
}
"""Folder of songs on which settings may be chosen, which of its files, and how many at most."""
DEVELOPMENT_SECONDS = 20.0

CHORDS_WANTED = Measure(
    "chord spread in the score, p90 [ms]", "music.chord_spread_wanted_p90_ms", "{:.0f}"
)
MEASURES = (*MUSIC, CHORDS_WANTED, FRAMES[0])
"""Rows of a table that are means over songs."""
COUNTS = (
    ("left out by the planner", "dropped_notes", "notes"),
    ("never struck: melody", "music.melody.never_struck", "music.melody.notes"),
    ("never struck: bass", "music.bass.never_struck", "music.bass.notes"),
    ("never struck: inner voices", "music.inner.never_struck", "music.inner.notes"),
)
"""Rows that count notes of all songs together: label, name of the count, name of the whole."""

_BY_NAME = {measure.name: measure for measure in MEASURES}


@dataclass(frozen=True)
class Goal:
    """A number that is aimed at.

    Attributes:
        measure: name of the measure.
        song_set: the set on which it counts.
        least: what it should be at least; at most, where less is better.
        aim: what is hoped for.
    """

    measure: str
    song_set: str
    least: float
    aim: float

    def verdict(self, value: float) -> str:
        """How a value compares."""
        sign = 1 if self.aim > self.least else -1
        return next(
            (
                word
                for word, bound in (("aim reached", self.aim), ("reached", self.least))
                if sign * value >= sign * bound
            ),
            "missed",
        )


GOALS = (
    Goal("music.note_f1_50", "modern", 0.96, 0.98),
    Goal("music.note_f1_50", "Etude-12", 0.93, 0.96),
    Goal("music.note_f1_50", "pop", 0.92, 0.95),
    Goal("music.note_f1_50", "GiantMIDI", 0.85, 0.90),
    Goal("music.note_f1_25", "modern", 0.92, 0.97),
    Goal("music.note_f1_25", "Etude-12", 0.88, 0.94),
    Goal("music.velocity_f1", TOUCH, 0.50, 0.75),
    Goal("music.phantoms_per_minute", "modern", 4, 1),
    Goal("music.phantoms_per_minute", "Etude-12", 8, 3),
    *(Goal("music.chord_spread_p90_ms", name, 20, 12) for name in DEFAULT_SETS),
    *(Goal("music.restruck", name, 0.95, 0.99) for name in DEFAULT_SETS),
    Goal("f1", "modern", 0.975, 0.985),
    Goal("f1", "Etude-12", 0.95, 0.965),
    Goal("f1", "pop", 0.935, 0.955),
)


@dataclass(frozen=True)
class Playing:
    """A player as it is asked to play.

    Attributes:
        player: as `load_player` takes it.
        effort: how hard it tries, 0 to 3.
        lead_in: silence before the first note [s].
        settings: of the player.
        world: name of the world.
    """

    player: str
    effort: int
    lead_in: float = LEAD_IN
    settings: dict[str, Any] = field(default_factory=dict)
    world: str = PAPER

    @property
    def name(self) -> str:
        """For headings."""
        lead_in = f"lead-in {self.lead_in:g} s" if self.lead_in else "no lead-in"
        return f"{self.player}, effort {self.effort}, {lead_in}, world {self.world}"

    def rows(
        self, songs: Sequence[Path], seconds: float, jobs: int, out: Path | None
    ) -> dict[Path, Row]:
        """Play songs; the row of each, as `evaluate` has it."""
        results = evaluate(
            songs,
            self.player,
            effort=self.effort,
            settings=self.settings,
            seconds=seconds,
            lead_in=self.lead_in,
            world=self.world,
            jobs=jobs,
            out=out,
            progress=_tell,
        )
        return dict(zip(songs, results["songs"], strict=True))


@dataclass(frozen=True)
class Ablation:
    """What is taken out of the player.

    Attributes:
        part: what the table calls it.
        without: how it is taken out.
        change: what of the full `Playing` changes.
    """

    part: str
    without: str
    change: dict[str, Any]

    def playing(self) -> Playing:
        """The full player without the part."""
        return replace(FULL, **self.change)


FULL = Playing("zero-shot", 1)
_FRAME_COSTS = {
    f"planner.fingering.{name}": value for name, value in asdict(FingeringConfig()).items()
}
ABLATIONS = (
    Ablation("controls finer than a frame", "one a frame", {"settings": {"tracker.controls": 1}}),
    Ablation("rehearsal", "none", {"settings": {"rehearsal.passes": 0}}),
    # A single variation is the controls as they are.
    Ablation("search", "none", {"settings": {"sampling.variations": 1}}),
    Ablation("rehearsal and search", "effort 0", {"effort": 0}),
    Ablation("touch", "one velocity for all notes", {"player": "music:one_velocity"}),
    Ablation("fingering where notes count", "where frames count", {"settings": _FRAME_COSTS}),
    Ablation("lead-in", "none", {"lead_in": 0.0}),
    Ablation("all of these", "the player of the paper's protocol", {"player": "zero-shot-20hz"}),
)
ABLATION_MEASURES = (
    "music.note_f1_50",
    "music.note_f1_25",
    "music.velocity_f1",
    "music.phantoms_per_minute",
    "music.restruck",
    "music.chord_spread_p90_ms",
    "f1",
)
_JUDGE = ABLATION_MEASURES[0]
"""Says whether a part helps or harms a song."""


def one_velocity(effort: int, seed: int) -> Player:
    """The zero-shot player, which strikes all keys of a piece alike: with their median velocity."""
    player = load_player("zero-shot", effort, seed)
    assert isinstance(player, PlannedPlayer)
    return replace(player, planner=_OneVelocity(player.planner))


@dataclass(frozen=True)
class _OneVelocity:
    """Plans a score as if all its velocities were the same."""

    planner: Planner

    def plan(self, score: Score) -> FingertipPlan:
        same = np.full_like(score.velocity, round(float(np.median(score.velocity))))
        return self.planner.plan(replace(score, velocity=same))


def playing_of(text: str, lead_in: float = LEAD_IN) -> Playing:
    """A player from "PLAYER:EFFORT".

    Raises:
        argparse.ArgumentTypeError: it is something else.
    """
    player, _, effort = text.rpartition(":")
    if not player or effort not in ("0", "1", "2", "3"):
        raise argparse.ArgumentTypeError(f"must be PLAYER:EFFORT, such as zero-shot:1, not {text}")
    return Playing(player, int(effort), lead_in)


def songs_of(name: str) -> list[Path]:
    """The files of a set."""
    if name == TOUCH:
        return [
            song
            for each in TOUCH_SETS
            for song in sorted(songs_of(each), key=velocity_spread, reverse=True)[:TOUCH_SONGS]
        ]
    folder, most = SETS[name]
    return sorted((shared() / "data" / folder).glob("*.mid"))[:most]


@cache
def velocity_spread(song: Path) -> float:
    """Standard deviation of the velocities of the excerpt that is played."""
    return float(excerpt(Score.from_midi(song), seconds=SECONDS).velocity.std())


def development_songs() -> list[Path]:
    """Songs on which settings may be chosen."""
    data = shared() / "data"
    return [
        song
        for folder, which, most in DEVELOPMENT.values()
        for song in sorted((data / folder).glob("*.mid"))[which][:most]
    ]


def at(row: Row, name: str) -> Any:
    """A value of a row, by the name of a `Measure`."""
    value: Any = row
    for part in name.split("."):
        value = value[part]
    return value


def means(rows: Sequence[Row]) -> tuple[Row, Row]:
    """Means of rows, and of how many songs each of them is."""
    numbers = {name: schema for name, schema in ROW_SCHEMA.items() if name != "effort"}
    made = mean(rows, numbers)
    return made.value, made.songs


def music_table(sets: dict[str, list[Row]]) -> list[str]:
    """Markdown: a row for each measure, a column for each set.

    A mean of fewer songs than the set has, because there was nothing to measure in the others, says
    of how many. Songs that failed are counted in the last row.

    Args:
        sets: rows of `evaluate`, by the name of the set.
    """
    good = {name: [row for row in rows if "error" not in row] for name, rows in sets.items()}
    if not all(good.values()):
        raise SystemExit(f"all songs of a set failed: {_failures(sets)[0]}")
    mean_of = {name: means(rows) for name, rows in good.items()}

    def mean_cell(measure: Measure, name: str) -> str:
        value, count = mean_of[name]
        measured, songs = at(count, measure.name), len(good[name])
        # Of a list of numbers, all are of the same songs.
        of = f" ({measured} of {songs})" if measured < songs else ""
        return measure.show(value) + of

    def count_cell(part: str, whole: str, name: str) -> str:
        some = sum(at(row, part) for row in good[name])
        notes = sum(at(row, whole) for row in good[name])
        return f"{some} of {notes} ({some / max(notes, 1):.1%})"

    body = [
        *([measure.label, *(mean_cell(measure, name) for name in sets)] for measure in MEASURES),
        *([label, *(count_cell(*names, name) for name in sets)] for label, *names in COUNTS),
    ]
    if _failures(sets):
        body.append(["failed", *(str(len(sets[name]) - len(good[name])) for name in sets)])
    return markdown_lines(["", *(f"{name} ({len(rows)})" for name, rows in sets.items())], body)


def goals_table(sets: dict[str, list[Row]]) -> list[str]:
    """Markdown: what is aimed at, and whether it is reached; nothing of sets that were not played.

    Args:
        sets: rows of `evaluate`, by the name of the set.
    """
    body = []
    for goal in GOALS:
        rows = [row for row in sets.get(goal.song_set, []) if "error" not in row]
        if not rows:
            continue
        measure, (value, _) = _BY_NAME[goal.measure], means(rows)
        found = at(value, goal.measure)
        body.append(
            [
                measure.label,
                goal.song_set,
                measure.show(value),
                f"{goal.least:g}",
                f"{goal.aim:g}",
                "not measured" if found is None else goal.verdict(found),
            ]
        )
    return markdown_lines(["", "set", "measured", "target", "aim", "verdict"], body)


def ablation_table(full: list[Row], without: dict[str, tuple[str, list[Row]]]) -> list[str]:
    """Markdown: means of the full player, then means without each part, and how they differ.

    Differences are of the songs in which both could be measured.

    Args:
        full: rows of the full player.
        without: rows of the same songs, by part, as (how it is taken out, rows).
    """
    measures = [_BY_NAME[name] for name in ABLATION_MEASURES]
    whole, _ = means(full)
    body = [["all of it", "", *(measure.show(whole) for measure in measures), ""]]
    for part, (how, rows) in without.items():
        value, _ = means(rows)
        cells = []
        for measure in measures:
            pairs = [
                (at(less, measure.name), at(more, measure.name))
                for less, more in zip(rows, full, strict=True)
            ]
            changes = [less - more for less, more in pairs if None not in (less, more)]
            form = measure.form.replace("{:", "{:+")
            change = f" ({form.format(np.mean(changes))})" if changes else ""
            cells.append(measure.show(value) + change)
        worth = [at(more, _JUDGE) - at(less, _JUDGE) for less, more in zip(rows, full, strict=True)]
        count = f"{sum(each > 0 for each in worth)} : {sum(each < 0 for each in worth)}"
        body.append([part, how, *cells, count])
    head = ["part", "without it", *(measure.label for measure in measures), "helps : harms"]
    return markdown_lines(head, body)


def markdown_lines(head: Sequence[str], body: Sequence[Sequence[str]]) -> list[str]:
    """A Markdown table: words to the left, columns that begin with a number to the right."""
    right = [
        all(row[column][:1] in "-+0123456789" for row in body) and any(row[column] for row in body)
        for column in range(len(head))
    ]
    rules = ["---:" if each else "---" for each in right]
    return [f"| {' | '.join(line)} |" for line in (head, rules, *body)]


def _failures(sets: dict[str, list[Row]]) -> list[str]:
    return [
        f"{row['song']}: {row['error']}" for rows in sets.values() for row in rows if "error" in row
    ]


def _tell(phase: str, done: int, total: int, remark: str = "") -> None:
    print(f"  {done} of {total} {phase}, {remark}", file=sys.stderr, flush=True)


def play_sets(playings: list[Playing], sets: dict[str, list[Path]], jobs: int, out: Path) -> Row:
    """Both protocols on all sets; prints the tables, and returns the rows of all songs."""
    # A song of two sets is played once.
    songs = list(dict.fromkeys(song for each in sets.values() for song in each))
    results: Row = {}
    lines: list[str] = []
    for playing in playings:
        print(f"{playing.name}: {len(songs)} songs", file=sys.stderr)
        rows = playing.rows(songs, SECONDS, jobs, out / file_name(playing.name))
        played = {name: [rows[song] for song in each] for name, each in sets.items()}
        results[playing.name] = played
        made = ["", f"### {playing.name}", "", *music_table(played), "", *goals_table(played)]
        made += [f"- failed: {markdown_cell(each)}" for each in dict.fromkeys(_failures(played))]
        print(*made, sep="\n", flush=True)
        lines += made
    _write(out / "music.md", lines)
    return results


def play_alone(playings: list[Playing]) -> Row:
    """How much faster than real time songs are played, one at a time."""
    songs = [shared() / "data" / each for each in ALONE]
    results: Row = {}
    body = []
    for playing in playings:
        # Without a folder nothing is reused: what was played beside others is slower.
        rows = list(playing.rows(songs, SECONDS, 1, None).values())
        _require(rows)
        factors = [row["realtime_factor"] for row in rows]
        results[playing.name] = dict(zip(ALONE, factors, strict=True))
        body.append([playing.name, *(f"{factor:.1f}" for factor in factors)])
    head = [f"real-time factor, {len(cores())} cores", *(song.stem for song in songs)]
    print(*markdown_lines(head, body), sep="\n")
    return results


def play_ablations(jobs: int, out: Path, most: int | None) -> Row:
    """What each part of the player is worth."""
    # A setting that is not there is told now, not after hours.
    for ablation in ABLATIONS:
        playing = ablation.playing()
        try:
            load_player(playing.player, playing.effort, world=playing.world, **playing.settings)
        except InputError as error:
            raise SystemExit(f"without {ablation.part}: {error}") from None
    songs = development_songs()[:most]

    def rows(playing: Playing) -> list[Row]:
        made = list(playing.rows(songs, DEVELOPMENT_SECONDS, jobs, out / "ablation").values())
        _require(made)
        return made

    full = rows(FULL)
    without: dict[str, tuple[str, list[Row]]] = {}
    for ablation in ABLATIONS:
        print(f"without {ablation.part}", file=sys.stderr)
        without[ablation.part] = ablation.without, rows(ablation.playing())
        # What there is so far.
        _write(out / "ablation.md", ablation_table(full, without))
    print(*ablation_table(full, without), sep="\n")
    return {"full": full, **{part: played for part, (_, played) in without.items()}}


def _require(rows: list[Row]) -> None:
    failed = [row for row in rows if "error" in row]
    if failed:
        raise SystemExit(f"{failed[0]['song']}: {failed[0]['error']}")


def _write(path: Path, lines: list[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def options() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument(
        "--players",
        nargs="+",
        type=playing_of,
        default=[FULL],
        metavar="PLAYER:EFFORT",
        help="who plays (zero-shot:1)",
    )
    made.add_argument(
        "--lead-in",
        nargs="+",
        type=float,
        default=[LEAD_IN],
        metavar="SECONDS",
        help="silence before the first note; each player plays with each (%(default)s)",
    )
    made.add_argument(
        "--worlds",
        nargs="+",
        choices=WORLDS,
        default=[PAPER],
        help="where; each player plays in each (%(default)s)",
    )
    made.add_argument(
        "--sets", nargs="+", choices=[*SETS, TOUCH], default=DEFAULT_SETS, help="what is played"
    )
    made.add_argument(
        "--songs",
        type=int,
        help="as a trial: the first so many songs of each set (of all, to ablate)",
    )
    made.add_argument("--jobs", type=int, default=len(cores()), help="processes (%(default)s)")
    made.add_argument(
        "--out",
        type=Path,
        default=ROOT / "out" / "benchmarks" / "music",
        help="folder for tables and finished songs (%(default)s)",
    )
    other = made.add_mutually_exclusive_group()
    other.add_argument(
        "--rtf", action="store_true", help="measure how fast three songs are played alone"
    )
    other.add_argument(
        "--ablate", action="store_true", help="measure what each part of the player is worth"
    )
    return made


def main() -> None:
    """Play, print the tables, and write them."""
    asked = options().parse_args()
    facts = machine()
    show_machine(facts)
    playings = [
        replace(playing, lead_in=lead_in, world=world)
        for playing in asked.players
        for lead_in in asked.lead_in
        for world in asked.worlds
    ]
    if asked.rtf:
        name, results = "rtf", play_alone(playings)
    elif asked.ablate:
        name, results = "ablation", play_ablations(asked.jobs, asked.out, asked.songs)
    else:
        sets = {name: songs_of(name)[: asked.songs] for name in asked.sets}
        name, results = "music", play_sets(playings, sets, asked.jobs, asked.out)
    report(asked.out / f"{name}.json", facts, results)


if __name__ == "__main__":
    main()
