"""`python -m pianomime.songs` writes the bundled MIDI files from their notation."""

from pathlib import Path

from pianomime.songs.notation import SONGS, to_score

for name, song in SONGS.items():
    file = Path(__file__).parent / f"{name}.mid"
    to_score(song).to_midi(file)
    print(file)
