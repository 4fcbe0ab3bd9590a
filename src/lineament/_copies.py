"""What copies and threads rely on: arrays stay read-only, and states change one call at a time."""

from collections.abc import Callable
from copy import deepcopy
from functools import wraps
from threading import RLock
from typing import Any, Self, TypeVar, cast

import numpy as np

V = TypeVar("V")
F = TypeVar("F", bound=Callable[..., Any])


class ReadOnly:
    """Has arrays that are read-only, also after it was copied or pickled: numpy forgets that."""

    __slots__ = ()

    def __setstate__(self, state: Any) -> None:
        for fields in state if isinstance(state, tuple) else (state,):
            for name, value in (fields or {}).items():
                object.__setattr__(self, name, locked(value))


def locked(value: V) -> V:
    """Return a read-only view of an array, and anything else as it is."""
    if not isinstance(value, np.ndarray):
        return value
    view = value.view()
    view.flags.writeable = False
    return view


class InTurn:
    """Has a state that calls change: threads wait for their turn, and a copy shares nothing.

    Methods that read or change the state are decorated by `in_turn`.
    """

    _turn: Any

    def __new__(cls, *_: Any, **__: Any) -> Self:
        made = super().__new__(cls)
        made._turn = RLock()
        return made

    def __getstate__(self) -> dict[str, Any]:
        """Return a snapshot; what is made of it has a lock of `__new__`."""
        with self._turn:
            return deepcopy({name: of for name, of in vars(self).items() if name != "_turn"})


def in_turn(method: F) -> F:
    """Let a method of an `InTurn` run alone."""

    @wraps(method)
    def alone(self: InTurn, *args: Any, **kwargs: Any) -> Any:
        with self._turn:
            return method(self, *args, **kwargs)

    return cast(F, alone)
