"""The methods, by name: each a frozen dataclass of its parameters, in one file."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..features import Features
    from ..scan import LaserScan
    from .trace import Trace
    from .workspace import Block

__all__ = ["DEFAULT_METHOD", "METHODS", "Method", "get_method", "method_names"]

DEFAULT_METHOD = "optimal"

#: Name of each method, and the class that it is, in the module of the same name.
METHODS = {
    "optimal": "Optimal",
    "liu": "Liu",
    "pdbs": "PDBS",
    "iepf": "IEPF",
    "split_and_merge": "SplitAndMerge",
    "line_tracking": "LineTracking",
    "hough": "Hough",
    "ransac": "Ransac",
    "region_growing": "RegionGrowing",
}


class Method(Protocol):
    """What the extractor needs of a method."""

    name: ClassVar[str]
    presets: ClassVar[tuple[str, ...]]

    def own_arrays(self, beams: int) -> Any:
        """Make the arrays that the method needs besides those of a block, for scans of `beams`."""

    def run(self, block: Block) -> None:
        """Find and measure the features of the scans of a block."""

    def trace(self, scan: LaserScan, features: Features, noise: NDArray[np.float64]) -> Trace:
        """Run again on a scan of which these features came, and keep every intermediate."""


def get_method(name: str, /, **parameters: Any) -> Method:
    """Make a method by name.

    Parameters
    ----------
    name : str
        A name of `METHODS`, or ``name:preset`` for one of the method's presets.
    **parameters
        Fields of the method's dataclass that differ from its defaults (or its preset's).

    Raises
    ------
    ValueError
        If there is no such method, preset or parameter, or a value is out of bounds.

    Examples
    --------
    >>> get_method("liu", support_radius=5).support_radius
    5
    >>> get_method("lui")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ValueError: method 'lui' is unknown, expected one of: optimal, liu, liu:paper, ...
    """
    base, _, preset = str(name).partition(":")
    cls = _method_class(base) if base in METHODS else None
    if cls is None or (preset and preset not in cls.presets):
        known_methods = ", ".join(method_names())
        raise ValueError(f"method {name!r} is unknown, expected one of: {known_methods}")
    known = [field.name for field in fields(cls)]
    for parameter in parameters:
        if parameter not in known:
            raise ValueError(
                f"method {base!r} has no parameter {parameter!r}, expected one of: "
                f"{', '.join(known)}"
            )
    return cast(Method, (getattr(cls, preset) if preset else cls)(**parameters))


def _method_class(name: str) -> Any:
    return getattr(import_module(f".{name}", __name__), METHODS[name])


def method_names() -> list[str]:
    """List the names of all methods, each followed by those of its presets."""
    return [
        full
        for name in METHODS
        for full in (name, *(f"{name}:{preset}" for preset in _method_class(name).presets))
    ]
