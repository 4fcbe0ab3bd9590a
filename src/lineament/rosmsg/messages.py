"""Scans from serialised ROS messages: LaserScan, MultiEchoLaserScan, a ring of a PointCloud2."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scan import LaserScan
from .wire import Buffer, Wire

__all__ = ["CLOUD", "Decoder", "decoders", "laser_scan", "multi_echo_scan", "ring_scan"]

CLOUD = "sensor_msgs/PointCloud2"

Array = NDArray[Any]
Decoder = Callable[[Buffer, str], LaserScan]


def decoders(echo: str, ring: int | None) -> dict[str, Decoder]:
    """How to read each type of message that carries scans; clouds only where `ring` is given."""
    known: dict[str, Decoder] = {
        "sensor_msgs/LaserScan": laser_scan,
        "sensor_msgs/MultiEchoLaserScan": partial(multi_echo_scan, echo=echo),
    }
    return known if ring is None else {**known, CLOUD: partial(ring_scan, ring=ring)}


def laser_scan(data: Buffer, encoding: str) -> LaserScan:
    r"""Read a ``sensor_msgs/LaserScan``.

    A scanner that turns clockwise (a negative increment) has its beams reversed, so that bearings
    increase; beam ``i`` is then at ``stamp + i * time_increment`` with a negative
    `time_increment`.

    Parameters
    ----------
    data : bytes-like
        The message.
    encoding : str
        ``ros1`` or ``cdr``.

    Raises
    ------
    ValueError
        If the message is malformed, has no beams, or its fields make no sense together.

    Examples
    --------
    >>> import struct
    >>> header = struct.pack("<III5s", 0, 7, 500_000_000, b"\1\0\0\0l")
    >>> fields = struct.pack("<7f", 0.0, 0.5, 0.5, 0.0, 0.1, 0.1, 30.0)
    >>> scan = laser_scan(header + fields + struct.pack("<IffI", 2, 1.0, 2.0, 0), "ros1")
    >>> scan.ranges.tolist(), scan.stamp, scan.frame_id
    ([1.0, 2.0], 7.5, 'l')
    """
    wire = Wire(data, encoding)
    stamp, frame_id = wire.header()
    *geometry, n = wire.numbers("7fI")
    ranges = wire.floats(n)
    intensities = wire.floats(wire.count())
    wire.end()
    return _scan(stamp, frame_id, geometry, ranges, intensities if len(intensities) else None)


def multi_echo_scan(data: Buffer, encoding: str, echo: str = "first") -> LaserScan:
    """Read one echo of each beam of a ``sensor_msgs/MultiEchoLaserScan``.

    Parameters
    ----------
    data, encoding
        As for :func:`laser_scan`.
    echo : {"first", "last", "strongest"}
        Which one: the nearest, the farthest (echoes come in that order), or the one with the
        greatest intensity, the first where there are no intensities. A beam without echo is NaN.

    Raises
    ------
    ValueError
        As for :func:`laser_scan`, or if ranges and intensities have different echoes.
    """
    wire = Wire(data, encoding)
    stamp, frame_id = wire.header()
    *geometry, n = wire.numbers("7fI")
    echoes, starts, counts = _echoes(wire, n)
    strengths, _, strength_counts = _echoes(wire, wire.count())
    wire.end()
    has_strengths = len(strength_counts) > 0
    if has_strengths and not np.array_equal(counts, strength_counts):
        raise ValueError("intensities have other numbers of echoes than ranges, expected the same")
    chosen = starts
    if echo == "last":
        chosen = starts + counts - 1
    elif echo == "strongest" and has_strengths:
        chosen = _strongest(strengths, starts, counts)
    seen = counts > 0
    ranges, intensities = np.full((2, len(counts)), np.nan)
    ranges[seen] = echoes[chosen[seen]]
    if has_strengths:
        intensities[seen] = strengths[chosen[seen]]
    return _scan(stamp, frame_id, geometry, ranges, intensities if has_strengths else None)


# Clouds hold what they like: infinities are left out below, and a signalling NaN is a NaN.
@np.errstate(over="ignore", invalid="ignore")
def ring_scan(data: Buffer, encoding: str, ring: int) -> LaserScan:
    """Read one ring of a ``sensor_msgs/PointCloud2`` as a scan with irregular bearings.

    The ring is made of the points whose field `ring` is that number or, in an organised cloud
    without that field, of that row. A point (x, y, z) becomes a beam with its bearing and
    horizontal distance; z is left out. Beams are sorted by bearing; of points with the same
    bearing the nearest stays; points that are not finite go.

    Parameters
    ----------
    data, encoding
        As for :func:`laser_scan`.
    ring : int
        Number of the ring, from 0.

    Raises
    ------
    ValueError
        If the message is malformed, has no fields x and y, no rings, or no such ring.
    """
    wire = Wire(data, encoding)
    stamp, frame_id = wire.header()
    points, height = _points(wire)
    if "ring" in points:
        chosen = points["ring"] == ring
    elif height > 1:
        chosen = np.repeat(np.arange(height), len(points["x"]) // height) == ring
    else:
        raise ValueError("has no field ring and a single row, expected a cloud with rings")
    x, y = (points[name][chosen].astype(np.float64) for name in ("x", "y"))
    angles, ranges = np.arctan2(y, x), np.hypot(x, y)
    order = np.lexsort((ranges, angles))
    order = order[np.isfinite(ranges[order])]
    order = order[np.diff(angles[order], prepend=-math.inf) > 0]
    if not len(order):
        raise ValueError(f"has no points in ring {ring}{_rings_text(points)}")
    intensities = points["intensity"][chosen][order] if "intensity" in points else None
    return LaserScan(
        ranges[order],
        angles=angles[order],
        stamp=stamp,
        frame_id=frame_id,
        intensities=intensities,
    )


def _scan(
    stamp: float,
    frame_id: str,
    geometry: Sequence[float],
    ranges: Array,
    intensities: Array | None,
) -> LaserScan:
    """Make a scan of the fields of LaserScan, whose seven numbers are `geometry`."""
    angle_min, _, increment, time_increment, scan_time, range_min, range_max = geometry
    n = len(ranges)
    if n == 0:
        raise ValueError("ranges is empty, expected at least one beam")
    if increment < 0 and n > 1:
        ranges = ranges[::-1]
        intensities = None if intensities is None else intensities[::-1]
        angle_min, increment = angle_min + (n - 1) * increment, -increment
        stamp, time_increment = stamp + (n - 1) * time_increment, -time_increment
    return LaserScan(
        ranges,
        angle_min,
        increment,
        range_min=range_min,
        range_max=range_max,
        stamp=stamp,
        scan_time=scan_time,
        time_increment=time_increment,
        frame_id=frame_id,
        intensities=intensities,
    )


def _echoes(wire: Wire, n: int) -> tuple[Array, Array, Array]:
    """Take `n` of ``LaserEcho``: all words, where each beam's begin, and how many."""
    # Each beam is the number of its echoes and then they: a chain to be walked.
    lengths = wire.words()
    words = lengths.tolist()
    if n > len(words):
        raise ValueError(f"ends early: {n} beams expected in {4 * len(words)} bytes")
    starts: list[int] = []
    counts: list[int] = []
    at = 0
    for _ in range(n):
        if at >= len(words) or at + words[at] >= len(words):
            raise ValueError(f"ends early: beam {len(counts)} of {n} reaches past its end")
        counts.append(words[at])
        starts.append(at + 1)
        at += 1 + words[at]
    echoes = wire.floats(at)
    return echoes, np.array(starts, dtype=np.int64), np.array(counts, dtype=np.int64)


def _strongest(strengths: Array, starts: Array, counts: Array) -> Array:
    """Where the strongest echo of each beam is; anywhere for a beam without."""
    is_echo = np.ones(len(strengths), dtype=np.bool_)
    is_echo[starts - 1] = False
    places = np.flatnonzero(is_echo)
    beams = np.repeat(np.arange(len(counts)), counts)
    ordered = places[np.lexsort((places, -strengths[places], beams))]
    chosen, seen = starts.copy(), counts > 0
    chosen[seen] = ordered[(np.cumsum(counts) - counts)[seen]]
    return chosen


#: Types of ``PointField``: letters of numpy by their number, from 1.
_FIELD_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
_FIELDS = ("x", "y", "ring", "intensity")


def _points(wire: Wire) -> tuple[dict[str, Array], int]:
    """Take the rest of a ``PointCloud2``: the columns that matter here, and its height."""
    height, width = wire.numbers("II")
    layout: dict[str, tuple[int, int]] = {}
    for _ in range(wire.count()):
        name = wire.text()
        offset, (kind,) = wire.count(), wire.numbers("B")
        wire.count()
        if name in _FIELDS:
            layout[name] = offset, kind
    order = ">" if wire.numbers("B")[0] else "<"
    point_step, row_step = wire.numbers("II")
    data = wire.raw(wire.count())
    if not {"x", "y"} <= layout.keys():
        raise ValueError(f"has fields {', '.join(layout) or 'other'}, expected x and y")
    if height == 1:  # Some drivers leave it unset.
        row_step = width * point_step
    if row_step < width * point_step or height * row_step > len(data) or not height * width:
        raise ValueError(
            f"has {len(data)} bytes in {height} rows of {row_step}, expected {width} points of "
            f"{point_step} in each"
        )
    return {
        name: _column(data, name, order, field, (height, width), (row_step, point_step))
        for name, field in layout.items()
    }, height


def _column(
    data: Buffer,
    name: str,
    order: str,
    field: tuple[int, int],
    shape: tuple[int, int],
    strides: tuple[int, int],
) -> Array:
    offset, kind = field
    if not 1 <= kind <= len(_FIELD_TYPES):
        raise ValueError(f"field {name} has type {kind}, expected 1 to {len(_FIELD_TYPES)}")
    dtype = np.dtype(order + _FIELD_TYPES[kind - 1])
    if offset + dtype.itemsize > strides[1]:
        raise ValueError(f"field {name} reaches past the {strides[1]} bytes of a point")
    return np.ndarray(shape, dtype, data, offset, strides).ravel()


def _rings_text(points: dict[str, Array]) -> str:
    if "ring" not in points:
        return ""
    rings = points["ring"]
    return f", its rings are {rings.min()} to {rings.max()}"
