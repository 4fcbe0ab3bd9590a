"""What the page asks for: a log, its scans, and what methods find in them."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LineamentError
from ..explain.explain import explain
from ..extractor import Extractor
from ..logs import open_log
from ..progress import compiling_now
from ..scan import LaserScan
from .store import ScanStore


class Session:
    """A log that is looked at, with one extractor for each method.

    The page shows the extractors by their names, the first of them first. The log is read as by
    `lineament.open_log`; a LogError if it cannot be read up to its first scan.
    """

    def __init__(
        self, path: str | os.PathLike[str], extractors: Mapping[str, Extractor], **reading: Any
    ) -> None:
        self.extractors = dict(extractors)
        self._busy = {name: threading.Lock() for name in self.extractors}
        self._log = open_log(path, **reading)
        self._log.scan(0)
        self.name = self._log.name
        self._total: int | None = None
        self._error = ""
        # Another log, as each iteration counts its faults anew.
        self._store = ScanStore(lambda: open_log(path, **reading).items())
        self._reader = threading.Thread(target=self._fill, name="reader of the log", daemon=True)

    def __enter__(self) -> Session:
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._store.close()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the log is read; return whether it is."""
        self._reader.join(seconds)
        return not self._reader.is_alive()

    def facts(self) -> dict[str, Any]:
        """Return what is known of the log, and how far it has been read."""
        return {
            "name": Path(self.name).name,
            "format": self._log.format,
            "methods": list(self.extractors),
            "scans": len(self._store),
            "total": self._total,
            "complete": not self._reader.is_alive(),
            "error": self._error,
            "skipped": self._log.skipped,
            "faults": list(self._log.faults),
            "compiling": compiling_now(),
        }

    def stamps(self, first: int, count: int) -> dict[str, Any]:
        """Return the stamps of some scans [s]."""
        return {"first": first, "stamps": self._store.stamps(first, count)}

    def scan(self, index: int, method: str) -> dict[str, Any]:
        """Return a scan and what a method finds in it; IndexError if it was not read."""
        topic, scan = self._store.item(index)
        with self._busy[method]:
            features = self.extractors[method](scan).to_dict()
        return {"index": index, "method": method, "topic": topic} | _beams(scan) | features

    def trace(self, index: int, method: str, beam: int) -> dict[str, Any]:
        """Return what became of a beam; ValueError if it is not there, IndexError for the scan."""
        _, scan = self._store.item(index)
        with self._busy[method]:
            trace = self.extractors[method].trace(scan)
        return {"index": index, "method": method, **asdict(explain(trace, beam))}

    def _fill(self) -> None:
        try:
            self._total = len(self._log)
            self._store.fill(self._log.items())
        except LineamentError as error:
            self._error = str(error)
        except Exception as error:  # Nobody else could report it: the page does.
            self._error = f"reading ended: {type(error).__name__}: {error}"


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
