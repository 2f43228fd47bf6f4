"""Compare players on the same songs, each in processes of its own, and print a table."""

import pianomime

PLAYERS = ("zero-shot", "zero-shot-ik")
SONGS = ("twinkle-twinkle", "bach-prelude-c")
SECONDS = 2.0


def main() -> None:
    print(f"{'player':14} {'F1':>6} {'onset F1':>9} {'times real time':>16}")
    for player in PLAYERS:
        results = pianomime.evaluate(
            SONGS, player=player, effort=0, seconds=SECONDS, out=f"out/compare/{player}"
        )
        mean = results["mean"]
        print(
            f"{player:14} {mean['f1']:6.3f} {mean['onset_f1']:9.3f} {mean['realtime_factor']:16.1f}"
        )


if __name__ == "__main__":
    main()
