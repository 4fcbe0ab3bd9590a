"""A method of yours in a few lines: a function of a scan that returns segments, and corners.

What it does not return is made here: the measurements of each segment and their noise, from which
come its covariance, and the clusters and breakpoints of the scan.
"""

from __future__ import annotations

import math
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..errors import LineamentError
from ..kernels.breakpoints import BORGES_ALDON
from ..scan import LaserScan
from . import Method, made
from .base import MethodBase
from .workspace import Block
from .written import corner_records, segment_records, write

#: λ of the clusters' breakpoints, missing beams that they go over, and their least points: as of
#: the methods of the laboratory.
_GRAZING, _MISSING, _LEAST = math.radians(6.0), 5, 3


@dataclass(frozen=True)
class FunctionMethod(MethodBase):
    """A function of a scan, as a method.

    Parameters
    ----------
    function : callable
        ``function(scan)`` returns the segments of a `LaserScan`, or a pair of segments and corners.
        Segments are floats of shape (L, 4) or (L, 2, 2), start and end of each in the frame of the
        scanner [m], which are kept; or whole numbers of shape (L, 2), the first and the last beam
        of each, to which lines are fitted. Corners are floats of shape (K, 2), positions [m]; or
        whole numbers of shape (K,), beams, on whose measurements they are put.
    name : str
        What tables call it.

    Notes
    -----
    A segment has the measurements between its ends that are within 5 cm of it, or within four
    standard deviations. Its covariance is that of the best fit to these (Pfister et al. 2003): if
    the function makes less of them, its NEES says so. One with fewer than two is left out, with a
    warning. A corner belongs to the segments whose ends it is next to; one between two has the
    covariance of where they meet, another that of a measurement, and no opening.

    Examples
    --------
    >>> import numpy as np
    >>> import lineament as ln
    >>> def ends(scan):
    ...     first, *_, last = np.flatnonzero(scan.valid)
    ...     return [(first, last)]
    >>> ln.extract([2.0] * 9, angle_min=-0.04, angle_increment=0.01, method=ends, noise=0.01)
    Features(1 segments, 0 corners, 0 edges, 0 arcs, 2 breakpoints, 1 clusters, stamp=0.000)
    """

    function: Callable[[LaserScan], Any]
    name: str = ""  # type: ignore[misc]  # by class, where a class is the method
    #: File, name in it and parameters, for a copy in another process.
    source: tuple[str, tuple[tuple[str, Any], ...]] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if not self.name:
            named = getattr(self.function, "__name__", type(self.function).__name__)
            object.__setattr__(self, "name", named)

    def __reduce__(self) -> tuple[Any, ...]:
        if self.source is None:
            return FunctionMethod, (self.function, self.name)
        name, parameters = self.source
        return from_file, (name, dict(parameters))

    def find(self, block: Block) -> None:
        """Call the function, and write what it returns."""
        block.part((BORGES_ALDON, 3.0, _GRAZING), _MISSING, _LEAST)
        scan = block.scan()
        segments, corners = self._called(scan)
        noise = block.noises[block.row]
        try:
            found = segment_records(segments, scan, noise)
            with_corners = corner_records(corners, found, scan, noise)
        except (TypeError, ValueError) as error:
            raise LineamentError(f"{self.name} returned {error}") from None
        write(block, found, with_corners, gap=_MISSING + 1.0)

    def _called(self, scan: LaserScan) -> tuple[Any, Any]:
        """Return segments and corners; an error of the function's names its line."""
        try:
            found = self.function(scan)
        except Exception as error:
            raise LineamentError(f"{self.name} failed: {_where(error)}") from error
        if isinstance(found, tuple) and len(found) == 2 and np.ndim(found[0]) != 0:
            first = np.shape(found[0])
            if len(first) != 1 or first == (0,):
                return found
        return found, np.empty((0, 2))


def as_method(given: Any, name: str = "") -> Method:
    """Return a method as it is, and a function of a scan as one.

    Raises a TypeError if it is neither.
    """
    if hasattr(given, "run") and hasattr(given, "own_arrays"):
        return cast(Method, given)
    if callable(given):
        return cast(Method, FunctionMethod(given, name))
    raise TypeError(f"method is {given!r:.60}, expected a name, a function of a scan, or a method")


def from_file(name: str, parameters: dict[str, Any]) -> Method:
    """Make a method of a function or a class in a file of Python, by ``FILE.py:NAME``.

    Raises a ValueError if there is no such file or name, or it cannot be loaded; the file runs.
    """
    path, _, inner = name.rpartition(":")
    found = vars(_loaded(name, Path(path))).get(inner)
    if not callable(found):
        raise ValueError(f"method {name!r}: {path} has no function or class {inner!r}")
    short = f"{Path(path).name}:{inner}"
    method = made(short, found, found, parameters)
    if isinstance(method, FunctionMethod):
        source = str(Path(path).absolute()) + f":{inner}", tuple(parameters.items())
        object.__setattr__(method, "source", source)
    return method


def _loaded(name: str, path: Path) -> Any:
    """Run a file as a module, in whose folder it may import others."""
    if not path.is_file():
        raise ValueError(f"method {name!r}: there is no file {path}")
    spec = spec_from_file_location(f"lineament_method_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ValueError(f"method {name!r}: {path} is no file of Python")
    module = sys.modules[spec.name] = module_from_spec(spec)  # dataclasses look for it there
    sys.path.insert(0, str(path.parent.absolute()))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ValueError(f"method {name!r} cannot be loaded: {_where(error)}") from error
    finally:
        sys.path.remove(str(path.parent.absolute()))
    return module


def _where(error: Exception) -> str:
    """Return an error with the last line of the traceback, in one line."""
    text = f"{type(error).__name__}: {error}"
    if isinstance(error, SyntaxError):
        return text
    # Not the line here that calls the function: of one that takes no scan.
    frames = [at for at in traceback.extract_tb(error.__traceback__) if at.filename != __file__]
    return f"{text} ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else text
