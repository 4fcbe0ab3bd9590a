"""Lines, corners, arcs and clusters from 2-D LiDAR scans, each with its covariance.

Names are imported when they are first used, so that ``import lineament`` is quick and needs
neither numba nor pyarrow.

Examples
--------
>>> import lineament as ln
>>> scan = ln.LaserScan([2.0] * 5, angle_min=-0.01, angle_increment=0.01)
>>> ln.extract(scan)
Features(1 segments, 0 corners, 0 arcs, 2 breakpoints, 1 clusters, stamp=0.000)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from .deskewing import deskew
    from .errors import LineamentError, LogError
    from .extractor import Extractor, extract, trace
    from .features import FeatureBatch, Features
    from .logs import open_log
    from .scan import LaserScan, RangeNoise
    from .tracing import Trace

_HOME = {
    "Extractor": "extractor",
    "FeatureBatch": "features",
    "Features": "features",
    "LaserScan": "scan",
    "LineamentError": "errors",
    "LogError": "errors",
    "RangeNoise": "scan",
    "Trace": "tracing",
    "deskew": "deskewing",
    "extract": "extractor",
    "open_log": "logs",
    "trace": "extractor",
}

__all__ = [*_HOME, "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'lineament' has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
