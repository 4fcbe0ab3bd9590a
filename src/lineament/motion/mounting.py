"""Twists of a scanner and of odometry: what leads from one to the other, fitted with its noise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scan import Array
from ..scan.poses import Twist, twist_between
from .association import chi_square
from .estimate import Motion
from .odometry import covariance_of_twist

#: Before anything is seen, values are known to this: mounting [m, m, rad]; what odometry counts of
#: a way and of a turn, as shares; what it turns for each metre [rad/m].
BEFORE = np.array((1.0, 1.0, math.pi, 0.15, 0.15, 0.15))
#: Least root of the sum of squares of turns and ways that say something [rad, m].
_TURNS, _WAYS = 0.3, 0.5
#: Half of a track, where it is not known: wheels roll while a robot turns on the spot [m].
_HALF = 0.2
#: No value changes by more in a round: on a circle, nothing holds them.
_STEP = 0.2
#: Most rounds, with the weights of Student's t of so many degrees, then without slips; changes, in
#: deviations or of their variances, and shares of the noise, that are small.
_ROUNDS, _DEGREES, _SMALL = 60, 3.0, 0.01
#: A step beyond this quantile of χ² is a slip, or its scans were matched wrongly; at most so many.
_SLIP, _MOST_SLIPS = 0.999, 0.5
#: The drive is cut into so many pieces, of so many steps at least; they disagree where their
#: scatter is beyond what χ² has by chance, at so many deviations of a normal variable.
_PIECES, _FEWEST_STEPS, _DISAGREES = 12, 10, 3.0
#: Why odometry and scans may not go together.
HINT = "is it another robot's, of other times, or in other units?"


@dataclass(slots=True, eq=False)
class Model:
    """Twists of the scanner (n, 3) with their covariances, those of odometry, and what leads there.

    `walks` (3, n, 3, 3) is the covariance of the latter for noise forward, to the left and of the
    turn that is 1 in a metre.
    The last three of `values` are what odometry counts: α of a way, γ of a turn, δ of a turn for
    each metre.
    """

    sensor: Array
    spread: Array
    wheels: Array
    walks: Array
    track: float
    values: Array = field(default_factory=lambda: np.array((0.0, 0.0, 0.0, 1.0, 1.0, 0.0)))

    @property
    def shows(self) -> NDArray[np.bool_]:
        """Whether the drive shows each value at all."""
        rate = self.sensor[:, 2]
        turns = np.linalg.norm(rate) > max(_TURNS, 3 * math.sqrt(self.spread[:, 2, 2].sum()))
        goes = np.linalg.norm(self.wheels[:, 0]) > _WAYS
        return np.array((turns, turns, goes, goes, turns, goes), bool)

    @property
    def _half(self) -> float:
        return self.track / 2 or _HALF

    def predicted(self) -> tuple[Array, Array, Array]:
        """Predict the odometry (n, 3), with its slopes by the values and by the sensor's twists."""
        x, y, theta, way, turn, drift = self.values
        c, s = math.cos(theta), math.sin(theta)
        # With one wheel larger, to turn on the spot counts as a way.
        lever = self.track**2 / 4 * turn / way
        counted = np.array([[way, 0, drift * lever], [0, way * turn, 0], [drift, 0, turn]])
        carried = np.array([[c, -s, y], [s, c, -x], [0, 0, 1.0]])
        body, rate, none = self.sensor @ carried.T, self.sensor[:, 2], np.zeros(len(self.sensor))
        forward, left = body[:, 0], body[:, 1]
        slid = self.sensor[:, :2] @ np.array([[-s, c], [-c, -s]])
        by_body = np.stack(
            (
                np.column_stack((none, -rate, none)),
                np.column_stack((rate, none, none)),
                np.column_stack((slid, none)),
            ),
            axis=2,
        )
        by_counts = np.stack(
            (
                np.column_stack((forward - drift * lever / way * rate, turn * left, none)),
                np.column_stack((drift * lever / turn * rate, way * left, rate)),
                np.column_stack((lever * rate, none, forward)),
            ),
            axis=2,
        )
        return (
            body @ counted.T,
            np.concatenate((counted @ by_body, by_counts), 2),
            counted @ carried,
        )

    def parts(self, predicted: Array, by_sensor: Array) -> Array:
        """Return the covariance that each part of the noise gives per unit, shape (4, n, 3, 3).

        By the predicted motions: by those of the odometry, what is too small would weigh more.
        """
        reach = np.array((1.0, 0.0, self._half))
        sizes = [np.linalg.norm(motion * reach, axis=1) for motion in (predicted, self.wheels)]
        parts = np.empty((4, *self.spread.shape))
        parts[0] = by_sensor @ self.spread @ by_sensor.T
        parts[1:] = self.walks * np.clip(sizes[0] / (sizes[1] + 1e-6), 0.5, 2)[:, None, None]
        return parts

    @classmethod
    def of(cls, odometry: Sequence[ArrayLike], motions: Sequence[Motion], track: float) -> Self:
        """Take in steps as `calibrate` does; ValueError if one has no poses."""
        ways = [np.asarray(way, dtype=np.float64) for way in odometry]
        for way in ways:
            if way.ndim != 2 or way.shape[1] != 3 or len(way) < 2 or not np.isfinite(way).all():
                raise ValueError(
                    f"odometry has a step of {way.tolist()}, expected poses (k ≥ 2, 3)"
                )
        return cls(
            np.array([motion.twist(1.0) for motion in motions]),
            np.array([covariance_of_twist(motion, 1.0) for motion in motions]),
            np.array([_twist(way[0], way[-1]) for way in ways]),
            np.stack([_walk(way, track / 2 or _HALF) for way in ways], axis=1),
            track,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """How the values were fitted: their covariance, and what `Calibration` has of the steps.

    `noise` are variances: of the scans as a factor, of odometry forward, to the left, of its turn.
    """

    covariance: Array
    residuals: Array
    deviates: Array
    is_slip: NDArray[np.bool_]
    noise: Array


def _twist(pose: Array, other: Array) -> Twist:
    (x, y, theta), (other_x, other_y, other_theta) = pose.tolist(), other.tolist()
    return twist_between((x, y, theta), (other_x, other_y, other_theta), 1.0)


def _walk(way: Array, half: float) -> Array:
    """Covariances (3, 3, 3) of the twist of a step, for noise of 1 in a metre of each part.

    Noise of a turn leads aside by the way that follows, less that before: half of either, as a
    twist over the whole step has the other half. Noise of a way does by the turn before.
    """
    steps = np.array([_twist(pose, other) for pose, other in pairwise(way)])
    forward, _, turn = steps.T
    length = np.maximum(np.abs(forward), half * np.abs(turn)) + 0.01 / len(steps)
    aside = np.zeros((3, len(steps), 3))
    aside[[0, 1, 2], :, [0, 1, 2]] = 1.0
    aside[0, :, 1] = np.cumsum(turn) - turn / 2 - turn.sum() / 2
    aside[2, :, 1] = forward.sum() / 2 - np.cumsum(forward) + forward / 2
    walk: Array = np.einsum("k,pki,pkj->pij", length, aside, aside)
    # Within a part, evenly: a bridge.
    walk[0, 1, 1] += length @ turn**2 / 12
    walk[2, 1, 1] += length @ forward**2 / 12
    return walk


def heading_of(model: Model) -> float:
    """Guess the heading of the mounting: from most ways of the scanner to those of the robot."""
    (a, b), (c, d) = model.sensor[:, :2].T, model.wheels[:, :2].T
    # A turn moves a scanner that is not over the axle: ways that turn count less.
    weight = 1.0 / (0.1 + np.abs(model.wheels[:, 2]))
    return math.atan2(float(weight @ (a * d - b * c)), float(weight @ (a * c + b * d)))


def fitted(model: Model, count: int) -> Fit:
    """Fit the values, and variances of the noise; first by weights that slips have little of.

    Of `count` values, those that the drive does not show at all stay as they are.
    """
    free = np.flatnonzero(model.shows[:count])
    gate, before = chi_square(_SLIP, 3), 1.0 / BEFORE[free] ** 2
    noise, start = np.array((1.0, 1e-4, 1e-4, 1e-3)), model.values[free]
    for robust in (True, False):
        for _ in range(_ROUNDS):
            predicted, slopes, by_sensor = model.predicted()
            residuals, slopes = model.wheels - predicted, slopes[:, :, free]
            parts = model.parts(predicted, by_sensor)
            covariances = np.einsum("p,pnij->nij", noise, parts)
            weights = np.linalg.inv(covariances)
            scaled = np.einsum("nij,nj->ni", weights, residuals)
            square = np.einsum("ni,ni->n", scaled, residuals)
            is_slip = (square > gate) & (not robust)
            if is_slip.mean() > _MOST_SLIPS:
                raise ValueError(f"odometry does not go with the motions of the scans: {HINT}")
            share = (_DEGREES + 3) / (_DEGREES + square) if robust else np.where(is_slip, 0.0, 1.0)
            # Each part of the noise by what is left: by minorisation, never below 0.
            left = np.einsum("n,ni,pnij,nj->p", share, scaled, parts, scaled)
            due = np.einsum("nij,pnji,n->p", weights, parts, ~is_slip)
            seen = 3 * int((~is_slip).sum())
            ratio = np.sqrt(left / due * seen / max(seen - len(free), 1))
            matters = noise * due > _SMALL * (noise @ due)
            noise = noise * ratio + 1e-12
            weighted = np.einsum("n,nai,nab->nib", share, slopes, weights)
            information = np.einsum("nib,nbj->ij", weighted, slopes) + np.diag(before)
            gradient = np.einsum("nib,nb->i", weighted, residuals)
            gradient -= before * (model.values[free] - start)
            step = np.linalg.solve(information, gradient)
            model.values[free] += step * min(1.0, _STEP / max(abs(step).max(initial=0.0), 1e-9))
            model.values[3:5] = np.clip(model.values[3:5], 1e-3, 1e3)
            if step @ information @ step < _SMALL**2 and (abs(ratio[matters] - 1) < _SMALL).all():
                break
    deviates = np.sqrt(np.einsum("nii->ni", covariances))
    covariance: Array = np.diag(BEFORE[:count] ** 2)
    pulls = np.linalg.solve(information, np.einsum("nib,nb->in", weighted, residuals))
    covariance[np.ix_(free, free)] = _widened(np.linalg.inv(information), pulls)
    return Fit(covariance, residuals, deviates, is_slip, noise)


def _widened(covariance: Array, pulls: Array) -> Array:
    """Widen a covariance where pieces of the drive disagree by more than it says.

    `pulls` (k, n) are those of each step on each value. Of steps that are independent, the sums
    over pieces scatter by the covariance; an error that lasts longer than a step, as where a robot
    slides to one side for a while, makes them scatter more.
    """
    pieces = min(_PIECES, pulls.shape[1] // _FEWEST_STEPS)
    if pieces < 2:
        return covariance
    starts, degrees = np.arange(pieces) * pulls.shape[1] // pieces, pieces - 1
    excess = (np.add.reduceat(pulls, starts, axis=1) ** 2).sum(axis=1) / np.diag(covariance)
    excess *= pieces / degrees
    spread = 2 / (9 * degrees)  # Wilson and Hilferty: the cube root of χ² is about normal.
    limit = (1 - spread + _DISAGREES * math.sqrt(spread)) ** 3
    factors = np.sqrt(np.where(excess > limit, excess, 1.0))
    return np.asarray(covariance * np.outer(factors, factors))
