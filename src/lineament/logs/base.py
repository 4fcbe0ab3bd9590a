"""What every log offers, and what a reader says about its format."""

import operator
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, SupportsIndex, TypeVar, overload

from .._lazy import Pictured
from ..errors import LogError
from ..limits import LIMITS, Limits
from ..scan import LaserScan, Pose
from ..scan.changes import Mask, check_scale, checked_mask
from ..scan.fields import STAMPS, checked_mounting
from ..scan.poses import carried, compose
from ..scan.units import why_invalid

if TYPE_CHECKING:
    from ..rosmsg.poses import StampedPose

T = TypeVar("T")

#: What is wrong with a file whose end is not where it was.
SHRUNK = "has become shorter while it was read"
#: How many messages about faults are kept.
MAX_FAULTS = 10
#: Which return of a beam that has several can be asked for.
ECHOES = ("first", "last", "strongest")


@dataclass(frozen=True)
class ReadOptions:
    """How logs are read, as `open_log` takes it; ValueError if a value is wrong."""

    echo: str = "first"
    ring: int | None = None
    pose_topic: str | None = None
    limits: Limits = LIMITS
    stamp: str = "first"
    scale: float = 1.0
    laser_pose: Pose | None = None
    mask: Mask = ()

    def __post_init__(self) -> None:
        if self.echo not in ECHOES:
            raise ValueError(f"echo is {self.echo!r}, expected {' or '.join(ECHOES)}")
        if self.ring is not None and (type(self.ring) is not int or self.ring < 0):
            raise ValueError(f"ring is {self.ring!r}, expected a whole number ≥ 0")
        if self.stamp not in STAMPS:
            raise ValueError(f"stamp is {self.stamp!r}, expected {' or '.join(STAMPS)}")
        check_scale(self.scale)
        if self.laser_pose is not None:
            object.__setattr__(self, "laser_pose", checked_mounting(self.laser_pose))
        object.__setattr__(self, "mask", checked_mask(self.mask))
        topic = self.pose_topic
        if topic is not None and not (isinstance(topic, str) and topic):
            raise ValueError(f"pose_topic is {topic!r}, expected the name of a topic")


@dataclass(frozen=True)
class Topic:
    """One kind of messages in a log, of scans or of anything else.

    `count` messages from `publishers` senders; `type` is empty where the name says it all.
    """

    name: str
    type: str
    count: int
    publishers: int = 1


@dataclass(frozen=True)
class Head:
    """The beginning of a file or folder, from which readers recognise their format.

    `data` is decompressed where the file is gzip, and empty for a folder.
    """

    path: Path
    data: bytes
    is_directory: bool = False
    is_gzip: bool = False


@dataclass
class Skipped:
    """Faults that an iteration skipped: how many, and the first messages."""

    count: int = 0
    faults: list[str] = field(default_factory=list)


class Log(Pictured, ABC):
    """An iterable of `lineament.LaserScan`; each iteration reads from the start.

    ``log[i]`` is a scan, ``log[i:j]`` a list of them; in a notebook a log is a picture.

    Parameters
    ----------
    path : path-like
        The file. Its ``str`` is what errors call it; this is not the path itself where the log
        is a temporary copy of what an archive or an address holds.
    topic : str, optional
        Which scans to read; all, or the reader's choice, if None.
    keep_going : bool
        Skip and count what is faulty instead of raising an error at it.
    options : ReadOptions
        How to make scans of messages that hold more than one, and the limits of what is read.

    Attributes
    ----------
    source, path, name
        The file as it was given, as a ``pathlib.Path``, and as messages call it.
    """

    #: Name of the format.
    format: ClassVar[str]
    #: The format as an error names it, with what it holds.
    description: ClassVar[str]
    #: Usual endings, lower case, of files in this format.
    endings: ClassVar[tuple[str, ...]]
    #: Whether the reader seeks in the file, which must then not be compressed as a whole.
    needs_seek: ClassVar[bool] = False
    #: Whether poses may be chosen by a topic; other logs have their own, or none.
    has_pose_topics: ClassVar[bool] = False
    #: Whether all of it is in memory, whatever becomes of the file.
    is_held: ClassVar[bool] = False
    #: The one topic of a format whose scans are all of a kind.
    only_topic: ClassVar[str] = "scan"

    def __init__(
        self,
        path: str | os.PathLike[str],
        topic: str | None = None,
        *,
        keep_going: bool = False,
        options: ReadOptions = ReadOptions(),
    ) -> None:
        self.source = path  # A temporary copy lives as long as this.
        self.path = Path(path)
        self.name = str(path)
        self.topic = topic
        self.keep_going = keep_going
        self.options, self.limits = options, options.limits
        self._skipped = Skipped()
        self._size = 0
        self._open()
        self._check_size()

    def __reduce__(self) -> tuple[Callable[..., Self], tuple[Any, ...]]:
        """Return how a copy opens the file again."""
        open_again = partial(type(self), keep_going=self.keep_going, options=self.options)
        return open_again, (self.source, self.topic)

    @property
    def skipped(self) -> int:
        """How many faults the iteration that began last skipped; 0 unless `keep_going`."""
        return self._skipped.count

    @property
    def faults(self) -> list[str]:
        """The first of these faults."""
        return self._skipped.faults

    def _open(self) -> None:
        """Read as much of the file as shows that it is a log, and has the topic."""

    @classmethod
    @abstractmethod
    def recognises(cls, head: Head) -> bool:
        """Whether a file that begins so is in this format."""

    @property
    def topics(self) -> list[str]:
        """The topics of the log that carry scans."""
        return [self.only_topic]

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of scans, faulty ones included."""

    @abstractmethod
    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        """Read each scan, with its topic, from the start; faults go through `_fault`."""

    def contents(self) -> list[Topic]:
        """Return all kinds of messages in the log, scans and others; empty where unknown."""
        return []

    def mountings(self) -> "list[StampedPose]":
        """Return where frames of the robot are fixed in each other; most logs do not say."""
        return []

    def items(self) -> Iterator[tuple[str, LaserScan]]:
        """Yield each scan behind its topic, which is one of `topics`, from the start."""
        # Another iteration that begins before this one ends counts its faults by itself.
        this = object.__new__(type(self))
        vars(this).update(vars(self))
        this._skipped = self._skipped = Skipped()
        this._check_size()
        self._size = this._size
        scans, beams = self.limits.scans, self.limits.beams
        for count, (topic, scan) in enumerate(this._items(), 1):
            n = len(scan.ranges)
            if n <= beams and count <= scans:
                yield topic, self._meant(scan)
                continue
            try:
                self.limits.check("scans", count)
                self.limits.check("beams", n)  # Most readers checked it before it was made.
            except ValueError as error:
                this._fault(LogError(self.name, f"scan {count - 1}: {error}"))
            if count > scans:
                return

    def _meant(self, scan: LaserScan) -> LaserScan:
        """Return a scan as the options say what is in the log."""
        options = self.options
        if options.stamp != "first":
            scan = scan.stamped(options.stamp)
        if options.laser_pose is not None and scan.pose is not None:
            pose, covariance = compose(scan.pose, options.laser_pose), scan.pose_covariance
            if covariance is not None:
                covariance = carried(covariance, scan.pose, pose)
            scan = scan.with_pose(pose, covariance)
        if options.mask:
            scan = scan.masked(options.mask)
        return scan if options.scale == 1 else scan.scaled(options.scale)

    def measured(self) -> Iterator[tuple[str, LaserScan]]:
        """Yield what `items` does; a LogError at the end if no beam of all scans is valid."""
        scans, is_measured, why = 0, False, ""
        for topic, scan in self.items():
            scans += 1
            is_measured = is_measured or bool(scan.valid.any())
            if not is_measured and not why:
                why = why_invalid(scan.ranges, scan.range_min, scan.range_max)
            yield topic, scan
        if scans and not is_measured:
            why = why or "no beam returned anything"
            raise LogError(self.name, f"has no valid range in {scans} scans: {why}")

    def _check_size(self) -> None:
        """Report that the file has become shorter than it was when the log was last read."""
        try:
            before, self._size = self._size, self.path.stat().st_size
        except OSError:
            return  # What reads it reports that.
        if self._size < before and not self.is_held and self.path.is_file():
            self._fault(LogError(self.name, SHRUNK))

    def __iter__(self) -> Iterator[LaserScan]:
        return map(itemgetter(1), self.items())

    @overload
    def __getitem__(self, index: SupportsIndex) -> LaserScan: ...

    @overload
    def __getitem__(self, index: slice) -> list[LaserScan]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> LaserScan | list[LaserScan]:
        # Both read from the start: a log is a stream.
        if isinstance(index, slice):
            wanted = range(len(self))[index]
            if wanted.step < 0:
                raise ValueError(f"step is {wanted.step}, expected > 0: a log is read forwards")
            return list(islice(self, wanted.start, wanted.stop, wanted.step))
        i = operator.index(index)
        i += len(self) * (i < 0)
        scan = next(islice(self, i, None), None) if i >= 0 else None
        if scan is None:
            raise IndexError(f"{self.name}: has no scan {index}, expected 0 to {len(self) - 1}")
        return scan

    def scan(self, index: int) -> LaserScan:
        """Read one scan by its index, from 0; those before it are read too.

        Raises
        ------
        LogError
            If there is no such scan.
        """
        return self.item(index)[1]

    def item(self, index: int) -> tuple[str, LaserScan]:
        """Read one scan as `scan` does, behind its topic."""
        if index >= 0:
            for item in islice(self.items(), index, None):
                return item
        raise LogError(self.name, f"has no scan {index}, expected 0 to {len(self) - 1}")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, topic={self.topic!r})"

    def _fault(self, error: LogError) -> None:
        """Raise `error`, or count it when the log keeps going."""
        if not self.keep_going:
            raise error.fresh() from None
        self._skipped.count += 1
        if len(self.faults) < MAX_FAULTS:
            self.faults.append(str(error))

    def _made(
        self, topic: str, where: str, make: Callable[..., LaserScan], *arguments: Any
    ) -> Iterator[tuple[str, LaserScan]]:
        """Yield the scan that `make` returns, behind its topic; what it raises is a fault."""
        try:
            scan = make(*arguments)
        except (ValueError, OverflowError) as error:
            self._fault(LogError(self.name, f"{where}{error}"))
        else:
            yield topic, scan

    def _until_broken(self, items: Iterable[T]) -> Iterator[T]:
        """Pass on what is read from a file; a break in it is a fault, and the end."""
        try:
            yield from items
        except LogError as error:
            self._fault(error)

    def _check_topic(self) -> None:
        if self.topic is not None and self.topic not in self.topics:
            raise self._no_such_topic(self.topics)

    def _no_such_topic(self, topics: list[str]) -> LogError:
        known = ", ".join(topics) or "none that carries scans"
        return LogError(self.name, f"has no topic {self.topic!r}; topics there are: {known}")
