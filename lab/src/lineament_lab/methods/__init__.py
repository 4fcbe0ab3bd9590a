"""The rivals: methods that `lineament` is compared with, each a frozen dataclass in one file.

``lineament`` finds them by their entry points, as it does anybody's: ``Extractor("iepf")``.
"""

from typing import TYPE_CHECKING

from lineament._lazy import lazily

if TYPE_CHECKING:
    from .falko import FALKO as FALKO
    from .flirt import FLIRT as FLIRT
    from .hough import Hough as Hough
    from .iepf import IEPF as IEPF
    from .line_tracking import LineTracking as LineTracking
    from .pdbs import PDBS as PDBS
    from .ple import PLE as PLE
    from .ransac import Ransac as Ransac
    from .region_growing import RegionGrowing as RegionGrowing
    from .split_and_merge import SplitAndMerge as SplitAndMerge

#: Name of each rival, and the class that it is, in the module of the same name.
RIVALS = {
    "pdbs": "PDBS",
    "iepf": "IEPF",
    "split_and_merge": "SplitAndMerge",
    "line_tracking": "LineTracking",
    "hough": "Hough",
    "ransac": "Ransac",
    "region_growing": "RegionGrowing",
    "ple": "PLE",
    "falko": "FALKO",
    "flirt": "FLIRT",
}

__all__ = ["RIVALS", *RIVALS.values()]

__getattr__ = lazily(__name__, {name: module for module, name in RIVALS.items()})


def __dir__() -> list[str]:
    return __all__
