"""Points that are seen again and again, as running means."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .markers import FARTHEST

__all__ = ["Averages"]

Array = NDArray[np.float64]

#: So many points are kept; the least seen are forgotten first.
MOST = 20_000


class Averages:
    """Means of the points that lie near each other.

    A point joins the nearest mean within a radius, or is a mean of its own.

    Parameters
    ----------
    dimensions : int
        Coordinates of a point.
    radius : float
        The distance [m].

    Examples
    --------
    >>> means = Averages(2, radius=0.1)
    >>> means.add(np.array([[0.0, 0.0], [1.0, 0.0]]))
    >>> means.add(np.array([[0.0, 0.05]]))
    >>> means.seen(2).tolist()
    [[0.0, 0.025]]
    """

    def __init__(self, dimensions: int, radius: float) -> None:
        self.radius = radius
        self._means = np.zeros((0, dimensions))
        self._views = np.zeros(0, dtype=np.int64)

    def add(self, points: Array) -> None:
        """Add the points (n, dimensions) of one scan; those that cannot be drawn are left out."""
        for point in points[(np.abs(points) < FARTHEST).all(axis=1)]:
            distance = np.linalg.norm(self._means - point, axis=1)
            if len(distance) and distance.min() <= self.radius:
                k = int(distance.argmin())
                self._views[k] += 1
                self._means[k] += (point - self._means[k]) / self._views[k]
            else:
                self._means = np.vstack((self._means, point))
                self._views = np.append(self._views, 1)
        if len(self._means) > MOST:
            kept = np.sort(np.argsort(-self._views, kind="stable")[: MOST // 2])
            self._means, self._views = self._means[kept], self._views[kept]

    def seen(self, min_views: int) -> Array:
        """Give the means of at least so many points, shape (m, dimensions)."""
        return self._means[self._views >= min_views]
