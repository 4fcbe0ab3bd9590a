"""ROS 2 bags: a folder with ``metadata.yaml`` and its parts, or one ``.db3`` (sqlite3) alone.

The parts hold all that is needed; ``metadata.yaml`` is read for their order alone, so that a
folder without one, or with one that is wrong about them, is read like any other.
"""

import os
import re
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import LogError
from ..limits import Limits
from ..rosmsg.wire import Buffer
from ..scan import LaserScan
from .base import SHRUNK, Head
from .lines import reading
from .mcap import McapReader
from .ros import RosLog
from .ros_bag import Bag, Connection, Fault, RecordBag, decompress

_MAGIC = b"SQLite format 3\0"
_METADATA = "metadata.yaml"
#: A part as the metadata list it; it may be named with its folder. Newer metadata have a second
#: list, of what they know of each path. No repetition gives back what it took: a file of blanks
#: would take hours.
_LISTED = re.compile(
    r"(?m)^ *+- ++(?!path:)['\"]?([^'\"\n]+?\.(?:db3|mcap)(?:\.zstd)?)['\"]?[ \r]*+$"
)
_ZSTD = b"\x28\xb5\x2f\xfd"
#: How sqlite opens a file that nobody writes, and reaches one that nobody else writes.
_ALONE = "immutable=1"
_WITHOUT_LOCKS = "win32-none" if os.name == "nt" else "unix-none"
#: What it raises at damage; the second where its message holds a name that is no text.
_BROKEN = (sqlite3.Error, UnicodeDecodeError)

#: Tables that are stored: views and virtual tables could compute without end, and so could columns.
_TABLES = "SELECT name FROM sqlite_master WHERE type = 'table' AND rootpage > 0"
_COMPUTED = (
    "SELECT t.name, c.name FROM sqlite_master AS t, pragma_table_xinfo(t.name) AS c "
    "WHERE t.name IN ('topics', 'messages') AND c.hidden"
)
_TOPICS = "SELECT id, name, type, serialization_format FROM topics"
_COUNTS = "SELECT topic_id, COUNT(*) FROM messages GROUP BY 1"
#: What is sorted, perhaps in a temporary file, is small: the messages themselves are looked up.
_MESSAGES = (
    "SELECT m.topic_id, m.data FROM (SELECT id FROM messages WHERE topic_id IN ({}) "
    "ORDER BY timestamp, id LIMIT -1) AS o CROSS JOIN messages AS m ON m.id = o.id"
)
#: A row of a table takes more room than that in a file [bytes]: its place, its size, its key, the
#: types of its columns, a time and the beginning of a message.
_LEAST_ROW = 16
#: Steps of the machine of sqlite that a query takes for a row at most, and between two looks.
_STEPS, _LOOK = 64, 100_000


class Rosbag2Log(RosLog):
    """Scans of a ROS 2 bag: a folder with parts of sqlite3 or MCAP, or a single ``.db3``."""

    format = "rosbag2"
    description = "ROS 2 bag (sensor_msgs)"
    endings = (".db3",)

    #: Parts that the metadata list and that are not there.
    _missing: Sequence[str] = ()

    def _open_bags(self) -> list[Bag]:
        if not self.path.is_dir():
            return [Sqlite3Bag(self.source, self.limits)]
        with reading(self.name):
            parts = _parts(self.path, self.limits)
            self._missing = [part.name for part in parts if not part.is_file()]
        self._report_missing()
        bags = [_bag(part, self.limits) for part in parts if part.name not in self._missing]
        if not bags:
            raise LogError(self.name, "holds no part of a ROS 2 bag, expected .db3 or .mcap")
        return bags

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        self._report_missing()
        yield from super()._items()

    def _report_missing(self) -> None:
        for name in self._missing:
            self._fault(LogError(self.name, f"has no {name}, which {_METADATA} lists"))

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it is sqlite3, a folder with metadata, or one of the parts of a single bag."""
        if not head.is_directory:
            return head.data.startswith(_MAGIC)
        with reading(head.path):
            return (head.path / _METADATA).is_file() or _holds_one_bag(head.path)


def _parts(folder: Path, limits: Limits) -> list[Path]:
    """List the parts of a bag in order: as the metadata have them, else by their numbers."""
    metadata = folder / _METADATA
    if metadata.is_file():
        with metadata.open("rb") as file:
            text = file.read(limits.line).decode("utf-8", "replace")
        # Names alone: a bag does not reach out of its folder.
        names = dict.fromkeys(Path(name).name for name in _LISTED.findall(text))
        if names:
            return [folder / name for name in names]
    found = [path for path in folder.iterdir() if path.suffix in (".db3", ".mcap")]
    return sorted(found, key=lambda path: (_number(path), path.name))


def _number(path: Path) -> int:
    digits = re.search(r"_(\d+)$", path.stem)
    return int(digits[1]) if digits else -1


def _holds_one_bag(folder: Path) -> bool:
    """Whether there is nothing but databases with the same name before their numbers."""
    files = list(folder.iterdir())
    # What a recorder keeps beside a database ends with more letters.
    names = {re.sub(r"(_\d+)?\.db3(-wal|-shm)?$", ".db3", path.name) for path in files}
    return len(names) == 1 and names.pop().endswith(".db3")


def _bag(part: Path, limits: Limits) -> Bag:
    if part.suffix == ".zstd":
        raise LogError(part, "is compressed as a whole: decompress it first (zstd -d)")
    if part.suffix == ".mcap":
        return RecordBag(part, McapReader, limits)
    return Sqlite3Bag(part, limits)


class Sqlite3Bag(Bag):
    """One part of a ROS 2 bag, a database."""

    def messages(
        self, topics: Collection[str] | None, fault: Fault
    ) -> Iterator[tuple[Connection, Buffer]]:
        """Read the messages by the time when they were received; see `Bag`."""
        try:
            with self._opened(fault) as (database, connections, extent):
                wanted = [n for n, c in connections.items() if topics is None or c.topic in topics]
                query = _MESSAGES.format(",".join("?" * len(wanted)))
                packed = unpacked = 0
                for number, data in database.execute(query, wanted):
                    packed += len(data) if isinstance(data, bytes) else 0
                    extent.check(packed)
                    try:
                        message = _uncompressed(data, unpacked, packed, self.limits)
                        unpacked += len(message)
                    except ValueError as error:
                        fault(LogError(self.path, f"{connections[number].topic}: {error}"))
                    else:
                        yield connections[number], message
        except LogError as error:
            fault(error)

    def counts(self) -> Counter[Connection]:
        """Count by the database; LogError if that is broken."""
        total: Counter[Connection] = Counter()
        with self._opened(lambda error: None) as (database, connections, _):  # noqa: ARG005
            counts = dict(database.execute(_COUNTS))
            self.limits.check("rows", sum(counts.values()), partial(LogError, self.path))
            for number, connection in connections.items():
                total[connection] += counts.get(number, 0)
        return total

    @contextmanager
    def _opened(
        self, fault: Fault
    ) -> Iterator[tuple[sqlite3.Connection, dict[int, Connection], "_Extent"]]:
        """Open the database, without any chance of writing or waiting; what it raises is one line.

        It comes with its connections and its extent. Refused are those without the tables, or with
        views and columns that could compute; what is cut off is a fault.
        """
        with reading(self.path):
            extent = _Extent(self.path, self.limits)
            cut_off = f"is cut off: ends at byte {extent.size}" if extent.is_cut_off() else ""
        try:
            with extent.file, closing(sqlite3.connect(extent.uri, uri=True)) as database:
                if not _shares(extent.path):  # Else it would keep its shared memory in a file.
                    database.execute("PRAGMA locking_mode = EXCLUSIVE")
                database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, self.limits.piece)
                database.execute("PRAGMA trusted_schema = OFF")
                database.set_progress_handler(extent.look, _LOOK)
                if cut_off:
                    fault(LogError(self.path, cut_off))
                tables = {str(row[0]) for row in database.execute(_TABLES)}
                if not {"topics", "messages"} <= tables:
                    names = ", ".join(sorted(tables)) or "none"
                    problem = f"expected the tables topics and messages; it has: {names}"
                    raise LogError(self.path, f"is no ROS 2 bag, {problem}")
                for name, column in database.execute(_COMPUTED):
                    problem = f"column {column} of its table {name} is computed"
                    raise LogError(self.path, f"is no ROS 2 bag: {problem}")
                yield database, self._connections(database.execute(_TOPICS)), extent
        except _BROKEN as error:
            if extent.is_endless:
                raise extent.overrun() from None
            problem = f"{cut_off or 'cannot be read as a ROS 2 bag'} (sqlite3: {error})"
            raise LogError(self.path, problem) from None

    def _connections(self, topics: Iterable[Any]) -> dict[int, Connection]:
        try:
            return {n: Connection.named(self.limits, *map(str, names)) for n, *names in topics}
        except ValueError as error:
            raise LogError(self.path, str(error)) from None


class _Extent:
    """How large a database is, and so how much it can hold: its pages may lead round in circles."""

    def __init__(self, name: str | os.PathLike[str], limits: Limits) -> None:
        self.path = Path(name).absolute()
        mode = _mode(self.path)
        self._name, self._limits, self._is_alone = name, limits, mode == _ALONE
        self.uri = f"{self.path.as_uri()}?{mode}"
        self.file = self.path.open("rb")
        self._number = self.file.fileno()
        self.size = self._now()
        self._rows = min(limits.rows, self.size // _LEAST_ROW)
        self._looks = self._rows * _STEPS // _LOOK + 1
        #: Whether sqlite was stopped, as it took more steps than the rows there is room for.
        self.is_endless = False

    def look(self) -> bool:
        """Return whether sqlite is to stop, which asks again and again."""
        self._looks -= 1
        self.is_endless = self._looks < 0
        return self.is_endless

    def overrun(self) -> LogError:
        """Return what is wrong with a database that holds more than it has room for."""
        return LogError(self._name, f"holds more rows than its {self.size} bytes have room for")

    def check(self, read: int) -> None:
        """LogError if the file has become shorter, or more bytes were read than it holds."""
        now = os.fstat(self._number).st_size if self._is_alone else self._now()
        if now < self.size and self._is_alone:
            raise LogError(self._name, SHRUNK)
        if read > now:
            raise self.overrun()

    def is_cut_off(self) -> bool:
        """Whether the file is shorter than it says; sqlite reads what is missing as zeros."""
        head = self.file.read(100)
        # An old recorder does not keep the number of pages.
        if not self._is_alone or len(head) < 100 or head[24:28] != head[92:96]:
            return False
        page, pages = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
        return self.size < (page if page > 1 else 1 << 16) * pages

    def _now(self) -> int:
        newest = self.path.with_name(f"{self.path.name}-wal")
        beside = newest.stat().st_size if not self._is_alone and newest.exists() else 0
        return os.fstat(self._number).st_size + beside


def _shares(path: Path) -> bool:
    """Whether a recorder that may still run shares its memory with readers, by a file."""
    return path.with_name(f"{path.name}-shm").exists()


def _mode(path: Path) -> str:
    """How to open a database so that nothing is created beside it."""
    # A recorder that was stopped, or still runs, keeps the newest pages in a file beside it.
    newest = path.with_name(f"{path.name}-wal")
    if not newest.exists() or not newest.stat().st_size:
        return _ALONE
    return "mode=ro" if _shares(path) else f"mode=ro&vfs={_WITHOUT_LOCKS}"


def _uncompressed(data: object, before: int, packed: int, limits: Limits) -> Buffer:
    """Decompress a message of a bag that is compressed message by message.

    `packed` bytes were read with it, `before` unpacked without it.
    """
    if not isinstance(data, bytes):
        raise ValueError(f"message is {data!r:.20}, expected bytes")
    if not data.startswith(_ZSTD):
        return data
    from zstandard import ZstdError, frame_content_size

    try:
        size = frame_content_size(data)
    except ZstdError as error:
        raise ValueError(f"zstd data is broken: {error}") from None
    limits.check_growth(before + size, packed)
    return decompress("zstd", data, size, limits)
