"""What a person looks at: the numbers, the pictures, the page."""

from pianomime.report.numbers import Row, numbers
from pianomime.report.picture import DARK, LIGHT, Theme, draw
from pianomime.report.staging import staged
from pianomime.report.write import FILES, write_report

__all__ = ["DARK", "FILES", "LIGHT", "Row", "Theme", "draw", "numbers", "staged", "write_report"]
