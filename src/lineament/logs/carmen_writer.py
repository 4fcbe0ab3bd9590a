"""CARMEN logs out: one ROBOTLASER1 line a scan, plain or gzip."""

from __future__ import annotations

import gzip
import math
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..files import naming_errors, written_beside
from ..scan import LaserScan

__all__ = ["save_carmen"]

_HEADER = """\
# CARMEN Logfile
# ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range accuracy \
remission_mode num_readings [range_readings] num_remissions [remission_values] \
laser_pose_x laser_pose_y laser_pose_theta robot_pose_x robot_pose_y robot_pose_theta \
laser_tv laser_rv forward_safety_dist side_safety_dist turn_axis \
timestamp ipc_hostname logger_timestamp
"""


def save_carmen(path: str | os.PathLike[str], scans: Iterable[LaserScan]) -> None:
    """Write scans as a CARMEN log, one after the other, beside `path` and then renamed.

    Numbers are written so that they read back to the same value. Beams that are not valid are
    written as the scan's `range_max`, which CARMEN takes for no return. The format has no place
    for `range_min`, `scan_time`, `time_increment` and `frame_id`.

    Parameters
    ----------
    path : path-like
        The file; one that exists is replaced. It is compressed where its name ends in ``.gz``.
    scans : iterable of LaserScan
        With a pose each, evenly spaced bearings and a finite `range_max`. None is kept in memory.

    Raises
    ------
    ValueError
        If a scan cannot be written so, or there are none.
    LineamentError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from lineament.logs import open_log
    >>> path = Path(tempfile.mkdtemp(), "two.log.gz")
    >>> scan = LaserScan([1.5, math.inf], 0.0, 0.1, range_max=8.0, stamp=2.5, pose=(1, 2, 0.5))
    >>> save_carmen(path, [scan, scan])
    >>> [(scan.ranges.tolist(), scan.stamp, scan.pose) for scan in open_log(path)][1]
    ([1.5, 8.0], 2.5, (1.0, 2.0, 0.5))
    """
    with written_beside(path) as temporary:
        compressed = Path(path).name.lower().endswith(".gz")
        with naming_errors(path), _opened(temporary, compressed) as file:
            file.write(_HEADER.encode())
            i = -1
            for i, scan in enumerate(scans):
                file.write(_line(i, scan).encode())
        if i < 0:
            raise ValueError("there are no scans to write")


@contextmanager
def _opened(path: Path, compressed: bool) -> Iterator[BinaryIO | gzip.GzipFile]:
    with path.open("wb") as file:
        if not compressed:
            yield file
            return
        # Without name and time: the same scans give the same file.
        with gzip.GzipFile("", "wb", 6, file, mtime=0) as packed:
            yield packed


def _line(i: int, scan: LaserScan) -> str:
    if scan.pose is None:
        raise ValueError(f"scan {i} has no pose, which a CARMEN log holds for every scan")
    if not scan.is_regular:
        raise ValueError(f"scan {i} has irregular bearings, which a CARMEN log cannot hold")
    if not scan.range_max < math.inf:
        raise ValueError(f"scan {i} has no finite range_max, which a CARMEN log needs")
    ranges = np.where(scan.valid, scan.ranges, scan.range_max).tolist()
    remissions = [] if scan.intensities is None else scan.intensities.tolist()
    span = (len(ranges) - 1) * scan.angle_increment
    laser = (0, scan.angle_min, span, scan.angle_increment, scan.range_max, 0, 0)
    stopped = (0, 0, 0, 0, 0)
    return _words(
        *("ROBOTLASER1", *laser, len(ranges), *ranges, len(remissions), *remissions),
        *(*scan.pose, *scan.pose, *stopped, scan.stamp, "lineament", scan.stamp),
    )


def _words(*values: object) -> str:
    return " ".join(map(str, values)) + "\n"
