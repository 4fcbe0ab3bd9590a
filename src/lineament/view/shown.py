"""One log that is looked at: read in the background, any scan of it at once."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import tee
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from ..extractor import Extractor
from ..kernels import FARTHEST
from ..logs import Log, open_log, save_npz
from ..rosmsg.frames import Place
from ..scan import LaserScan
from .store import Item, ScanStore

if TYPE_CHECKING:
    from ..mapping import LineMap

#: Most points of a scan that is shown behind others.
MOST_POINTS = 360
#: So long after another look it is seen how far a log was read [s].
_SOON = 0.02


class ShownLog:
    """A log as `lineament.open_log` gives it, and what has been read of it so far.

    Reading starts at once, in a thread, and ends with the log or when it is closed. A LogError if
    the log cannot be read up to its first scan. With the `place` of its scanner on the robot, the
    poses of the log are those of the robot, and become those of the scanner.
    """

    def __init__(
        self,
        path: str,
        capacity: int,
        reading: dict[str, Any],
        plan: LineMap | None = None,
        place: Place | None = None,
    ) -> None:
        if place is not None:
            reading = reading | {"laser_pose": place.pose}
        log = open_log(path, **reading)
        log.scan(0)
        self.place = place
        self._about: dict[str, Any] = {"format": log.format, "total": None}
        self._faults = {"error": "", "skipped": 0, "faults": log.faults}
        # Another log, as each iteration counts its faults anew.
        again = lambda: self._upright(open_log(path, **reading).items())  # noqa: E731
        self.store = ScanStore(again, capacity=capacity)
        self._plan, self._where = plan, dict[int, dict[str, Any]]()
        # The thread alone holds the log, and a temporary copy that it may have, while it reads.
        self._reader = threading.Thread(
            target=self._fill, args=(log,), name="reader of the log", daemon=True
        )
        self._reader.start()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the log is read; return whether it is."""
        self._reader.join(seconds)
        return not self._reader.is_alive()

    def close(self) -> None:
        """End reading, and remove what was kept."""
        self.store.close()

    def facts(self) -> dict[str, Any]:
        """Return what is known of the log, and how far it has been read."""
        complete = not self._reader.is_alive()  # before the number of scans, which may still grow
        read = {"scans": len(self.store), "posed": self.store.posed, "complete": complete}
        return self._about | read | self._faults

    def drive(self, first: int, step: int, count: int) -> dict[str, Any]:
        """Return poses and points of every `step`-th scan, for a picture of the whole drive.

        The points [m] are in the world frame, x and y in turn, at most `MOST_POINTS` of a scan, and
        none that is farther than any scanner sees. Scans without a pose, and those that have not
        been read, are left out.
        """
        scans = []
        for index in range(first, min(first + step * count, len(self.store)), step):
            _, scan = self.store.item(index)
            if scan.pose is not None:
                points = [round(value, 3) for value in _in_world(scan, *scan.pose).ravel().tolist()]
                scans.append({"index": index, "pose": scan.pose, "points": points})
        return {"scans": scans}

    def where(self, index: int) -> dict[str, Any] | None:
        """Return what is known of the pose of a scan on the plan; None without one."""
        return self._where.get(index)

    def npz(self, index: int) -> bytes:
        """Return a scan as an npz log; ValueError if it has no beams, IndexError if not read."""
        _, scan = self.store.item(index)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "scan.npz")
            save_npz(path, [scan])
            return path.read_bytes()

    def near(self, stamp: float) -> int | None:
        """Return which scan is nearest to a time [s], once the log is read so far; None if none."""
        while not self.wait(_SOON):
            last = self.store.stamps(max(len(self.store) - 1, 0), 1)
            if last and last[0] > stamp:
                break
        return self.store.nearest(stamp)

    def _upright(self, items: Iterable[Item]) -> Iterable[Item]:
        """Turn the scans of a scanner over that is upside down."""
        if self.place is None or not self.place.is_upside_down:
            return items
        return ((topic, scan.turned_over()) for topic, scan in items)

    def _located(self, items: Iterable[Item]) -> Iterator[Item]:
        """Yield scans with their poses on the plan, or none while that is not known."""
        from ..mapping.following import follow

        assert self._plan is not None
        items, copy = tee(items)
        found = follow((scan for _, scan in copy), self._plan, Extractor())
        for index, ((topic, _), (scan, where)) in enumerate(zip(items, found, strict=False)):
            self._where[index] = {
                "verdict": where.verdict,
                "covariance": where.covariance.tolist() if where.is_known else None,
                **asdict(where.evidence),
            }
            yield topic, scan.with_pose(where.pose if where.is_known else None)

    def _fill(self, log: Log) -> None:
        try:
            self._about["total"] = len(log)
            items = self._upright(log.measured())
            self.store.fill(items if self._plan is None else self._located(items))
        except LineamentError as error:
            self._faults["error"] = str(error)
        except Exception as error:  # Nobody else could report it: the page does.
            self._faults["error"] = f"reading ended: {type(error).__name__}: {error}"
        self._faults |= {"skipped": log.skipped, "faults": list(log.faults)}


def _in_world(scan: LaserScan, x: float, y: float, theta: float) -> NDArray[np.float64]:
    """Return some points of a scan at a pose, in the world frame, shape (n, 2)."""
    seen = (scan.valid & (scan.ranges < FARTHEST)).nonzero()[0]
    px, py = scan.points[seen[:: -(-len(seen) // MOST_POINTS) or 1]].T
    c, s = np.cos(theta), np.sin(theta)
    return np.column_stack([x + c * px - s * py, y + s * px + c * py])
