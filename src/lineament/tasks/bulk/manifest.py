"""The manifest of a data set: what became of each log, one line of JSON a log."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from ...files import naming_errors, write_text
from ...logs.lines import reading

__all__ = ["MANIFEST", "Manifest", "Row"]

#: Its name in the folder. What begins with "_" is no data for Arrow, Hive and Spark.
MANIFEST = "_manifest.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What became of one log.

    Attributes
    ----------
    log : str
        Its full path, or its address.
    name : str
        What it is called in the data set: the value of the column ``log``.
    outcome : str
        ``pending`` (not reached, or stopped in), ``done`` or ``failed``.
    error : str
        Why it failed.
    output : str
        Its file, seen from the folder of the data set.
    bytes : int
        Size of that file.
    topics : list of str
        The topics of the scans.
    scans : int
        Scans that were read.
    features : dict of str to int
        Features of each kind.
    invalid : float
        Share of the beams that are invalid.
    skipped : int
        Faults of the log that were left out.
    faults : list of str
        What the first of them were.
    seconds : float
        Wall time that it took.
    log_bytes : int or None
        Size of the log; None where it is not known.
    log_state : str
        What changes when the log does: the time of its last change, or what its store tells.
    version : str
        The version of lineament.
    configuration : dict
        The method, its parameters, the noise, and how the log is read.

    Examples
    --------
    >>> Row(log="/data/a.bag", name="a.bag").outcome
    'pending'
    """

    log: str
    name: str
    outcome: str = "pending"
    error: str = ""
    output: str = ""
    bytes: int = 0
    topics: list[str] = field(default_factory=list)
    scans: int = 0
    features: dict[str, int] = field(default_factory=dict)
    invalid: float = 0.0
    skipped: int = 0
    faults: list[str] = field(default_factory=list)
    seconds: float = 0.0
    log_bytes: int | None = None
    log_state: str = ""
    version: str = ""
    configuration: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the row as one line."""
        return json.dumps(asdict(self)) + "\n"


#: What a row must have to be one; the rest may be of another version.
_NAMES = ("log", "name", "outcome", "output")


def _row_of(line: bytes) -> Row | None:
    """Read a row; None for a line that a crash has torn."""
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(record, dict) or not all(isinstance(record.get(k), str) for k in _NAMES):
        return None
    return Row(**{f.name: record[f.name] for f in fields(Row) if f.name in record})


class Manifest:
    """The rows of a data set, by log.

    Parameters
    ----------
    folder : path-like
        The folder of the data set. A manifest that is there is read; where it has several rows of
        a log the last one counts, and a line that a crash has torn is left out.

    Raises
    ------
    LogError
        If it cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> manifest = Manifest(folder)
    >>> with manifest.recording() as record:
    ...     record(Row(log="/data/a.bag", name="a.bag", outcome="done", scans=7))
    >>> Manifest(folder).rows["/data/a.bag"].scans
    7
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.path = Path(folder, MANIFEST)
        self.rows: dict[str, Row] = {}
        if self.path.exists():
            with reading(self.path), self.path.open("rb") as file:
                rows = filter(None, map(_row_of, file))
                self.rows = {row.log: row for row in rows}

    @contextmanager
    def recording(self) -> Iterator[Callable[[Row], None]]:
        """Give a function that records a row, which is on the disk when it returns.

        Before and after, also when an exception ends the block, the file is written anew with one
        row a log, sorted by name.

        Raises
        ------
        LineamentError
            If it cannot be written.
        """
        self._save()
        try:
            with naming_errors(self.path):
                file = self.path.open("ab")
            with file:

                def record(row: Row) -> None:
                    self.rows[row.log] = row
                    with naming_errors(self.path):
                        file.write(row.to_json().encode())
                        file.flush()
                        os.fsync(file.fileno())

                yield record
        finally:
            self._save()

    def _save(self) -> None:
        rows = sorted(self.rows.values(), key=lambda row: (row.name, row.log))
        write_text(self.path, "".join(row.to_json() for row in rows))
