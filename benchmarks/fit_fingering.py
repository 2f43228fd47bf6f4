"""Costs of the fingering search fitted to human fingerings: whether they agree better.

Random search over the costs, each within a factor of four of its default, for the share of notes
with the human's hand and finger, on the first 30 s of every other piece of the fingered repertoire
(PIANOMIME_SHARED names the folder of the reference data). The best costs are then measured on the
other pieces, which had no part in the choice.

    python benchmarks/fit_fingering.py --tries 16
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from functools import partial

import numpy as np

import common
from fingering import Count, Piece, compare, fingered
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.plan.fingering_cost import FingeringConfig

_FACTOR = 4.0
# The costs that decide between fingers; those of lost frames follow from the F1.
_FITTED = (
    "stretch", "strain", "travel_speed", "hop_speed", "reuse", "thumb_on_black", "weak_finger",
    "crossed",
)  # fmt: skip


def beginning(piece: Piece) -> Piece:
    """The first 30 s of a piece."""
    score = piece.score
    keep = score.onset < score.onset.min() + EXCERPT_SECONDS
    part = type(score)(score.key[keep], score.onset[keep], score.offset[keep], score.velocity[keep])
    return Piece(part, piece.hand[keep], piece.finger[keep])


def agreement(pieces: list[Piece], config: FingeringConfig, pool: ProcessPoolExecutor) -> Count:
    """Sum of the counts of all pieces."""
    counts = list(pool.map(partial(compare, config=config), pieces))
    return Count(*(sum(column) for column in zip(*counts, strict=True)))


def main() -> None:
    parser = common.parser("fit_fingering", __doc__)
    parser.add_argument("--tries", type=int, default=16, help="random sets of costs (%(default)s)")
    arguments = parser.parse_args()
    pieces = [beginning(piece) for piece in fingered(common.shared() / "data" / "repertoire")]
    fitted, kept_out = pieces[::2], pieces[1::2]
    facts = common.machine()
    common.show_machine(facts)
    rng = np.random.default_rng(0)
    default = FingeringConfig()
    configs = [default]
    for _ in range(arguments.tries):
        exponents = rng.uniform(-1.0, 1.0, len(_FITTED))
        factors = dict(zip(_FITTED, _FACTOR**exponents, strict=True))
        configs.append(
            replace(default, **{name: getattr(default, name) * factors[name] for name in _FITTED})
        )
    rows = []
    with ProcessPoolExecutor(len(common.cores())) as pool:
        for config in configs:
            found = agreement(fitted, config, pool)
            rows.append((found.same_finger / found.known, config))
        best = max(rows, key=lambda row: row[0])[1]
        table = [
            _row(name, agreement(part, config, pool))
            for config_name, config in (("default", default), ("learned", best))
            for name, part in (
                (f"{config_name}, fitted", fitted),
                (f"{config_name}, kept out", kept_out),
            )
        ]
    common.table(["costs, pieces", "notes", "played", "same hand", "same finger"], table)
    print({name: round(getattr(best, name), 3) for name in _FITTED})
    common.report(arguments.output, facts, {"learned": asdict(best), "rows": table})


def _row(name: str, count: Count) -> list[str | int | float]:
    known = count.known
    shares = (count.played, count.same_hand, count.same_finger)
    return [name, known, *(share / known for share in shares)]


if __name__ == "__main__":
    main()
