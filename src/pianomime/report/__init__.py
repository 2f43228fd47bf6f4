"""What a person looks at: the pictures, the page."""

from pianomime.report.explanation import EXPLANATION_FILES, write_explanation
from pianomime.report.picture import draw
from pianomime.report.roll import DARK, LIGHT, Theme, key_name
from pianomime.report.staging import staged
from pianomime.report.write import FILES, write_report

__all__ = [
    "DARK",
    "EXPLANATION_FILES",
    "FILES",
    "LIGHT",
    "Theme",
    "draw",
    "key_name",
    "staged",
    "write_explanation",
    "write_report",
]
