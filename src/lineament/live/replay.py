"""A log played as if its scanner were running."""

import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from heapq import merge as merged
from typing import Any

from ..errors import LogError
from ..logs import open_log
from ..logs.ros import RosLog
from ..logs.ros_bag import Connection
from ..rosmsg.poses import TRANSFORMS
from ..rosmsg.wire import Buffer
from ..scan import LaserScan
from .received import JUDGED, MOUNTINGS, Received, Wanted

#: Stamps that stand still, go back or leap by more than this are played one `_STEP` apart [s].
_LEAP, _STEP = 10.0, 0.1
#: A scan that is returned so soon after it was due is returned alone [s].
_PUNCTUAL = 0.01
#: Most scans at once, where reading is slower than the rate.
_MOST = 64


class ReplaySource:
    """Returns the scans of a log at the times of their stamps.

    Two scans are as far apart in time as their stamps, divided by the rate. Scans that are due
    together come together: the node processes the newest and counts the others as dropped, as it
    does on a robot.

    Parameters
    ----------
    path : path-like
        The log.
    rate : float
        Factor on the speed; 0 for one scan at each call of `receive`.
    loop : bool
        Whether to start again at the end, with the same stamps.
    topic : str, optional
        Which scans are played.
    merge : sequence of str
        In place of it, the topics of several scanners, with the mountings that the log has.
    heard : sequence of Wanted
        What is heard of a bag beside its scans, in its order; mountings before all of them.
    clock : callable
        Returns the time [s].
    **reading
        How the log is read, as for `lineament.open_log`.

    Raises
    ------
    LogError
        If the log cannot be read, here or while it is played.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lineament.logs import save_npz
    >>> path = pathlib.Path(tempfile.mkdtemp(), "log.npz")
    >>> save_npz(path, [LaserScan([2.0, 2.0], 0.0, 0.01, stamp=i / 10) for i in range(3)])
    >>> source = ReplaySource(path, rate=0)
    >>> while not source.ended:
    ...     print([received.read().stamp for received in source.receive(0.1)])
    [0.0]
    [0.1]
    [0.2]
    []
    """

    lost = 0

    def __init__(
        self,
        path: str | os.PathLike[str],
        rate: float = 1.0,
        *,
        loop: bool = False,
        topic: str | None = None,
        merge: Sequence[str] = (),
        heard: Sequence[Wanted] = (),
        clock: Callable[[], float] = time.monotonic,
        **reading: Any,
    ) -> None:
        # Of scans of one time the first scanner's comes last: it is merged with the others.
        names = merge[::-1] or (topic,)
        self._logs = [open_log(path, name, **reading) for name in names]
        self._rate, self._loop, self._clock = rate, loop, clock
        # Of several scanners it is to be known where they are, before their scans.
        self._before = [self._mountings()] if merge or heard else []
        self._heard = {one.topic: one for one in heard if one.what != MOUNTINGS}
        if heard:
            self._overhear()
        self._items = self._measured()
        self._next: tuple[str, LaserScan] | None = next(self._items, None)
        self._due, self._topic, self._stamp = math.nan, "", math.nan
        self._played: set[str] = set()
        #: Whether the log is at its end.
        self.ended = False

    @property
    def publishers(self) -> int:
        """1, the log, until its end."""
        return int(not self.ended)

    def receive(self, timeout: float) -> list[Received]:
        """Wait until the next scan is due, up to `timeout` [s]; return those that are."""
        came: list[Received] = []
        if self._read_ahead():
            time.sleep(max(min(self._due - self._clock(), timeout), 0.0))
        now = self._clock()
        while len(came) < _MOST and self._read_ahead() and self._due <= now:
            came, self._before = [*came, *self._before, self._take()], []
            # When there is time, this scan is processed before the next one is read.
            if self._clock() - came[-1].arrived < _PUNCTUAL:
                break
        return came

    def problems(self) -> list[str]:
        """Return what was skipped in the log, and that scans of several topics become one."""
        found = [f"skipped: {fault}" for log in self._logs for fault in log.faults]
        if len(self._logs) == 1 and len(self._played) > 1:
            topics = ", ".join(sorted(self._played))
            found.append(
                f"scans of {topics} are played as one topic: log_topic chooses one of them"
            )
        return found

    def close(self) -> None:
        """Stop reading."""
        self._items, self._next, self._loop = iter(()), None, False

    def _measured(self) -> Iterator[tuple[str, LaserScan]]:
        """Read all logs from the start, by the stamps of their scans."""
        return merged(*(log.measured() for log in self._logs), key=lambda item: item[1].stamp)

    def _mountings(self) -> Received:
        links = self._logs[0].mountings()
        return Received(self._logs[0].name, lambda: links, self._clock(), MOUNTINGS)

    def _overhear(self) -> None:
        """Let what stands in the bag before a scan come before it."""
        log, found = self._logs[0], {(topic.name, topic.type) for topic in self._logs[0].contents()}
        for one in self._heard.values():
            if one.what == JUDGED and (one.topic, one.kind) not in found:
                raise LogError(log.name, f"has no {one.kind} on {one.topic!r}, to be judged")
        assert isinstance(log, RosLog)  # Others have no messages of such types.
        kinds = {
            topic: TRANSFORMS if one.kind in TRANSFORMS else (one.kind,)
            for topic, one in self._heard.items()
        }
        log.overhear(kinds, self._hear)

    def _hear(self, connection: Connection, data: Buffer) -> None:
        one = self._heard[connection.topic]
        self._before.append(one.received(connection.topic, data, connection.encoding))

    def _take(self) -> Received:
        assert self._next is not None
        (topic, scan), self._next = self._next, None
        self._topic, self._stamp = topic, scan.stamp
        self._played.add(topic)
        # Latency counts from when the scan was due.
        return Received(topic, lambda: scan, self._due if self._rate else self._clock())

    def _read_ahead(self) -> bool:
        """Read the next scan, and find when it is due; False at the end."""
        if self._next is None:
            self._next = self._following()
            if self._next is None:
                self.ended = True
                return False
            topic, step = self._next[0], self._next[1].stamp - self._stamp
            is_next = 0 < step <= _LEAP or (step == 0 and topic != self._topic)
            self._due += (step if is_next else _STEP) / (self._rate or math.inf)
        if math.isnan(self._due):  # The first scan is due when it is first asked for.
            self._due = self._clock()
        return True

    def _following(self) -> tuple[str, LaserScan] | None:
        following = next(self._items, None)
        if following is None and self._loop:
            self._items = self._measured()
            following = next(self._items, None)
        return following
