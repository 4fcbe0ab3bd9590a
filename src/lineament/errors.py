"""The errors that a person can act on; the command line prints them as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

#: The packages that only some commands need, each with the extra that installs it.
EXTRAS = {
    "cyclonedds": "live",
    "distributed": "dask",
    "ezdxf": "cad",
    "foxglove": "foxglove",
    "fsspec": "remote",
    "pandas": "pandas",
    "polars": "polars",
    "rerun": "rerun",
    "scipy": "evaluation",
    "shapely": "evaluation",
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


def needs(package: str, extra: str = "") -> str:
    """Return that an optional package is missing, with the command that installs it."""
    extra = extra or EXTRAS[package]
    return f"needs {package}, which is not installed: pip install 'lineament[{extra}]'"


@contextmanager
def needed_by(who: str, extra: str = "") -> Iterator[None]:
    """Turn the missing import of an optional package into a LineamentError.

    `extra` is the one to install where several have the package, as they have scipy.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        raise LineamentError(f"{who} {needs(package, extra)}") from None
