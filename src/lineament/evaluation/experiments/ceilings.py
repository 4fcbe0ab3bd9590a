"""What no method can pass: how many features the noise leaves to be told at all."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...features import Features
from ...scan import Array, RangeNoise
from ...simulation import Sensor
from ..beams import MIN_BEAMS
from ..corners import demanded_corners
from ..segments import ANGLE, DISTANCE

__all__ = ["curved_arcs", "line_misfit", "lines_within_gates", "within_gate"]

#: Directions over which a probability is averaged.
_DIRECTIONS = 64


def within_gate(truth: Features, gate: float) -> Array:
    """Probability that the best estimate there is finds each demanded corner within a distance.

    Its error is e ~ N(0, Σ) with the bound Σ. With the eigenvalues λ of Σ and u(θ)² =
    λ₁ cos² θ + λ₂ sin² θ, P(|e| ≤ gate) is the mean over θ of 1 - exp(-gate²/2u²). A corner whose
    place is not known to 0.1 m is at once missed and false: the mean over all demanded corners is
    the largest F1 that is to be expected.

    Parameters
    ----------
    truth : Features
        Of one scan.
    gate : float
        Distance [m].

    Returns
    -------
    ndarray, shape (m,)

    Examples
    --------
    With 3 cm in each direction, 0.4 % are farther off than 0.1 m:

    >>> from lineament.simulation import SENSORS, room, truth
    >>> features = truth(room(), (0.0, 0.0, 0.0), SENSORS["paper"])
    >>> features.corners.flags.writeable = True
    >>> features.corners["covariance"] = 0.03**2 * np.eye(2)
    >>> within_gate(features, 0.1).round(3).tolist()
    [0.996, 0.996]
    """
    covariance = truth.corners["covariance"][demanded_corners(truth)]
    eigenvalues = np.linalg.eigvalsh(covariance)[:, np.newaxis]
    theta = (np.arange(_DIRECTIONS) + 0.5) * (math.pi / _DIRECTIONS)
    square = eigenvalues[..., 0] * np.cos(theta) ** 2 + eigenvalues[..., 1] * np.sin(theta) ** 2
    return np.asarray(-np.expm1(-0.5 * gate**2 / square).mean(axis=1))


def lines_within_gates(truth: Features) -> Array:
    """Probability that the best estimate there is of each demanded segment counts as right.

    Its offset at the centroid and its angle have independent errors with the variances of the
    bound, and count within `segments.DISTANCE` and `segments.ANGLE`, so that the probability is
    erf(DISTANCE/√2σ_d) erf(ANGLE/√2σ_α). A short wall of vague direction is at once missed and
    false: the mean is the largest F1 that is to be expected, even if all beams were known.

    Parameters
    ----------
    truth : Features
        Of one scan.

    Returns
    -------
    ndarray, shape (m,)

    Examples
    --------
    With 5° of deviation, 4.6 % are more than 10° off:

    >>> from lineament.simulation import SENSORS, room, truth
    >>> features = truth(room(), (0.0, 0.0, 0.0), SENSORS["paper"])
    >>> features.segments.flags.writeable = True
    >>> features.segments["covariance"] = np.diag([0.01, np.radians(5.0)]) ** 2
    >>> lines_within_gates(features)[:2].round(3).tolist()
    [0.954, 0.954]
    """
    from scipy.special import erf  # SciPy takes long to import.

    demanded = truth.segments["n_points"] >= MIN_BEAMS
    variances = np.diagonal(truth.segments["covariance"][demanded], axis1=1, axis2=2)
    return np.asarray(erf(np.array([DISTANCE, ANGLE]) / np.sqrt(2.0 * variances)).prod(axis=1))


def curved_arcs(truth: Features, sensor: Sensor, evidence: float) -> NDArray[np.bool_]:
    """Tell which demanded arcs are no lines by at least so much of χ², shape (m,)."""
    arcs = truth.arcs[truth.arcs["n_points"] >= MIN_BEAMS]
    return np.array(
        [line_misfit(sensor.angles, arc, sensor.noise) >= evidence for arc in arcs], dtype=np.bool_
    )


def line_misfit(angles: Array, arc: np.void, noise: RangeNoise) -> float:
    """Measure χ² of the best line through the readings of an arc without noise.

    Where it is small, no method can tell the arc from a wall. A line is 1/ρ = A cos φ + B sin φ,
    and the error of 1/ρ times ρ² is that of the range.

    Parameters
    ----------
    angles : ndarray, shape (n,)
        Bearings of all beams [rad].
    arc : record of `lineament.features.ARC`
        With its outside to the sensor.
    noise : RangeNoise

    Examples
    --------
    >>> from lineament.features import ARC
    >>> arc = np.zeros(1, ARC)[0]
    >>> arc["center"], arc["radius"], arc["first_beam"], arc["n_points"] = (2.0, 0.0), 0.2, 0, 9
    >>> round(line_misfit(np.linspace(-0.08, 0.08, 9), arc, RangeNoise(sigma=0.01)))
    57
    """
    beams = (arc["first_beam"] + np.arange(arc["n_points"])) % len(angles)
    design = np.column_stack((np.cos(angles[beams]), np.sin(angles[beams])))
    along = design @ arc["center"]
    off_center = float(arc["center"] @ arc["center"]) - along**2
    ranges = along - np.sqrt(np.maximum(arc["radius"] ** 2 - off_center, 0.0))
    weight = ranges**2 / np.sqrt(noise.range_variance(ranges))
    left = weight[:, np.newaxis] * design
    right = weight / ranges
    line = np.linalg.lstsq(left, right)[0]
    return float(np.square(left @ line - right).sum())
