"""The errors that a person can act on; the command line prints them as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["EXTRAS", "LineamentError", "LogError", "needed_by", "needs", "one_line"]

#: The packages that only some commands need, each with the extra that installs it.
EXTRAS = {
    "cyclonedds": "live",
    "distributed": "dask",
    "ezdxf": "cad",
    "foxglove": "foxglove",
    "fsspec": "remote",
    "rerun": "rerun",
    "scipy": "evaluation",
    "shapely": "evaluation",
}


def one_line(text: str) -> str:
    r"""Write what would break a line or steer a terminal as an escape, whatever a file holds.

    Examples
    --------
    >>> print(one_line("a\tb"), one_line("Gebäude 7"))
    a\tb Gebäude 7
    """
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


class LineamentError(Exception):
    """Something outside the program is wrong: a file, a folder, a log, an ending."""


class LogError(LineamentError):
    """A log cannot be read: the message names the file, the line or record, and what was expected.

    Parameters
    ----------
    path : str
        The file.
    problem : str
        What is wrong and what was expected.
    line : int, optional
        Number of the line, from 1.

    Examples
    --------
    >>> str(LogError("a.log", "FLASER has 3 of 180 ranges", line=7))
    'a.log:7: FLASER has 3 of 180 ranges'
    """

    def __init__(self, path: object, problem: str, line: int | None = None) -> None:
        where = f"{path}:{line}" if line is not None else f"{path}"
        super().__init__(one_line(f"{where}: {problem}"))
        self.path, self.problem, self.line = str(path), problem, line

    def fresh(self) -> LogError:
        """Make the same error without a traceback.

        One that is kept and raised again makes a cycle with the frame that keeps it: whatever
        that holds, such as a temporary copy of a log, would stay until the next collection.
        """
        return LogError(self.path, self.problem, self.line)

    def __reduce__(self) -> tuple[type, tuple[str, str, int | None]]:
        return type(self), (self.path, self.problem, self.line)


def needs(package: str) -> str:
    """Return what is wrong when an optional package is missing, with the command that installs it.

    Examples
    --------
    >>> needs("ezdxf")
    "needs ezdxf, which is not installed: pip install 'lineament[cad]'"
    """
    return f"needs {package}, which is not installed: pip install 'lineament[{EXTRAS[package]}]'"


@contextmanager
def needed_by(who: str) -> Iterator[None]:
    """Turn the missing import of an optional package into a LineamentError.

    Examples
    --------
    >>> with needed_by("DXF"):
    ...     raise ModuleNotFoundError(name="ezdxf")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    lineament.errors.LineamentError: DXF needs ezdxf, which is not installed: pip install ...
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        raise LineamentError(f"{who} {needs(package)}") from None
