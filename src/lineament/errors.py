"""The errors that a person can act on; the command line prints them as one line."""

from __future__ import annotations

__all__ = ["LineamentError", "LogError"]


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
        super().__init__(f"{where}: {problem}")
        self.path, self.problem, self.line = str(path), problem, line

    def __reduce__(self) -> tuple[type, tuple[str, str, int | None]]:
        return type(self), (self.path, self.problem, self.line)
