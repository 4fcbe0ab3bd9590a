"""The manifest of a data set: the name of each log and what became of it, one line of JSON each."""

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ...files import naming_errors, write_text
from ...logs.lines import reading
from ...logs.sources import is_address
from ..extract import Extraction

#: File name in the folder: Arrow, Hive and Spark skip what begins with "_".
MANIFEST = "_manifest.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row(Extraction):
    """What became of one log, and what was extracted from it.

    The log is a full path or an address; the name, that in the column ``log``. The outcome is
    ``pending`` (not reached, or interrupted), ``done`` or ``failed``, with the error; what was
    warned of is in `warnings`. The output is relative to the data set, of size `bytes`. `log_bytes`
    is None if unknown, `log_state` the time of the last change, or what the store reports.
    """

    name: str
    outcome: str = "pending"
    error: str = ""
    warnings: list[str] = field(default_factory=list)
    bytes: int = 0
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
    """Return the row of a line; None if a crash has torn it."""
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(record, dict) or not all(isinstance(record.get(k), str) for k in _NAMES):
        return None
    return Row(**{f.name: record[f.name] for f in fields(Row) if f.name in record})


class Manifest:
    """The rows of a data set, by log.

    An existing manifest is read: of several rows of a log the last counts, and torn lines are
    skipped. A LogError if it cannot be read.
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
        """Yield a function that appends a row and flushes it to disk.

        Before and after, also after an exception, the file is rewritten with one row a log, sorted
        by name. A LineamentError if it cannot be written.
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


def full_path(log: str) -> str:
    """Return the path or address under which every process finds a log."""
    return log if is_address(log) else os.path.abspath(log)  # noqa: PTH100 (keeps links)


def names_of(logs: Iterable[str], known: Mapping[str, str]) -> dict[str, str]:
    """Name logs (full paths or addresses): as known, else by the shortest end that is unique.

    No two names differ in case alone, and no log gets the known name of another one.

    Examples
    --------
    >>> list(names_of(["/mon/a.bag", "/tue/a.bag", "/tue/b.bag"], {}).values())
    ['mon/a.bag', 'tue/a.bag', 'b.bag']
    """
    logs = list(dict.fromkeys(logs))
    names = {log: known[log] for log in logs if log in known}
    taken = {name.casefold() for name in known.values()}
    paths = {log: log.replace(os.sep, "/").split("/") for log in logs if log not in names}
    left = {log: list(filter(None, path)) for log, path in paths.items()}
    depth = 1
    while left:
        deepest = depth > max(map(len, left.values()))
        ends = {log: "/".join(parts[-depth:]) for log, parts in left.items()}
        counts = Counter(end.casefold() for end in ends.values())
        for log, end in ends.items():
            if deepest:  # it differs from another in case alone
                numbered = (f"{end}~{number}" for number in count(1))
                end = next(name for name in numbered if name.casefold() not in taken)
            elif counts[end.casefold()] > 1 or end.casefold() in taken:
                continue
            names[log] = end
            taken.add(end.casefold())
            del left[log]
        depth += 1
    return {log: names[log] for log in logs}


def part_path(name: str, ending: str) -> str:
    """Return where the file of a log is in a data set, partitioned as Hive does."""
    return f"log={quote(name, safe=' ', errors='surrogateescape')}/part-0{ending}"
