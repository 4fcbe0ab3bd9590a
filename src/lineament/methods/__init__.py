"""The methods, by name: each a frozen dataclass of its parameters, in one file.

Those of other packages are found by their entry points, see `lineament.plugins`; a function of
yours in a file by ``my.py:find``, see `functions`.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

from .. import plugins
from .._lazy import lazily

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..features import Features
    from ..scan import LaserScan
    from .liu import Liu as Liu
    from .optimal import Optimal as Optimal
    from .trace import Trace
    from .workspace import Block

DEFAULT_METHOD = "optimal"

#: Name of each method of ours, and the class that it is, in the module of the same name.
METHODS = {"optimal": "Optimal", "liu": "Liu"}


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
        A name of `method_names`, with ``name:preset`` for one of the method's presets; or
        ``FILE.py:NAME`` for a function or a class of yours, see `functions.as_method`.
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
            f"method is {name!r:.60}, expected a name, a function of a scan, or a method: "
            f"{', '.join(method_names(presets=False))}"
        )
    if name.rpartition(":")[0].endswith(".py"):
        from .functions import from_file

        return from_file(name, parameters)
    base, _, preset = name.partition(":")
    cls = _method_class(base)
    if cls is None or (preset and preset not in _presets(cls)):
        problem = plugins.missing(plugins.METHODS, base)
        known = f"method {name!r} is unknown, expected one of: {', '.join(method_names())}"
        raise ValueError(f"method {problem}" if problem and cls is None else known)
    return made(name, getattr(cls, preset) if preset else cls, cls, parameters)


def made(name: str, make: Any, cls: Any, parameters: dict[str, Any]) -> Method:
    """Make a method of a class, by itself or by one of its presets, or of a function of a scan.

    A ValueError names a parameter that it does not have.
    """
    from .parameters import unknown

    is_class = isinstance(cls, type)
    if parameters and not is_class:
        raise ValueError(
            f"method {name!r} is a function, expected no parameters: {', '.join(parameters)} "
            "(a class with fields and a __call__ has some)"
        )
    if is_dataclass(cls):
        known = [field.name for field in fields(cls)]
        for parameter in parameters:
            if parameter not in known:
                base, _, last = name.partition(":")
                owner = base if last in _presets(cls) or not last else name
                raise ValueError(unknown(f"method {owner!r}", parameter, known))
    method = make(**parameters) if is_class else cls
    if hasattr(method, "run"):
        return cast(Method, method)
    from .functions import as_method

    return as_method(method, name)


def _method_class(name: str) -> Any:
    """Return the class of a method, or None; a ValueError if a package's cannot be loaded."""
    if name in METHODS:
        return getattr(import_module(f".{name}", __name__), METHODS[name])
    entry = plugins.plugins(plugins.METHODS).get(name)
    if entry is None:
        return None
    try:
        return entry.load()
    except Exception as error:
        raise ValueError(
            f"method {name!r} cannot be loaded from {entry.value}: {type(error).__name__}: {error}"
        ) from error


def _presets(cls: Any) -> tuple[str, ...]:
    return tuple(getattr(cls, "presets", ()))


def method_names(presets: bool = True) -> list[str]:
    """List the names of all methods, ours first, each followed by those of its presets.

    Examples
    --------
    >>> method_names(presets=False)[:2]
    ['optimal', 'liu']
    """
    names = [*METHODS, *(name for name in plugins.plugins(plugins.METHODS) if name not in METHODS)]
    if not presets:
        return names
    return [full for name in names for full in (name, *(f"{name}:{p}" for p in _presets_of(name)))]


def _presets_of(name: str) -> tuple[str, ...]:
    """Return a method's presets; a package that cannot be loaded costs no other."""
    try:
        return _presets(_method_class(name))
    except ValueError:
        return ()


def describe(name: str = "") -> str:
    """Describe a method in plain text: its parameters, defaults, units and bounds; or list all.

    Raises a ValueError if there is no such method.

    Examples
    --------
    >>> print(describe("optimal").splitlines()[3])
    evidence         12                            a number > 0
    """
    from .parameters import described

    if not name:
        return "\n".join(f"{full:<23} {_about_name(full)}" for full in method_names())
    return described(name, get_method(name))


def _about_name(full: str) -> str:
    name, _, preset = full.partition(":")
    try:
        cls = _method_class(name)
    except ValueError as error:
        return str(error)
    return about(getattr(cls, preset) if preset else cls)


def about(documented: Any) -> str:
    """Return the first line of a docstring."""
    return (documented.__doc__ or "no description").strip().splitlines()[0]
