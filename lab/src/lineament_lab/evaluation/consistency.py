"""Errors in units of a covariance: that of the bound, or the one that came with the feature."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lineament.scan import Array

from .counts import Summable, quantile, ratio

#: A covariance whose eigenvalues have a smaller ratio than this has lost all its digits.
_LEAST_EIGENVALUE = 1e-14
#: Deviations of the bound within which a feature is right.
_DEVIATIONS = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class NormalisedErrors(Summable):
    """Errors e of k components, as L⁻¹ e with the covariance Σ = L Lᵀ.

    If Σ is that of the errors, the squares e'Σ⁻¹e are chi-square distributed. With the covariance
    that a method gives they are its normalised estimation error squared (NEES; Bar-Shalom, Li,
    Kirubarajan 2001, section 5.4): above `interval`, `mean_ratio` says that it is too sure of
    itself. With the Cramér-Rao bound they are multiples of the least possible.

    Examples
    --------
    >>> errors = np.array([[0.02, 0.0], [0.0, 0.03]])
    >>> normalised = NormalisedErrors.of(errors, np.tile(np.diag([1e-4, 1e-4]), (2, 1, 1)))
    >>> normalised.squares.round(6).tolist(), round(normalised.mean_ratio, 6)
    ([4.0, 9.0], 3.25)
    """

    #: L⁻¹ e of each error, shape (m, k).
    whitened: Array
    #: Errors left out, as their covariance is not finite or not positive definite.
    unusable: int = 0

    @classmethod
    def none(cls, components: int) -> Self:
        """Return those of no scan."""
        return cls(np.empty((0, components)))

    @classmethod
    def of(cls, errors: Array, covariances: Array) -> Self:
        """Normalise errors (m, k) by their covariances (m, k, k), in the same units."""
        kept = usable_covariances(covariances) & np.isfinite(errors).all(axis=1)
        factors = np.linalg.cholesky(covariances[kept])
        whitened = np.linalg.solve(factors, errors[kept, :, np.newaxis])[:, :, 0]
        return cls(whitened, len(errors) - len(whitened))

    @property
    def squares(self) -> Array:
        """e'Σ⁻¹e of each error, shape (m,)."""
        return np.asarray(np.square(self.whitened).sum(axis=1))

    @property
    def mean_ratio(self) -> float:
        """Mean of the squares over k: 1 if the covariance is right; NaN of nothing."""
        return ratio(float(np.square(self.whitened).sum()), self.whitened.size)

    @property
    def median_ratio(self) -> float:
        """Median of the squares over that of chi-square; a few gross errors do not move it."""
        return quantile(self.squares, 0.5) / _chi_square(0.5, self.whitened.shape[1])

    def share_within(self, probability: float) -> float:
        """Share of the errors within the ellipse that should hold this share of them."""
        limit = _chi_square(probability, self.whitened.shape[1])
        return ratio(int((self.squares <= limit).sum()), len(self.whitened))

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of `mean_ratio` with 95 % probability if the covariance is right."""
        size = self.whitened.size
        if not size:
            return math.nan, math.nan
        return _chi_square(0.025, size) / size, _chi_square(0.975, size) / size

    def bound_summary(self, prefix: str = "") -> dict[str, float]:
        """List the figures of errors over the bound: RMSE ÷ bound, and the same by the median."""
        return {
            f"{prefix}over_bound": math.sqrt(self.mean_ratio),
            f"{prefix}over_bound_median": math.sqrt(self.median_ratio),
        }

    def nees_summary(self) -> dict[str, float]:
        """List the figures of errors over the covariance that a method gives."""
        low, high = self.interval
        return {
            "nees": self.mean_ratio,
            "nees_low": low,
            "nees_high": high,
            "nees_median": self.median_ratio,
            "nees_unusable": self.unusable,
        }


def usable_covariances(covariances: Array) -> NDArray[np.bool_]:
    """Whether each covariance (m, k, k) is finite and positive definite, shape (m,)."""
    usable: NDArray[np.bool_] = np.asarray(np.isfinite(covariances).all(axis=(1, 2)))
    eigenvalues = np.linalg.eigvalsh(covariances[usable])
    usable[usable] = eigenvalues[:, 0] > _LEAST_EIGENVALUE * eigenvalues[:, -1]
    return usable


def largest_variance(covariances: Array) -> Array:
    """Largest eigenvalue of each covariance (m, k, k); 0 of one that is not usable."""
    usable = usable_covariances(covariances)
    largest = np.zeros(len(covariances))
    largest[usable] = np.linalg.eigvalsh(covariances[usable])[:, -1]
    return largest


def tolerance(variance: Array) -> Array:
    """Three deviations: how far off the best possible estimate may be; 0 if it is not known."""
    return np.asarray(_DEVIATIONS * np.sqrt(np.nan_to_num(variance)))


def _chi_square(probability: float, degrees: int) -> float:
    """Quantile of the chi-square distribution, that of a gamma distribution of half as many."""
    from scipy.special import gammaincinv

    return 2.0 * float(gammaincinv(degrees / 2, probability))
