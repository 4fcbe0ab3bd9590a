"""Public names that are imported when they are first used: ``import lineament`` stays quick."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, ClassVar


def lazily(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package whose names live in modules of it.

    Parameters
    ----------
    package : str
        Name of the package.
    homes : mapping
        The module of each name, relative to the package; "" for a module itself.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not homes[name]:
            return import_module(f".{name}", package)
        value = getattr(import_module(f".{homes[name]}", package), name)
        setattr(sys.modules[package], name, value)  # To look for it takes as long as a scan.
        return value

    return get


class Pictured:
    """Is a picture in notebooks, which the package's choice of module draws."""

    __slots__ = ()

    #: Name of the module that draws: it has `picture` and `plot`.
    _drawn_by: ClassVar[str]

    def _drawing(self) -> Any:
        return import_module(self._drawn_by)

    def _repr_html_(self) -> str:
        html: str = self._drawing().picture(self)
        return html
