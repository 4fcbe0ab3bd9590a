"""Extractors of the methods that are scored and timed, by the names that tables give them."""

from __future__ import annotations

from collections.abc import Callable

from ...extractor import Extractor
from ...methods import METHODS
from .findings import Setting
from .methods_compared import LIU_BEST, LIU_PAPER
from .repetition_grid import best_parameters

__all__ = ["LITERAL", "LITERAL_BEST", "LIU_NOTE", "extractors", "liu_extractors"]

LITERAL, LITERAL_BEST = "liu:paper, paper’s numbers", "liu:paper, best of Figure 9"

#: What the rows of `liu` are, for the notes below tables.
LIU_NOTE = (
    "liu:paper is the paper’s literal pipeline: y = kx + b through filtered ranges, corners on "
    "readings. liu fits lines to the raw ranges, and puts corners where they meet."
)


def liu_extractors(setting: Setting, progress: Callable[[str], None]) -> dict[str, Extractor]:
    """Make `liu` and its literal preset, with the paper's numbers and the best of Figure 9."""
    best = best_parameters(setting, progress)
    return {
        LITERAL: Extractor("liu:paper"),
        LITERAL_BEST: best.extractor("liu:paper"),
        LIU_PAPER: Extractor("liu"),
        LIU_BEST: best.extractor("liu"),
    }


def extractors(setting: Setting, progress: Callable[[str], None]) -> dict[str, Extractor]:
    """Make all methods, those other than `liu` with their defaults."""
    others = {name: Extractor(name) for name in METHODS if name != "liu"}
    return liu_extractors(setting, progress) | others
