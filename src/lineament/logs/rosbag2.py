"""ROS 2 bags: a folder with ``metadata.yaml`` and its parts, or one ``.db3`` (sqlite3) alone.

The parts hold all that is needed; ``metadata.yaml`` is read for their order alone, so that a
folder without one, or with one that is wrong about them, is read like any other.
"""

import os
import re
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from ..errors import LogError
from ..rosmsg.wire import Buffer
from ..scan import LaserScan
from .base import Head
from .lines import reading
from .mcap import McapReader
from .ros import RosLog
from .ros_bag import MAX_PIECE, Bag, Connection, Fault, RecordBag, decompress

_MAGIC = b"SQLite format 3\0"
_METADATA = "metadata.yaml"
#: A part as the metadata list it; it may be named with its folder. Newer metadata have a second
#: list, of what they know of each path. No repetition gives back what it took: a file of blanks
#: would take hours.
_LISTED = re.compile(
    r"(?m)^ *+- ++(?!path:)['\"]?([^'\"\n]+?\.(?:db3|mcap)(?:\.zstd)?)['\"]?[ \r]*+$"
)
_MAX_METADATA = 1 << 24
_ZSTD = b"\x28\xb5\x2f\xfd"
#: How sqlite reaches files that nobody else writes.
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
_MESSAGES = "SELECT topic_id, data FROM messages WHERE topic_id IN ({}) ORDER BY timestamp, id"


class Rosbag2Log(RosLog):
    """Scans of a ROS 2 bag: a folder with parts of sqlite3 or MCAP, or a single ``.db3``."""

    format = "rosbag2"
    description = "ROS 2 bag (sensor_msgs)"
    endings = (".db3",)

    #: Parts that the metadata list and that are not there.
    _missing: Sequence[str] = ()

    def _open_bags(self) -> list[Bag]:
        if not self.path.is_dir():
            return [Sqlite3Bag(self.source)]
        with reading(self.name):
            parts = _parts(self.path)
            self._missing = [part.name for part in parts if not part.is_file()]
        self._report_missing()
        bags = [_bag(part) for part in parts if part.name not in self._missing]
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


def _parts(folder: Path) -> list[Path]:
    """List the parts of a bag in order: as the metadata have them, else by their numbers."""
    metadata = folder / _METADATA
    if metadata.is_file():
        with metadata.open("rb") as file:
            text = file.read(_MAX_METADATA).decode("utf-8", "replace")
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


def _bag(part: Path) -> Bag:
    if part.suffix == ".zstd":
        raise LogError(part, "is compressed as a whole: decompress it first (zstd -d)")
    return RecordBag(part, McapReader) if part.suffix == ".mcap" else Sqlite3Bag(part)


class Sqlite3Bag(Bag):
    """One part of a ROS 2 bag, a database."""

    def messages(
        self, topics: Collection[str] | None, fault: Fault
    ) -> Iterator[tuple[Connection, Buffer]]:
        """Read the messages by the time when they were received; see `Bag`."""
        try:
            with self._opened() as (database, connections):
                wanted = [n for n, c in connections.items() if topics is None or c.topic in topics]
                query = _MESSAGES.format(",".join("?" * len(wanted)))
                for number, data in database.execute(query, wanted):
                    try:
                        message = _uncompressed(data)
                    except ValueError as error:
                        fault(LogError(self.path, f"{connections[number].topic}: {error}"))
                    else:
                        yield connections[number], message
        except LogError as error:
            fault(error)

    def counts(self) -> Counter[Connection]:
        """Count by the database; LogError if that is broken."""
        total: Counter[Connection] = Counter()
        with self._opened() as (database, connections):
            counts = dict(database.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY 1"))
            for number, connection in connections.items():
                total[connection] += counts.get(number, 0)
        return total

    @contextmanager
    def _opened(self) -> Iterator[tuple[sqlite3.Connection, dict[int, Connection]]]:
        """Open the database, without any chance of writing or waiting; what it raises is one line.

        Refused are those without the tables, or with views and columns that could compute.
        """
        path = Path(self.path).absolute()
        try:
            with closing(sqlite3.connect(f"{path.as_uri()}?{_mode(path)}", uri=True)) as database:
                if not _shares(path):  # Else it would keep its shared memory in a file.
                    database.execute("PRAGMA locking_mode = EXCLUSIVE")
                database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_PIECE)
                database.execute("PRAGMA trusted_schema = OFF")
                tables = {str(row[0]) for row in database.execute(_TABLES)}
                if not {"topics", "messages"} <= tables:
                    names = ", ".join(sorted(tables)) or "none"
                    problem = f"expected the tables topics and messages; it has: {names}"
                    raise LogError(self.path, f"is no ROS 2 bag, {problem}")
                for name, column in database.execute(_COMPUTED):
                    problem = f"column {column} of its table {name} is computed"
                    raise LogError(self.path, f"is no ROS 2 bag: {problem}")
                topics = database.execute(_TOPICS)
                yield database, {n: Connection.named(*map(str, names)) for n, *names in topics}
        except _BROKEN as error:
            problem = f"cannot be read as a ROS 2 bag (sqlite3): {error}"
            raise LogError(self.path, problem) from None


def _shares(path: Path) -> bool:
    """Whether a recorder that may still run shares its memory with readers, by a file."""
    return path.with_name(f"{path.name}-shm").exists()


def _mode(path: Path) -> str:
    """How to open a database so that nothing is created beside it."""
    # A recorder that was stopped, or still runs, keeps the newest pages in a file beside it.
    newest = path.with_name(f"{path.name}-wal")
    if not newest.exists() or not newest.stat().st_size:
        return "immutable=1"
    return "mode=ro" if _shares(path) else f"mode=ro&vfs={_WITHOUT_LOCKS}"


def _uncompressed(data: object) -> Buffer:
    """Decompress a message of a bag that is compressed message by message."""
    if not isinstance(data, bytes):
        raise ValueError(f"message is {data!r:.20}, expected bytes")
    if not data.startswith(_ZSTD):
        return data
    from zstandard import ZstdError, frame_content_size

    try:
        size = frame_content_size(data)
    except ZstdError as error:
        raise ValueError(f"zstd data is broken: {error}") from None
    return decompress("zstd", data, size)
