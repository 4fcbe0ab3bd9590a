"""How long runs show how far they are: items through a track, kernels that numba compiles."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager, suppress
from typing import Any

#: ``track(items, about, whole)`` gives the items, and shows how far they are. Their number is
#: ``len(whole)``, which some logs are read for: it is asked for only where it is shown.
Track = Callable[[Any, str, Sized], Iterable[Any]]
#: Takes a line about what is compiled.
Say = Callable[[str], None]

#: What is compiled in less time is not worth a line [s].
_PATIENCE = 0.5


def untracked(items: Iterable[Any], about: str, whole: Sized) -> Iterable[Any]:  # noqa: ARG001
    """Give the items, and show nothing.

    Examples
    --------
    >>> list(untracked("ab", "letters", "ab"))
    ['a', 'b']
    """
    return items


def say_to_person(line: str) -> None:
    """Print a line in a notebook or on a terminal; a script without one stays silent."""
    if sys.stderr is not None and ("ipykernel" in sys.modules or sys.stderr.isatty()):
        print(line, file=sys.stderr, flush=True)


class _Compiler:
    """Says that numba compiles kernels, and that it has: of each function it sends two events."""

    def __init__(self) -> None:
        self.say: Say | None = say_to_person
        self.reason = ""
        self._lock = threading.RLock()
        #: Pieces of work, and functions within functions, that have begun and not ended.
        self._open = self._depth = 0
        self._began, self._is_said = 0.0, False

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

    def now(self) -> str:
        """Return what is said while it compiles; "" where it does not."""
        return f"compiling kernels ({self.reason}): once, for up to some minutes" * self._is_said

    def open(self) -> None:
        with self._lock:
            self._open += 1

    def close(self) -> None:
        with self._lock:
            self._open -= 1
            self._end_if_idle()

    def start(self) -> None:
        with self._lock:
            self._began = self._began or time.perf_counter()
            self._depth += 1
            self._begin_if_long()

    def end(self) -> None:
        with self._lock:
            self._depth -= 1
            self._begin_if_long()
            self._end_if_idle()

    def _begin_if_long(self) -> None:
        if not self._is_said and time.perf_counter() - self._began >= _PATIENCE:
            self._is_said = True
            self._tell(self.now())

    def _end_if_idle(self) -> None:
        if self._open == self._depth == 0:
            if self._is_said:
                seconds = time.perf_counter() - self._began
                self._tell(f"compiled kernels in {seconds:.0f} s; they are cached for the next run")
            self._began, self._is_said = 0.0, False

    def _tell(self, line: str) -> None:
        if self.say is not None:
            # Nobody to read it is no reason to end the work.
            with suppress(OSError, ValueError):
                self.say(line)


_compiler = _Compiler()


def compiling_now() -> str:
    """Return a line about the compilation of kernels in this process; "" if there is none."""
    return _compiler.now()


@contextmanager
def compiling() -> Iterator[None]:
    """Take the kernels that are compiled within for one piece of work, with one line at its end."""
    _compiler.open()
    try:
        yield
    finally:
        _compiler.close()


@contextmanager
def compiling_said(say: Say | None) -> Iterator[None]:
    """Say what is compiled by another function within; None says nothing.

    Examples
    --------
    >>> with compiling_said(None):  # as `--quiet` does
    ...     pass
    """
    before, _compiler.say = _compiler.say, say
    try:
        yield
    finally:
        _compiler.say = before


def hear_compiler(reason: str) -> None:
    """Say from now on what numba compiles, and why it does."""
    _compiler.hear(reason)
