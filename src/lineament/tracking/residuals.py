"""How far matched features are from each other under a motion, by kind, with its derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..scan import Array
from .association import Matches, rough_variances, segment_lengths, turned

__all__ = ["Residuals", "residuals"]

#: Segments whose direction is known worse than this are too short to tell a motion [rad].
_DIRECTED = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Errors of m pairs of features, two components each.

    Attributes
    ----------
    errors : ndarray, shape (m, 2)
        Of segments the offset [m] and the angle [rad], of corners and arcs x and y [m].
    jacobians : ndarray, shape (m, 2, 3)
        Their derivatives by (x, y, theta) of the motion.
    information : ndarray, shape (m, 2, 2)
        Inverse covariances of the errors; singular where only a part of them counts.
    feigned : ndarray, shape (m, 3)
        How many deviations of its offset a segment seems to change by, with each part of the
        motion, because its direction is off by one deviation; 0 of corners and arcs.
    """

    errors: Array
    jacobians: Array
    information: Array
    feigned: Array

    @property
    def squares(self) -> Array:
        """e'Σ⁻¹e of each pair, shape (m,)."""
        return np.asarray(np.einsum("ki,kij,kj->k", self.errors, self.information, self.errors))

    def normal_equations(self, weights: Array) -> tuple[Array, Array, Array]:
        """Information (3, 3), gradient (3,), and information that is feigned (3, 3)."""
        weighted = weights[:, np.newaxis, np.newaxis] * self.information
        weighted = np.swapaxes(self.jacobians, 1, 2) @ weighted
        return (
            (weighted @ self.jacobians).sum(axis=0),
            (weighted @ self.errors[:, :, np.newaxis]).sum(axis=0)[:, 0],
            (weights[:, np.newaxis] * self.feigned).T @ self.feigned,
        )


def residuals(matches: Matches, motion: Array, roughness: float) -> Residuals:
    """Errors of all pairs under a motion (x, y, theta), shape (3,)."""
    parts = [
        _of_segments(matches, motion, roughness),
        _of_corners(matches, motion, roughness),
        _of_arcs(matches, motion, roughness),
    ]
    together = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Residuals(*together)


#: The fields of `Residuals`.
_Parts = tuple[Array, Array, Array, Array]


def _of_segments(matches: Matches, motion: Array, roughness: float) -> _Parts:
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
    covariance = now["covariance"] + lever @ before["covariance"] @ np.swapaxes(lever, 1, 2)
    lengths = np.minimum(segment_lengths(now), segment_lengths(before))
    rough_offset, rough_angle = rough_variances(lengths, roughness)
    covariance[:, 0, 0] += rough_offset
    covariance[:, 1, 1] += rough_angle
    information = np.linalg.inv(covariance)
    slope = np.sqrt(covariance[:, 1, 1] / covariance[:, 0, 0])
    too_short = covariance[:, 1, 1] > _DIRECTED**2
    information[too_short], slope[too_short] = 0.0, 0.0
    along = np.column_stack((tangent, (tangent * by_turn).sum(axis=1)))
    return errors, jacobians, information, slope[:, np.newaxis] * along


def _of_corners(matches: Matches, motion: Array, roughness: float) -> _Parts:
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


def _of_arcs(matches: Matches, motion: Array, roughness: float) -> _Parts:
    before, now = matches.tables("arcs")
    points = _of_points(before["center"], now["center"], motion)
    rotation = _rotation(motion[2])
    covariance = before["covariance"][:, :2, :2].copy()
    covariance += rotation @ now["covariance"][:, :2, :2] @ rotation.T + roughness**2 * np.eye(2)
    return (*points, np.linalg.inv(covariance), np.zeros((len(now), 3)))


def _of_points(before: Array, now: Array, motion: Array) -> tuple[Array, Array]:
    """Errors (m, 2) and jacobians (m, 2, 3) of points."""
    moved, by_turn = _moved(now, motion)
    jacobians = np.zeros((len(now), 2, 3))
    jacobians[:, 0, 0] = jacobians[:, 1, 1] = 1.0
    jacobians[:, :, 2] = by_turn
    return moved - before, jacobians


def _moved(points: Array, motion: Array) -> tuple[Array, Array]:
    """Points (m, 2) after the motion, and their derivatives by its turn."""
    turned_points = points @ _rotation(motion[2]).T
    return turned_points + motion[:2], turned_points[:, ::-1] * (-1.0, 1.0)


def _rotation(theta: float) -> Array:
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])
