"""Train an expert of one song, plot its learning curve and play with it."""

from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

import pianomime
from pianomime.learn.expert.config import preset_config
from pianomime.learn.expert.expert import train_expert

SONG, SECONDS = "twinkle-twinkle", 1.0
STEPS = 200  # for a good one, leave those of the preset
OUT = Path("out/expert")


def main() -> None:
    config = replace(preset_config("best"), total_steps=STEPS)
    run = train_expert(SONG, OUT, config, seconds=SECONDS)

    curve = run.curve()
    figure = Figure(figsize=(5, 3), layout="constrained")
    axes = figure.add_subplot(xlabel="control steps", ylabel="F1", title=SONG)
    axes.plot([row.steps for row in curve], [row.f1 for row in curve], marker=".")
    figure.savefig(OUT.parent / "expert.png")

    score = pianomime.Score.from_midi(pianomime.songs.path(SONG))
    player = pianomime.load_player(OUT)
    performance = player.play(pianomime.excerpt(score, seconds=SECONDS))
    print(f"F1 {performance.metrics()['f1']:.3f} after {curve[-1].steps} steps: {OUT}")


if __name__ == "__main__":
    main()
