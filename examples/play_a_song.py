"""Play a song, say how well it went, and keep what happened: play_a_song.py [SONG.mid]."""

import sys

import pianomime

SONG = sys.argv[1] if len(sys.argv) > 1 else pianomime.songs.path("twinkle-twinkle")
SECONDS = 3.0


def main() -> None:
    score = pianomime.excerpt(pianomime.Score.from_midi(SONG), seconds=SECONDS)
    player = pianomime.load_player("zero-shot", effort=0)
    performance = player.play(score)

    print(f"{score.title}: {len(score)} notes, {score.duration:.1f} s")
    for name, value in performance.metrics().items():
        print(f"  {name:10} {value:.3f}")
    for fault in pianomime.diagnose(performance).faults[:3]:
        print(" ", fault)

    performance.save("performance.npz")  # controls, joints and keys of every frame
    performance.played().to_midi("played.mid")


if __name__ == "__main__":
    main()
