"""What the page asks for: logs, their scans, and what methods find in them."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..explain.explain import explain
from ..extractor import Extractor
from ..logs import find_logs
from ..progress import compiling_now
from ..scan import LaserScan
from .shown import ShownLog

if TYPE_CHECKING:
    from ..mapping import LineMap

#: Logs that are kept open; of more, the one that was asked for least recently is closed.
KEPT = 4
#: Room for the scans of all open logs in temporary files [bytes].
ROOM = 1 << 30


class Session:
    """The logs that are looked at, with one extractor for each method.

    The logs are those that `lineament.logs.find_logs` finds when the session is made, named by
    their number from 0 on; each is opened when it is first asked for, the first at once where
    there is no other. The page shows the extractors by their names, the first of them first.

    With a plan, the poses of the logs are odometry, and those on the plan take their place.

    Raises a LogError if no log is found, or the only one cannot be read up to its first scan.
    """

    def __init__(
        self,
        paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
        extractors: Mapping[str, Extractor],
        plan: LineMap | None = None,
        **reading: Any,
    ) -> None:
        paths = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
        self.extractors = dict(extractors)
        self._paths, self._reading, self._plan = find_logs(paths), reading, plan
        self.name = ", ".join(map(str, paths))
        self._open: dict[int, ShownLog] = {}  # the one that was asked for last is the last
        self._opening = threading.Lock()
        if len(self._paths) == 1:
            self.log(0)
        else:
            self.name += f" ({len(self._paths)} logs)"

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        with self._opening:
            while self._open:
                self._open.popitem()[1].close()

    def log(self, number: int) -> ShownLog:
        """Return a log, opened if it is not; ValueError if there is none of that number."""
        if number >= len(self._paths):
            last = len(self._paths) - 1
            raise ValueError(f"log {number} is not there, expected a whole number from 0 to {last}")
        with self._opening:
            shown = self._open.pop(number, None)
            if shown is None:
                room = ROOM // min(len(self._paths), KEPT)
                shown = ShownLog(self._paths[number], room, self._reading, self._plan)
            self._open[number] = shown
            if len(self._open) > KEPT:
                self._open.pop(next(iter(self._open))).close()
            return shown

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the logs that are open are read; return whether they are."""
        return all(shown.wait(seconds) for shown in list(self._open.values()))

    def logs(self) -> dict[str, Any]:
        """Return the names of all logs, without the folder that they share, and of the methods."""
        shared = os.path.commonprefix(self._paths)  # noqa: RUF071  # cut at a folder below
        start = max(shared.rfind(sign) for sign in ("/", os.sep)) + 1
        names = [path[start:] for path in self._paths]
        return {"name": self.name, "logs": names, "methods": list(self.extractors)}

    def facts(self, log: int) -> dict[str, Any]:
        """Return what is known of a log, and how far it has been read."""
        return self.log(log).facts() | {"compiling": compiling_now()}

    def stamps(self, log: int, first: int, count: int) -> dict[str, Any]:
        """Return the stamps of some scans [s]."""
        return {"first": first, "stamps": self.log(log).store.stamps(first, count)}

    def poses(self, log: int, first: int, count: int) -> dict[str, Any]:
        """Return the poses of some scans (m, m, rad); NaN where there is none."""
        return {"first": first, "poses": self.log(log).store.poses(first, count)}

    def plan(self) -> dict[str, Any]:
        """Return the walls of the plan, ``x1 y1 x2 y2`` each [m]; none where there is no plan."""
        walls = [] if self._plan is None else self._plan.ends.reshape(-1, 4).round(4).tolist()
        return {"walls": walls}

    def drive(self, log: int, first: int, step: int, count: int) -> dict[str, Any]:
        """Return poses and points of every `step`-th scan; see `ShownLog.drive`."""
        return self.log(log).drive(first, step, count)

    def npz(self, log: int, index: int) -> bytes:
        """Return a scan as an npz log; see `ShownLog.npz`."""
        return self.log(log).npz(index)

    def scan(self, log: int, index: int, method: str) -> dict[str, Any]:
        """Return a scan and what a method finds in it; IndexError if it was not read."""
        topic, scan = self.log(log).store.item(index)
        features = self.extractors[method](scan).to_dict()
        where = self.log(log).where(index)
        about = {"index": index, "method": method, "topic": topic, "where": where}
        return about | _beams(scan) | features

    def trace(self, log: int, index: int, method: str, beam: int) -> dict[str, Any]:
        """Return what became of a beam; ValueError if it is not there, IndexError for the scan."""
        _, scan = self.log(log).store.item(index)
        trace = self.extractors[method].trace(scan)
        return {"index": index, "method": method, **asdict(explain(trace, beam))}


def _beams(scan: LaserScan) -> dict[str, Any]:
    """Beams of a scan; the range of an invalid one is NaN."""
    bearings: dict[str, Any] = {"angles": scan.angles.tolist()}
    if scan.is_regular:
        bearings = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
    names = ("range_min", "range_max", "is_full_circle", "pose")
    return {
        "beams": len(scan),
        "ranges": np.where(scan.valid, scan.ranges, np.nan).tolist(),
        **bearings,
        **{name: getattr(scan, name) for name in names},
    }
