"""Features of several scanners on one robot, as one set in the frame of the robot."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import TABLES, Features
from ..features.features import checked_features
from ..motion.association import chi_square
from ..scan import LaserScan, Pose
from ..scan.fields import checked_mounting
from ..scan.poses import carried, compose, inverse
from ..walls import Numbers, Records
from .merging import (
    fused_places,
    fused_segments,
    grouped,
    roughness,
    squares_of_places,
    squares_of_segments,
)

#: Share of the pairs of one thing that the tests keep together.
GATE = 0.999
#: Fields that are beams, and fields that are indices of segments.
_BEAMS, _SEGMENTS = {"beam", "first_beam", "last_beam", "occluder"}, {"segment", "segments"}
#: The field by which the records of a table are in order; segments come first.
_ORDER = {"corners": "beam", "edges": "beam", "arcs": "first_beam", "breakpoints": "beam"}


def merge_features(
    features: Sequence[Features],
    mountings: Sequence[Pose],
    covariance: ArrayLike | None = None,
    *,
    gate: float = GATE,
    frame_id: str = "base_link",
) -> Features:
    """Merge what several scanners of a robot see at one time into one set of features.

    Features of different scanners are one if the χ² of their difference is within the quantile
    `gate` of its distribution: of offset and angle for segments that lie along each other or no
    farther apart than 0.2 m, of the position for corners of the same convexity, of centre and
    radius for arcs. The most alike come first; no two of one scanner become one. They are weighted
    by their information. A segment goes as far as any of its parts, and of their edges those stay
    that are its ends. Where the view of one scanner ends is no breakpoint.

    The scan of the result has the measurements of all, by their bearing from the robot, at the
    stamp of the first scan; beams count in it. There is no `noise`: each scanner has its own.

    Parameters
    ----------
    features : sequence of Features
        Those of one scan of each scanner, in its own frame, with their `scan`.
    mountings : sequence of (x, y, theta)
        The pose of each scanner on the robot [m, m, rad].
    covariance : array_like, shape (3, 3), optional
        How well each of these is known [m, m, rad]; exactly, where it is not given.
    gate : float
        Share of the pairs of one thing that are found.
    frame_id : str
        Name of the frame of the robot.

    Raises
    ------
    ValueError
        If there are no features, or not as many mountings, or they have no scan, or a number makes
        no sense.

    Examples
    --------
    A wall ahead of two scanners that see it from places 4 cm apart:

    >>> import lineament as ln
    >>> found = ln.extract(ln.LaserScan([2.0] * 9, -0.04, 0.01))
    >>> merged = merge_features([found, found], [(0.1, 0.02, 0.0), (0.1, -0.02, 0.0)])
    >>> merged.segments["length"].round(2).tolist(), merged.segments["n_points"].tolist()
    ([0.2], [18])
    """
    mountings = [checked_mounting(mounting, "mounting") for mounting in mountings]
    scans = [found.scan for found in map(checked_features, features) if found.scan is not None]
    if not features or len(features) != len(mountings):
        raise ValueError(
            f"{len(mountings)} mountings of {len(features)} features, expected one each"
        )
    if len(scans) < len(features):
        raise ValueError("features have no scan: expected those of single scans, not moved yet")
    limits = chi_square(gate, 2), chi_square(gate, 3)
    moved = [
        found.transform(*pose, covariance) for found, pose in zip(features, mountings, strict=True)
    ]
    scan, beams = merged_scan(scans, mountings, frame_id)
    tables, owners, clusters = _pooled(moved, beams, len(scan))
    _merge(tables, owners, limits)
    fields: dict[str, Any] = {**tables, "clusters": clusters}
    for array in fields.values():
        array.flags.writeable = False
    return replace(moved[0], **fields, frame_id=frame_id, noise=None, scan=scan)


def merged_scan(
    scans: Sequence[LaserScan], mountings: Sequence[Pose], frame_id: str = "base_link"
) -> tuple[LaserScan, list[Numbers]]:
    """Return the scan of all measurements as if from the robot, and where each beam is in it.

    Of two measurements in the very same direction the nearer is left. The beams of each scan are
    numbered, with -1 for those that are not valid, and one more -1 behind the last.

    Examples
    --------
    >>> scan = LaserScan([1.0, float("nan"), 2.0], 0.0, 0.1)
    >>> merged, beams = merged_scan([scan, scan], [(0.5, 0.0, 0.0), (-0.5, 0.0, math.pi)])
    >>> len(merged), [numbers.tolist() for numbers in beams]
    (4, [[1, -1, 2, -1], [3, -1, 0, -1]])
    """
    points = []
    for scan, (x, y, theta) in zip(scans, mountings, strict=True):
        c, s = math.cos(theta), math.sin(theta)
        points.append(scan.points[scan.valid] @ np.array([[c, s], [-s, c]]) + (x, y))
    xy = np.concatenate(points) + 0.0  # without -0.0, whose bearing is -π
    angles, at = np.unique(np.arctan2(xy[:, 1], xy[:, 0]), return_inverse=True)
    ranges = np.full(len(angles), np.inf)
    np.minimum.at(ranges, at, np.hypot(xy[:, 0], xy[:, 1]))
    beams = [np.full(len(scan) + 1, -1) for scan in scans]
    parts = np.split(at, np.cumsum([len(part) for part in points])[:-1])
    for scan, numbers, part in zip(scans, beams, parts, strict=True):
        numbers[:-1][scan.valid] = part
    first = scans[0]
    merged = LaserScan(ranges, angles=angles, stamp=first.stamp, frame_id=frame_id)
    if first.pose is not None:
        pose, spread = compose(first.pose, inverse(mountings[0])), first.pose_covariance
        spread = None if spread is None else carried(spread, first.pose, pose)
        merged = merged.with_pose(pose, spread)
    return merged.stamped("first", first.stamp_ns), beams


def _pooled(
    parts: Sequence[Features], beams: Sequence[Numbers], count: int
) -> tuple[dict[str, Records], dict[str, Numbers], NDArray[np.int32]]:
    """Return tables of the records of all, the numbers of whose they are, and all clusters."""
    tables: dict[str, list[Records]] = {name: [] for name in TABLES}
    clusters, n_clusters, n_segments = np.full(count, -1, np.int32), 0, 0
    for part, numbers in zip(parts, beams, strict=True):
        for name, table in tables.items():
            records = part[name].copy()
            fields = {*(records.dtype.names or ())}
            for field in fields & _BEAMS:
                records[field] = numbers[records[field]]
            for field in fields & _SEGMENTS - {name}:
                records[field] += n_segments * (records[field] >= 0)
            if name == "segments":
                records["cluster"] += n_clusters * (records["cluster"] >= 0)
            table.append(
                records[records["kind"] != "scan_end"] if name == "breakpoints" else records
            )
        valid = numbers[:-1] >= 0
        labels = part.clusters[valid]
        clusters[numbers[:-1][valid]] = labels + n_clusters * (labels >= 0)
        n_clusters += int(labels.max(initial=-1)) + 1
        n_segments += len(part.segments)
    owners = {
        name: np.repeat(np.arange(len(parts), dtype=np.int64), list(map(len, table)))
        for name, table in tables.items()
    }
    return {name: np.concatenate(table) for name, table in tables.items()}, owners, clusters


def _merge(
    tables: dict[str, Records], owners: dict[str, Numbers], limits: tuple[float, float]
) -> None:
    """Make one of what is one in the tables, in order of the beams."""
    segments, corners, edges, arcs, _ = tables.values()
    rough = np.append(roughness(segments), 0.0)[corners["segments"]].sum(axis=1)
    labels = grouped(squares_of_segments(segments, owners["segments"]), limits[0])
    found, is_end = fused_segments(segments, labels)
    # The places of the groups once they are in order, and -1 for no segment.
    order = np.argsort(found["first_beam"], kind="stable")
    numbers = np.append(np.argsort(order)[labels], -1)
    tables["segments"] = found[order]
    corners["segments"] = numbers[corners["segments"]]
    squares = squares_of_places("corners", corners, owners["corners"], corners["convex"], rough)
    tables["corners"] = fused_places("corners", corners, grouped(squares, limits[0]))
    squares = squares_of_places("arcs", arcs, owners["arcs"], np.zeros(len(arcs), int))
    tables["arcs"] = fused_places("arcs", arcs, grouped(squares, limits[1]))
    is_end = np.append(is_end, [[True, True]], axis=0)  # An edge of no segment stays.
    tables["edges"] = _edges(edges, owners["edges"], numbers, is_end, limits[0])
    for name, beam in _ORDER.items():
        beams = tables[name][beam]
        order = np.argsort(beams if beams.ndim == 1 else beams[:, 0], kind="stable")
        tables[name] = tables[name][order]


def _edges(
    edges: Records, owners: Numbers, numbers: Numbers, is_end: NDArray[np.bool_], limit: float
) -> Records:
    """Return the edges that are ends of segments still; those of one end that are alike are one."""
    side = (edges["side"] == "end").astype(int)
    stays = is_end[edges["segment"], side]
    edges["segment"] = numbers[edges["segment"]]
    squares = squares_of_places("edges", edges, owners, 2 * edges["segment"] + side)
    labels = grouped(squares, limit)
    stays = np.bincount(labels, stays, labels.max(initial=-1) + 1) > 0
    return fused_places("edges", edges, labels)[stays]
