"""The rivals: methods that `lineament` is compared with, each a frozen dataclass in one file.

``lineament`` finds them by their entry points, as it does anybody's: ``Extractor("iepf")``.
"""

from lineament._lazy import lazily

#: Name of each rival, and the class that it is, in the module of the same name.
RIVALS = {
    "pdbs": "PDBS",
    "iepf": "IEPF",
    "split_and_merge": "SplitAndMerge",
    "line_tracking": "LineTracking",
    "hough": "Hough",
    "ransac": "Ransac",
    "region_growing": "RegionGrowing",
}

__all__ = ["RIVALS", *RIVALS.values()]

__getattr__ = lazily(__name__, {name: module for module, name in RIVALS.items()})


def __dir__() -> list[str]:
    return __all__
