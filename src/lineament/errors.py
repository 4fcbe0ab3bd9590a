"""The errors that a person can act on; the command line prints them as one line."""

from __future__ import annotations

__all__ = ["LineamentError", "LogError", "one_line"]


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
