"""How long runs show how far they are: items through a track, kernels while they are compiled."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from types import FunctionType, ModuleType
from typing import Any

#: ``track(items, about, total)`` gives the items, and shows how far they are.
Track = Callable[[Any, str, int], Iterable[Any]]

#: What is compiled in less time is not shown [s].
_PATIENCE = 0.5
#: Work on a kernel after all that it calls is compiled, as a share of that on them; and the work
#: of a second, in bytes of Python's code, that the first estimate of the time left goes by.
_LAST_SHARE, _SPEED = 0.15, 1500.0


def untracked(items: Iterable[Any], about: str, total: int) -> Iterable[Any]:  # noqa: ARG001
    """Give the items, and show nothing.

    Examples
    --------
    >>> list(untracked("ab", "letters", 2))
    ['a', 'b']
    """
    return items


@dataclass(frozen=True, slots=True)
class Compiling:
    """How far the compilation of kernels is.

    Attributes
    ----------
    done, total : int
        Functions that are compiled, and all that are known to be needed.
    seconds, left : float
        Time since it began, and what is estimated to be left [s].
    is_first, is_last : bool
        Whether this is the first that is shown, or the end.

    Examples
    --------
    >>> print(Compiling(14, 40, 9.7, 17.6, is_first=False, is_last=False))
    compiling kernels, once: 14 of 40, 18 s left
    """

    done: int
    total: int
    seconds: float
    left: float
    is_first: bool
    is_last: bool

    def __str__(self) -> str:
        if self.is_last:
            return f"compiled kernels in {self.seconds:.0f} s; they are cached for the next run"
        return f"compiling kernels, once: {self.done} of {self.total}, {self.left:.0f} s left"


Show = Callable[[Compiling], None]


def show_line(state: Compiling) -> None:
    """Show it in the last line of a terminal, which stays at the end."""
    sys.stderr.write(f"\r\033[K{state}" + ("\n" if state.is_last else ""))
    sys.stderr.flush()


def show_in_notebook(state: Compiling) -> None:
    """Show it in the output of a cell."""
    from IPython.display import display

    global _handle
    shown = {"text/plain": str(state)}
    if _handle is None:
        _handle = display(shown, raw=True, display_id=True)
    else:
        _handle.update(shown, raw=True)
    if state.is_last:
        _handle = None


_handle: Any = None


def show_to_person(state: Compiling) -> None:
    """Show it in a notebook or on a terminal; a script without one stays silent."""
    if "ipykernel" in sys.modules:
        show_in_notebook(state)
    elif sys.stderr is not None and sys.stderr.isatty():
        show_line(state)


class _Compiler:
    """Follows numba, which reports by an event that it compiles a function, and that it has."""

    def __init__(self) -> None:
        self.show: Show | None = show_to_person
        self.seconds = 0.0
        self.now: Compiling | None = None
        self._lock = threading.RLock()
        self._is_heard = False
        self._open = self._depth = 0
        self._began = self._outer_began = 0.0
        self._begin()

    def _begin(self) -> None:
        self._expected: list[tuple[tuple[Any, ...], tuple[type, ...]]] = []
        self._started: list[Any] = []
        self._done: set[Any] = set()
        self._is_shown = False

    def hear(self) -> None:
        """Listen to numba from now on; it has been imported."""
        with self._lock:
            if self._is_heard:
                return
            self._is_heard = True
            from numba.core import event

            compiler = self

            class Listener(event.Listener):  # type: ignore[misc]  # numba has no types
                def on_start(self, event: Any) -> None:
                    compiler.start(event.data["dispatcher"])

                def on_end(self, event: Any) -> None:
                    compiler.end(event.data["dispatcher"])

            event.register("numba:compile", Listener())

    def open(self, functions: tuple[Any, ...], classes: tuple[type, ...]) -> None:
        """Take what is compiled until `close` for one piece of work, see `compiling`."""
        with self._lock:
            self._open += 1
            self._expected.append((functions, classes))

    def close(self) -> None:
        with self._lock:
            self._open -= 1
            self._end_if_idle()

    def start(self, kernel: Any) -> None:
        with self._lock:
            if self._depth == 0:
                self._outer_began = time.perf_counter()
                if not self._started:
                    self._began = self._outer_began
                self._started.append(kernel)
            self._depth += 1
            self._report()

    def end(self, kernel: Any) -> None:
        with self._lock:
            self._depth -= 1
            self._done.add(kernel.py_func)
            if self._depth == 0:
                self.seconds += time.perf_counter() - self._outer_began
            self._report()
            self._end_if_idle()

    def _end_if_idle(self) -> None:
        if self._open == self._depth == 0:
            if self._is_shown:
                self._report(is_last=True)
            self._begin()

    def _report(self, is_last: bool = False) -> None:
        seconds = time.perf_counter() - self._began
        if seconds < _PATIENCE and not self._is_shown:
            return
        # What has an overload and was not compiled here came from the cache.
        expected = (kernel for called in self._expected for kernel in _kernels_of(*called))
        work: dict[Any, float] = {}
        for kernel in [*self._started, *(kernel for kernel in expected if not kernel.overloads)]:
            needed = _needed(kernel)
            work.update((other, cost) for other, cost in needed.items() if other not in work)
            work[kernel.py_func] = needed[kernel.py_func] + _LAST_SHARE * sum(needed.values())
        done = self._done & work.keys()
        worked = sum(work[function] for function in done)
        speed = (worked + 2.0 * _SPEED) / (seconds + 2.0)
        left = (sum(work.values()) - worked) / speed
        is_first, self._is_shown = not self._is_shown, True
        state = Compiling(len(done), len(work), seconds, left, is_first, is_last)
        self.now = None if is_last else state
        if self.show is not None:
            # Nobody to show it to is no reason to end the work.
            with suppress(OSError, ValueError):
                self.show(state)


_compiler = _Compiler()


def compiled_seconds() -> float:
    """Return the time that went into compiling kernels, in this process [s]."""
    return _compiler.seconds


def compiling_now() -> str:
    """Return how far the compilation of kernels is, in this process; "" if there is none."""
    return str(_compiler.now or "")


@contextmanager
def compiling(functions: Iterable[Any] = (), classes: Iterable[type] = ()) -> Iterator[None]:
    """Take the kernels that are compiled within for one piece of work, which is shown as such.

    Parameters
    ----------
    functions : iterable of function
        What will be called: kernels that their code names are counted from the beginning.
    classes : iterable of type
        Where the attributes that their code names are looked for.
    """
    _compiler.hear()
    _compiler.open(tuple(functions), tuple(classes))
    try:
        yield
    finally:
        _compiler.close()


@contextmanager
def compiling_shown(show: Show | None) -> Iterator[None]:
    """Show compilation by another function within; None shows nothing.

    Examples
    --------
    >>> with compiling_shown(None):  # as `--quiet` does
    ...     pass
    """
    before, _compiler.show = _compiler.show, show
    try:
        yield
    finally:
        _compiler.show = before


def hear_compiler() -> None:
    """Show from now on what numba compiles; for modules that import kernels."""
    _compiler.hear()


def _named_by(function: Any, classes: tuple[type, ...] = ()) -> Iterator[Any]:
    """Yield what the names in the code of a function may stand for."""
    for name in function.__code__.co_names:
        yield function.__globals__.get(name)
        for module in function.__code__.co_names:
            if isinstance(home := function.__globals__.get(module), ModuleType):
                yield vars(home).get(name)
        for cls in classes:
            yield getattr(cls, name, None)


@cache
def _needed(kernel: Any) -> dict[Any, float]:
    """Return the functions that numba compiles for a kernel, itself too, with their work."""
    needed: dict[Any, float] = {}
    todo = [kernel]
    while todo:
        function = todo.pop().py_func
        if function not in needed:
            needed[function] = float(len(function.__code__.co_code))
            todo += [other for other in _named_by(function) if hasattr(other, "py_func")]
    return needed


@cache
def _kernels_of(functions: tuple[Any, ...], classes: tuple[type, ...]) -> list[Any]:
    """Return the kernels that functions of Python call, and those that these call in turn."""
    kernels, seen, todo = [], set(), list(functions)
    while todo:
        function = todo.pop()
        if function in seen or not isinstance(function, FunctionType):
            continue
        seen.add(function)
        for named in _named_by(function, classes):
            if hasattr(named, "py_func"):
                kernels.append(named)
            elif getattr(named, "__module__", "").startswith("lineament"):
                todo.append(named)
    return kernels
