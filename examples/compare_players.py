"""Compare players on the same songs, each in processes of its own, and print a table."""

import pianomime

PLAYERS = ("zero-shot", "zero-shot-ik")
SONGS = ("twinkle-twinkle", "bach-prelude-c")
SECONDS = 2.0


def main() -> None:
    print(f"{'player':14} {'note F1':>8} {'phantoms a minute':>18} {'frame F1':>9}")
    for player in PLAYERS:
        results = pianomime.evaluate(
            SONGS, player=player, effort=0, seconds=SECONDS, out=f"out/compare/{player}"
        )
        mean = results["mean"]
        music = mean["music"]
        print(
            f"{player:14} {music['note_f1_50']:8.3f} {music['phantoms_per_minute']:18.1f} "
            f"{mean['f1']:9.3f}"
        )


if __name__ == "__main__":
    main()
