"""Colours of the keys from frame to frame, in a few patches on and above each key.

In tutorials keys light up, or bars fall onto them; in a recording keys go down, and the sides of
their neighbours become visible. Both change the colour of some of the patches.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, KEYS
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.track import KeyboardTrack
from pianomime.video.notes.touch import touching
from pianomime.world.parameters import key_centres

ZONES = {
    "above the keys": (-0.088, -0.080),
    "far end": (-0.070, -0.055),
    "between the black keys": (-0.050, -0.040),
}
"""Name and range of world x of each patch of a key [m]."""
LIT = range(2)
"""Indices of the zones in which keys light up and which hands do not hide."""

_SOME = 2000
"""Frames from which the usual look of the keys is taken."""
_FEWEST = 20
"""Least number of frames without a finger near a key for its look at rest to be taken from them."""
_NEAR = 0.05
"""`touching` from which a finger is near a key: about 15 mm from its middle."""
_STRONG = 99.5
"""Percentile of all changes that counts as a glow of 1."""
_HALF_WIDTH = np.where(BLACK, 0.004, 0.006)
"""(88,) [m] Half the width of each key's patches."""


class KeyLight:
    """Reads the patches of all keys in the frames of a film.

    What a camera that moves does not show stays as it was seen last.
    """

    def __init__(self, track: KeyboardTrack, size: tuple[int, int]) -> None:
        """Begin at the first frame.

        Args:
            track: of the keyboard.
            size: width and height of the pictures [pixels].
        """
        self._track, self._size = track, np.array(size)
        self._last = np.zeros((len(ZONES), KEYS, 3))
        self._plane: Plane | None = None
        for picture, plane in reversed(track.backgrounds):
            self._read(picture, plane)

    def read(self, frame: int, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Mean colour of each patch.

        Args:
            frame: number of the frame; each is read once, in order.
            picture: (height, width, 3) uint8.

        Returns:
            (zones, 88, 3) uint8; black where it has never been in the picture.
        """
        plane = self._track.at(frame)
        if plane is not None:
            self._read(picture, plane)
        return self._last.astype(np.uint8)

    def _read(self, picture: NDArray[np.uint8], plane: Plane) -> None:
        if plane is not self._plane:
            self._aim(plane)
        patches = picture[self._row, self._column].mean(axis=2)
        self._last = np.where(self._inside[..., None], patches, self._last)

    def _aim(self, plane: Plane) -> None:
        """Find the pixels of all patches."""
        self._plane = plane
        along = np.array([np.linspace(*zone, 4) for zone in ZONES.values()])
        beside = np.linspace(-1, 1, 3)[None, :] * _HALF_WIDTH[:, None] + key_centres()[:, 1:2]
        world = np.stack(
            np.broadcast_arrays(along[:, None, :, None], beside[None, :, None, :]), axis=-1
        )
        places = np.floor(plane.to_pixels(world)).astype(np.int64).reshape(len(ZONES), KEYS, -1, 2)
        self._inside = np.asarray(((places >= 0) & (places < self._size)).all(axis=(2, 3)))
        self._column, self._row = np.moveaxis(np.clip(places, 0, self._size - 1), -1, 0)


def unattended(tracks: HandTracks) -> NDArray[np.bool_]:
    """(S, 88) bool: keys without a finger near them, in the frames that show their usual look."""
    points = tracks.seen_points(_step(len(tracks)))
    return np.stack([touching(points, key) < _NEAR for key in range(KEYS)], axis=1)


def _step(frames: int) -> int:
    """Distance between the frames, of so many, that show the usual look of the keys."""
    return max(1, frames // _SOME)


class Glow:
    """Change of the keys from their usual look in one zone; about 0..1.

    It is read one key at a time, because all keys in hours of video would exceed the memory.

    Attributes:
        usual: (88, 3) usual colour of each key, 0..255.
    """

    def __init__(
        self, light: LightRecord, away: NDArray[np.bool_], zone: int, colourful: bool
    ) -> None:
        """Find the usual look of every key.

        Args:
            light: colours of the keys in each frame, see `KeyLight`.
            away: (S, 88) keys without a finger, as `unattended` returns them.
            zone: index of a zone in `ZONES`.
            colourful: measure the increase in saturation, instead of any change of colour.
        """
        self._light = light
        self._zone = zone
        self._colourful = colourful
        # Some frames are enough for the usual look, and for the strength of changes.
        some = light.every(_step(len(light)), zone)
        self.usual = np.asarray(np.median(some, axis=0), np.float32)
        # A key may be down for most of the video; without a finger near it, it is at rest.
        for key in range(KEYS):
            rest = some[away[:, key], key]
            if len(rest) >= _FEWEST:
                self.usual[key] = np.median(rest, axis=0)
        self._strong = max(float(np.percentile(self._change(some, self.usual), _STRONG)), 5.0)

    def of(self, key: int) -> NDArray[np.float32]:
        """(T,) Change of a key in every frame, about 0..1; 0 for keys that do not exist."""
        if not 0 <= key < KEYS:
            return np.zeros(len(self._light), np.float32)
        light = self._light.key(self._zone, key)
        return self._change(light, self.usual[key]) / np.float32(self._strong)

    def standing_out(self, key: int, share: float = 0.5) -> NDArray[np.float32]:
        """(T,) Change of a key, less a share of its brighter neighbour's, since light spreads.

        Args:
            key: the key, 0..87.
            share: share of the neighbour's change to subtract.
        """
        beside = np.maximum(self.of(key - 1), self.of(key + 1))
        return np.asarray(self.of(key) - share * beside, np.float32)

    def _change(self, light: NDArray[np.uint8], usual: NDArray[np.float32]) -> NDArray[np.float32]:
        seen = light.astype(np.float32)
        if self._colourful:
            change = np.ptp(seen, axis=-1) - np.ptp(usual, axis=-1)
        else:
            change = np.abs(seen - usual).mean(axis=-1)
        return np.asarray(np.maximum(change, 0))
