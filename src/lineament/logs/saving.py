"""Scans to logs, by the ending of the file."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from ..scan import LaserScan
from .carmen_writer import save_carmen
from .npz import save_npz

__all__ = ["SAVED_ENDINGS", "save_log"]

#: What writes a log of each ending. A new format is one file and one line here.
_WRITERS: dict[str, Callable[[str | os.PathLike[str], Iterable[LaserScan]], None]] = {
    ".npz": save_npz,
    ".log": save_carmen,
    ".log.gz": save_carmen,
}

#: The endings that `save_log` knows.
SAVED_ENDINGS = tuple(_WRITERS)


def save_log(path: str | os.PathLike[str], scans: Iterable[LaserScan]) -> None:
    """Write scans as a log of the format that the ending of `path` tells.

    The file appears under its name when it is whole; one that exists is replaced.

    Parameters
    ----------
    path : path-like
        The file: ``.npz`` (scans that share their bearings, all held in memory), or ``.log`` or
        ``.log.gz`` (CARMEN, written as they come; each with a pose).
    scans : iterable of LaserScan
        At least one.

    Raises
    ------
    ValueError
        If the ending is not known, before the first scan is asked for; or if the format cannot
        hold the scans.
    LineamentError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from lineament.logs import open_log
    >>> from lineament.simulation import SENSORS, building, drive
    >>> path = Path(tempfile.mkdtemp(), "drive.log.gz")
    >>> save_log(path, drive(*building(), SENSORS["lms181"], seed=1, rate=0.2))
    >>> log = open_log(path)
    >>> log.format, len(log), log.scan(0).pose
    ('carmen', 18, (0.7, 5.0, 0.0))
    """
    name = Path(path).name.lower()
    for ending, save in _WRITERS.items():
        if name.endswith(ending):
            save(path, scans)
            return
    raise ValueError(f"{path}: its ending is not known, expected {' or '.join(SAVED_ENDINGS)}")
