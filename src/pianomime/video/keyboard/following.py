"""Following: where the keyboard is in each frame of a film whose camera moves, or that is cut.

A stretch is what one camera shows. Its keyboard is found once, and from then on compared with every
frame, also after other pictures have come between. Where none of the keyboards known so far is
seen, another one is looked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pianomime.keyboard import FRAME_RATE
from pianomime.progress import Progress
from pianomime.short_repr import short_repr
from pianomime.video.film.background import median_of
from pianomime.video.film.film import Film
from pianomime.video.keyboard.keyboard import Keyboard, find_keyboards
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.registration import Pyramid, Template
from pianomime.world.parameters import key_centres

_ALIKE = 0.7
"""Likeness from which on a keyboard is the one that was seen before."""
_SURELY = 0.93
"""Likeness from which on it is certainly where it was found. What shakes by 8 pixels from frame to
frame may be found askew with 0.9, where it is in truth with 0.96."""
_STILL = 0.003
"""[m] Movement of keys that is none: an eighth of the width of a white key."""
_STILL_SHARE = 0.9
"""Least share of pictures in which the keyboard of a camera that does not move is seen."""
_LEAVING = 0.6
"""Share of a template in the picture below which another one is taken."""
_MOST_STRETCHES = 8
"""Most stretches that are compared with a picture: those seen last. Earlier ones are done."""
_PICTURES = 15
"""Most pictures of which the background of a stretch is made."""
_SHORTEST = 1.0
"""[s] Stretches in which the keyboard is seen for less are left out."""
_WAIT, _LONGEST_WAIT = 0.5, 8.0
"""[s] Time after which a keyboard is looked for again where there was none; it doubles each time,
up to the second."""
_AFTER_CUT = 1 / 8
"""Part of that time after which a keyboard is looked for again after a cut."""
_OTHER = 0.06
"""Mean difference of brightness, 0..1, from one frame to the next from which on there is a cut."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Frames in which one keyboard is seen.

    Attributes:
        frames: (n,) int64 their numbers, ascending.
        moved: (n, 3, 3) homography of pixels (column, row, 1) to each frame, from `background`.
        background: (height, width, 3) uint8, what most of the frames show, without hands, as seen
            in the first one.
        keyboards: those in the first frame, with hands, as `find_keyboards` gives them.
    """

    frames: NDArray[np.int64]
    moved: NDArray[np.float64]
    background: NDArray[np.uint8]
    keyboards: tuple[Keyboard, ...]

    __repr__ = short_repr


def stands_still(
    pictures: list[NDArray[np.uint8]], background: NDArray[np.float32], plane: Plane
) -> bool:
    """Whether the keyboard is in the same place in nearly all pictures of a film.

    Args:
        pictures: (height, width, 3) uint8 each, from all of the film.
        background: (height, width) brightness, 0..1, what most of them show.
        plane: of the keyboard in it.
    """
    template = Template(Pyramid(np.asarray(background * 255, np.uint8)), plane)
    keys = plane.to_pixels(key_centres()[:, :2])
    keys = keys[((keys > 0) & (keys < background.shape[::-1])).all(axis=1)]
    places = plane.to_world(keys)
    seen = 0
    for picture in pictures:
        found = template.find(Pyramid(picture), np.eye(3))
        if found is None or found.likeness < _ALIKE:
            continue
        moved = plane.to_world(Plane(found.matrix).to_world(keys))
        if np.abs(moved - places).max() > _STILL:
            return False
        seen += 1
    return seen >= _STILL_SHARE * len(pictures)


def follow_keyboard(film: Film, most: int, progress: Progress) -> tuple[list[Stretch], int]:
    """Follow the keyboard through a film, at 20 Hz.

    Args:
        film: the film.
        most: number of frames after which it ends.
        progress: called in the phase "keyboard".

    Returns:
        The stretches in which a keyboard is seen, in order of their first frames, and the number of
        frames of the film.
    """
    number = -1
    known: list[_Camera] = []
    done: list[Stretch] = []
    search = _Search()
    total = round(film.seconds * FRAME_RATE)
    for number, frame in enumerate(islice(film.frames(FRAME_RATE), most)):
        progress("keyboard", number + 1, max(total, number + 1))
        pyramid = Pyramid(frame.picture)
        due = search.is_due(number, pyramid)
        for camera in known:
            if camera.sees(number, frame.picture, pyramid):
                # Those seen last are compared first.
                known.remove(camera)
                known.insert(0, camera)
                break
        else:
            if due:
                keyboards = find_keyboards(median_of([frame.picture]))
                search.done(number, bool(keyboards))
                if keyboards:
                    camera = _Camera(tuple(keyboards), pyramid)
                    camera.add(number, frame.picture, np.eye(3))
                    known.insert(0, camera)
                    # To save memory: a film may have hundreds of cuts.
                    done += [camera.stretch() for camera in known[_MOST_STRETCHES:] if camera.lasts]
                    del known[_MOST_STRETCHES:]
    stretches = done + [camera.stretch() for camera in known if camera.lasts]
    return sorted(stretches, key=lambda stretch: int(stretch.frames[0])), number + 1


@dataclass
class _Search:
    """When to look for a keyboard, where none is seen: it takes long."""

    due: float = 0.0
    wait: float = _WAIT
    soonest: float = 0.0
    before: NDArray[np.float32] | None = None

    def is_due(self, frame: int, pyramid: Pyramid) -> bool:
        """Whether it is time, or there was a cut; never soon after the last search.

        Args:
            frame: its number; each is asked for once, in order.
            pyramid: the frame.
        """
        before, self.before = self.before, pyramid.levels[0]
        if before is not None and np.abs(pyramid.levels[0] - before).mean() > _OTHER:
            self.due = min(self.due, max(frame, self.soonest))
        return frame >= self.due

    def done(self, frame: int, found: bool) -> None:
        """Note that a picture was looked at."""
        self.soonest = frame + _AFTER_CUT * self.wait * FRAME_RATE
        self.due = frame + self.wait * FRAME_RATE
        self.wait = _WAIT if found else min(2 * self.wait, _LONGEST_WAIT)


@dataclass
class _Camera:
    """A stretch while it grows.

    Attributes:
        keyboards: in its first frame, in each way to name the keys.
        first: that frame.
        frames: the frames so far.
        moved: for each the homography of pixels from the first.
        pictures: some of the frames, with their homographies.
    """

    keyboards: tuple[Keyboard, ...]
    first: Pyramid
    frames: list[int] = field(default_factory=list)
    moved: list[NDArray[np.float64]] = field(default_factory=list)
    pictures: list[tuple[NDArray[np.uint8], NDArray[np.float64]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._template = Template(self.first, self.keyboards[0].plane)
        self._base = np.eye(3)
        self._step = 1

    @property
    def lasts(self) -> bool:
        """Whether it has been seen for long enough."""
        return len(self.frames) >= _SHORTEST * FRAME_RATE

    def sees(self, frame: int, picture: NDArray[np.uint8], pyramid: Pyramid) -> bool:
        """Whether a frame shows its keyboard; if so, it is added."""
        last = self.moved[-1]
        best = self._template.find(pyramid, last @ np.linalg.inv(self._base))
        if (
            (best is None or best.likeness < _SURELY)
            and len(self.moved) > 1
            and self.frames[-1] == frame - 1
        ):
            # It may have moved as it did before.
            guess = last @ np.linalg.inv(self.moved[-2]) @ last
            other = self._template.find(pyramid, guess @ np.linalg.inv(self._base))
            if best is None or (other is not None and other.likeness > best.likeness):
                best = other
        if best is None or best.likeness < _ALIKE:
            return False
        self.add(frame, picture, best.matrix @ self._base)
        if best.visible < _LEAVING:
            self._base = self.moved[-1]
            seen = Plane(self.keyboards[0].plane.matrix @ np.linalg.inv(self._base))
            self._template = Template(pyramid, seen)
        return True

    def add(self, frame: int, picture: NDArray[np.uint8], moved: NDArray[np.float64]) -> None:
        """Add a frame."""
        if len(self.frames) % self._step == 0:
            if len(self.pictures) == _PICTURES:
                self.pictures = self.pictures[::2]
                self._step *= 2
            if len(self.frames) % self._step == 0:
                self.pictures.append((picture, moved))
        self.frames.append(frame)
        self.moved.append(moved)

    def stretch(self) -> Stretch:
        """All of it."""
        first = self.pictures[0][0]
        steady = [_steady(picture, moved, first) for picture, moved in self.pictures]
        # Row by row, to save memory.
        background = np.stack(
            [np.median([picture[row] for picture in steady], axis=0) for row in range(len(first))]
        )
        return Stretch(
            np.array(self.frames, np.int64),
            np.array(self.moved),
            background.astype(np.uint8),
            self.keyboards,
        )


def _steady(
    picture: NDArray[np.uint8], moved: NDArray[np.float64], first: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """The picture as seen in the first frame, whose pixels it has where it shows nothing."""
    size = (picture.shape[1], picture.shape[0])
    # Pillow measures from corners of pixels as well.
    pixels = tuple((moved / moved[2, 2]).ravel()[:8])
    ways = Image.Transform.PERSPECTIVE, pixels, Image.Resampling.BILINEAR
    there = Image.new("L", size, 255).transform(size, *ways)
    image = Image.fromarray(picture).transform(size, *ways)
    return np.where(np.asarray(there)[..., None] == 255, np.asarray(image), first)
