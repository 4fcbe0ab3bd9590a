"""How long runs show how far they are: items through a track, kernels while they are compiled."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

#: ``track(items, about, total)`` gives the items, and shows how far they are.
Track = Callable[[Any, str, int], Iterable[Any]]

#: What is compiled in less time is not shown [s].
_PATIENCE = 0.5


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
    """How far numba is with the kernels, where no library of them fits.

    Attributes
    ----------
    reason : str
        Why it compiles them.
    done : int
        Functions that are compiled.
    seconds : float
        Time since it began [s].
    is_first, is_last : bool
        Whether this is the first that is shown, or the end.

    Examples
    --------
    >>> print(Compiling("LINEAMENT_JIT is set", 14, 9.7, is_first=False, is_last=False))
    compiling kernels (LINEAMENT_JIT is set): 14 done in 10 s
    """

    reason: str
    done: int
    seconds: float
    is_first: bool
    is_last: bool

    def __str__(self) -> str:
        if self.is_last:
            return f"compiled kernels in {self.seconds:.0f} s; they are cached for the next run"
        return f"compiling kernels ({self.reason}): {self.done} done in {self.seconds:.0f} s"


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
        self.seconds, self.reason = 0.0, ""
        self.now: Compiling | None = None
        self._lock = threading.RLock()
        self._open = self._depth = self._done = 0
        self._began = self._outer_began = 0.0
        self._is_shown = False

    def hear(self, reason: str) -> None:
        """Listen to numba from now on; it has been imported."""
        from numba.core import event

        self.reason, compiler = reason, self

        class Listener(event.Listener):  # type: ignore[misc]  # numba has no types
            def on_start(self, _: Any) -> None:
                compiler.start()

            def on_end(self, _: Any) -> None:
                compiler.end()

        event.register("numba:compile", Listener())

    def open(self) -> None:
        """Take what is compiled until `close` for one piece of work."""
        with self._lock:
            self._open += 1

    def close(self) -> None:
        with self._lock:
            self._open -= 1
            self._end_if_idle()

    def start(self) -> None:
        with self._lock:
            if self._depth == 0:
                self._outer_began = time.perf_counter()
                self._began = self._began or self._outer_began
            self._depth += 1
            self._report()

    def end(self) -> None:
        with self._lock:
            self._depth, self._done = self._depth - 1, self._done + 1
            if self._depth == 0:
                self.seconds += time.perf_counter() - self._outer_began
            self._report()
            self._end_if_idle()

    def _end_if_idle(self) -> None:
        if self._open == self._depth == 0:
            if self._is_shown:
                self._report(is_last=True)
            self._began, self._done, self._is_shown = 0.0, 0, False

    def _report(self, is_last: bool = False) -> None:
        seconds = time.perf_counter() - self._began
        if seconds < _PATIENCE and not self._is_shown:
            return
        is_first, self._is_shown = not self._is_shown, True
        state = Compiling(self.reason, self._done, seconds, is_first, is_last)
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
def compiling() -> Iterator[None]:
    """Take the kernels that are compiled within for one piece of work, which is shown as such."""
    _compiler.open()
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


def hear_compiler(reason: str) -> None:
    """Show from now on what numba compiles, and why it does."""
    _compiler.hear(reason)
