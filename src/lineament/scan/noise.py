"""Noise of ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import TypeVar

from .fields import Array, number

Distance = TypeVar("Distance", float, Array)

#: What no scanner reaches, and the unit that a larger number is likely in. The worst ranges are off
#: by centimetres or a few percent, and a beam is that wide.
_BEYOND = {
    "sigma": (1.0, "in metres: is it in millimetres? (0.001 of it)"),
    "proportional": (1.0, "metres a metre: is it in percent? (0.01 of it)"),
    "bearing": (0.2, "in radians: is it in degrees? (math.radians)"),
    "quantum": (1.0, "in metres: is it in millimetres? (0.001 of it)"),
}


@dataclass(frozen=True, slots=True)
class RangeNoise:
    """Noise of one range, as standard deviations.

    The variance of a range ρ is ``sigma² + (proportional ρ)² + quantum²/12``; the bearing of
    each beam is off by ``bearing``. A part that is negative or not finite is a ValueError.

    Parameters
    ----------
    sigma, proportional : float
        Constant part [m], and the part that grows with the range [m/m].
    bearing : float
        Noise of the bearing [rad].
    quantum : float
        Step of the lattice on which ranges are reported [m].
    uncertainty : float
        Standard deviation of sigma, over sigma, where it was estimated: 0.03 for a scan of 1,081
        beams, 0.05 for one of 361, 1 where nothing is known. The variance is a mean over what it
        may be, so that covariances include this; nothing else depends on it.

    Examples
    --------
    >>> RangeNoise(sigma=0.03, proportional=0.01).range_variance(4.0)
    0.0025
    """

    sigma: float = 0.0
    proportional: float = 0.0
    bearing: float = 0.0
    quantum: float = 0.0
    uncertainty: float = 0.0

    def __post_init__(self) -> None:
        for name in ("sigma", "proportional", "bearing", "quantum", "uncertainty"):
            value = getattr(self, name)
            if type(value) is float and 0 <= value < math.inf:
                continue
            value = number(f"RangeNoise.{name}", value)
            if not 0 <= value < math.inf:
                raise ValueError(f"RangeNoise.{name} is {value}, expected a finite number ≥ 0")
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, noise: NoiseLike) -> RangeNoise:
        """Return the noise of a scanner as it is; a number is its sigma [m].

        Raises
        ------
        TypeError
            If it is neither.
        ValueError
            If no scanner is so bad: `sigma` or `quantum` of 1 m and more, `proportional` of 1,
            `bearing` of 0.2 rad.

        Examples
        --------
        >>> RangeNoise.of(0.01) == RangeNoise(sigma=0.01)
        True
        """
        if not isinstance(noise, RangeNoise):
            if not isinstance(noise, Real) or isinstance(noise, bool):
                raise TypeError(
                    f"noise is {noise!r:.60}, expected a RangeNoise, or its sigma in metres"
                )
            noise = cls(sigma=float(noise))
        for name, (least, unit) in _BEYOND.items():
            value = getattr(noise, name)
            if value >= least:
                raise ValueError(
                    f"noise has {name} = {value:g}, expected less than {least:g} {unit}"
                )
        return noise

    def range_variance(self, distance: Distance) -> Distance:
        """Variance [m²] of a range of `distance` [m], or of each of an array of them."""
        # Products: a power of numbers that are too large raises an error.
        slope = self.proportional * distance
        return self.sigma * self.sigma + slope * slope + self.quantum * self.quantum / 12


#: A noise, or its sigma [m].
NoiseLike = RangeNoise | float
