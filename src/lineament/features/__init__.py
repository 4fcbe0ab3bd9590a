"""What is found in a scan, and its fields: their types, units and columns are declared once."""

from .batch import FeatureBatch
from .features import Features
from .records import ARC, BREAKPOINT, CORNER, EDGE, SEGMENT, TABLES, make_records
from .written import noise_of, noise_row

__all__ = [
    "ARC",
    "BREAKPOINT",
    "CORNER",
    "EDGE",
    "SEGMENT",
    "TABLES",
    "FeatureBatch",
    "Features",
    "make_records",
    "noise_of",
    "noise_row",
]
