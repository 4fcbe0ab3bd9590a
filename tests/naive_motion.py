"""Slow, obvious twin of the motion between two frames, with numpy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from naive_association import chi_square, rough_variances, segment_lengths, turned

from lineament.motion import Motion

_KNOWN, _FEIGNED, _RIGHT, _DIRECTED = 0.1, 3.0, 0.99, 0.1
_ROUNDS, _SMALL = 20, 1e-7


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
    # The misfit is the same in both frames where both saw the same wall.
    ends = (_moved(now[end], motion)[0] - before["start"] for end in ("start", "end"))
    first, last = ((arm * tangent).sum(axis=1) for arm in ends)
    length = segment_lengths(before)
    low, high = np.minimum(first, last), np.maximum(first, last)
    shared = np.minimum(high, length) - np.maximum(low, 0.0)
    union = np.maximum(high, length) - np.minimum(low, 0.0)
    alone = 1.0 - np.clip(shared / union, 0.0, 1.0)
    covariance = lever @ before["covariance"] @ np.swapaxes(lever, 1, 2) + now["covariance"]
    lengths = np.minimum(segment_lengths(now), length)
    rough_offset, rough_angle = rough_variances(lengths, roughness)
    bow = alone * (before["misfit"] ** 2 + now["misfit"] ** 2)
    covariance[:, 0, 0] += rough_offset + bow
    covariance[:, 1, 1] += rough_angle + 12 * bow / lengths**2
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
