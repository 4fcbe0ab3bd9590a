"""Features as marks to be drawn: lines, points, arcs and ellipses, as plain arrays."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan

#: Share of the errors that lie within an ellipse.
LEVEL = 0.95
#: Vertices of a whole turn, when an arc or an ellipse becomes a strip of lines.
TURN = 48
#: What is farther from the origin than this is not drawn [m]: no scanner sees so far.
FARTHEST = 1e9
#: Cosines and sines of the directions to the vertices of an ellipse.
_COSINES, _SINES = (wave(np.linspace(0, 2 * math.pi, TURN + 1)) for wave in (np.cos, np.sin))


@dataclass(frozen=True, slots=True)
class Markers:
    """What is drawn of the features of a scan [m, rad], in their frame. All of it is finite.

    An arc is x, y of its centre, radius, and the directions in which what was seen begins and ends,
    counter-clockwise; a whole turn apart where that is not known. An ellipse is x, y, half axes
    (the longer first), direction of the longer: within them lie 95 % of the errors of the corners,
    then of the edges, then of the arcs' centres.
    """

    segments: Array
    corners: Array
    edges: Array
    arcs: Array
    ellipses: Array

    @property
    def points(self) -> Array:
        """Points (n, 2) that a picture of all of it must show."""
        circles = np.repeat(self.arcs[:, :2], 4, axis=0)
        circles += np.kron(self.arcs[:, 2:3], [[1, 0], [-1, 0], [0, 1], [0, -1]])
        return np.vstack([self.segments.reshape(-1, 2), self.corners, self.edges, circles])

    def arc_rows(self) -> list[tuple[list[float], bool]]:
        """Return the rows of the arcs, each with whether it is a whole circle."""
        return [(arc, arc[4] - arc[3] >= 2 * math.pi - 1e-6) for arc in self.arcs.tolist()]

    def arc_strips(self) -> list[Array]:
        """Make strips of vertices (n, 2), one an arc, at least 48 to a turn."""
        strips = []
        for x, y, radius, first, last in self.arcs:
            n = max(math.ceil(TURN * (last - first) / (2 * math.pi)), 2) + 1
            turn = first + (last - first) / (n - 1) * np.arange(n)
            strips.append(np.stack((x + radius * np.cos(turn), y + radius * np.sin(turn)), axis=1))
        return strips

    def ellipse_strips(self) -> Array:
        """Make closed strips of vertices, shape (E, 49, 2); the last vertex is the first."""
        x, y, a, b, direction = self.ellipses.T[:, :, None]
        u, v = a * _COSINES, b * _SINES
        c, s = np.cos(direction), np.sin(direction)
        strips = np.empty((len(u), TURN + 1, 2))
        strips[..., 0], strips[..., 1] = x + c * u - s * v, y + s * u + c * v
        return strips


def markers_of(features: Features, scan: LaserScan | None = None) -> Markers:
    """Make the marks of the features of a scan; those not finite or too far away are left out.

    Without the scan, in whose frame the features must be, arcs are drawn as whole circles.
    """
    segments, arcs = features.segments, features.arcs
    lines = np.empty((len(segments), 2, 2))  # faster than stacked, as below
    lines[:, 0], lines[:, 1] = segments["start"], segments["end"]
    corners, edges = (
        table[is_drawn(table["position"])] for table in (features.corners, features.edges)
    )
    arcs = arcs[is_drawn(arcs["center"]) & is_drawn(arcs["radius"])]
    spans = [(0.0, 2 * math.pi) if scan is None else arc_span(arc, scan) for arc in arcs]
    return Markers(
        segments=lines[is_drawn(lines)],
        corners=corners["position"],
        edges=edges["position"],
        arcs=np.column_stack((arcs["center"], arcs["radius"], np.reshape(spans, (-1, 2)))),
        ellipses=ellipses_of(
            np.concatenate((corners["position"], edges["position"], arcs["center"])),
            np.concatenate(
                (corners["covariance"], edges["covariance"], arcs["covariance"][:, :2, :2])
            ),
        ),
    )


def is_drawn(values: Array) -> NDArray[np.bool_]:
    """Whether all values of each row are finite, and not too far away to be drawn."""
    near = np.abs(values) < FARTHEST  # NaN is not
    return np.asarray(near.all(axis=tuple(range(1, values.ndim))))


def arc_span(arc: np.void, scan: LaserScan) -> tuple[float, float]:
    """First and last direction [rad] from the centre of an arc to its points; all without them."""
    first, last, n = int(arc["first_beam"]), int(arc["last_beam"]), len(scan)
    if not (0 <= first < n and 0 <= last < n):
        return 0.0, 2 * math.pi
    beams = slice(first, last + 1) if first <= last else np.r_[first:n, : last + 1]
    ranges = np.where(scan.valid[beams], scan.ranges[beams], np.nan)
    bearings = scan.angles[beams]
    x, y = arc["center"].tolist()
    angles = np.arctan2(ranges * np.sin(bearings) - y, ranges * np.cos(bearings) - x)
    angles = angles[~np.isnan(angles)]  # of beams that are not valid
    if not len(angles):
        return 0.0, 2 * math.pi
    angles[1:] -= 2 * math.pi * np.rint(np.diff(angles) / (2 * math.pi)).cumsum()
    return float(angles.min()), float(angles.max())


def ellipses_of(positions: Array, covariances: Array, level: float = LEVEL) -> Array:
    """Return the ellipses (m, 5), as in `Markers`, within which a share of the errors lies.

    Points (n, 2) [m] without a finite covariance (n, 2, 2) have none. Of two Gaussian coordinates
    the share lies within √(-2 ln(1 - level)) deviations.
    """
    known = is_drawn(positions) & is_drawn(covariances)
    centers, covariances = positions[known], covariances[known]
    a, b, c = covariances[:, 0, 0], covariances[:, 1, 0], covariances[:, 1, 1]
    # The eigenvalues of [[a, b], [b, c]] are mean ± spread.
    mean, spread = (a + c) / 2, np.hypot((a - c) / 2, b)
    scale = -2 * math.log1p(-level)
    ellipses = np.empty((len(centers), 5))
    ellipses[:, :2] = centers
    ellipses[:, 2] = np.sqrt(scale * np.maximum(mean + spread, 0))
    ellipses[:, 3] = np.sqrt(scale * np.maximum(mean - spread, 0))
    ellipses[:, 4] = np.arctan2(2 * b, a - c) / 2 % math.pi
    return ellipses
