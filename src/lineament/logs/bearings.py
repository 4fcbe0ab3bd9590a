"""Bearings as text logs have them: rounded, left out, in degrees, or in any order."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Range from which a SICK scanner saw nothing, where the log does not say otherwise [m].
SICK_RANGE_MAX = 50.0

# Logs print angles with 6 decimals; scanners step by simple fractions of a degree.
_ANGLES_PER_DEGREE = 12
_ROUNDING = 6e-7
#: Beyond this there are no bearings, but what a file may hold all the same [rad].
_FARTHEST = 1e6
#: Bearings [rad] that go farther than a turn, and some rounding, are degrees.
_RADIANS = 2 * math.pi + 0.1


def snap(angle: float) -> float:
    """Return the multiple of 1/12° that was rounded to `angle` [rad], or `angle` itself."""
    if not abs(angle) < _FARTHEST:
        return angle
    exact = math.radians(round(math.degrees(angle) * _ANGLES_PER_DEGREE) / _ANGLES_PER_DEGREE)
    return exact if abs(exact - angle) <= _ROUNDING else angle


def sick_step(n: int) -> float:
    """Return the step [rad] between `n` beams of a scanner that sees 180°."""
    # Scanners of 1° and 0.5° may leave out the last beam.
    steps = n if n in (180, 360) else max(n - 1, 1)
    return math.pi / steps


@np.errstate(over="ignore", invalid="ignore")  # Absurd bearings: `LaserScan` refuses them.
def bearing_fields(angles: NDArray[np.float64]) -> dict[str, Any]:
    """Return the fields of `LaserScan` for bearings [rad] that a text lists, with 6 decimals.

    They are ``angle_min`` and ``angle_increment`` where the steps are even but for the rounding,
    else ``angles``.
    """
    n = len(angles)
    if n > 1 and np.isfinite(angles[[0, -1]]).all():
        first, step = float(angles[0]), float(angles[-1] - angles[0]) / (n - 1)
        for start, increment in ((snap(first), snap(step)), (first, step)):
            off = np.abs(start + increment * np.arange(n) - angles)
            if increment > 0 and off.max() <= 2 * _ROUNDING:
                return {"angle_min": start, "angle_increment": increment}
    return {"angles": angles}


def by_bearing(
    angles: NDArray[np.float64], *, degrees: bool | None = None
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the order of beams by bearing, and their bearings [rad], which increase.

    Of several with one bearing, the first is kept. Bearings are degrees where asked for or, if
    that is None, where one is beyond ±2π; ValueError if one is not finite.
    """
    bad = np.flatnonzero(~np.isfinite(angles))
    if len(bad):
        raise ValueError(f"bearing {bad[0] + 1} is {angles[bad[0]]}, expected a finite one")
    if degrees or (degrees is None and np.abs(angles).max(initial=0.0) > _RADIANS):
        angles = np.radians(angles)
    increasing, order = np.unique(angles, return_index=True)
    return order, increasing
