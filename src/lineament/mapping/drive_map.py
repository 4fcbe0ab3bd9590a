"""`Drive`: key frames of a log, each placed by the walls of the last metres of the way."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES, Features, make_records
from ..motion.association import associate, is_landmark
from ..motion.estimate import Motion, estimate_motion
from ..scan import Array, LaserScan, Pose
from ..scan.poses import compose, inverse, poses_along, relative, twist_between

#: A key frame is taken after so much way, or so much turn [m, rad].
SPACING, TURN = 0.3, math.radians(15.0)
#: Key frames through which a wall is remembered that is not seen.
REMEMBERED = 30
#: Deviations of the motion by odometry [m, rad], and their growth with way and turn.
_ODOMETRY = (0.03, 0.02), (0.1, 0.1)
#: The same where it goes on as it did: robots turn at once.
_CONTINUED = (0.25, 0.35), (0.3, 0.3)
#: How surfaces are off straight lines [m].
_ROUGHNESS = 0.01
_ROUNDS = 4
#: A measurement is explained within this of a wall, contradicts one that it passes by more [m].
_NEAR, _BEYOND = 0.1, 0.3
#: Most beams that are looked at.
_BEAMS = 90
#: With at least this share of the beams explained, less contradicted, a place is taken at once.
_SURE = 0.75
#: Bins of turns, how many of them are tried, and the deviations from there [m, rad].
_BINS, _TRIED, _AROUND = 120, 10, (0.4, 0.4, 0.07)

Numbers = NDArray[np.int64]


@dataclass(slots=True, eq=False)
class KeyFrame:
    """A scan that stands for those around it.

    Attributes
    ----------
    index : int
        Of its scan in the log.
    features : Features
        In the frame of the sensor.
    walls : ndarray of int64, shape (n,)
        Which wall each of the segments shows.
    pose : (x, y, theta)
        In the frame of the first key frame.
    motion : Motion
        From the key frame before.
    """

    index: int
    features: Features
    walls: Numbers
    pose: Pose
    motion: Motion


class Drive:
    """Places the scans of a log, one after the other, by the walls of the last metres.

    Attributes
    ----------
    frames : list of KeyFrame
    scans : list of (int, Pose)
        Of each scan: the key frame that it belongs to, and its pose in that one's frame.
    lost : list of int
        Key frames that nothing of what was seen before explains.
    """

    def __init__(self) -> None:
        self.frames: list[KeyFrame] = []
        self.scans: list[tuple[int, Pose]] = []
        self.lost: list[int] = []
        #: Walls, corners and arcs of the last metres, in the frame of the last key frame; the
        #: number of each wall, and the key frame that saw it last.
        self._around: Features
        self._numbers, self._seen = np.empty(0, np.int64), np.empty(0, np.int64)
        self._next = 0
        #: Stamp, odometry and pose in the frame of the last key frame of the last scan; its twist.
        self._last: tuple[float, Pose | None, Pose] = (math.nan, None, (0.0, 0.0, 0.0))
        self._twist = (0.0, 0.0, 0.0)

    def add(self, scan: LaserScan, features: Features, odometry: Pose | None = None) -> None:
        """Add the next scan."""
        corners = features.corners
        features = replace(features, corners=corners[is_landmark(corners)])
        if not self.frames:
            empty: dict[str, Any] = {name: make_records(name, []) for name in TABLES}
            self._around = Features(**empty, clusters=np.empty(0, np.int32))
            self._key(features, Motion(0.0, 0.0, 0.0, np.zeros((3, 3))))
        else:
            prior, spread = self._expected(scan.stamp, odometry)
            motion, is_lost = self._place(scan, features, prior, spread)
            x, y, turn = motion.pose
            self._go_on(scan.stamp, motion.pose)
            if math.hypot(x, y) >= SPACING or abs(turn) >= TURN or is_lost:
                if is_lost:
                    self.lost.append(len(self.frames))
                self._key(features, motion)
            else:
                self.scans.append((len(self.frames) - 1, motion.pose))
                self._last = scan.stamp, odometry, motion.pose
                return
        self.scans.append((len(self.frames) - 1, (0.0, 0.0, 0.0)))
        self._last = scan.stamp, odometry, (0.0, 0.0, 0.0)

    def _go_on(self, stamp: float, pose: Pose) -> None:
        duration = stamp - self._last[0]
        if duration > 0:
            twist = twist_between(self._last[2], pose, duration)
            if max(map(abs, twist)) < 5.0:
                self._twist = twist

    def _expected(self, stamp: float, odometry: Pose | None) -> tuple[Pose, Array]:
        """Pose in the frame of the last key frame as it is expected, and its covariance."""
        before, duration = self._last[2], stamp - self._last[0]
        if odometry is not None and self._last[1] is not None:
            (least_way, least_turn), (by_way, by_turn) = _ODOMETRY
            step = relative(self._last[1], odometry)
        else:
            (least_way, least_turn), (by_way, by_turn) = _CONTINUED
            x, y, turn = poses_along(self._twist, [min(max(duration, 0.0), 0.5)])[0].tolist()
            step = x, y, turn
        way = least_way + by_way * math.hypot(step[0], step[1])
        turned = least_turn + by_turn * abs(step[2])
        return compose(before, step), np.diag((way, way, turned)) ** 2

    def _place(
        self, scan: LaserScan, features: Features, prior: Pose, spread: Array
    ) -> tuple[Motion, bool]:
        """Find the pose by the walls around; if it explains too little, by all likely turns."""
        motion = self._match(features, prior, spread)
        beams = _beams(scan)
        best = _score(beams, motion.pose, self._around)
        if best >= _SURE:
            return motion, False
        around = np.diag(_AROUND) ** 2
        for turn in _turns(self._around, features, prior[2]):
            found = self._match(features, (prior[0], prior[1], turn), around)
            score = _score(beams, found.pose, self._around)
            if score > best + 0.02:
                motion, best = found, score
        return motion, best < 0.3

    def _match(self, features: Features, prior: Pose, spread: Array) -> Motion:
        motion, matches = Motion(*prior, spread), None
        for _ in range(_ROUNDS):
            found = associate(
                self._around, features, motion.pose, motion.covariance, roughness=_ROUGHNESS
            )
            if matches is not None and found.same_as(matches):
                break
            matches = found
            motion = estimate_motion(matches, prior, spread, roughness=_ROUGHNESS)
        return motion

    def _key(self, features: Features, motion: Motion) -> None:
        """Take a key frame: the walls around it are those known and those of this scan."""
        pose = compose(self.frames[-1].pose, motion.pose) if self.frames else (0.0, 0.0, 0.0)
        around = self._around.transform(*inverse(motion.pose))
        matches = associate(around, features, roughness=_ROUGHNESS)
        here = len(self.frames)
        walls = np.full(len(features.segments), -1, np.int64)
        before, now = matches.segments.T
        walls[now] = self._numbers[before]
        new = np.flatnonzero(walls < 0)
        walls[new] = self._next + np.arange(len(new))
        self._next += len(new)
        segments = around.segments.copy()
        _fuse(segments, before, features.segments[now])
        self._seen[before] = here
        kept = self._seen >= here - REMEMBERED
        place = np.cumsum(kept) - 1
        mine = np.empty(len(walls) + 1, np.int32)
        mine[now], mine[new], mine[-1] = place[before], kept.sum() + np.arange(len(new)), -1
        corners = features.corners.copy()
        corners["segments"] = mine[corners["segments"]]
        old = np.append(np.where(kept, place, -1), -1).astype(np.int32)
        others = np.delete(around.corners, matches.corners[:, 0])
        others["segments"] = old[others["segments"]]
        others = others[(others["segments"] >= 0).any(axis=1)]
        arcs = np.delete(around.arcs, matches.arcs[:, 0])
        near = np.hypot(*arcs["center"].T) < 8.0
        self._around = replace(
            around,
            segments=np.concatenate((segments[kept], features.segments[new])),
            corners=np.concatenate((corners, others)),
            arcs=np.concatenate((features.arcs, arcs[near])),
        )
        self._numbers = np.concatenate((self._numbers[kept], walls[new]))
        self._seen = np.concatenate((self._seen[kept], np.full(len(new), here)))
        self.frames.append(KeyFrame(len(self.scans), features, walls, pose, motion))


def _fuse(walls: NDArray[np.void], at: NDArray[np.intp], seen: NDArray[np.void]) -> None:
    """Move walls to the mean of their line and the one that is seen now, by their covariances."""
    for k, other in zip(at.tolist(), seen, strict=True):
        wall = walls[k]
        angle = wall["angle"]
        u = np.array((math.cos(angle), math.sin(angle)))
        n = np.array((-u[1], u[0]))
        between = other["centroid"] - wall["centroid"]
        along = float(between @ u)
        turn = math.remainder(other["angle"] - angle, 2 * math.pi)
        rough = np.diag((_ROUGHNESS**2, (2 * _ROUGHNESS / max(other["length"], 0.1)) ** 2))
        arm = np.array(((1.0, -along), (0.0, 1.0)))
        spread = arm @ (other["covariance"] + rough) @ arm.T
        gain = wall["covariance"] @ np.linalg.inv(wall["covariance"] + spread)
        shift, turned = gain @ (float(between @ n) - along * math.tan(turn), turn)
        left = (np.eye(2) - gain) @ wall["covariance"]
        wall["covariance"] = (left + left.T) / 2
        wall["angle"] = math.remainder(angle + turned, 2 * math.pi)
        wall["centroid"] += shift * n
        u = np.array((math.cos(wall["angle"]), math.sin(wall["angle"])))
        ends = np.stack((wall["start"], wall["end"], other["start"], other["end"]))
        places = (ends - wall["centroid"]) @ u
        wall["start"] = wall["centroid"] + places.min() * u
        wall["end"] = wall["centroid"] + places.max() * u
        wall["length"] = places.max() - places.min()
        wall["n_points"] = max(wall["n_points"], other["n_points"])


def _turns(around: Features, features: Features, expected: float) -> list[float]:
    """Turns by which segments seen now lie along walls around, the likeliest first [rad]."""
    before, now = around.segments, features.segments
    off = before["angle"][:, np.newaxis] - now["angle"]
    weight = np.minimum(before["length"][:, np.newaxis], now["length"])
    bins = np.floor(np.mod(off, 2 * math.pi) / (2 * math.pi) * _BINS).astype(int) % _BINS
    votes = np.bincount(bins.ravel(), weight.ravel(), _BINS)
    votes = votes + 0.5 * (np.roll(votes, 1) + np.roll(votes, -1))
    # Large turns are less likely.
    middles = (np.arange(_BINS) + 0.5) / _BINS * 2 * math.pi
    far = np.abs(np.remainder(middles - expected + math.pi, 2 * math.pi) - math.pi)
    votes = votes * np.exp(-0.5 * (far / 1.2) ** 2)
    peaks = (votes >= np.roll(votes, 1)) & (votes > np.roll(votes, -1))
    order = np.argsort(-np.where(peaks, votes, 0.0), kind="stable")[:_TRIED]
    return [math.remainder(float(middles[k]), 2 * math.pi) for k in order if votes[k] > 0]


def _beams(scan: LaserScan) -> Array:
    """Bearings and ranges of some valid beams, shape (n, 2)."""
    valid = np.flatnonzero(scan.valid)
    if len(valid) > _BEAMS:
        valid = valid[np.linspace(0, len(valid) - 1, _BEAMS).astype(int)]
    return np.column_stack((scan.angles[valid], scan.ranges[valid]))


def _score(beams: Array, pose: Pose, around: Features) -> float:
    """Share of the beams that end on a wall around, less twice those that pass through one.

    Where nothing is known, no beam counts. Walls are met from their left alone.
    """
    x, y, theta = pose
    bearing = beams[:, 0] + theta
    ux, uy = np.cos(bearing)[:, np.newaxis], np.sin(bearing)[:, np.newaxis]
    ranges = beams[:, 1:]
    (px, py), (qx, qy) = around.segments["start"].T, around.segments["end"].T
    px, py, qx, qy = px - x, py - y, qx - x, qy - y
    wx, wy = qx - px, qy - py
    length = np.maximum(np.hypot(wx, wy), 1e-9)
    ex, ey = ranges * ux - px, ranges * uy - py
    along, off = (ex * wx + ey * wy) / length, (wx * ey - wy * ex) / length
    is_seen = (px * qy - py * qx > 0) & (np.abs(along - length / 2) < length / 2 + _NEAR)
    ends_there = (is_seen & (np.abs(off) < _NEAR)).any(axis=1)
    side_p, side_q = ux * py - uy * px, ux * qy - uy * qx
    inner = 0.05 * length
    at_p = side_p + inner * (ux * wy - uy * wx) / length
    at_q = side_q - inner * (ux * wy - uy * wx) / length
    passes = ((at_p < 0) & (at_q > 0) & (off < -_BEYOND)).any(axis=1) & ~ends_there
    count = max(len(beams), 1)
    return float(ends_there.sum() - 2.0 * passes.sum()) / count
