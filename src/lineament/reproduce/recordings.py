"""Recorded scans, for pictures and for similarity errors."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from ..logs import open_log
from ..scan import LaserScan
from .findings import Setting

__all__ = ["recorded_scans", "spread_scans"]

#: The recordings, by name.
LOGS = {
    "Intel lab": "carmen/intel-corrected.log.gz",
    "MIT CSAIL": "carmen/csail-corrected.log.gz",
    "ACES": "carmen/aces-corrected.log.gz",
}


def recorded_scans(setting: Setting, count: int) -> Iterator[tuple[str, list[LaserScan]]]:
    """Give so many scans of each recording that is there, from equal parts of it."""
    for name, file in LOGS.items():
        path = setting.recording(file)
        if path is not None:
            yield name, spread_scans(path, count)


def spread_scans(path: str | Path, count: int) -> list[LaserScan]:
    """Read so many scans of a log, from equal parts of it."""
    log = open_log(path, keep_going=True)
    step = max(len(log) // count, 1)
    return list(islice(log, step // 2, None, step))[:count]
