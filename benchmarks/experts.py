"""How well experts play: learning curves, sets of songs within a time, seeds.

    python benchmarks/experts.py curve SONG --total-steps 1000000
    python benchmarks/experts.py set FOLDER --minutes 15
    python benchmarks/experts.py seeds SONG SONG SONG --minutes 15

`curve` trains the `paper` preset and prints F1 over control steps. `set` trains a preset (`best` if
none is named) on every song of a folder, one after the other, each for some minutes on all cores,
and prints for each song its F1 and that of the zero-shot player of frames. `seeds` does that with
several seeds and prints the spread. All resume when started again: minutes that were used before
are counted.
"""

from __future__ import annotations

import json
import statistics
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import common
from pianomime import load_player
from pianomime.learn.expert.config import ExpertConfig, preset_config
from pianomime.learn.expert.expert import train_expert
from pianomime.learn.expert.expert_run import ExpertRun
from pianomime.learn.expert.many import find_experts_songs
from pianomime.plan.demonstration import DemonstrationPlanner


class TimeUpError(Exception):
    """The minutes are used."""


def train(song: Path, out: Path, config: ExpertConfig, seconds: float, minutes: float) -> float:
    """Train until the steps or the minutes are spent; the minutes used in all."""
    clock = out.with_name(out.name + ".minutes")
    used = float(clock.read_text("utf-8")) if clock.exists() else 0.0
    began = time.monotonic()
    told = ""

    def progress(phase: str, done: int, total: int, remark: str = "") -> None:
        nonlocal told
        now = used + (time.monotonic() - began) / 60
        if remark != told:
            told = remark
            print(f"{song.stem}: {done}/{total} steps, {now:.1f} min, {remark}", flush=True)
        if now >= minutes:
            raise TimeUpError

    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        if used < minutes:
            train_expert(song, out, config, seconds=seconds, progress=progress)
    except TimeUpError:
        pass
    finally:
        clock.write_text(str(used + (time.monotonic() - began) / 60), "utf-8")
    return float(clock.read_text("utf-8"))


def row(song: Path, out: Path, minutes: float) -> dict[str, Any]:
    """The F1 of the best expert, and of the zero-shot player of frames on the same excerpt."""
    run = ExpertRun.load(out)
    best = run.best()[1]
    zero_shot = out.with_name(out.name + ".zero-shot")
    if not zero_shot.exists():
        player = replace(
            load_player("zero-shot-20hz"), planner=DemonstrationPlanner(run.demonstration)
        )
        zero_shot.write_text(str(player.play(run.demonstration.score).metrics()["f1"]), "utf-8")
    return {
        "song": song.stem,
        "seed": run.config.seed,
        "f1": best["f1"],
        "precision": best["precision"],
        "recall": best["recall"],
        "zero_shot_f1": float(zero_shot.read_text("utf-8")),
        "steps": run.steps_done,
        "minutes": round(minutes, 1),
    }


def show(rows: list[dict[str, Any]]) -> None:
    common.table(list(rows[0]), [list(one.values()) for one in rows])
    for name in ("f1", "zero_shot_f1"):
        print(f"mean {name}: {statistics.mean(one[name] for one in rows):.4f}")


def main() -> None:
    options = common.parser("experts", __doc__)
    options.add_argument("what", choices=("curve", "set", "seeds"))
    options.add_argument("songs", nargs="+", type=Path)
    options.add_argument("--preset", default=None, help="`paper` for curves, else `best`")
    options.add_argument("--total-steps", type=int, default=None, help="the preset's if not given")
    options.add_argument("--minutes", type=float, default=float("inf"), help="of each run")
    options.add_argument("--seconds", type=float, default=30.0, help="of each song")
    options.add_argument("--seeds", type=int, nargs="+", default=(0, 1, 2), help="for `seeds`")
    options.add_argument("--most", type=int, default=None, help="songs of a folder")
    options.add_argument(
        "--runs", type=Path, default=common.ROOT / "out" / "benchmarks" / "experts", help="folder"
    )
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    name = arguments.preset or ("paper" if arguments.what == "curve" else "best")
    config = preset_config(name)
    if arguments.total_steps is not None:
        config = replace(config, total_steps=arguments.total_steps)
    songs: list[Path] = arguments.songs
    if arguments.what == "set":
        songs = [file for folder in songs for file in find_experts_songs(folder).values()]
    seeds = arguments.seeds if arguments.what == "seeds" else (0,)
    rows = []
    for song in songs[: arguments.most]:
        for seed in seeds:
            out = arguments.runs / f"{song.stem}-{name}-{seed}"
            minutes = train(
                song, out, replace(config, seed=seed), arguments.seconds, arguments.minutes
            )
            rows.append(row(song, out, minutes))
            if arguments.what == "curve":
                for one in ExpertRun.load(out).curve():
                    print(json.dumps(vars(one)))
    show(rows)
    if arguments.what == "seeds":
        for song in songs:
            f1 = [one["f1"] for one in rows if one["song"] == song.stem]
            spread = statistics.stdev(f1) if len(f1) > 1 else 0.0
            print(f"{song.stem}: {statistics.mean(f1):.4f} +- {spread:.4f} over {len(f1)} seeds")
    common.report(arguments.output, facts, {"preset": name, "rows": rows})


if __name__ == "__main__":
    main()
