"""Scans from bags of ROS messages, whatever the container."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from ..errors import LogError, one_line, warn
from ..rosmsg.scans import CLOUD, MULTI_ECHO, decoders
from ..rosmsg.wire import Buffer
from ..scan import LaserScan
from .base import Log, Topic
from .ros_bag import Bag, Connection

if TYPE_CHECKING:
    from ..rosmsg.poses import StampedPose
    from .ros_poses import PoseFinder

#: How many topics an error lists.
_LISTED = 20


class RosLog(Log):
    """Scans of a bag: those of the topic that is asked for, or of all, in the order of the bag.

    Topics of ``PointCloud2`` carry scans only where a ring is chosen. Poses are those of the frame
    that the topic of poses is about, and never guessed: without a topic there are none.

    Faults are broken chunks and malformed messages, by their number from 0 among those of their
    topic; a bag that is broken or cut off raises a LogError after all that is whole.
    """

    needs_seek = has_pose_topics = True

    def _open(self) -> None:
        self._decoders = decoders(self.options.echo, self.options.ring, self.limits)
        self._bags = self._open_bags()
        self._counts: Counter[Connection] = Counter()
        for bag in self._bags:
            self._counts.update(bag.counts())
        self._wanted = self.topics if self.topic is None else [self.topic]
        if not any(name in self.topics for name in self._wanted):
            raise self._no_scans()
        # Of the whole bag, whatever the topic: of several scanners one may have rings.
        for name, is_given, kind in (
            ("echo", self.options.echo != "first", MULTI_ECHO),
            ("ring", self.options.ring is not None, CLOUD),
        ):
            if is_given and not self._topics_of((kind,)):
                short = kind.removeprefix("sensor_msgs/")
                warn(one_line(f"{self.name}: has no {short}: {name} changes nothing"))
        self._pose_finder()
        self._overheard: Mapping[str, Container[str]] = {}

    @abstractmethod
    def _open_bags(self) -> list[Bag]:
        """Open the files of the bag, in the order of time."""

    @property
    def topics(self) -> list[str]:
        """The topics with scans."""
        return self._topics_of(self._decoders)

    def __len__(self) -> int:
        counts = self._counts.items()
        return sum(n for c, n in counts if c.topic in self._wanted and c.type in self._decoders)

    def contents(self) -> list[Topic]:
        """Return all topics, with their types, messages and, in a ROS 1 bag, publishers."""
        kinds: dict[tuple[str, str], list[int]] = {}
        for connection, count in sorted(self._counts.items()):
            kinds.setdefault(connection[:2], []).append(count)
        return [
            Topic(name, kind, sum(counts), len(counts)) for (name, kind), counts in kinds.items()
        ]

    def mountings(self) -> list[StampedPose]:
        """Return where frames of the robot are fixed in each other, by ``/tf_static``."""
        from ..rosmsg.poses import TRANSFORMS, stamped_poses
        from .ros_poses import MAX_POSES, STATIC

        found: list[StampedPose] = []
        for bag in self._bags:
            for connection, data in bag.messages({STATIC}, self._fault):
                kind = connection.type
                try:
                    if kind in TRANSFORMS and len(found) < MAX_POSES:
                        found += stamped_poses(data, connection.encoding, kind, self.limits)
                except ValueError as error:
                    self._fault(LogError(bag.path, f"{STATIC}: {error}"))
        return found

    def overhear(
        self, topics: Mapping[str, Container[str]], hear: Callable[[Connection, Buffer], None]
    ) -> None:
        """While scans are read, call `hear` with messages of such topics and types among them."""
        self._overheard, self._hear = topics, hear

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        finder = self._pose_finder()
        waiting = finder.finish if finder else tuple
        try:
            yield from self._ready(finder)
        except LogError:
            yield from waiting()  # They are whole, whatever comes behind them.
            raise
        yield from waiting()

    def _ready(self, finder: PoseFinder | None) -> Iterator[tuple[str, LaserScan]]:
        topics = {*self._wanted, *self._overheard, *(finder.topics if finder else ())}
        numbers: Counter[str] = Counter()
        for bag in self._bags:
            for connection, data in bag.messages(topics, self._fault):
                number = numbers[connection.topic]
                numbers[connection.topic] = number + 1
                try:
                    ready = self._read(connection, data, finder)
                except ValueError as error:
                    where = f"{connection.topic} message {number}"
                    self._fault(LogError(bag.path, f"{where}: {error}"))
                else:
                    yield from ready

    def _read(
        self, connection: Connection, data: Buffer, finder: PoseFinder | None
    ) -> Sequence[tuple[str, LaserScan]]:
        """Read one message: the scans that are ready after it, by topic."""
        topic, kind = connection.topic, connection.type
        if finder and finder.takes(topic, kind):
            return finder.learn(connection, data)
        if kind in self._overheard.get(topic, ()):
            self._hear(connection, data)
        if topic not in self._wanted or kind not in self._decoders:
            return ()
        scan = self._decoders[kind](data, connection.encoding)
        return finder.wait(topic, scan) if finder else ((topic, scan),)

    def _pose_finder(self) -> PoseFinder | None:
        if self.options.pose_topic is None:
            return None
        from ..rosmsg.poses import TRANSFORMS
        from .ros_poses import PoseFinder

        try:
            is_given = self.options.laser_pose is not None
            mountings = None if is_given else self._topics_of(TRANSFORMS)
            finder = PoseFinder(self.name, self.options.pose_topic, self.limits, mountings)
        except ValueError as error:
            raise LogError(self.name, str(error)) from None
        if finder.topic not in self._topics_of(finder.types):
            wanted = f"{' or '.join(finder.types)} on {finder.topic!r}"
            raise LogError(self.name, f"has no {wanted}; topics there are: {self._listing()}")
        return finder

    def _topics_of(self, types: Container[str]) -> list[str]:
        return sorted({c.topic for c in self._counts if c.type in types})

    def _no_scans(self) -> LogError:
        wanted = " or ".join(name.removeprefix("sensor_msgs/") for name in self._decoders)
        on = "" if self.topic is None else f" on {self.topic!r}"
        hint = ""
        if self.options.ring is None and self._topics_of((CLOUD,)):
            hint = "; choose a ring to read a PointCloud2"
        return LogError(
            self.name, f"has no {wanted}{on}; topics there are: {self._listing()}{hint}"
        )

    def _listing(self) -> str:
        known = self.contents()
        names = [f"{topic.name} ({topic.type}, {topic.count})" for topic in known[:_LISTED]]
        if len(known) > _LISTED:
            names.append(f"{len(known) - _LISTED} more")
        return ", ".join(names) or "none"
