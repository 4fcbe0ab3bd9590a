"""Segments and corners that a function returns, as the records that all methods write."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import warn
from ..features.records import CORNER, CORNERS, SEGMENT, SEGMENTS
from ..kernels import LARGEST
from ..kernels import layout as at
from ..scan import LaserScan, RangeNoise
from .workspace import Block

Array = NDArray[np.float64]
Records = NDArray[np.void]

#: A measurement is of a segment within this distance [m], or within so many deviations.
_NEAR, _SIGMAS = 0.05, 4.0
#: A corner is at the end of a segment within so many spacings there.
_REACH = 6.0


def segment_records(given: Any, scan: LaserScan, noise: Array) -> Records:
    """Return the records of segments, by their ends or by their beams, in the order of beams.

    Raises a ValueError if they have another shape or numbers that are none.
    """
    rows = _numbers(given, "segments", "(L, 4) or (L, 2, 2): start and end; or whole (L, 2): beams")
    if rows.size == 0:
        return np.zeros(0, SEGMENT)
    if rows.dtype.kind in "iu" and rows.ndim == 2 and rows.shape[1] == 2:
        found = [_of_beams(scan, first, last, noise) for first, last in _beams(rows, scan).tolist()]
    elif rows.shape[1:] in ((4,), (2, 2)):
        found = [
            _of_ends(scan, start, end, noise) for start, end in rows.reshape(-1, 2, 2).astype(float)
        ]
    else:
        raise ValueError(
            f"segments of shape {rows.shape} and type {rows.dtype}, "
            "expected (L, 4) or (L, 2, 2): start and end [m]; or whole numbers (L, 2): beams"
        )
    kept = [one for one in found if one is not None]
    if len(kept) < len(found):
        warn("segments on fewer than two measurements are left out, as they have no covariance")
    records = np.array(kept, SEGMENT) if kept else np.zeros(0, SEGMENT)
    return records[np.argsort(records["first_beam"], kind="stable")]


def _numbers(given: Any, what: str, expected: str) -> NDArray[Any]:
    """Return an array of finite numbers."""
    try:
        rows = np.asarray(given)
    except ValueError:
        raise ValueError(f"{what} of several lengths, expected {expected}") from None
    if rows.size == 0:
        return rows
    if rows.dtype.kind not in "iuf":
        raise ValueError(f"{what} of type {rows.dtype}, expected {expected}")
    if not np.isfinite(rows).all():
        raise ValueError(f"{what} with a number that is not finite, expected {expected}")
    return rows


def _beams(rows: NDArray[Any], scan: LaserScan) -> NDArray[np.int64]:
    """Check beams of a scan."""
    if rows.min() < 0 or rows.max() >= len(scan):
        wrong = rows.min() if rows.min() < 0 else rows.max()
        raise ValueError(f"beam {wrong}, expected one of 0 to {len(scan) - 1}")
    return rows.astype(np.int64)


def _of_beams(scan: LaserScan, first: int, last: int, noise: Array) -> Records | None:
    """Fit a line to the valid measurements from a beam to another, over the seam if need be."""
    if first > last and not scan.is_full_circle:
        raise ValueError(f"a segment from beam {first} to {last}, expected the first one first")
    count = (last - first) % len(scan) + 1
    beams = (first + np.arange(count)) % len(scan)
    return _fitted(scan, beams[scan.valid[beams]], noise)


def _fitted(scan: LaserScan, beams: NDArray[np.int64], noise: Array) -> Records | None:
    """Return the record of the best line through measurements; None of fewer than two places."""
    from .stages import fit_line

    points = scan.points[beams]
    if len(beams) < 2 or not np.ptp(points, axis=0).any():
        return None
    record: Any = fit_line(points, noise=RangeNoise(*noise[:4]), fit="weighted").copy()
    if not record["length"] > 0.0:  # Of ranges of 1e-300 m, whose squares are 0.
        return None
    record["first_beam"], record["last_beam"], record["cluster"] = beams[0], beams[-1], -1
    return record  # type: ignore[no-any-return]


def _of_ends(scan: LaserScan, start: Array, end: Array, noise: Array) -> Records | None:
    """Return the record of a segment by its ends, with the covariance that its measurements give.

    It leads counter-clockwise around the sensor, as beams do.
    """
    if start[0] * end[1] - start[1] * end[0] < 0.0:
        start, end = end, start
    length = float(np.hypot(*(end - start)))
    if length == 0.0:
        return None
    along = (end - start) / length
    normal = np.array([-along[1], along[0]])
    ahead, off = (scan.points - start) @ along, (scan.points - start) @ normal
    near = np.maximum(_SIGMAS * np.sqrt(RangeNoise(*noise[:4]).range_variance(scan.ranges)), _NEAR)
    with np.errstate(invalid="ignore"):
        on = scan.valid & (np.abs(off) <= near) & (ahead >= -near) & (ahead <= length + near)
    record: Any = _fitted(scan, _in_order(np.flatnonzero(on), scan), noise)
    if record is None:
        return None
    record["start"], record["end"], record["length"] = start, end, length
    record["centroid"] = start + ((record["centroid"] - start) @ along) * along
    record["angle"] = np.arctan2(along[1], along[0])
    record["rms"] = np.sqrt(np.mean(off[on] ** 2))
    return record  # type: ignore[no-any-return]


def _in_order(beams: NDArray[np.int64], scan: LaserScan) -> NDArray[np.int64]:
    """Let beams of a full circle begin after the widest gap between them."""
    if not scan.is_full_circle or len(beams) < 2:
        return beams
    gaps = np.diff(beams, append=beams[0] + len(scan))
    return np.roll(beams, -1 - int(np.argmax(gaps)))


def corner_records(given: Any, segments: Records, scan: LaserScan, noise: Array) -> Records:
    """Return the records of corners, by their positions or by their beams.

    Raises a ValueError if they have another shape or numbers that are none.
    """
    expected = "(K, 2): positions [m]; or whole (K,): beams"
    rows = _numbers(given, "corners", expected)
    if rows.size == 0:
        return np.zeros(0, CORNER)
    if rows.dtype.kind in "iu" and rows.ndim == 1:
        beams = _beams(rows, scan)
        if not scan.valid[beams].all():
            raise ValueError(f"a corner at beam {beams[~scan.valid[beams]][0]}, which has no range")
        places = scan.points[beams]
    elif rows.ndim == 2 and rows.shape[1] == 2:
        places = rows.astype(float)
    else:
        raise ValueError(
            f"corners of shape {rows.shape} and type {rows.dtype}, expected {expected}"
        )
    near = [place for place in places if np.hypot(*place) < LARGEST]  # Squares are finite there.
    found = np.array([_corner(place, segments, scan, noise) for place in near], CORNER)
    return found[np.argsort(found["beam"], kind="stable")]


def _corner(place: Array, segments: Records, scan: LaserScan, noise: Array) -> Any:
    """Return the record of a corner at a position."""
    record = np.zeros((), CORNER)
    valid = np.flatnonzero(scan.valid)
    turns = np.angle(np.exp(1j * (scan.angles - np.arctan2(place[1], place[0]))))
    beam = int(valid[np.argmin(np.abs(turns[valid]))]) if len(valid) else -1
    step = float(np.median(np.abs(np.diff(scan.angles)))) if len(scan) > 1 else 0.0
    spacing = float(np.hypot(*place)) * step
    record["position"], record["beam"], record["kind"] = place, beam, "corner"
    record["response"] = record["quality"] = record["opening"] = np.nan
    reach = _REACH * max(spacing, _NEAR / _REACH)
    before, after = (
        _next_to(place, segments["end"], reach),
        _next_to(place, segments["start"], reach),
    )
    record["segments"] = before, after
    if before >= 0 and after >= 0:
        turn = segments["angle"][after] - segments["angle"][before]
        turn = float(np.angle(np.exp(1j * turn)))
        record["opening"], record["convex"] = np.pi - abs(turn), turn < 0.0
        covariance = _meeting(place, segments[before], segments[after])
    else:
        covariance = None
    record["covariance"] = _measured(place, spacing, noise) if covariance is None else covariance
    return record


def _next_to(place: Array, ends: Array, reach: float) -> int:
    """Return which end is nearest to a place, -1 if none is near."""
    if not len(ends):
        return -1
    apart = np.hypot(*(ends - place).T)
    nearest = int(np.argmin(apart))
    return nearest if apart[nearest] <= reach else -1


def _meeting(place: Array, before: Any, after: Any) -> Array | None:
    """Return the covariance of where two lines meet, A⁻¹ diag(s₁², s₂²) A⁻ᵀ; None if parallel."""
    normals = np.array(
        [[-np.sin(line["angle"]), np.cos(line["angle"])] for line in (before, after)]
    )
    if abs(np.linalg.det(normals)) < 1e-3:
        return None
    variances = []
    for line, normal in zip((before, after), normals, strict=True):
        lever = np.array([1.0, float((place - line["centroid"]) @ (normal[1], -normal[0]))])
        variances.append(lever @ line["covariance"] @ lever)
    inverse = np.linalg.inv(normals)
    covariance: Array = inverse @ np.diag(variances) @ inverse.T
    return 0.5 * (covariance + covariance.T)


def _measured(place: Array, spacing: float, noise: Array) -> Array:
    """Return the covariance of a measurement: the noise along its beam, a spacing across."""
    rho = float(np.hypot(*place))
    along = place / rho if rho > 0.0 else np.array([1.0, 0.0])
    across = max(spacing**2 / 12.0 + (rho * noise[2]) ** 2, 1e-12)
    variance = float(RangeNoise(*noise[:4]).range_variance(rho))
    covariance: Array = across * np.eye(2) + variance * np.outer(along, along)
    return covariance


def write(block: Block, segments: Records, corners: Records, gap: float) -> None:
    """Write the records of the scan that was taken, with its clusters and breakpoints."""
    row, room = block.row, block.beams + 1
    for what, records in (("segments", segments), ("corners", corners)):
        if len(records) > room:
            raise ValueError(f"{len(records)} {what} of {block.beams} beams")
    block.counts[at.PIECES] = 0
    block.measure(gap=gap)
    labels = block.clusters[row]
    segments["cluster"] = labels[segments["first_beam"]]
    offsets = block.offsets
    for number, records in ((SEGMENTS, segments), (CORNERS, corners)):
        start = int(offsets[row, number])
        table = block.features[number].reshape(-1).view(records.dtype)
        table[start : start + len(records)] = records
        offsets[row + 1, number] = start + len(records)
