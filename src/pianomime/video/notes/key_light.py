"""What each key looks like from frame to frame: the colour of a few patches on it and above it.

Tutorials let keys light up, or bars fall onto them; a camera sees keys go down and their
neighbours' sides come to light. Either shows in some of the patches.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, KEYS
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.keyboard.plane import Plane
from pianomime.video.notes.touch import touching
from pianomime.world.parameters import key_centres

ZONES = {
    "above the keys": (-0.088, -0.080),
    "far end": (-0.070, -0.055),
    "between the black keys": (-0.050, -0.040),
}
"""World x from and to [m] of the patches."""
LIT = range(2)
"""Numbers of those zones in which keys light up, and which hands do not hide. In the others keys
that go down change their shade, and hands come and go."""

_SOME = 2000
"""Frames."""
_FEWEST = 20
"""Frames without a finger near a key that tell what it looks like at rest."""
_NEAR = 0.05
"""`touching` from which a finger is near a key: at about 15 mm from its middle."""
_HALF_WIDTH = np.where(BLACK, 0.004, 0.006)


class KeyLight:
    """Reads the patches of all keys in pictures taken from one place."""

    def __init__(self, plane: Plane, size: tuple[int, int]) -> None:
        """Prepare for pictures of a size (width, height), of which `plane` is the plane."""
        along = np.array([np.linspace(*zone, 4) for zone in ZONES.values()])
        beside = np.linspace(-1, 1, 3)[None, :] * _HALF_WIDTH[:, None] + key_centres()[:, 1:2]
        world = np.stack(
            np.broadcast_arrays(along[:, None, :, None], beside[None, :, None, :]), axis=-1
        )
        places = np.floor(plane.to_pixels(world)).astype(np.int64).reshape(len(ZONES), KEYS, -1, 2)
        inside = np.asarray(((places >= 0) & (places < size)).all(axis=(2, 3)))
        self._column, self._row = np.moveaxis(np.clip(places, 0, np.array(size) - 1), -1, 0)
        self._inside = inside

    def read(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(zones, 88, 3) mean colour of each patch; black outside the picture."""
        patches = picture[self._row, self._column].mean(axis=2)
        return np.where(self._inside[..., None], patches, 0).astype(np.uint8)


def unattended(tracks: HandTracks) -> NDArray[np.bool_]:
    """(S, 88) whether no finger is near a key, in the frames that tell what is usual."""
    points = tracks.seen_points(_step(len(tracks)))
    return np.stack([touching(points, key) < _NEAR for key in range(KEYS)], axis=1)


def _step(frames: int) -> int:
    """Of so many frames every how manieth tells what is usual."""
    return max(1, frames // _SOME)


class Glow:
    """How much the keys stand out from their usual look in one zone, a key at a time.

    A key at a time, because of hours of video all keys at once would fill the memory.
    """

    def __init__(
        self, light: LightRecord, away: NDArray[np.bool_], zone: int, colourful: bool
    ) -> None:
        """Find out what is usual.

        Args:
            light: what `KeyLight.read` gives for each frame.
            away: what `unattended` tells of the same frames.
            zone: which of `ZONES`.
            colourful: go by how colourful a patch is, rather than by any change of colour.
        """
        self._light = light
        self._zone = zone
        self._colourful = colourful
        # Some frames will do to know what is usual, and what is strong.
        some = light.every(_step(len(light)), zone)
        self._usual = np.asarray(np.median(some, axis=0), np.float32)
        # A key may be down for most of the film: at rest it is when no finger is near it.
        for key in range(KEYS):
            rest = some[away[:, key], key]
            if len(rest) >= _FEWEST:
                self._usual[key] = np.median(rest, axis=0)
        self._strong = max(float(np.percentile(self._change(some, self._usual), 99.5)), 5.0)

    def of(self, key: int) -> NDArray[np.float32]:
        """(T,) about 0..1."""
        if not 0 <= key < KEYS:
            return np.zeros(len(self._light), np.float32)
        light = self._light.key(self._zone, key)
        return self._change(light, self._usual[key]) / np.float32(self._strong)

    def standing_out(self, key: int, share: float = 0.5) -> NDArray[np.float32]:
        """(T,) glow less a share of the brighter neighbour's, for light spreads to neighbours."""
        beside = np.maximum(self.of(key - 1), self.of(key + 1))
        return np.asarray(self.of(key) - share * beside, np.float32)

    def _change(self, light: NDArray[np.uint8], usual: NDArray[np.float32]) -> NDArray[np.float32]:
        seen = light.astype(np.float32)
        if self._colourful:
            change = np.ptp(seen, axis=-1) - np.ptp(usual, axis=-1)
        else:
            change = np.abs(seen - usual).mean(axis=-1)
        return np.asarray(np.maximum(change, 0))
