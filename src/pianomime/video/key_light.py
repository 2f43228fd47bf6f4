"""What each key looks like from frame to frame: the colour of a few patches on it and above it.

Tutorials let keys light up, or bars fall onto them; a camera sees keys go down and their
neighbours' sides come to light. Either shows in some of the patches.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.video.plane import Plane
from pianomime.world.figures import BLACK, KEYS, key_centres

ZONES = {
    "above the keys": (-0.088, -0.080),
    "far end": (-0.070, -0.055),
}
"""World x from and to [m] of the patches, where hands do not hide them."""

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


def glow(light: NDArray[np.uint8], zone: int, colourful: bool) -> NDArray[np.float32]:
    """How much each key of a zone stands out from its usual look, about 0..1.

    Args:
        light: (T, zones, 88, 3), what `KeyLight.read` gives for each frame.
        zone: which of `ZONES`.
        colourful: go by how colourful a patch is, rather than by any change of colour.

    Returns:
        (T, 88) float32.
    """
    seen = light[:, zone].astype(np.float32) / 255
    # Every eleventh frame will do to know what is usual.
    usual = np.median(seen[:: max(1, len(seen) // 2000)], axis=0)
    if colourful:
        change = np.ptp(seen, axis=2) - np.ptp(usual, axis=1)
    else:
        change = np.abs(seen - usual).mean(axis=2)
    change = np.maximum(change, 0)
    strong = float(np.percentile(change, 99.5))
    return np.asarray(change / max(strong, 0.02), np.float32)


def standing_out(light: NDArray[np.float32], share: float = 0.5) -> NDArray[np.float32]:
    """(T, 88) glow less a share of the brighter neighbour's, for light spreads to neighbours."""
    padded = np.pad(light, ((0, 0), (1, 1)))
    return np.asarray(light - share * np.maximum(padded[:, :-2], padded[:, 2:]), np.float32)
