"""What is found in a scan, and its fields: their types, units and columns are declared once."""

from .features import COUNTED, TABLES, FeatureBatch, Features, noise_of, noise_row
from .records import ARC, BREAKPOINT, CORNER, SEGMENT

__all__ = [
    "ARC",
    "BREAKPOINT",
    "CORNER",
    "COUNTED",
    "SEGMENT",
    "TABLES",
    "FeatureBatch",
    "Features",
    "noise_of",
    "noise_row",
]
