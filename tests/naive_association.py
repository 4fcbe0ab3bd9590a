"""Slow, obvious twin of the association of two frames, with numpy and scipy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.special import gammaincinv

from lineament.motion import Matches

_PATCH, _OVERLAP = 0.3, 0.5


def associate(before, now, motion=(0.0, 0.0, 0.0), covariance=None, *, gate=0.99, roughness=0.0):
    """Find the features that two frames share."""
    moved = now.transform(*motion)
    about = _Uncertainty(np.array(motion[:2]), covariance, roughness)
    return Matches(
        before,
        now,
        _paired(*_segment_costs(before.segments, moved.segments, about), chi_square(gate, 2)),
        _paired(*_corner_costs(before.corners, moved, about), chi_square(gate, 2)),
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
    bow = before["misfit"][:, np.newaxis] ** 2 + now["misfit"] ** 2
    spread[..., 0, 0] += bow
    spread[..., 1, 1] += 12 * bow / lengths**2
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


def _corner_costs(before, frame, about):
    now = frame.corners
    squares = np.append(frame.segments["misfit"] ** 2, 0.0)
    bows = 2 * squares[now["segments"]].sum(axis=1)
    apart = now["position"] - before["position"][:, np.newaxis]
    spread = before["covariance"][:, np.newaxis] + now["covariance"]
    spread = spread + about.of_points(now["position"]) + bows[:, np.newaxis, np.newaxis] * np.eye(2)
    same = before["convex"][:, np.newaxis] == now["convex"]
    same &= (before["kind"] != "edge")[:, np.newaxis] & (now["kind"] != "edge")
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
