"""Files of music that are no MIDI files, and what makes MIDI or a demonstration of each kind."""

from __future__ import annotations

from pathlib import Path

from pianomime.shown import command_word

_SOUND = (".mp3", ".wav", ".flac", ".ogg", ".oga", ".opus", ".m4a", ".aac", ".aif", ".aiff", ".wma")
_VIDEO = (".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi")
_MUSESCORE = (".mscz", ".mscx", ".mxl", ".musicxml", ".xml")
"""Of MuseScore, and MusicXML, which it opens; so does it the next ones, of Guitar Pro."""
_GUITAR_PRO = (".gp", ".gp3", ".gp4", ".gp5", ".gpx", ".gtp")
_PICTURE = (".pdf", ".png", ".jpg", ".jpeg", ".tif", ".tiff")

_MUSIC = {
    **dict.fromkeys(_SOUND, "`pianomime transcribe {file}` makes MIDI of a recording of a piano"),
    **dict.fromkeys(
        _VIDEO,
        "`pianomime retarget {file}` makes a demonstration of a video of a person who plays, "
        "filmed from above, and `pianomime transcribe {file}` makes MIDI of its sound, or of "
        "keys that light up in it",
    ),
    **dict.fromkeys(
        _MUSESCORE + _GUITAR_PRO,
        "export MIDI in MuseScore (File > Export, or `mscore -o {midi} {file}`)",
    ),
    ".sib": "export MIDI in Sibelius (File > Export > MIDI)",
    ".abc": "`abc2midi {file} -o {midi}` makes MIDI of it",
    ".ly": r"put `\midi {{ }}` into its \score block, and `lilypond {file}` writes MIDI",
}
_ADVICE = {
    **_MUSIC,
    **dict.fromkeys(
        _PICTURE,
        "a score in pictures must be read by a tool like Audiveris first, whose MusicXML MuseScore "
        "exports as MIDI",
    ),
}


def advice(path: Path) -> str:
    """What a user of a file of another kind should do instead, as a part of a sentence.

    Args:
        path: of the file, whose suffix decides; upper and lower case count as equal.

    Returns:
        Such as "`abc2midi song.abc -o song.mid` makes MIDI of it"; "" for MIDI files, and for
        kinds of files that are not known to hold music.
    """
    text = _ADVICE.get(path.suffix.lower(), "")
    # The MIDI file is named without its folder: it may be one that cannot be written.
    return text.format(file=command_word(path), midi=command_word(f"{path.stem}.mid"))


def is_recording(path: Path) -> bool:
    """Whether a file is sound or a video by its suffix, upper and lower case alike."""
    return path.suffix.lower() in (*_SOUND, *_VIDEO)


def is_music(path: Path) -> bool:
    """Whether a file is of another kind that holds music for sure, unlike pictures."""
    return path.suffix.lower() in _MUSIC
