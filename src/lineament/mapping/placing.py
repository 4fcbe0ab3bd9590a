"""Where a scan may be among walls around: turns and scores of poses, and walls that grow."""

import math

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan, Pose
from .evidence import _THROUGH as THROUGH
from .evidence import TOGETHER, evidence_of
from .line_map import Index, make_index
from .walls import COLUMN, WALL

#: How surfaces are off straight lines [m].
ROUGHNESS = 0.01
#: Bins of turns, and how many of them are tried.
_BINS, _TURNS = 120, 12
#: What a beam that passes through a wall says [nats], and what it takes off those explained.
_MILD, PASSED = -0.8, 0.5


def some(beams: Array, count: int) -> Array:
    """Return so many of the beams, evenly spread."""
    if len(beams) <= count:
        return beams
    return np.ascontiguousarray(beams[np.linspace(0, len(beams) - 1, count).astype(int)])


def scored(poses: Array, beams: Array, index: Index, spread: float) -> Array:
    """How well poses explain the beams [nats]; a wall that beams pass may have gone away."""
    found = evidence_of(poses, beams, index, spread)
    passed = len(beams) / TOGETHER * found[:, 3]
    return np.asarray(found[:, 0] + (_MILD - THROUGH) * passed)


def index_of(walls: NDArray[np.void]) -> Index:
    """Return the index of walls; where there are none, of a short one where no beam ends."""
    if not len(walls):
        walls = np.zeros(1, WALL)
        walls["start"], walls["end"], walls["centroid"] = 999.0, (999.1, 999.0), 999.0
    return make_index(walls, np.zeros(0, COLUMN), 0.0)


def as_walls(segments: NDArray[np.void]) -> NDArray[np.void]:
    """Segments as walls that are seen from their left."""
    walls = np.zeros(len(segments), WALL)
    for name in ("start", "end", "centroid", "angle", "covariance"):
        walls[name] = segments[name]
    walls["side"] = walls["views"] = 1
    walls["covariance"][:, 0, 0] += segments["misfit"] ** 2
    length = np.maximum(segments["length"], 1e-3)
    walls["covariance"][:, 1, 1] += 4 * (segments["misfit"] / length) ** 2
    return walls[segments["length"] > 0.05]


def likely_turns(
    around: Features, features: Features, expected: float, spread: float
) -> list[float]:
    """List the turns by which segments lie along walls around, the likeliest first [rad]."""
    before, now = around.segments, features.segments
    off = before["angle"][:, np.newaxis] - now["angle"]
    weight = np.minimum(before["length"][:, np.newaxis], now["length"])
    bins = np.floor(np.mod(off, 2 * math.pi) / (2 * math.pi) * _BINS).astype(int) % _BINS
    votes = np.bincount(bins.ravel(), weight.ravel(), _BINS)
    votes = votes + 0.5 * (np.roll(votes, 1) + np.roll(votes, -1))
    # Large turns are less likely.
    middles = (np.arange(_BINS) + 0.5) / _BINS * 2 * math.pi
    far = np.abs(np.remainder(middles - expected + math.pi, 2 * math.pi) - math.pi)
    votes = votes * np.exp(-0.5 * (far / max(spread, 0.5)) ** 2)
    peaks = (votes >= np.roll(votes, 1)) & (votes > np.roll(votes, -1))
    order = np.argsort(-np.where(peaks, votes, 0.0), kind="stable")[:_TURNS]
    return [math.remainder(float(middles[k]), 2 * math.pi) for k in order if votes[k] > 0]


def unlikely(poses: Array, prior: Pose, way: float, turn: float) -> Array:
    """How unlikely poses (n, 3) are by what is expected [nats]."""
    off = poses - prior
    off[:, 2] = np.remainder(off[:, 2] + math.pi, 2 * math.pi) - math.pi
    far = (off[:, 0] ** 2 + off[:, 1] ** 2) / (2 * way**2)
    return np.asarray(far + off[:, 2] ** 2 / (2 * turn**2))


def passed(walls: NDArray[np.void], scan: LaserScan) -> NDArray[np.bool_]:
    """Whether beams pass through each wall, away from its ends, and end far behind."""
    valid = scan.valid
    bearing, ranges = scan.angles[valid][:, np.newaxis], scan.ranges[valid][:, np.newaxis]
    ux, uy = np.cos(bearing), np.sin(bearing)
    (px, py), (qx, qy) = walls["start"].T, walls["end"].T
    wx, wy = qx - px, qy - py
    length = np.maximum(np.hypot(wx, wy), 1e-9)
    ex, ey = ranges * ux - px, ranges * uy - py
    off = (wx * ey - wy * ex) / length
    margin = np.minimum(0.1, 0.2 * length) * (ux * wy - uy * wx) / length
    # The start lies to the right of a beam that passes, the end to its left.
    passes = (ux * py - uy * px < -abs(margin)) & (ux * qy - uy * qx > abs(margin)) & (off < -0.3)
    return np.asarray(passes.sum(axis=0) >= 3)
