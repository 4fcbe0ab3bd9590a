"""Slow twins of tracking, pair by pair: how features differ, who is who, and the motion between."""

from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from lineament.features import TABLES, Features, make_records
from lineament.motion import Matches, Motion, Tracker, Tracks
from lineament.scan.poses import inverse

KINDS = ("segments", "corners", "arcs")
PLACE = {"segments": "centroid", "corners": "position", "arcs": "center"}
PATCH = 0.3


def turned(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def moved(points, motion):
    """Points under a motion (x, y, theta)."""
    c, s = np.cos(motion[2]), np.sin(motion[2])
    return points @ np.array([[c, s], [-s, c]]) + motion[:2]


def length_of(segment):
    return max(np.hypot(*(segment["end"] - segment["start"])), np.finfo(float).eps)


def side_by_side(a, b, motion):
    """Share of what two segments cover together along a's line that both do, and that length."""
    tangent = np.array([np.cos(a["angle"]), np.sin(a["angle"])])
    ends = sorted((moved(b[end], motion) - a["start"]) @ tangent for end in ("start", "end"))
    length = length_of(a)
    shared = min(ends[1], length) - max(ends[0], 0.0)
    return max(shared / (max(ends[1], length) - min(ends[0], 0.0)), 0.0), shared


def compared(kind, a, b, motion, roughness):
    """Error of a later feature, its derivatives by the motion, and its covariance.

    Of a segment (offset from a's line, angle), of a corner its place, of an arc place and radius.
    """
    point = moved(b[PLACE[kind]], motion)
    apart, (dx, dy) = point - a[PLACE[kind]], point - motion[:2]
    by_motion = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx]])
    if kind == "segments":
        c, s = np.cos(a["angle"]), np.sin(a["angle"])
        error = np.array(
            [-s * apart[0] + c * apart[1], turned(b["angle"] + motion[2] - a["angle"])]
        )
        jacobian = np.array([[-s, c] @ by_motion, [0.0, 0.0, 1.0]])
        # The offset of the earlier line where the later one has its centroid.
        lever = np.array([[1.0, [c, s] @ apart], [0.0, 1.0]])
        return error, jacobian, lever @ a["covariance"] @ lever.T + b["covariance"]
    turn = np.eye(len(b["covariance"]))
    turn[:2, :2] = moved(np.eye(2), (0.0, 0.0, motion[2])).T
    covariance = a["covariance"] + turn @ b["covariance"] @ turn.T
    covariance += roughness**2 * np.eye(len(turn))
    if kind == "arcs":
        apart = np.append(apart, b["radius"] - a["radius"])
        by_motion = np.vstack((by_motion, np.zeros(3)))
    return apart, by_motion, covariance


def unevenness(a, b, roughness, share):
    """Covariance of (offset, angle) by roughness, patch by patch, and a share of both misfits."""
    length = min(length_of(a), length_of(b))
    offset, bow = roughness**2 / (1 + length / PATCH), share * (a["misfit"] ** 2 + b["misfit"] ** 2)
    return (offset + bow) * np.diag((1.0, 12.0 / length**2))


def square_of(error, covariance):
    """e'S⁻¹e; inf if S is not known."""
    if not np.isfinite(covariance).all() or not np.linalg.det(covariance) > 0:
        return np.inf
    return error @ np.linalg.solve(covariance, error)


def associate(before, now, motion=(0.0, 0.0, 0.0), covariance=None, *, gate=0.99, roughness=0.0):
    """Find the pairs of least cost; to stay alone costs as much as the gate, on either side."""
    spread = np.zeros((3, 3)) if covariance is None else np.asarray(covariance)
    pairs = []
    for kind in KINDS:
        earlier, later = getattr(before, kind), getattr(now, kind)
        limit = chi2.ppf(gate, 3 if kind == "arcs" else 2)
        cost = np.full((len(earlier), len(later)), 2 * limit)
        for i, a in enumerate(earlier):
            for j, b in enumerate(later):
                error, jacobian, own = compared(kind, a, b, motion, roughness)
                own = own + jacobian @ spread @ jacobian.T
                unlike = 0.0
                if kind == "segments":
                    own = own + unevenness(a, b, roughness, 1.0)
                    share, shared = side_by_side(a, b, motion)
                    unlike = limit * (1 - share)
                    if not is_beside(a, b, motion, spread, roughness, shared, error[1]):
                        continue
                if kind == "corners":
                    sides = [k for k in b["segments"] if 0 <= k < len(now.segments)]
                    own = own + 2 * sum(now.segments["misfit"][sides] ** 2) * np.eye(2)
                    if a["convex"] != b["convex"]:
                        continue
                square = square_of(error, own)
                if square <= limit:
                    cost[i, j] = square + unlike
        rows, columns = linear_sum_assignment(cost)
        kept = cost[rows, columns] < 2 * limit
        pairs.append(np.column_stack((rows[kept], columns[kept])))
    return Matches(before, now, *pairs)


def is_beside(a, b, motion, spread, roughness, shared, turn):
    """Whether two segments face the same way, half of the shorter beside the other."""
    dx, dy = moved(b["centroid"], motion) - motion[:2]
    along = np.array([np.cos(a["angle"]), np.sin(a["angle"])])
    along = np.append(along, along @ (-dy, dx))
    slack = 2 * np.sqrt(along @ spread @ along + roughness**2)
    return shared + slack >= 0.5 * min(length_of(a), length_of(b)) and np.cos(turn) > 0


def residuals(matches, motion, roughness):
    """List (error, jacobian, information, what is feigned) of each pair under a motion."""
    listed, shown = [], set()
    for kind in KINDS:
        for i, j in getattr(matches, kind):
            a, b = getattr(matches.before, kind)[i], getattr(matches.now, kind)[j]
            error, jacobian, covariance = (
                part[:2] for part in compared(kind, a, b, motion, roughness)
            )
            covariance, feigned = covariance[:, :2], np.zeros(3)
            if kind == "segments":
                share, _ = side_by_side(a, b, motion)
                covariance = covariance + unevenness(a, b, roughness, 1 - share)
                if covariance[1, 1] > 0.1**2:
                    listed.append((error, jacobian, np.zeros((2, 2)), feigned))
                    continue
                shown.add(int(j))
                dx, dy = moved(b["centroid"], motion) - motion[:2]
                c, s = np.cos(a["angle"]), np.sin(a["angle"])
                slope = np.sqrt(covariance[1, 1] / covariance[0, 0])
                feigned = slope * np.array([c, s, s * dx - c * dy])
            information = np.linalg.inv(covariance)
            if kind == "corners":
                # It is where its segments meet: of one that shows a motion, the place along it is
                # new.
                known = [k for k in b["segments"] if int(k) in shown]
                if known:
                    angle = matches.now.segments["angle"][known[0]] + motion[2]
                    u = np.array([np.cos(angle), np.sin(angle)])
                    information = (len(known) == 1) * np.outer(u, u) / (u @ covariance @ u)
            listed.append((error, jacobian, information, feigned))
    return listed


def estimate_motion(matches, prior=(0.0, 0.0, 0.0), covariance=None, *, roughness=0.0):
    """Estimate the motion by least squares, reweighted; what is not observed is the prior's."""
    spread = np.diag((10.0, 10.0, np.pi)) ** 2 if covariance is None else np.asarray(covariance)
    known, state = np.linalg.inv(spread), np.array(prior, float)
    places = [getattr(matches.now, k)[PLACE[k]][getattr(matches, k)[:, 1]] for k in KINDS]
    far = np.concatenate(places)
    scale = np.array([1.0, 1.0, max(1.0, np.sqrt((far**2).sum() / max(len(far), 1)))])
    for _ in range(20):
        listed = residuals(matches, state, roughness)
        squares = np.array([e @ w @ e for e, _, w, _ in listed])
        counted, limit = squares[squares > 0], chi2.ppf(0.99, 2)
        if len(counted):
            limit *= max(1.0, np.median(counted) / chi2.ppf(0.5, 2))
        information, gradient, feigned = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
        for (e, j, w, f), square in zip(listed, squares, strict=True):
            weight = limit / max(square, limit)
            information += weight * j.T @ w @ j
            gradient += weight * j.T @ w @ e
            feigned += weight * np.outer(f, f)
        values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
        seeming = np.diag(vectors.T @ (feigned / np.outer(scale, scale)) @ vectors)
        lost = vectors[:, values <= 0.1**-2 + 3.0**2 * seeming]
        kept = np.eye(3) - (lost @ lost.T) * scale / scale[:, None]
        total = kept.T @ information @ kept + known
        off = state - prior
        off[2] = turned(off[2])
        step = np.linalg.solve(total, kept.T @ gradient + known @ off)
        state = state - step
        if np.abs(step).max() < 1e-7:
            break
    return Motion(*state[:2], turned(state[2]), np.linalg.inv(total), lost.T)


class NaiveTracker(Tracker):
    """A tracker that looks for pairs three times, and numbers features one by one."""

    def __init__(self, **settings):
        super().__init__(**settings)
        tables = {name: make_records(name, []) for name in TABLES}
        self._seen = Features(**tables, clusters=np.empty(0, np.int32))

    def __call__(self, features, odometry=None):
        self._features = features
        return super().__call__(features, odometry)

    def _follow(self, _, start, near, prior, spread):
        motion = Motion(*start, near)
        for _ in range(3):
            matches = associate(
                self._seen, self._features, motion.pose, motion.covariance,
                gate=self.gate, roughness=self.roughness,
            )  # fmt: skip
            pairs = {kind: getattr(matches, kind) for kind in KINDS}
            fresh = {kind: of[self._missed[kind][of[:, 0]] == 0] for kind, of in pairs.items()}
            matched = replace(matches, **fresh)
            motion = estimate_motion(matched, prior, spread, roughness=self.roughness)
        return motion, tuple(pairs.values())

    def _doubles(self, k, older, features):
        """Whether a corner that was seen in the last frame alone is one with an older number."""
        number, seen = self._tracks["corners"][k], self._seen.corners[k]
        if number < self._young:
            return False
        for now, other in older.items():
            corner = features.corners[now]
            if other < number and corner["convex"] == seen["convex"]:
                off = corner["position"] - seen["position"]
                spread = corner["covariance"] + seen["covariance"]
                spread = spread + 2 * self.roughness**2 * np.eye(2)
                if not np.isfinite(spread).all():
                    continue
                if off @ np.linalg.inv(spread) @ off < chi2.ppf(self.gate, 2):
                    return True
        return False

    def _renew(self, _, pairs, motion):
        features = self._features
        if motion is not None:
            self._seen = self._seen.transform(*inverse(motion.pose))
        numbers, born, ended, tables = {}, [], [], {}
        for kind, of in zip(KINDS, pairs, strict=True):
            seen, mine = getattr(self._seen, kind), {}
            tracks, missed, waiting = self._tracks[kind], self._missed[kind], []
            found = dict(of.tolist())
            older = {now: tracks[k] for k, now in found.items()}
            for k in range(len(seen)):
                if k in found:
                    mine[found[k]] = tracks[k]
                elif kind == "corners" and missed[k] == 0 and self._doubles(k, older, features):
                    ended.append(tracks[k])
                elif missed[k] < self.max_missed:
                    waiting.append(k)
                else:
                    ended.append(tracks[k])
            if kind == "corners":
                self._young = self._next
            for k in range(len(getattr(features, kind))):
                if k not in mine:
                    mine[k] = self._next
                    born.append(self._next)
                    self._next += 1
            numbers[kind] = np.array([mine[k] for k in sorted(mine)], np.int64)
            tables[kind] = np.concatenate((getattr(features, kind), seen[waiting]))
            self._tracks[kind] = np.append(numbers[kind], tracks[waiting])
            self._missed[kind] = np.append(np.zeros(len(mine), np.int64), missed[waiting] + 1)
        self._seen = replace(features, **tables)
        return Tracks(**numbers, born=np.array(born), ended=np.array(ended), motion=motion)
