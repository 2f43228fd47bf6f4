"""Exports: what a performance did, and the world it did it in, in files of robotics.

`write_export` writes them all; `samples` gives joint trajectories in Python, `Limits` what a real
pair of hands allows, `mjcf` and `urdf` the world.
"""

from pianomime.export.limits import Breach, Limits
from pianomime.export.limits_file import read_limits
from pianomime.export.mjcf import mjcf
from pianomime.export.samples import Samples, samples
from pianomime.export.urdf import write_urdf
from pianomime.export.write import FILES, write_export

__all__ = [
    "FILES",
    "Breach",
    "Limits",
    "Samples",
    "mjcf",
    "read_limits",
    "samples",
    "write_export",
    "write_urdf",
]
