"""The stages of method `liu` as functions: filter, cluster, cut, fit.

Each checks what it is given and calls one kernel. The methods call the same kernels directly.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import noise_of, noise_row
from ..kernels import layout as at
from ..kernels.bilateral import filter_ranges, scratch_shape
from ..kernels.clustering import cluster
from ..kernels.corner_operator import RESPONSES, response_along
from ..kernels.cutting import cut
from ..kernels.line_fit import FITS
from ..scan import LaserScan, NoiseLike, RangeNoise
from .liu import Liu
from .parameters import Bounds, bounds_of
from .trace import candidate_records
from .workspace import Block

__all__ = [
    "adaptive_clusters",
    "bilateral_filter",
    "corner_response",
    "estimate_noise",
    "fit_line",
    "primary_corners",
]

Array = NDArray[np.float64]


def bilateral_filter(
    scan: LaserScan, *, sigma_d: float = 4.0, sigma_r: float = 0.3, half_width: int = 2
) -> Array:
    """Filter the ranges of a scan over index distance and range difference.

    ρ̃_i = Σ_j w ρ_j / Σ_j w with w = exp(-(i - j)²/2σ_d² - (ρ_i - ρ_j)²/2σ_r²) (equations 4-9).
    Invalid beams are left out of the sums and never filled; a full circle wraps.

    Parameters
    ----------
    scan : LaserScan
    sigma_d, sigma_r, half_width
        As in `Liu`.

    Returns
    -------
    float64 array, shape (n,)
        Filtered ranges [m], NaN where invalid.

    Examples
    --------
    >>> scan = LaserScan([2.0, 2.1, 2.0, 5.0], angle_min=0.0, angle_increment=0.01)
    >>> bilateral_filter(scan).round(3).tolist()
    [2.033, 2.035, 2.033, 5.0]
    """
    _check(sigma_d=sigma_d, sigma_r=sigma_r, half_width=half_width)
    block = _block(scan)
    filter_ranges(
        block.floats, block.range_min, block.range_max, float(sigma_d), float(sigma_r),
        int(half_width), block.circular,
        np.empty(scratch_shape(len(scan), int(half_width)), np.float32),
    )  # fmt: skip
    filtered: Array = block.work.beams[at.FILTERED, : len(scan)]
    return filtered


def estimate_noise(scan: LaserScan) -> RangeNoise | None:
    """Estimate the range noise of a scan from the second differences of its ranges.

    None where no beam is valid.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> ranges = 3.0 + rng.normal(0.0, 0.02, 3000)
    >>> round(estimate_noise(LaserScan(ranges, 0.0, 0.001)).sigma, 2)
    0.02
    """
    return noise_of(_block(scan).noises[0])


def adaptive_clusters(
    scan: LaserScan,
    ranges: ArrayLike | None = None,
    *,
    spacing_scale: float = 6.0,
    noise_floor: float = 3.0,
    density_k: float = 3.0,
    min_points: int = 3,
    noise: NoiseLike | None = None,
) -> NDArray[np.int32]:
    """Part the valid beams of a scan into clusters, on distance and density.

    A point joins the cluster before it if its spacing d is at most T_d = λ max(ρ_i, ρ_{i-1}) Δφ
    (equation 10) plus the noise floor, or at most T_K = μ_K + k σ_K of the spacings in the cluster
    (11-13). In a full circle the last cluster goes on in the first by the same rule.

    Parameters
    ----------
    scan : LaserScan
    ranges : array_like, shape (n,), optional
        Ranges to use in place of the scan's own, such as filtered ones [m].
    spacing_scale, noise_floor, density_k, min_points
        As in `Liu`.
    noise : RangeNoise or float, optional
        σ [m] of the noise floor; estimated from the scan if it is not given.

    Returns
    -------
    int32 array, shape (n,)
        Cluster of each beam, -1 for invalid beams and noise.

    Examples
    --------
    >>> scan = LaserScan([2.0] * 4 + [3.0] * 3 + [9.0], angle_min=0.0, angle_increment=0.01)
    >>> adaptive_clusters(scan).tolist()
    [0, 0, 0, 0, 1, 1, 1, -1]
    """
    _check(spacing_scale=spacing_scale, noise_floor=noise_floor, density_k=density_k)
    Bounds(int, low=1).check("min_points", min_points)
    n = len(scan)
    used = np.where(scan.valid, scan.ranges, np.nan)
    if ranges is not None:
        used = np.array(ranges, dtype=np.float64)
        if used.shape != (n,):
            raise ValueError(f"ranges has shape {used.shape}, expected ({n},), one for each beam")
        used[~scan.valid] = np.nan
    block = _block(scan)
    block.work.beams[at.FILTERED, :n] = used
    cluster(
        block.floats, block.ints, block.bearings, block.step, block.circular,
        noise_row(estimate_noise(scan) if noise is None else noise), float(spacing_scale),
        float(noise_floor), float(density_k), int(min_points),
    )  # fmt: skip
    labels = np.full(n, -1, np.int32)
    beam, label = block.work.marks[[at.BEAM, at.LABEL], : block.counts[at.POINTS]]
    labels[beam] = label
    return labels


def corner_response(
    points: ArrayLike, *, support_radius: int = 6, response: str = "tangent"
) -> Array:
    """Response of the corner detection operator along one cluster (equations 15-22).

    Parameters
    ----------
    points : array_like, shape (m, 2)
        Points of the cluster in beam order [m].
    support_radius, response
        As in `Liu`.

    Returns
    -------
    float64 array, shape (m,)

    Examples
    --------
    >>> arm = np.linspace(0.2, 0.0, 7)
    >>> right_angle = [(a, 0.0) for a in arm] + [(0.0, a) for a in arm[-2::-1]]
    >>> corner_response(right_angle, response="relative").round(2).tolist()[4:9]
    [0.35, 0.51, 0.71, 0.51, 0.35]
    """
    xy = _points(points)
    _check(support_radius=support_radius, response=response)
    out = np.empty(len(xy))
    response_along(*xy.T.copy(), int(support_radius), RESPONSES[response], out)
    return out


def primary_corners(
    points: ArrayLike,
    *,
    support_radius: int = 6,
    threshold: float = 0.66,
    response: str = "tangent",
    recursion: str = "both",
    ends: str = "truncated",
    min_points: int = 3,
) -> NDArray[np.void]:
    """Find the corners of one cluster: the farthest point from the chord, again and again.

    Steps 5-7 with equations 14-22: a candidate whose response exceeds the threshold is a corner,
    and both sides of it are searched in turn; a branch ends at its first rejected candidate.

    Parameters
    ----------
    points : array_like, shape (m, 2)
        Points of the cluster in beam order [m].
    support_radius, threshold, response, recursion, ends, min_points
        As in `Liu`.

    Returns
    -------
    structured array of dtype `lineament.methods.trace.CANDIDATE`
        The candidates in the order of their examination; ``beam`` counts the given points.

    Examples
    --------
    >>> arm = np.linspace(0.2, 0.0, 7)
    >>> right_angle = [(a, 0.0) for a in arm] + [(0.0, a) for a in arm[-2::-1]]
    >>> found = primary_corners(right_angle, response="relative", threshold=0.5)
    >>> found["beam"][found["accepted"]].tolist()
    [6]
    """
    xy = _points(points)
    _check(
        support_radius=support_radius,
        threshold=threshold,
        response=response,
        recursion=recursion,
        ends=ends,
        min_points=min_points,
    )
    block = _one_cluster(xy, noise_row(None))
    kind, least = RESPONSES[response], int(min_points)
    cut(
        block.floats, block.ints, int(support_radius), float(threshold), kind, least,
        recursion == "both", ends == "excluded",
    )  # fmt: skip
    return candidate_records(block, float(threshold))


def fit_line(points: ArrayLike, *, noise: NoiseLike | None = None, fit: str = "total") -> np.void:
    """Fit a line to points seen from the origin, by least squares (equations 23, 24).

    Parameters
    ----------
    points : array_like, shape (m, 2)
        Points in beam order, in the frame of the sensor [m]; m ≥ 2.
    noise : RangeNoise or float, optional
        Noise of the ranges, or its sigma [m], for the covariance and the weights; 1 m if not
        given, which leaves an angle unknown (the covariance is not linear in the variance).
    fit
        As in `Liu`; y = kx + b is x = ky + b where it is steeper than 45°.

    Returns
    -------
    record of dtype `lineament.features.SEGMENT`
        Beams count the given points.

    Examples
    --------
    >>> line = fit_line([(2.0, -1.0), (2.0, 0.0), (2.0, 1.0)], noise=RangeNoise(sigma=0.01))
    >>> line["centroid"].tolist(), round(float(line["angle"]), 4)
    ([2.0, 0.0], 1.5708)
    """
    xy = _points(points)
    _check(fit=fit)
    if len(xy) < 2:
        raise ValueError(f"points has {len(xy)} points, expected at least 2")
    if not xy.any(axis=1).all():
        raise ValueError("points has a point at the origin, expected points that a beam can meet")
    block = _one_cluster(xy, np.eye(5)[0] if noise is None else noise_row(noise))
    block.work.pieces[[at.FIRST, at.LAST, at.BEFORE], 0] = 0, len(xy) - 1, -1
    block.counts[at.PIECES] = 1
    block.measure(fit=FITS[fit], sharp=False)
    block.offsets[1, 0] = 1  # Points along one beam may give no segment, but a line they have.
    line: np.void = block.written()[0][0]
    return line


def _check(**given: Any) -> None:
    """Check values by the bounds of the method's parameters of these names."""
    for name, value in given.items():
        bounds_of(Liu, name).check(name, value)


def _block(scan: LaserScan) -> Block:
    block = Block(scan, noise_row(None), 1)
    block.load(scan.ranges)
    block.take(0)
    return block


def _one_cluster(xy: Array, noise: Array) -> Block:
    """Make a scan of points, all of one open cluster."""
    m, rho = len(xy), np.hypot(*xy.T)
    # The bearings do not matter but for their sines and cosines; points need not be in order.
    block = _block(LaserScan(rho, 0.0, 1.0 / max(m, 1)))
    with np.errstate(invalid="ignore"):
        block.bearings[:] = xy.T / rho
    block.noises[0] = noise
    block.work.beams[at.RANGE, :m] = rho  # Also of points at the origin.
    block.work.marks[at.BEAM, :m], block.work.marks[at.LABEL, :m] = np.arange(m), 0
    block.work.clusters[[at.FIRST, at.LAST], 0] = 0, m - 1
    block.work.points[[at.X, at.Y], :m] = xy.T
    block.counts[[at.POINTS, at.CLOSED, at.CLUSTERS]] = m, False, min(m, 1)
    return block


def _points(points: ArrayLike) -> Array:
    xy = np.array(points, dtype=np.float64)
    if xy.size == 0:
        return xy.reshape(0, 2)
    if xy.ndim != 2 or xy.shape[1] != 2:
        raise ValueError(f"points has shape {xy.shape}, expected (m, 2)")
    if not np.isfinite(xy).all():
        raise ValueError("points has a value that is not finite")
    return xy
