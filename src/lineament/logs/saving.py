"""Scans to logs: CARMEN and npz, by the ending of the file."""

import gzip
import math
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..files import naming_errors, spare_inputs, written_beside
from ..scan import LaserScan
from ..scan.fields import nanoseconds
from .base import Log
from .npz import SCALARS, SHAPES

_CARMEN_HEADER = """\
# CARMEN Logfile
# ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range accuracy \
remission_mode num_readings [range_readings] num_remissions [remission_values] \
laser_pose_x laser_pose_y laser_pose_theta robot_pose_x robot_pose_y robot_pose_theta \
laser_tv laser_rv forward_safety_dist side_safety_dist turn_axis \
timestamp ipc_hostname logger_timestamp
"""


@contextmanager
def _written(path: str | os.PathLike[str], scans: Iterable[LaserScan]) -> Iterator[BinaryIO]:
    """Give a file that becomes `path`, which must not be the log that the scans are read from."""
    if isinstance(scans, Log):
        spare_inputs([path], [scans.name])
    with written_beside(path) as temporary, naming_errors(path), temporary.open("wb") as file:
        yield file


def save_carmen(path: str | os.PathLike[str], scans: Iterable[LaserScan]) -> None:
    """Write scans as a CARMEN log, each as it comes; see `save_log`."""
    i = -1
    with _written(path, scans) as plain:
        is_gzip = Path(path).name.lower().endswith(".gz")
        # Without name and time: the same scans give the same file.
        packed = gzip.GzipFile("", "wb", 6, plain, mtime=0) if is_gzip else nullcontext(plain)
        with packed as file:
            file.write(_CARMEN_HEADER.encode())
            for i, scan in enumerate(scans):
                file.write(_carmen_line(i, scan).encode())
        if i < 0:
            raise ValueError("there are no scans to write")


def _carmen_line(i: int, scan: LaserScan) -> str:
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
    words = [
        *("ROBOTLASER1", *laser, len(ranges), *ranges, len(remissions), *remissions),
        *(*scan.pose, *scan.pose, *stopped, scan.stamp, "lineament", scan.stamp),
    ]
    return " ".join(map(str, words)) + "\n"


def save_npz(path: str | os.PathLike[str], scans: Iterable[LaserScan], **extra: ArrayLike) -> None:
    """Write scans that share their bearings as an npz log, beside `path` and then renamed.

    Parameters
    ----------
    path : path-like
        The file; one that exists is replaced.
    scans : iterable of LaserScan
        At least one; all are held in memory until written.
    **extra : array_like
        Further keys, such as ``source`` or ``licence``.

    Raises
    ------
    ValueError
        If there are no scans or no beams, bearings differ, only some scans have intensities, or
        an extra key is one of the log's own or holds objects.
    LineamentError
        If the file cannot be written, or `scans` is a log that is read from it: ``list(log)`` has
        all of it in memory, and may replace it.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lineament.logs import open_log
    >>> path = pathlib.Path(tempfile.mkdtemp(), "two.npz")
    >>> save_npz(path, [LaserScan([1.0, 2.0], 0.0, 0.1, stamp=t) for t in (7.0, 7.5)])
    >>> [scan.stamp for scan in open_log(path)]
    [7.0, 7.5]
    """
    with _written(path, scans) as file:  # before the first scan is asked for
        arrays = _pack(list(scans))
        for key, value in extra.items():
            if key in SHAPES:
                raise ValueError(f"extra key {key} is one of the log's own")
            arrays[key] = np.asarray(value)
            if arrays[key].dtype.hasobject:
                raise ValueError(f"extra key {key} holds objects, expected numbers or text")
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _pack(scans: list[LaserScan]) -> dict[str, NDArray[Any]]:
    first = next(iter(scans), None)
    if first is None:
        raise ValueError("there are no scans to write")
    if not len(first):
        raise ValueError("scan 0 has no beams, expected at least one")
    for i, scan in enumerate(scans):
        if scan.is_regular != first.is_regular or not np.array_equal(scan.angles, first.angles):
            raise ValueError(f"scan {i} has other bearings than scan 0, expected the same for all")
        if (scan.intensities is None) != (first.intensities is None):
            raise ValueError(f"scan {i} and scan 0: only one of them has intensities")
    arrays = {"ranges": lossless(np.stack([scan.ranges for scan in scans]))}
    bearings = ("angle_min", "angle_increment") if first.is_regular else ("angles",)
    arrays |= {name: np.asarray(getattr(first, name)) for name in bearings}
    arrays["stamps"] = np.array([scan.stamp for scan in scans])
    if any(scan.stamp_ns != nanoseconds(scan.stamp) for scan in scans):
        arrays["stamps_ns"] = np.array([scan.stamp_ns for scan in scans])
    for key in (*SCALARS, "stamp_beam", "frame_id"):
        values = np.array([getattr(scan, key) for scan in scans])
        arrays[key] = values[0] if (values == values[0]).all() else values
    if first.intensities is not None:
        arrays["intensities"] = lossless(np.array([scan.intensities for scan in scans]))
    arrays |= _where_known("poses", [scan.pose for scan in scans], (3,))
    of_poses = [scan.pose_covariance for scan in scans]
    return arrays | _where_known("pose_covariances", of_poses, (3, 3))


def _where_known(key: str, values: list[Any], shape: tuple[int, ...]) -> dict[str, NDArray[Any]]:
    """Stack what is known of each scan, NaN where it is not; nothing if it is of none."""
    if all(value is None for value in values):
        return {}
    unknown = np.full(shape, np.nan)
    return {key: np.array([unknown if value is None else value for value in values])}


def lossless(values: NDArray[np.float64]) -> NDArray[Any]:
    """Return the values as float32 where none changes, as most sensors report them."""
    with np.errstate(over="ignore"):
        small = values.astype(np.float32)
    return small if np.array_equal(small, values, equal_nan=True) else values


#: What writes a log of each ending.
_WRITERS: dict[str, Callable[[str | os.PathLike[str], Iterable[LaserScan]], None]] = {
    ".npz": save_npz,
    ".log": save_carmen,
    ".log.gz": save_carmen,
}


def save_log(path: str | os.PathLike[str], scans: Iterable[LaserScan]) -> None:
    """Write scans as a log, in the format that the ending of `path` names.

    The file appears under its name when it is whole; one that exists is replaced. In a CARMEN log
    numbers are written so that they read back to the same value; beams that are not valid are
    written as the scan's `range_max`, which CARMEN takes for no return. It has no place for
    `range_min`, `scan_time`, `time_increment` and `frame_id`.

    Parameters
    ----------
    path : path-like
        The file: ``.npz`` (scans that share their bearings, all held in memory), or ``.log`` or
        ``.log.gz`` (CARMEN, written as they come; each with a pose, even bearings and a finite
        `range_max`).
    scans : iterable of LaserScan
        At least one.

    Raises
    ------
    ValueError
        If the ending is not known, before the first scan is asked for; or if the format cannot
        hold the scans.
    TypeError
        If it is one scan.
    LineamentError
        If the file cannot be written, or `scans` is a log that is read from it: ``list(log)`` has
        all of it in memory, and may replace it.

    Examples
    --------
    >>> import tempfile
    >>> from lineament.logs import open_log
    >>> path = Path(tempfile.mkdtemp(), "two.log.gz")
    >>> scan = LaserScan([1.5, math.inf], 0.0, 0.1, range_max=8.0, stamp=2.5, pose=(1, 2, 0.5))
    >>> save_log(path, [scan, scan])
    >>> [(scan.ranges.tolist(), scan.stamp, scan.pose) for scan in open_log(path)][1]
    ([1.5, 8.0], 2.5, (1.0, 2.0, 0.5))
    """
    if isinstance(scans, LaserScan):
        raise TypeError("scans is one LaserScan, expected several: [scan]")
    name = Path(path).name.lower()
    for ending, save in _WRITERS.items():
        if name.endswith(ending):
            save(path, scans)
            return
    raise ValueError(f"{path}: its ending is not known, expected {' or '.join(_WRITERS)}")
