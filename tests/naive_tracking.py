"""Slow, obvious twins of association and motion, of many features at once with numpy and scipy."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.special import gammaincinv

from lineament.kernels.noise import LEAST_SIGMA
from lineament.poses import inverse
from lineament.tracking import Matches, Motion, Tracker, Tracks

KINDS = ("segments", "corners", "arcs")
_PATCH, _OVERLAP = 0.3, 0.5
_KNOWN, _FEIGNED, _RIGHT, _DIRECTED = 0.1, 3.0, 0.99, 0.1
_ROUNDS, _SMALL = 20, 1e-7


def associate(before, now, motion=(0.0, 0.0, 0.0), covariance=None, *, gate=0.99, roughness=0.0):
    """Find the features that two frames share."""
    moved = now.transform(*motion)
    about = _Uncertainty(np.array(motion[:2]), covariance, roughness)
    return Matches(
        before,
        now,
        _paired(*_segment_costs(before.segments, moved.segments, about), chi_square(gate, 2)),
        _paired(*_corner_costs(before.corners, moved.corners, about), chi_square(gate, 2)),
        _paired(*_arc_costs(before.arcs, moved.arcs, about), chi_square(gate, 3)),
    )


def segment_lengths(segments):
    """Length of each segment [m], more than 0."""
    arm = segments["end"] - segments["start"]
    return np.maximum(np.hypot(arm[:, 0], arm[:, 1]), np.finfo(float).eps)


def rough_variances(lengths, roughness):
    """Variances of offset [m²] and angle [rad²] of lines on surfaces that are not straight.

    Deviations r are one over a patch of a surface, and independent from patch to patch: the mean
    of 1 + L/patch of them is known to r²/(1 + L/patch), and their slope to 12/L² times that.
    """
    offset = roughness**2 / (1.0 + lengths / _PATCH)
    return offset, 12.0 * offset / lengths**2


def turned(angle):
    """Angles brought into [-π, π)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def chi_square(probability, degrees):
    """Quantile of the χ² distribution."""
    return 2.0 * float(gammaincinv(degrees / 2, probability))


@dataclass
class _Uncertainty:
    """What makes features differ besides their own covariances."""

    origin: np.ndarray
    covariance: np.ndarray | None
    roughness: float

    def of_points(self, points):
        """Covariance (…, 2, 2) of points that the motion has moved."""
        spread = self.roughness**2 * np.eye(2)
        if self.covariance is None:
            return np.broadcast_to(spread, (*points.shape[:-1], 2, 2))
        jacobian = np.zeros((*points.shape[:-1], 2, 3))
        jacobian[..., 0, 0] = jacobian[..., 1, 1] = 1.0
        jacobian[..., 0, 2] = self.origin[1] - points[..., 1]
        jacobian[..., 1, 2] = points[..., 0] - self.origin[0]
        moved = jacobian @ self.covariance @ np.swapaxes(jacobian, -1, -2)
        return spread + moved

    def of_lines(self, points, normals, lengths):
        """Covariance (…, 2, 2) of offset and angle of lines through moved points."""
        rough = np.zeros((*lengths.shape, 2, 2))
        rough[..., 0, 0], rough[..., 1, 1] = rough_variances(lengths, self.roughness)
        if self.covariance is None:
            return rough
        arm = points - self.origin
        jacobian = np.zeros((*lengths.shape, 2, 3))
        jacobian[..., 0, :2] = normals
        jacobian[..., 0, 2] = normals[..., 1] * arm[..., 0] - normals[..., 0] * arm[..., 1]
        jacobian[..., 1, 2] = 1.0
        return rough + jacobian @ self.covariance @ np.swapaxes(jacobian, -1, -2)


def _segment_costs(before, now, about):
    """d² (B, N) of all pairs, inf where they are not side by side; and the share they are not."""
    tangent = np.column_stack((np.cos(before["angle"]), np.sin(before["angle"])))[:, np.newaxis]
    normal = tangent[..., ::-1] * (-1.0, 1.0)
    apart = now["centroid"] - before["centroid"][:, np.newaxis]
    along = (apart * tangent).sum(axis=2)
    error = np.stack(
        ((apart * normal).sum(axis=2), turned(now["angle"] - before["angle"][:, np.newaxis])),
        axis=2,
    )
    lever = np.zeros((*along.shape, 2, 2))
    lever[..., 0, 0] = lever[..., 1, 1] = 1.0
    lever[..., 0, 1] = along
    lengths = np.minimum(segment_lengths(before)[:, np.newaxis], segment_lengths(now))
    points = np.broadcast_to(now["centroid"], apart.shape)
    spread = about.of_lines(points, np.broadcast_to(normal, apart.shape), lengths)
    spread = spread + now["covariance"]
    spread += lever @ before["covariance"][:, np.newaxis] @ np.swapaxes(lever, -1, -2)
    slack = about.of_points(points)
    slack = 2 * np.sqrt(((tangent[..., np.newaxis, :] @ slack)[..., 0, :] * tangent).sum(axis=2))
    shared, union = _side_by_side(before, now, tangent)
    beside = (shared + slack >= _OVERLAP * lengths) & (np.cos(error[..., 1]) > 0)
    cost = np.where(beside, _mahalanobis(error, spread), np.inf)
    return cost, 1.0 - np.clip(shared / union, 0.0, 1.0)


def _side_by_side(before, now, tangent):
    """Length along which pairs lie side by side, less than 0 if they do not, and of both [m]."""
    ends = np.stack([now["start"], now["end"]], axis=1) - before["start"][:, np.newaxis, np.newaxis]
    along = (ends * tangent[:, :, np.newaxis]).sum(axis=3)
    low, high = along.min(axis=2), along.max(axis=2)
    length = segment_lengths(before)[:, np.newaxis]
    shared = np.minimum(high, length) - np.maximum(low, 0.0)
    return shared, np.maximum(high, length) - np.minimum(low, 0.0)


def _corner_costs(before, now, about):
    apart = now["position"] - before["position"][:, np.newaxis]
    spread = before["covariance"][:, np.newaxis] + now["covariance"]
    spread = spread + about.of_points(now["position"])
    same = before["convex"][:, np.newaxis] == now["convex"]
    return np.where(same, _mahalanobis(apart, spread), np.inf), np.zeros(same.shape)


def _arc_costs(before, now, about):
    apart = np.concatenate(
        (
            now["center"] - before["center"][:, np.newaxis],
            (now["radius"] - before["radius"][:, np.newaxis])[..., np.newaxis],
        ),
        axis=2,
    )
    spread = before["covariance"][:, np.newaxis] + now["covariance"]
    spread[..., :2, :2] += about.of_points(now["center"])
    spread[..., 2, 2] += about.roughness**2
    return _mahalanobis(apart, spread), np.zeros(apart.shape[:2])


def _mahalanobis(error, covariance):
    """Squares e'S⁻¹e, shape (B, N); inf where the covariance is not known."""
    usable = np.isfinite(covariance).all(axis=(-1, -2))
    usable &= np.isfinite(error).all(axis=-1)
    usable &= np.linalg.det(np.where(usable[..., np.newaxis, np.newaxis], covariance, 0.0)) > 0
    square = np.full(usable.shape, np.inf)
    whitened = np.linalg.solve(covariance[usable], error[usable][..., np.newaxis])[..., 0]
    square[usable] = (whitened * error[usable]).sum(axis=-1)
    return square


def _paired(cost, unlike, limit):
    """Pair one to one, within the limit; `unlike` (0 to 1) tells the pieces of one wall apart."""
    if not cost.size:
        return np.empty((0, 2), np.intp)
    allowed = cost <= limit
    alone = 2 * limit
    rows, columns = linear_sum_assignment(np.where(allowed, cost + limit * unlike, alone))
    kept = allowed[rows, columns]
    return np.column_stack((rows[kept], columns[kept]))


@dataclass
class Residuals:
    """Errors (m, 2) of pairs, jacobians (m, 2, 3), information (m, 2, 2), and what is feigned."""

    errors: np.ndarray
    jacobians: np.ndarray
    information: np.ndarray
    feigned: np.ndarray

    @property
    def squares(self):
        """e'Σ⁻¹e of each pair, shape (m,)."""
        return np.einsum("ki,kij,kj->k", self.errors, self.information, self.errors)

    def normal_equations(self, weights):
        """Information (3, 3), gradient (3,), and information that is feigned (3, 3)."""
        weighted = weights[:, np.newaxis, np.newaxis] * self.information
        weighted = np.swapaxes(self.jacobians, 1, 2) @ weighted
        return (
            (weighted @ self.jacobians).sum(axis=0),
            (weighted @ self.errors[:, :, np.newaxis]).sum(axis=0)[:, 0],
            (weights[:, np.newaxis] * self.feigned).T @ self.feigned,
        )


def residuals(matches, motion, roughness):
    """Errors of all pairs under a motion (x, y, theta), shape (3,)."""
    parts = [
        _of_segments(matches, motion, roughness),
        _of_corners(matches, motion, roughness),
        _of_arcs(matches, motion, roughness),
    ]
    together = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Residuals(*together)


def own_shares(segments, noise):
    """Share of the covariance of segments that comes of the noise of their readings."""
    if noise is None:
        return np.ones(len(segments))
    (x, y), angle, n = segments["centroid"].T, segments["angle"], segments["n_points"]
    square = x**2 + y**2
    near = np.maximum((np.cos(angle) * y - np.sin(angle) * x) ** 2, 1e-6 * square)
    along_beam = noise.sigma**2 + noise.proportional**2 * square + noise.quantum**2 / 12
    along_beam = np.maximum(along_beam, LEAST_SIGMA**2)
    reading = along_beam * near / square + noise.bearing**2 * (square - near)
    scatter = np.maximum(reading, segments["rms"] ** 2)
    return np.minimum(scatter / n * (1 + 4 / n) / segments["covariance"][:, 0, 0], 1.0)


def _of_segments(matches, motion, roughness):
    before, now = matches.tables("segments")
    moved, by_turn = _moved(now["centroid"], motion)
    tangent = np.column_stack((np.cos(before["angle"]), np.sin(before["angle"])))
    normal = tangent[:, ::-1] * (-1.0, 1.0)
    apart = moved - before["centroid"]
    turn = turned(now["angle"] + motion[2] - before["angle"])
    errors = np.column_stack(((apart * normal).sum(axis=1), turn))
    jacobians = np.zeros((len(now), 2, 3))
    jacobians[:, 0, :2], jacobians[:, 0, 2] = normal, (normal * by_turn).sum(axis=1)
    jacobians[:, 1, 2] = 1.0
    # The offset of the earlier line is asked for where the later one has its centroid.
    lever = np.tile(np.eye(2), (len(now), 1, 1))
    lever[:, 0, 1] = (apart * tangent).sum(axis=1)
    # What is not the readings' own is the same in both frames where both saw the same wall.
    ends = (_moved(now[end], motion)[0] - before["start"] for end in ("start", "end"))
    first, last = ((arm * tangent).sum(axis=1) for arm in ends)
    length = segment_lengths(before)
    low, high = np.minimum(first, last), np.maximum(first, last)
    shared = np.minimum(high, length) - np.maximum(low, 0.0)
    union = np.maximum(high, length) - np.minimum(low, 0.0)
    alone = 1.0 - np.clip(shared / union, 0.0, 1.0)
    own, other = own_shares(before, matches.before.noise), own_shares(now, matches.now.noise)
    covariance = lever @ before["covariance"] @ np.swapaxes(lever, 1, 2)
    covariance *= (own + alone * (1.0 - own))[:, np.newaxis, np.newaxis]
    share = (other + alone * (1.0 - other))[:, np.newaxis, np.newaxis]
    covariance += share * now["covariance"]
    lengths = np.minimum(segment_lengths(now), length)
    rough_offset, rough_angle = rough_variances(lengths, roughness)
    covariance[:, 0, 0] += rough_offset
    covariance[:, 1, 1] += rough_angle
    information = np.linalg.inv(covariance)
    slope = np.sqrt(covariance[:, 1, 1] / covariance[:, 0, 0])
    too_short = covariance[:, 1, 1] > _DIRECTED**2
    information[too_short], slope[too_short] = 0.0, 0.0
    along = np.column_stack((tangent, (tangent * by_turn).sum(axis=1)))
    return errors, jacobians, information, slope[:, np.newaxis] * along


def _of_corners(matches, motion, roughness):
    before, now = matches.tables("corners")
    points = _of_points(before["position"], now["position"], motion)
    rotation = _rotation(motion[2])
    covariance = before["covariance"] + rotation @ now["covariance"] @ rotation.T
    covariance += roughness**2 * np.eye(2)
    information = np.linalg.inv(covariance)
    # The corner is where its segments meet: those that are matched have told their part.
    segments = now["segments"]
    told = (segments >= 0) & np.isin(segments, matches.segments[:, 1])
    for k in np.flatnonzero(told.any(axis=1)):
        if told[k].all():
            information[k] = 0.0
            continue
        angle = matches.now.segments["angle"][segments[k][told[k]][0]] + motion[2]
        along = np.array((math.cos(angle), math.sin(angle)))
        information[k] = np.outer(along, along) / (along @ covariance[k] @ along)
    return (*points, information, np.zeros((len(now), 3)))


def _of_arcs(matches, motion, roughness):
    before, now = matches.tables("arcs")
    points = _of_points(before["center"], now["center"], motion)
    rotation = _rotation(motion[2])
    covariance = before["covariance"][:, :2, :2].copy()
    covariance += rotation @ now["covariance"][:, :2, :2] @ rotation.T + roughness**2 * np.eye(2)
    return (*points, np.linalg.inv(covariance), np.zeros((len(now), 3)))


def _of_points(before, now, motion):
    """Errors (m, 2) and jacobians (m, 2, 3) of points."""
    moved, by_turn = _moved(now, motion)
    jacobians = np.zeros((len(now), 2, 3))
    jacobians[:, 0, 0] = jacobians[:, 1, 1] = 1.0
    jacobians[:, :, 2] = by_turn
    return moved - before, jacobians


def _moved(points, motion):
    """Points (m, 2) after the motion, and their derivatives by its turn."""
    turned_points = points @ _rotation(motion[2]).T
    return turned_points + motion[:2], turned_points[:, ::-1] * (-1.0, 1.0)


def _rotation(theta):
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def estimate_motion(matches, prior=(0.0, 0.0, 0.0), covariance=None, *, roughness=0.0):
    """Estimate the motion between two frames by weighted least squares, robustly."""
    spread = np.diag((10.0, 10.0, math.pi)) ** 2 if covariance is None else np.array(covariance)
    prior_information = np.linalg.inv(spread)
    start = state = np.array(prior, dtype=np.float64)
    scale = np.array((1.0, 1.0, _distance(matches)))
    for _ in range(_ROUNDS):
        errors = residuals(matches, state, roughness)
        information, gradient, feigned = errors.normal_equations(_weights(errors.squares))
        unobserved = _unobserved(information, feigned, scale)
        # Nothing is taken from the features in directions that they do not tell.
        kept = np.eye(3) - (unobserved.T @ unobserved) * scale / scale[:, np.newaxis]
        total = kept.T @ information @ kept + prior_information
        off = state - start
        off[2] = turned(off[2])
        step = -np.linalg.solve(total, kept.T @ gradient + prior_information @ off)
        state = state + step
        if np.abs(step).max() < _SMALL:
            break
    x, y, theta = state.tolist()
    theta = math.remainder(theta, 2 * math.pi)
    return Motion(x, y, theta, np.linalg.inv(total), unobserved)


def _weights(squares):
    """Weigh pairs by their squares: 1 within the quantile, then falling; shape (m,)."""
    limit, counted = chi_square(_RIGHT, 2), squares[squares > 0]
    if len(counted):
        # Far from the solution all are far off: what counts is which are more so than others.
        limit *= max(1.0, float(np.median(counted)) / chi_square(0.5, 2))
    return limit / np.maximum(squares, limit)


def _unobserved(information, feigned, scale):
    """Directions (m, 3) of which the information tells nothing, in scaled units."""
    in_metres = 1.0 / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(information * in_metres)
    seeming = np.einsum("ik,ij,jk->k", vectors, feigned * in_metres, vectors)
    return vectors.T[values <= _KNOWN**-2 + _FEIGNED**2 * seeming]


def _distance(matches):
    """Root of the mean squared distance of what was matched, 1 m at least [m]."""
    places = [
        matches.tables(kind)[1][name]
        for kind, name in (("segments", "centroid"), ("corners", "position"), ("arcs", "center"))
    ]
    points = np.concatenate(places)
    return max(1.0, math.sqrt(np.square(points).sum() / max(len(points), 1)))


class NaiveTracker(Tracker):
    """A tracker that looks for pairs three times, and moves all that it has seen."""

    def _follow(self, features, prior, spread):
        motion = Motion(*prior, spread)
        for _ in range(3):
            matches = associate(
                self._seen,
                features,
                motion.pose,
                motion.covariance,
                gate=self.gate,
                roughness=self.roughness,
            )
            motion = estimate_motion(self._fresh(matches), prior, spread, roughness=self.roughness)
        return motion, matches

    def _renew(self, features, matches, motion):
        if motion is not None:
            self._seen = self._seen.transform(*inverse(motion.pose))
        numbers, born, ended = {}, [], []
        tables = {}
        for kind in KINDS:
            table, seen = getattr(features, kind), getattr(self._seen, kind)
            tracks, missed = self._tracks[kind], self._missed[kind] + 1
            pairs = getattr(matches, kind)
            mine = np.full(len(table), -1, np.int64)
            mine[pairs[:, 1]] = tracks[pairs[:, 0]]
            new = np.flatnonzero(mine < 0)
            mine[new] = self._next + np.arange(len(new))
            self._next += len(new)
            missed[pairs[:, 0]] = 0
            kept = (missed > 0) & (missed <= self.max_missed)
            born.append(mine[new])
            ended.append(tracks[missed > self.max_missed])
            numbers[kind], tables[kind] = mine, np.concatenate((table, seen[kept]))
            self._tracks[kind] = np.concatenate((mine, tracks[kept]))
            self._missed[kind] = np.concatenate((np.zeros_like(mine), missed[kept]))
        self._seen = replace(features, **tables)
        return Tracks(
            **numbers, born=np.concatenate(born), ended=np.concatenate(ended), motion=motion
        )
