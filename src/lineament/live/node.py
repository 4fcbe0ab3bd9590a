"""`Node`: takes the newest scans from a source, processes them, and publishes what it found."""

import time
from collections.abc import Callable, Sequence
from itertools import chain

from ..errors import one_line
from ..scan import LaserScan
from ..scan.fields import NANO
from .counters import Counters, Report
from .pipeline import Pipeline
from .received import SCAN, Received, Source
from .sinks import Sink

#: Longest wait for a scan [s]: how soon a stop is seen.
_WAIT = 0.1
#: Time between two reports [s].
_EACH = 1.0
#: Time after which the absence of publishers is a message [s].
_PATIENCE = 2.0
#: Publishers whose faults are messages; there are few, unless names are made up.
_MOST_FAULTY = 64


class Node:
    """Turns a stream of scans into a stream of features.

    There is no queue: of the scans that came while one was processed, only the newest of each
    publisher is processed, and the others are counted as dropped. Malformed messages are counted,
    and are a line once for each publisher.

    Parameters
    ----------
    source : Source
        Where scans come from.
    pipeline : Pipeline
        What is done with them.
    sinks : sequence of Sink
        Where features go.
    write : callable
        Called with each line that a person should see.
    show : callable
        Called with each report, each second.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lineament.live import LiveConfig, ReplaySource
    >>> from lineament.logs import save_npz
    >>> path = pathlib.Path(tempfile.mkdtemp(), "log.npz")
    >>> save_npz(path, [LaserScan([2.0, 2.0, 2.0], 0.0, 0.01, stamp=i / 10) for i in range(3)])
    >>> Node(ReplaySource(path, rate=0), Pipeline(LiveConfig()), []).run().total.scans
    3
    """

    def __init__(
        self,
        source: Source,
        pipeline: Pipeline,
        sinks: Sequence[Sink],
        *,
        write: Callable[[str], None] = print,
        show: Callable[[Report], None] = lambda report: None,  # noqa: ARG005
    ) -> None:
        self._source, self._pipeline, self._sinks = source, pipeline, tuple(sinks)
        self._write, self._show = write, show
        self._faulty: set[str] = set()
        self._problems: set[str] = set()
        self._publishers: int | None = None

    def run(self, is_stopped: Callable[[], bool] = lambda: False) -> Report:
        """Work until the source ends or `is_stopped` returns True; it is called every 0.1 s.

        Returns
        -------
        Report
            The last one; its totals are those of the whole run.
        """
        started = reported = time.monotonic()
        counters = Counters(started)
        while not is_stopped() and not self._source.ended:
            for received in self._newest(self._source.receive(_WAIT), counters):
                self._process(received, counters)
            now = time.monotonic()
            if now - reported >= _EACH and not self._source.ended:
                reported = now
                self._write_problems()
                self._watch(now - started)
                self._report(counters, now)
        self._write_problems()
        return self._report(counters, time.monotonic())

    def _newest(self, received: list[Received], counters: Counters) -> list[Received]:
        """Keep what is no scan, then the newest scan of each publisher, as they came."""
        scans = [item for item in received if item.what == SCAN]
        newest = {item.publisher: item for item in scans}
        counters.dropped += len(scans) - len(newest)
        return [*(item for item in received if item.what != SCAN), *newest.values()]

    def _process(self, received: Received, counters: Counters) -> None:
        try:
            message = received.read()
            if not isinstance(message, LaserScan):
                self._pipeline.hear(message, received.what)
                return
            # What can be read may still make no sense: a robot that turns a million times a sweep.
            frames = self._pipeline.frames(received.publisher, message)
        except ValueError as error:
            counters.malformed += 1
            self._write_fault(received, error)
            return
        for frame in frames:
            for sink in self._sinks:
                sink.publish(frame)
            counters.add(frame.scan, frame.features, time.monotonic() - received.arrived)

    def _write_fault(self, received: Received, error: ValueError) -> None:
        if received.publisher not in self._faulty and len(self._faulty) < _MOST_FAULTY:
            self._faulty.add(received.publisher)
            text = f"{received.what} of {received.publisher} makes no sense: {error}"
            self._write(one_line(f"{text} (others like it are only counted)"))

    def _write_problems(self) -> None:
        """Write what keeps scans from coming, or from being deskewed, each problem once."""
        for problem in chain(self._source.problems(), self._pipeline.problems()):
            if problem not in self._problems:
                self._problems.add(problem)
                self._write(one_line(problem))

    def _watch(self, seconds: float) -> None:
        """Write when publishers come and go."""
        publishers = self._source.publishers
        if publishers == self._publishers or (not publishers and seconds < _PATIENCE):
            return
        self._publishers = publishers
        if publishers:
            self._write(f"{publishers} publisher{'s' if publishers > 1 else ''} of scans")
        else:
            self._write("no publisher of scans: waiting for one")
            self._faulty.clear()

    def _report(self, counters: Counters, now: float) -> Report:
        report = counters.report(
            now,
            publishers=self._source.publishers,
            lost=self._source.lost,
            unsent=sum(sink.unsent for sink in self._sinks),
        )
        stamp = divmod(time.time_ns(), NANO)
        for sink in self._sinks:
            sink.diagnose(report, stamp)
        self._show(report)
        return report
