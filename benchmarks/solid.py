"""Whether the physics of a world ever breaks, and whether the limits of the solid world hold.

Plays random scores, whose notes are anywhere on the keyboard and too many for ten fingers, and
MIDI files if any are named. Each is played in one pass (effort 0) and watched at every physics
step. A break is counted (`blow_ups`); so is every frame in which hands or fingers of a hand are
inside each other by over 1 mm. Maxima are those of all scores. All controls are then played again
in both worlds, in turns: `speed` is how many steps the world makes in the CPU time of one of the
paper's.

    python benchmarks/solid.py --scores 1000
    python benchmarks/solid.py --scores 0 FOLDER/*.mid
    python benchmarks/solid.py --scores 10 --world paper
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import common
from pianomime import Performance, Score, excerpt, load_player
from pianomime.keyboard import KEYS
from pianomime.players.body import BodyMetrics, body_metrics
from pianomime.world import World
from pianomime.world_names import PAPER, WORLDS

_NOTES_A_SECOND = 20.0
_LONGEST = 1.0
"""[s] Of a random note."""
_MAXIMA = (
    *("hands_overlap_max", "fingers_overlap_max", "rail_speed_max", "rail_force_max"),
    *("rail_acceleration_max", "joint_speed_max"),
)


def random_score(seed: int, seconds: float) -> Score:
    """Notes at random times, on keys of a part of the keyboard that is drawn as well."""
    draw = np.random.default_rng(seed)
    count = int(draw.integers(1, int(_NOTES_A_SECOND * seconds)))
    low, high = np.sort(draw.integers(0, KEYS, 2))
    onset = np.sort(draw.uniform(0.0, seconds, count))
    return Score(
        key=draw.integers(low, high + 1, count),
        onset=onset,
        offset=onset + draw.uniform(0.01, _LONGEST, count),
        velocity=draw.integers(1, 128, count),
        title=f"random {seed}",
    )


def scores(count: int, songs: list[Path], seconds: float) -> Iterator[Score]:
    """Random scores, then the songs."""
    for seed in range(count):
        yield random_score(seed, seconds)
    for song in songs:
        yield excerpt(Score.from_midi(song), seconds=seconds)


def replay_seconds(performance: Performance, world_name: str) -> float:
    """CPU seconds that the controls of a performance take in a world."""
    world = World(world_name, quiet=True)
    began = time.process_time()
    for ctrl in performance.ctrl:
        world.step(ctrl)
    return time.process_time() - began


def main() -> None:
    parser = common.parser("solid", __doc__)
    parser.add_argument("songs", nargs="*", type=Path, metavar="SONG.mid")
    parser.add_argument("--scores", type=int, default=20, metavar="N", help="random scores")
    parser.add_argument("--seconds", type=float, default=5.0, metavar="S", help="of each")
    parser.add_argument("--world", choices=WORLDS, default="solid")
    options = parser.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    player = load_player("zero-shot", 0, world=options.world)
    total = options.scores + len(options.songs)
    frames = blow_ups = 0
    overlaps = dict.fromkeys(("hands_overlap", "fingers_overlap"), 0.0)
    maxima = dict.fromkeys(_MAXIMA, 0.0)
    seconds = dict.fromkeys((PAPER, options.world), 0.0)
    for number, score in enumerate(scores(options.scores, options.songs, options.seconds), 1):
        performance = player.play(score)
        body = body_metrics(performance)
        if body.invalid:
            raise SystemExit(f"{score.title}: could not be measured: {body.invalid}")
        frames, blow_ups = frames + len(performance), blow_ups + len(performance.blow_ups)
        for name in overlaps:
            overlaps[name] += _number(body, name) * len(performance)
        for name in maxima:
            maxima[name] = max(maxima[name], _number(body, name))
        for name in seconds:
            seconds[name] += replay_seconds(performance, name)
        if number % 10 == 0 or number == total or len(performance.blow_ups):
            print(f"{number}/{total}: {_told(performance)}, {blow_ups} blow-ups so far", flush=True)
    shares = {name: value / max(frames, 1) for name, value in overlaps.items()}
    counts = {"scores": total, "frames": frames, "blow_ups": blow_ups}
    speed = seconds[PAPER] / seconds[options.world]
    results = {**counts, **shares, **maxima, "speed": speed}
    common.table(["", options.world], [[name, value] for name, value in results.items()])
    common.report(options.output, facts, {"world": options.world, **results})


def _told(performance: Performance) -> str:
    return f"{performance.score.title!r} ({len(performance.blow_ups)} blow-ups)"


def _number(body: BodyMetrics, name: str) -> float:
    """A metric, 0 where there was nothing to measure."""
    value = getattr(body, name)
    return 0.0 if value is None else float(value)


if __name__ == "__main__":
    main()
