"""FLIRT: keypoints where a scan differs from itself smoothed, at several scales.

G. D. Tipaldi, K. O. Arras, *FLIRT – interest regions for 2D range data*, ICRA 2010: the curvature
detector, by the integral invariants of R. Unnikrishnan and M. Hebert, *Multi-scale interest regions
from unorganized point clouds*, CVPR workshop 2008.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lineament.methods.parameters import method, parameter
from lineament.scan import Array, LaserScan

from .keypoints import KeypointMethod, Keypoints

#: Beyond so many scales a point has no weight: exp(-8).
_REACH = 4.0
#: Of keypoints within so much of each other [m] that of the smallest scale stays.
_APART = 0.2


@method
class FLIRT(KeypointMethod):
    """Keypoints of the curvature detector of Tipaldi and Arras 2010.

    1. *Graph*: the points, linked by some disjoint minimum spanning trees; the distance g of two
       points is along it.
    2. *Smooth* at each scale t: A(p) = Σ k q / Σ k over the points q, with
       k = exp(-g²/2t²) / (d(p) d(q)), where d is the density Σ exp(-g²/2t²).
    3. *Signal*: with s = 2 |p - A(p)| / t, it is s exp(-s), at most 1/e.
    4. *Maxima* along the scan above `least_signal`, on the nearer side of a jump, and not within
       two scales of the ends of the scan.

    The defaults are those of the authors' implementation.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> scan = SENSORS["paper"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(7))
    >>> keypoints = ln.extract(scan, method="flirt").corners["position"]
    >>> bool(np.hypot(*(keypoints - (3.0, 2.0)).T).min() < 0.2)  # where two walls meet
    True
    """

    name = "flirt"

    scales: int = parameter(5, "number of scales", low=1, below=65)
    scale: float = parameter(0.2, "the smallest scale", above=0, unit="m")
    step: float = parameter(1.4, "ratio of a scale to the one before", above=0)
    least_signal: float = parameter(0.34, "least signal of a maximum", low=0)
    rise: float = parameter(0.001, "by which it is above those of its neighbours", low=0)
    trees: int = parameter(3, "spanning trees of the graph", low=1, below=65)

    def keypoints(self, scan: LaserScan) -> Keypoints:
        """Find the keypoints of a scan."""
        beams = np.flatnonzero(scan.valid)
        points = scan.points[beams]
        scales = self.scale * self.step ** np.arange(self.scales)
        places: list[Array] = []
        scores: list[float] = []
        if len(points) > 2:
            apart = _geodesics(points, self.trees, _REACH * scales[-1], scan.is_full_circle)
            for scale in scales:
                signal = _signal(points, apart, scale)
                for i in self._maxima(signal, scan.is_full_circle):
                    place = points[foreground(scan, beams, i)]
                    alone = all(math.dist(place, p) > _APART for p in places)
                    ends = () if scan.is_full_circle else (points[0], points[-1])
                    if alone and all(math.dist(place, end) >= 2 * scale for end in ends):
                        places.append(place)
                        scores.append(float(signal[i]) * math.e)
        return Keypoints(np.array(places).reshape(-1, 2), np.array(scores))

    def _maxima(self, signal: Array, circular: bool) -> list[int]:
        """Return the points whose signal is a maximum along the scan."""
        before, after = signal - np.roll(signal, 1), signal - np.roll(signal, -1)
        peaks = (signal > self.least_signal) & (before > self.rise) & (after > self.rise)
        if not circular:
            peaks[[0, -1]] = False
        return [int(i) for i in np.flatnonzero(peaks)]


def _geodesics(points: Array, trees: int, reach: float, circular: bool) -> Array:
    """Return the distances of all points from each other along the graph, up to `reach`."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

    lengths = np.hypot(*(points[:, np.newaxis] - points).transpose(2, 0, 1))
    lengths = np.where(lengths < reach, np.maximum(lengths, 1e-9), 0.0)  # 0: no link
    if not circular:
        lengths[0, -1] = lengths[-1, 0] = 0.0
    left, graph = np.triu(lengths, 1), np.zeros_like(lengths)
    for _ in range(trees):
        tree = minimum_spanning_tree(csr_array(left)).toarray()
        graph += tree
        left[tree > 0.0] = 0.0
    return np.asarray(dijkstra(csr_array(graph), directed=False, limit=reach))


def _signal(points: Array, apart: Array, scale: float) -> Array:
    """How far each point is from where its neighbours are, as a signal of the scale."""
    weights = np.exp(-np.square(apart) / (2 * scale * scale))
    density = weights.sum(axis=1)
    weights /= density * density[:, np.newaxis]
    smooth = weights @ points / weights.sum(axis=1)[:, np.newaxis]
    off = 2 * np.hypot(*(points - smooth).T) / scale
    return np.asarray(off * np.exp(-off))


def foreground(scan: LaserScan, beams: NDArray[np.intp], i: int) -> int:
    """Return the point or that of the neighbouring beam that is nearer to the scanner."""
    n, beam = len(scan), int(beams[i])
    near = [i]
    for other in (i - 1, i + 1):
        k = other % len(beams)
        step = abs(int(beams[k]) - beam)
        if step == 1 or (scan.is_full_circle and step == n - 1):
            near.append(k)
    return min(near, key=lambda k: float(scan.ranges[beams[k]]))
