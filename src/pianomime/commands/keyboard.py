"""`pianomime keyboard`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class FindKeyboard:
    """Find the keyboard in a picture or a video from above, and name its keys.

    That is what `pianomime retarget` begins with. One line says what was found, and what the
    picture leaves open. Where the camera of a video moves, or it is cut, that takes about as long
    as the video; the line names the second at which keys are where the files say.

    Examples:
      pianomime keyboard PICTURE.jpg --picture SEEN.png
      pianomime keyboard VIDEO.mp4 -o KEYBOARD.json
      pianomime keyboard VIDEO.mp4 --octave 2 --not-mirrored -o KEYBOARD.json
    """

    source: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PICTURE|VIDEO")]
    """A picture or a video of a keyboard from above."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="KEYBOARD.json", help_behavior_hint="")
    ] = None
    """File for where the keys are; by default none is written."""
    picture: Annotated[Path | None, tyro.conf.arg(metavar="OUT.png", help_behavior_hint="")] = None
    """File for the picture with the keys drawn into it; by default none is written."""
    octave: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Octave of the lowest C that is seen, 4 for the middle C; by default it is found out."""
    mirrored: tyro.conf.FlagCreatePairsOff[bool] = False
    """The picture is mirrored; by default that is found out."""
    not_mirrored: tyro.conf.FlagCreatePairsOff[bool] = False
    """The picture is not mirrored."""

    def run(self) -> None:
        """Find it, print what was found, and write the files.

        Raises:
            InputError: the picture cannot be read, or a name of a file has the wrong ending.
            OSError: a file cannot be read or written.
        """
        import json

        from PIL import Image

        from pianomime.commands.extras import extra
        from pianomime.commands.mirrored import mirrored_or_not
        from pianomime.commands.progress import bars
        from pianomime.errors import InputError
        from pianomime.files import atomic
        from pianomime.shown import shown

        with extra("video"):
            from pianomime.video.advice import KEYBOARD
            from pianomime.video.drawing import draw_keys
            from pianomime.video.keyboard.findings import findings
            from pianomime.video.keyboard.search import search_keyboard
            from pianomime.video.remarks import on_naming, on_stretches, on_told_names

        mirrored = mirrored_or_not(self.mirrored, self.not_mirrored)
        for file, ending in ((self.out, ".json"), (self.picture, ".png")):
            if file is None:
                continue
            if file.suffix.lower() != ending:
                raise InputError(f"{file}: its name must end in {ending}")
            if file.resolve() == self.source.resolve():
                raise InputError(f"{file}: would be overwritten; give it another name")
        with bars() as progress:
            searched = search_keyboard(self.source, self.octave, mirrored, progress)
        keyboards = () if searched.view is None else searched.view.namings
        doubtful = False
        if searched.view is None:
            told = (self.octave, mirrored) != (None, None)
            print("no such keyboard found" if told else "no keyboard found")
        else:
            open_names = on_naming(keyboards, KEYBOARD)
            contradicted = on_told_names(keyboards[0].plane, searched.view.untold, KEYBOARD)
            doubtful = bool(open_names or contradicted)
            moving = "" if searched.second is None else f"; at {searched.second:.2f} s"
            doubts = [*open_names, *contradicted, *on_stretches(searched.view, KEYBOARD)]
            said = "; in doubt: ".join(["", *map(str, doubts)])
            print(f"{searched.view.description}{moving}, {keyboards[0].describe_fit()}{said}")
        if self.out is not None:
            self.out.parent.mkdir(parents=True, exist_ok=True)
            height, width = searched.picture.shape[:2]
            found = findings(
                keyboards, (width, height), searched.zoom, not doubtful, searched.second
            )
            with atomic(self.out) as temporary:
                temporary.write_text(json.dumps(found) + "\n", "utf-8")
            print(f"written: {shown(self.out)}")
        if self.picture is not None:
            drawn = searched.picture
            if keyboards:
                drawn = draw_keys(drawn, keyboards[0].plane)
            self.picture.parent.mkdir(parents=True, exist_ok=True)
            with atomic(self.picture) as temporary:
                Image.fromarray(drawn).save(temporary)
            print(f"picture: {shown(self.picture)}")
