"""How a long run shows how far it is: through a function that it draws its items through."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

__all__ = ["Track", "untracked"]

#: ``track(items, about, total)`` gives the items, and shows how far they are.
Track = Callable[[Any, str, int], Iterable[Any]]


def untracked(items: Iterable[Any], about: str, total: int) -> Iterable[Any]:  # noqa: ARG001
    """Give the items, and show nothing.

    Examples
    --------
    >>> list(untracked("ab", "letters", 2))
    ['a', 'b']
    """
    return items
