"""What no method could find: arcs that look straight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..evaluation.beams import MIN_BEAMS
from ..features import Features
from ..scan import Array, RangeNoise
from ..simulation import Sensor

__all__ = ["curved_arcs", "line_misfit"]


def curved_arcs(truth: Features, sensor: Sensor, evidence: float) -> NDArray[np.bool_]:
    """Whether each demanded arc differs from all lines by at least so much of χ², shape (m,)."""
    arcs = truth.arcs[truth.arcs["n_points"] >= MIN_BEAMS]
    return np.array(
        [line_misfit(sensor.angles, arc, sensor.noise) >= evidence for arc in arcs], dtype=np.bool_
    )


def line_misfit(angles: Array, arc: np.void, noise: RangeNoise) -> float:
    """Return χ² of the best line through the measurements of an arc without noise.

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
