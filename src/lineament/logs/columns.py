"""Columns of text: rows that are cut at commas, semicolons or tabs, below a header or not."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

from .base import Head
from .lines import BOM, numbered_lines
from .words import floats

__all__ = ["Columns"]

_DELIMITERS = (b",", b";", b"\t")


@dataclass(frozen=True)
class Columns:
    """How the rows of a table are cut, and what its columns are called.

    Parameters
    ----------
    delimiter : bytes
        What stands between two cells.
    names : tuple of str
        Names of the columns, lower case; none where the table has no header.
    width : int
        Number of columns.
    """

    delimiter: bytes
    names: tuple[str, ...]
    width: int

    @classmethod
    def of(cls, line: bytes) -> Columns:
        """Tell the columns from the first row, which is a header unless it is all numbers.

        Examples
        --------
        >>> Columns.of(b"Angle; Range").names, Columns.of(b"0.5,1.25").names
        (('angle', 'range'), ())
        """
        delimiter = next((sign for sign in _DELIMITERS if sign in line), b",")
        cells = _cut(line, delimiter)
        try:
            floats("column", cells)
        except ValueError:
            names = tuple(cell.decode("utf-8", "replace").lower() for cell in cells)
            return cls(delimiter, names, len(cells))
        return cls(delimiter, (), len(cells))

    @classmethod
    def of_head(cls, head: Head) -> Columns | None:
        """Tell the columns from the beginning of a file; None if it has no row."""
        for line in head.data.removeprefix(BOM).split(b"\n"):
            if _is_row(line):
                return cls.of(line)
        return None

    @classmethod
    def of_file(cls, path: str | os.PathLike[str]) -> Columns | None:
        """Tell the columns of a file; None if it has no row."""
        for _, line in numbered_lines(path):
            if _is_row(line):
                return cls.of(line)
        return None

    def cells(self, line: bytes) -> list[bytes]:
        """Cut a row into its cells, without the spaces and quotes around them."""
        return _cut(line, self.delimiter)

    def rows(self, path: str | os.PathLike[str]) -> Iterator[tuple[int, bytes]]:
        """Yield each row below the header with the number of its line."""
        below = not self.names
        for number, line in numbered_lines(path):
            if _is_row(line):
                if below:
                    yield number, line
                below = True


def _is_row(line: bytes) -> bool:
    return not (line.isspace() or not line or line.lstrip().startswith(b"#"))


def _cut(line: bytes, delimiter: bytes) -> list[bytes]:
    return [cell.strip(b' \t\r"') for cell in line.split(delimiter)]
