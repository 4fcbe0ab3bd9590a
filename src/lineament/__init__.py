"""Lines, corners, arcs and clusters from 2-D LiDAR scans, each with its covariance.

Names are imported when they are first used, so that ``import lineament`` is quick and needs
neither numba nor pyarrow.

Examples
--------
>>> import lineament as ln
>>> scan = ln.LaserScan([2.0] * 5, angle_min=-0.01, angle_increment=0.01)
>>> ln.extract(scan)
Features(1 segments, 0 corners, 0 edges, 0 arcs, 2 breakpoints, 1 clusters, stamp=0.000)
"""

from typing import TYPE_CHECKING

from ._lazy import Pictured, lazily
from ._version import __version__

if TYPE_CHECKING:  # Under these very names: type checkers let others use no other ones.
    from . import bounds as bounds
    from . import logs as logs
    from . import methods as methods
    from . import simulation as simulation
    from .errors import LineamentError as LineamentError
    from .errors import LineamentWarning as LineamentWarning
    from .errors import LogError as LogError
    from .extractor import Extractor as Extractor
    from .extractor import extract as extract
    from .extractor import trace as trace
    from .features import FeatureBatch as FeatureBatch
    from .features import Features as Features
    from .logs import open_log as open_log
    from .methods.trace import Trace as Trace
    from .motion.deskew import deskew as deskew
    from .motion.tracker import Tracker as Tracker
    from .scan import LaserScan as LaserScan
    from .scan import RangeNoise as RangeNoise
    from .view.notebook import plot as plot

_HOME = {
    "Extractor": "extractor",
    "FeatureBatch": "features",
    "Features": "features",
    "LaserScan": "scan",
    "LineamentError": "errors",
    "LineamentWarning": "errors",
    "LogError": "errors",
    "RangeNoise": "scan",
    "Trace": "methods.trace",
    "Tracker": "motion.tracker",
    "bounds": "",
    "deskew": "motion.deskew",
    "extract": "extractor",
    "logs": "",
    "methods": "",
    "open_log": "logs",
    "plot": "view.notebook",
    "simulation": "",
    "trace": "extractor",
}

__all__ = [*_HOME, "__version__"]

__getattr__ = lazily(__name__, _HOME)
# The package alone knows all floors: what is found on a low one is drawn on a high one.
Pictured._drawn_by = f"{__name__}.view.notebook"


def __dir__() -> list[str]:
    return __all__
