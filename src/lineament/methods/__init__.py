"""The methods, by name: each a frozen dataclass of its parameters, in one file."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

from .._lazy import lazily

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..features import Features
    from ..scan import LaserScan
    from .hough import Hough as Hough
    from .iepf import IEPF as IEPF
    from .line_tracking import LineTracking as LineTracking
    from .liu import Liu as Liu
    from .optimal import Optimal as Optimal
    from .pdbs import PDBS as PDBS
    from .ransac import Ransac as Ransac
    from .region_growing import RegionGrowing as RegionGrowing
    from .split_and_merge import SplitAndMerge as SplitAndMerge
    from .trace import Trace
    from .workspace import Block

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


__all__ = ["DEFAULT_METHOD", "METHODS", "Method", "describe", "get_method", "method_names"]
__all__ += METHODS.values()

__getattr__ = lazily(__name__, {name: module for module, name in METHODS.items()})


def __dir__() -> list[str]:
    return __all__


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
    if not isinstance(name, str):
        raise TypeError(
            f"method is {name!r:.60}, expected a name or a method: {', '.join(METHODS)}"
        )
    base, _, preset = name.partition(":")
    cls = _method_class(base) if base in METHODS else None
    if cls is None or (preset and preset not in cls.presets):
        known_methods = ", ".join(method_names())
        raise ValueError(f"method {name!r} is unknown, expected one of: {known_methods}")
    from .parameters import unknown

    known = [field.name for field in fields(cls)]
    for parameter in parameters:
        if parameter not in known:
            raise ValueError(unknown(f"method {base!r}", parameter, known))
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


def describe(name: str = "") -> str:
    """Describe a method in plain text: its parameters, defaults, units and bounds; or list all.

    Raises a ValueError if there is no such method.

    Examples
    --------
    >>> print(describe("optimal").splitlines()[3])
    evidence         12                            a number > 0
    """
    from .parameters import indented, sentence

    if not name:
        names = method_names()
        abouts = [
            _about(getattr(_method_class(m), p) if p else _method_class(m))
            for m, _, p in (full.partition(":") for full in names)
        ]
        return "\n".join(f"{full:<23} {about}" for full, about in zip(names, abouts, strict=True))
    method: Any = get_method(name)
    lines = [f"{name}: {_about(type(method))}"]
    if method.presets:
        lines += [f"Presets: {', '.join(f'{method.name}:{preset}' for preset in method.presets)}"]
    lines += ["", f"{'parameter':<16} {'default':<22} {'unit':<6} bounds"]
    for one in fields(method):
        value = getattr(method, one.name)
        value = f"{value:.6g}" if isinstance(value, float) else str(value)
        about = one.metadata
        lines += [f"{one.name:<16} {value:<22} {about['unit']:<6} {about['bounds']}"]
        lines += indented(f"{sentence(about['meaning'])}.")
    return "\n".join(lines)


def _about(documented: Any) -> str:
    return str(documented.__doc__).strip().splitlines()[0]
