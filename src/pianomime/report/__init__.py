"""Reports: pictures, sound and a page of a performance, and pictures of a diagnosis."""

from pianomime.keyboard import key_name
from pianomime.palette import DARK, LIGHT, Theme
from pianomime.report.diagnosis import DIAGNOSIS_FILES, write_diagnosis
from pianomime.report.picture import draw
from pianomime.report.write import FILES, write_report

__all__ = [
    "DARK",
    "DIAGNOSIS_FILES",
    "FILES",
    "LIGHT",
    "Theme",
    "draw",
    "key_name",
    "write_diagnosis",
    "write_report",
]
