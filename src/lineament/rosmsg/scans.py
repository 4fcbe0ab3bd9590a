"""Scans from serialised ROS messages: LaserScan, MultiEchoLaserScan, a ring of a PointCloud2."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..limits import LIMITS, Limits
from ..scan import LaserScan
from .wire import Buffer, WireReader

MULTI_ECHO, CLOUD = "sensor_msgs/MultiEchoLaserScan", "sensor_msgs/PointCloud2"
#: Types of ``PointField``: those of numpy, by their number from 1.
POINT_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")
_POINT_FIELDS = ("x", "y", "ring", "intensity")
#: Most fields of a point: a broken message may say that there are billions.
_MOST_FIELDS = 1000

Array = NDArray[Any]
Decoder = Callable[[Buffer, str], LaserScan]


def decoders(echo: str, ring: int | None, limits: Limits = LIMITS) -> dict[str, Decoder]:
    """Return how to decode each type that carries scans; clouds only if `ring` is given."""
    known: dict[str, Decoder] = {
        "sensor_msgs/LaserScan": partial(laser_scan, limits=limits),
        MULTI_ECHO: partial(multi_echo_scan, echo=echo, limits=limits),
    }
    cloud = partial(ring_scan, ring=ring or 0, limits=limits)
    return known if ring is None else {**known, CLOUD: cloud}


def laser_scan(data: Buffer, encoding: str, limits: Limits = LIMITS) -> LaserScan:
    """Decode a ``sensor_msgs/LaserScan``.

    The beams of a scanner that turns clockwise (a negative increment) are reversed, so that
    bearings increase: see `LaserScan.from_message`. ValueError if the message is malformed, has no
    beams, is beyond a limit, or its fields make no sense together.
    """
    reader = WireReader(data, encoding, limits)
    stamp, frame_id = reader.header()
    *geometry, n = reader.numbers("7fI")
    ranges = reader.floats(n)
    if n > limits.beams:
        limits.check("beams", n)
    intensities = reader.floats(reader.count())
    reader.end()
    return _scan(stamp, frame_id, geometry, ranges, intensities if len(intensities) else None)


@np.errstate(invalid="ignore")  # A signalling NaN is a NaN.
def multi_echo_scan(
    data: Buffer, encoding: str, echo: str = "first", limits: Limits = LIMITS
) -> LaserScan:
    """Decode one echo of each beam of a ``sensor_msgs/MultiEchoLaserScan``.

    The echo is the ``first``, which is the nearest, the ``last``, or the ``strongest``, which has
    the greatest intensity, and is the first where there are no intensities. A beam without echo is
    NaN. ValueError as for `laser_scan`, or if ranges and intensities have different echoes.
    """
    reader = WireReader(data, encoding, limits)
    stamp, frame_id = reader.header()
    *geometry, n = reader.numbers("7fI")
    echoes, starts, counts = _echoes(reader, n, limits)
    strengths, _, strength_counts = _echoes(reader, reader.count(), limits)
    reader.end()
    has_strengths = len(strength_counts) > 0
    if has_strengths and not np.array_equal(counts, strength_counts):
        raise ValueError("intensities have other numbers of echoes than ranges, expected the same")
    chosen = starts
    if echo == "last":
        chosen = starts + counts - 1
    elif echo == "strongest" and has_strengths:
        values = np.where(np.isnan(strengths), -np.inf, strengths).tolist()
        beams = map(range, starts, starts + counts)
        chosen = np.array([max(beam, key=values.__getitem__, default=0) for beam in beams], int)
    seen = counts > 0
    ranges, intensities = np.full((2, len(counts)), np.nan)
    ranges[seen] = echoes[chosen[seen]]
    if has_strengths:
        intensities[seen] = strengths[chosen[seen]]
    return _scan(stamp, frame_id, geometry, ranges, intensities if has_strengths else None)


# Clouds may hold anything: infinities are left out below, and a signalling NaN is a NaN.
@np.errstate(over="ignore", invalid="ignore")
def ring_scan(data: Buffer, encoding: str, ring: int, limits: Limits = LIMITS) -> LaserScan:
    """Decode one ring of a ``sensor_msgs/PointCloud2`` as a scan with irregular bearings.

    The ring is the points whose field `ring` has that number or, in an organised cloud without
    that field, the points of that row, from 0. A point (x, y, z) becomes a beam with its bearing
    and horizontal distance; z is left out. Beams are sorted by bearing; of points with the same
    bearing the nearest stays; points that are not finite are left out. ValueError if the message is
    malformed, has no fields x and y, no rings, or no such ring.
    """
    reader = WireReader(data, encoding, limits)
    stamp, frame_id = reader.header()
    points = _points(reader, limits)
    names = points.dtype.names or ()
    numbers = points["ring"] if "ring" in names else None
    if numbers is not None:
        points = points[numbers == ring]
    elif len(points) > 1:
        points = points[ring : ring + 1].ravel()
    else:
        raise ValueError("has no field ring and a single row, expected a cloud with rings")
    limits.check("beams", len(points))
    x, y = (points[name].astype(np.float64) for name in ("x", "y"))
    angles, ranges = np.arctan2(y, x), np.hypot(x, y)
    order = np.lexsort((ranges, angles))
    order = order[np.isfinite(ranges[order])]
    order = order[np.diff(angles[order], prepend=-math.inf) > 0]
    if not len(order):
        rings = "" if numbers is None else f", its rings are {numbers.min()} to {numbers.max()}"
        raise ValueError(f"has no points in ring {ring}{rings}")
    return LaserScan(
        ranges[order],
        angles=angles[order],
        frame_id=frame_id,
        intensities=points["intensity"][order] if "intensity" in names else None,
    ).stamped(0, stamp)


def _scan(
    stamp: int,
    frame_id: str,
    geometry: Sequence[float],
    ranges: Array,
    intensities: Array | None,
) -> LaserScan:
    """Make a scan of the fields of LaserScan, whose seven numbers are `geometry`."""
    angle_min, _, increment, time_increment, scan_time, range_min, range_max = geometry
    if len(ranges) == 0:
        raise ValueError("ranges is empty, expected at least one beam")
    scan = LaserScan(
        ranges,
        angle_min,
        increment,
        range_min=range_min,
        range_max=range_max,
        scan_time=scan_time,
        time_increment=time_increment,
        frame_id=frame_id,
        intensities=intensities,
    )
    return scan.stamped(scan.stamp_beam, stamp)


def _echoes(reader: WireReader, n: int, limits: Limits) -> tuple[Array, Array, Array]:
    """Take `n` of ``LaserEcho``: all words, where each beam's begin, and how many."""
    # Each beam is the number of its echoes and then they: a chain to be walked.
    every = reader.words()
    words = every[: limits.points].tolist()
    if n > len(every):
        raise ValueError(f"ends early: {n} beams expected in {4 * len(every)} bytes")
    limits.check("beams", n)
    starts: list[int] = []
    counts: list[int] = []
    at = 0
    for _ in range(n):
        if at >= len(words) or at + words[at] >= len(words):
            if at < len(words) < len(every) > at + words[at]:
                limits.check("points", at + words[at])
            raise ValueError(f"ends early: beam {len(counts)} of {n} reaches past its end")
        counts.append(words[at])
        starts.append(at + 1)
        at += 1 + words[at]
    return reader.floats(at), np.array(starts, np.int64), np.array(counts, np.int64)


def _points(reader: WireReader, limits: Limits) -> NDArray[np.void]:
    """Take the rest of a ``PointCloud2``: the fields that matter here, shape (height, width)."""
    height, width = reader.numbers("II")
    fields: dict[str, tuple[int, int]] = {}
    n_fields = reader.count()
    if n_fields > _MOST_FIELDS:
        raise ValueError(f"has {n_fields} fields, expected at most {_MOST_FIELDS}")
    for _ in range(n_fields):
        name = reader.text()
        offset, (kind,) = reader.count(), reader.numbers("B")
        reader.count()
        if name in _POINT_FIELDS:
            fields[name] = offset, kind
    order = ">" if reader.numbers("B")[0] else "<"
    point_step, row_step = reader.numbers("II")
    data = reader.raw(reader.count())
    if not {"x", "y"} <= fields.keys():
        raise ValueError(f"has fields {', '.join(fields) or 'other'}, expected x and y")
    if height == 1:  # Some drivers leave it unset.
        row_step = width * point_step
    if row_step < width * point_step or height * row_step > len(data) or not height * width:
        raise ValueError(
            f"has {len(data)} bytes in {height} rows of {row_step}, expected {width} points of "
            f"{point_step} in each"
        )
    limits.check("points", height * width)
    formats = []
    for name, (offset, kind) in fields.items():
        if not 1 <= kind <= len(POINT_TYPES):
            raise ValueError(f"field {name} has type {kind}, expected 1 to {len(POINT_TYPES)}")
        formats.append(np.dtype(order + POINT_TYPES[kind - 1]))
        if offset + formats[-1].itemsize > point_step:
            raise ValueError(f"field {name} reaches past the {point_step} bytes of a point")
    layout: Any = {
        "names": list(fields),
        "formats": formats,
        "offsets": [offset for offset, _ in fields.values()],
        "itemsize": point_step,
    }
    return np.ndarray((height, width), np.dtype(layout), data, strides=(row_step, point_step))
