"""The errors that a person can act on; the command line prints them as one line."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: The packages that only some commands need, each with the smallest extra that installs it.
EXTRAS = {
    "cyclonedds": "live",
    "distributed": "dask",
    "ezdxf": "cad",
    "foxglove": "foxglove",
    "fsspec": "remote",
    "numba": "jit",
    "pandas": "pandas",
    "polars": "polars",
    "rerun": "rerun",
    "scipy": "mapping",
}


#: Letters of what is wrong with a file: a damaged one can put in as many as it likes.
_MOST = 1000


def shortened(problem: str) -> str:
    """Cut what is wrong with a file to a length that a person reads."""
    return problem if len(problem) <= _MOST else f"{problem[: _MOST - 2]} …"


def one_line(text: str) -> str:
    """Write what would break a line or steer a terminal as an escape, whatever a file holds."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


class LineamentError(Exception):
    """Something outside the program is wrong: a file, a folder, a log, an ending."""


class NothingFoundError(LineamentError):
    """What was asked for was done, and nothing was found; the command line ends with 3, not 1."""


class LineamentWarning(UserWarning):
    """What was given can hardly be meant, such as ranges in millimetres; it is taken as it is."""


#: Where warnings are collected in place of being shown, by thread.
_heard: ContextVar[list[str] | None] = ContextVar("heard", default=None)


def warn(message: str) -> None:
    """Warn whoever called the package, by a text that is the same for each scan of a log."""
    heard = _heard.get()
    if heard is not None:
        if message not in heard:
            heard.append(message)
        return
    level, frame = 2, sys._getframe(1).f_back
    while frame is not None and frame.f_globals.get("__name__", "").startswith("lineament."):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, LineamentWarning, stacklevel=level + 1)


@contextmanager
def heard() -> Iterator[list[str]]:
    """Collect what is warned of within, in this thread; Python's own filters are not by thread."""
    found: list[str] = []
    token = _heard.set(found)
    try:
        yield found
    finally:
        _heard.reset(token)


class LogError(LineamentError):
    """A log cannot be read: the message names the file, the line or record, and what was expected.

    Examples
    --------
    >>> str(LogError("a.log", "FLASER has 3 of 180 ranges", line=7))
    'a.log:7: FLASER has 3 of 180 ranges'
    """

    def __init__(self, path: object, problem: str, line: int | None = None) -> None:
        where = f"{path}:{line}" if line is not None else f"{path}"
        super().__init__(one_line(f"{where}: {shortened(problem)}"))
        self.path, self.problem, self.line = str(path), problem, line

    def fresh(self) -> LogError:
        """Make the same error without a traceback, for one that is kept and raised again.

        The cycle with the frame that keeps it would hold a temporary copy of a log, for instance.
        """
        return LogError(self.path, self.problem, self.line)

    def __reduce__(self) -> tuple[type, tuple[str, str, int | None]]:
        return type(self), (self.path, self.problem, self.line)


def needs(package: str) -> str:
    """Return that an optional package is missing, with the command that installs it."""
    return f"needs {package}, which is not installed: pip install 'lineament[{EXTRAS[package]}]'"


@contextmanager
def needed_by(who: str) -> Iterator[None]:
    """Turn the missing import of an optional package into a LineamentError."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        raise LineamentError(f"{who} {needs(package)}") from None
