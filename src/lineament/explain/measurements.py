"""One measurement and the features of its scan: is it valid, in which, how far off."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.noise import LEAST_SIGMA
from ..methods.trace import Trace
from ..scan import LaserScan


class Run(NamedTuple):
    """Measurements in a row that are in no feature, and the segments next to them."""

    beams: list[int]
    before: int  # index in the segments; -1 where the cluster ends, or an arc is next to them
    after: int


class Measurements:
    """The beams of a trace that the detection used, in order."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.beams = np.flatnonzero(np.isfinite(trace.filtered))

    def __len__(self) -> int:
        return len(self.beams)

    def neighbour(self, i: int, way: int) -> int | None:
        """Return the next usable beam, over the seam of a full circle."""
        at = int(np.searchsorted(self.beams, i)) + way
        if not 0 <= at < len(self.beams) and not self.trace.scan.is_full_circle:
            return None
        there = int(self.beams[at % len(self.beams)])
        return None if there == i else there

    def of(self, segment: np.void) -> list[int]:
        """Return the beams of a segment, in order, over the seam where it crosses it."""
        first, last, n = int(segment["first_beam"]), int(segment["last_beam"]), len(self.trace.scan)
        after = (self.beams - first) % n
        return [int((first + k) % n) for k in np.sort(after[after <= (last - first) % n])]

    def unexplained(self, beam: int) -> Run:
        """Return the measurements around this one in its cluster and in no feature."""
        earlier, before = self._up_to_a_feature(beam, -1, [beam])
        later, after = self._up_to_a_feature(beam, 1, [beam, *earlier])
        return Run([*reversed(earlier), beam, *later], before, after)

    def _up_to_a_feature(self, beam: int, way: int, seen: list[int]) -> tuple[list[int], int]:
        """Return the neighbours of a beam up to a feature, and the index of that segment or -1."""
        clusters, features = self.trace.clusters, self.trace.features
        found: list[int] = []
        there = self.neighbour(beam, way)
        while there is not None and there not in seen and clusters[there] == clusters[beam]:
            owners = np.flatnonzero(spans(features.segments, there))
            if len(owners) or spans(features.arcs, there).any():
                return found, int(owners[0]) if len(owners) else -1
            found.append(there)
            there = self.neighbour(there, way) if len(found) < len(self) else None
        return found, -1


class Line(NamedTuple):
    """The line a x + b y = 1 of least χ² through measurements (inverse-range regression)."""

    a: float
    b: float
    chi_square: float
    rms: float  # [m]
    length: float  # between its first and last measurement [m]

    @classmethod
    def through(cls, trace: Trace, beams: list[int]) -> Line:
        """Fit the line of some beams of a trace, weighted by the noise and the scale it used."""
        xy, noise = trace.scan.points[beams], trace.features.noise
        rho = trace.scan.ranges[beams]
        variance = noise.range_variance(rho) if noise else rho**2
        weight = rho**2 / (np.maximum(variance, LEAST_SIGMA**2) + trace.scale**2)
        root = np.sqrt(weight)
        (a, b), *_ = np.linalg.lstsq(xy * root[:, None], root, rcond=None)
        off = 1.0 - xy @ (a, b)
        rms = math.sqrt(np.mean(off**2) / (a * a + b * b)) if a or b else math.inf
        length = math.dist(xy[0], xy[-1])
        return cls(float(a), float(b), float(weight @ off**2), rms, length)

    def turn(self, other: Line) -> float:
        """Angle between two lines [°]."""
        cross, dot = self.a * other.b - self.b * other.a, self.a * other.a + self.b * other.b
        return math.degrees(math.atan2(abs(cross), abs(dot)))


def why_invalid(scan: LaserScan, i: int) -> str:
    """Return what is wrong with a range; empty if it is valid."""
    r = float(scan.ranges[i])
    if math.isnan(r):
        return "the range is NaN, no measurement"
    if math.isinf(r):
        return f"the range is {r}, nothing came back"
    if r <= 0:
        return f"the range is {r:g} m, no measurement"
    if r < scan.range_min:
        return f"{r:g} m is below range_min = {scan.range_min:g} m"
    if r >= scan.range_max:
        return f"{r:g} m is at or beyond range_max = {scan.range_max:g} m"
    return ""


def spans(records: NDArray[np.void], i: int) -> NDArray[np.bool_]:
    """Whether each feature's beams include this one; over the seam, first is larger than last."""
    first, last = records["first_beam"], records["last_beam"]
    inside: NDArray[np.bool_] = (first <= i) & (i <= last)
    over: NDArray[np.bool_] = (first > last) & ((i >= first) | (i <= last))
    return inside | over


def along_beam(scan: LaserScan, i: int, segment: np.void) -> float:
    """Return a range less that at which the beam meets the line of a segment [m]."""
    nx, ny = -math.sin(segment["angle"]), math.cos(segment["angle"])
    x, y = segment["centroid"]
    slope = nx * math.cos(scan.angles[i]) + ny * math.sin(scan.angles[i])
    return float(scan.ranges[i] - (nx * x + ny * y) / slope) if slope else math.inf
