"""Whether a key that changes is lit, or only covered by a hand or shaded: by colour and by place.

Shade never makes a key brighter or more colourful, and light has a hue. A hand does both, but it
has the colour of skin, or lies over the very place that changes; there, light is told by the hue
that keys without a hand over them light up in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.video.film.light_record import LightRecord
from pianomime.video.notes.key_light import ZONES
from pianomime.world.parameters import key_centres

_COLOURFUL = 30.0
"""Least difference of the largest and the smallest of red, green and blue, 0..255, of a lit key."""
_GAIN = 20.0
"""Least increase of that difference, or of the largest of the three; keys that go down, or lie in
the shade of a hand, stay below 10 where they are white, and below 20 where they are black."""
_SKIN_HUES = (-25.0, 45.0)
"""[degrees] Hues of skin in the light of lamps, windows and cheap cameras."""
_SKIN_SATURATION = 0.68
"""Greatest saturation of skin that is not dark."""
_DARK = 150.0
"""Largest of red, green and blue below which skin may have any saturation."""
_OVER = 0.020
"""[m] Distance from the line between a wrist and a fingertip within which a hand covers a place."""
_SAME_HUE = 20.0
"""[degrees] Difference of hues that are one."""
_FEWEST = 3
"""Least number of notes without a hand over them for their hue to be one of the film's lights."""


def are_lit(
    light: LightRecord,
    zone: int,
    usual: NDArray[np.float32],
    notes: NDArray[np.int64],
    points: NDArray[np.floating],
) -> NDArray[np.bool_]:
    """Tell light on keys from all else that changes their colour.

    Args:
        light: colours of the keys in each frame, see `KeyLight`.
        zone: index of the zone in `ZONES` in which the keys change.
        usual: (88, 3) usual colour of the keys in that zone, 0..255.
        notes: (N, 3) key, first frame, and frame after the last one of each change.
        points: (T, H, 6, 2) hands, as `HandTracks.seen_points` returns them; H may be 0.

    Returns:
        (N,) bool.
    """
    colour = _mean_colours(light, zone, notes)
    rest = usual[notes[:, 0]]
    most, chroma = colour.max(axis=1), np.ptp(colour, axis=1)
    gain = np.maximum(most - rest.max(axis=1), chroma - np.ptp(rest, axis=1))
    hue, saturation = _hue(colour), chroma / np.maximum(most, 1.0)
    low, high = _SKIN_HUES
    skin = (hue - low) % 360 <= high - low
    skin &= (saturation <= _SKIN_SATURATION) | (most < _DARK)
    lit = (chroma >= _COLOURFUL) & (gain >= _GAIN) & ~skin
    covered = _covered(zone, notes, points)
    known = np.sort(hue[lit & ~covered])
    # Hues go round: the same ones once more on either side.
    known = np.concatenate((known - 360, known, known + 360))
    alike = np.searchsorted(known, hue + _SAME_HUE) - np.searchsorted(known, hue - _SAME_HUE)
    return np.asarray(lit & (~covered | (alike >= _FEWEST)))


def _mean_colours(light: LightRecord, zone: int, notes: NDArray[np.int64]) -> NDArray[np.float64]:
    """(N, 3) Mean colour of the key of each note while it lasts, 0..255."""
    colour = np.zeros((len(notes), 3))
    for key in np.unique(notes[:, 0]):
        mine = notes[:, 0] == key
        first, end = notes[mine, 1], notes[mine, 2]
        total = np.cumsum(light.key(zone, int(key)), axis=0, dtype=np.float64)
        total = np.concatenate((np.zeros((1, 3)), total))
        colour[mine] = (total[end] - total[first]) / (end - first)[:, None]
    return colour


def _hue(colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) Hue of colours (N, 3) [degrees]: 0 red, 120 green, 240 blue; greys have any."""
    red, green, blue = colour.T
    angle = np.arctan2(np.sqrt(3) * (green - blue), 2 * red - green - blue)
    return np.asarray(np.degrees(angle) % 360)


def _covered(
    zone: int, notes: NDArray[np.int64], points: NDArray[np.floating]
) -> NDArray[np.bool_]:
    """(N,) bool: a hand is over the key for most of the note: in two of three of its frames."""
    along = np.mean(list(ZONES.values())[zone])
    beside = key_centres()[notes[:, 0], 1]
    place = np.stack((np.full(len(notes), along), beside), axis=1)[:, None, None]
    over = np.zeros(len(notes), np.int64)
    for share in (0.0, 0.5, 1.0):
        frame = notes[:, 1] + (share * (notes[:, 2] - 1 - notes[:, 1])).astype(np.int64)
        wrist, tips = points[frame, :, :1], points[frame, :, 1:]
        bone = tips - wrist
        length = np.maximum((bone**2).sum(axis=-1), 1e-9)
        at = np.clip(((place - wrist) * bone).sum(axis=-1) / length, 0, 1)
        off = np.linalg.norm(wrist + at[..., None] * bone - place, axis=-1)
        over += off.min(axis=(1, 2), initial=np.inf) < _OVER
    return over >= 2
