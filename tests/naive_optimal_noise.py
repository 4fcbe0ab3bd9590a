"""Slow twin of how method optimal estimates the noise, and how uneven walls are."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from naive import LEAST_SIGMA, sigma, valid
from naive_fit import range_variance
from naive_optimal_pieces import is_one_wall

from lineament.kernels import noise as noise_kernel
from lineament.kernels import residual_noise, unevenness


def lattice(scan):
    """Step of the lattice of the ranges: the least between neighbours, if it divides the others."""
    r = np.where(valid(scan), scan.ranges, np.nan)
    differences = np.array([abs(b - a) for a, b in pairwise(r) if not math.isnan(b - a)])
    small = [d for d in differences.tolist() if LEAST_SIGMA < d < noise_kernel.COARSEST_QUANTUM]
    if not small:
        return 0.0
    steps = differences / min(small)
    steps = steps[(steps > 0.5) & (steps < noise_kernel._MOST_STEPS)]
    divides = (abs(steps - np.floor(steps + 0.5)) <= 0.1).all()
    return min(small) if divides and len(steps) >= noise_kernel._LEAST_STEPS else 0.0


def range_errors(scan):
    """(size, range in the middle) of every other triple of valid neighbours.

    Three points of a line have the determinant 0 of (cos φ, sin φ, 1/ρ). What it is, over the
    deviation that it has for unit noise of ranges that are alike, and even steps, is the size.
    """
    ok, r, out = valid(scan), scan.ranges, []
    for i in range(1, len(scan) - 1, 2):
        if all(ok[i - 1 : i + 2]):
            three, span = scan.angles[i - 1 : i + 2], r[i - 1 : i + 2]
            rows = np.column_stack((np.cos(three), np.sin(three), 1 / span))
            spread = math.sin(three[2] - three[0])
            if spread > 0:
                size = abs(np.linalg.det(rows)) * r[i] ** 2 / (math.sqrt(1.5) * spread)
                out.append((size, r[i]))
    sizes, at = np.array(out).reshape(-1, 2).T
    return sizes, at


def clipped_variance(sizes):
    limit = max(noise_kernel.CLIP * np.sort(sizes)[len(sizes) // 3], LEAST_SIGMA)
    return max(1.03 * np.mean(sizes[sizes <= limit] ** 2), LEAST_SIGMA**2)


def parts_of(constant, growth, quantum):
    """Noise of so much variance at the sensor, rounding included, and so much more by ρ²."""
    own = math.sqrt(max(constant - quantum**2 / 12, 0.0)) if constant >= 0 else math.nan
    return (max(own, LEAST_SIGMA), math.sqrt(growth), 0.0, quantum)


def first_noise(scan, grows):
    """Estimate the noise from the near and the far half of the readings."""
    quantum = lattice(scan)
    sizes, at = range_errors(scan)
    if len(sizes) < 2 * noise_kernel._LEAST_TRIPLES:
        rough = sigma(scan)
        return (math.nan, 0.0, 0.0, quantum) if rough is None else parts_of(rough**2, 0.0, quantum)
    near = at <= np.sort(at)[(len(at) - 1) // 2]
    if (~near).sum() < noise_kernel._LEAST_TRIPLES:
        grows = False
    halves = [near, ~near] if not near.all() else [near]
    variances = [clipped_variance(sizes[half]) for half in halves]
    squares = [np.mean(at[half] ** 2) for half in halves]
    if not grows or squares[1] < 1.2 * squares[0] or variances[1] < 1.7 * variances[0]:
        together = np.average(variances, weights=[half.sum() for half in halves])
        return parts_of(together, 0.0, quantum)
    (v_near, v_far), (x_near, x_far), least = variances, squares, quantum**2 / 12
    growth = (v_far - v_near) / (x_far - x_near)
    constant = v_near - growth * x_near
    if constant < least:
        constant = least
        growth = max((v_near - least) / x_near + (v_far - least) / x_far, 0.0) / 2
    return parts_of(constant, growth, quantum)


def refined_noise(points, pieces):
    """Estimate it again: e² = σ² + p² ρ² by least squares over the readings of telling pieces."""
    long = [(i, j) for i, j in pieces if j - i + 1 >= residual_noise._LEAST_POINTS]
    telling, scale = telling_pieces(points, long)
    squares, at = [], []
    for first, last in telling:
        n = last - first + 1
        (a, b), _ = points.line(first, last)
        rho = points.rho[first : last + 1]
        with np.errstate(divide="ignore"):
            expected = rho / (points.xy[first : last + 1] @ (a, b))
        squares += ((rho - expected) ** 2 * n / (n - 2)).tolist()
        at += rho.tolist()
    q, x = np.array(squares), np.array(at) ** 2
    variance = range_variance(np.sqrt(x), points.noise)
    near = q <= residual_noise._OUT * min(scale, 1.0) * variance
    q, x, w = q[near], x[near], 1 / variance[near] ** 2
    if len(q) < residual_noise._LEAST_READINGS:
        return points.noise
    quantum = points.noise[3]
    constant, growth, least = np.average(q, weights=w), 0.0, quantum**2 / 12
    moments = np.array([[w.sum(), w @ x], [w @ x, w @ x**2]])
    spread = np.linalg.det(moments) > 1e-6 * moments[0, 0] * moments[1, 1]
    if points.noise[1] > 0 and spread:
        both = np.linalg.solve(moments, [w @ q, w @ (q * x)])
        if both[1] >= 0 and both[0] >= least:
            constant, growth = both
        elif both[1] >= 0:
            constant, growth = least, max(w @ ((q - least) * x), 0.0) / (w @ x**2)
    return parts_of(constant, growth, quantum)


def telling_pieces(points, pieces):
    """Leave out the pieces that are far more off their lines than most.

    And χ² of what is left over its degrees of freedom; all, and inf, if it is hardly less.
    """
    if not pieces:
        return pieces, math.inf
    free = np.array([last - first - 1.0 for first, last in pieces])
    costs = np.array([points.line(*piece)[1] for piece in pieces])
    whole = scale = costs.sum() / free.sum()
    for _ in range(residual_noise._PASSES - 1):
        near = costs <= scale * (free + residual_noise._ABOVE * np.sqrt(2 * free))
        most = max(residual_noise._MAJORITY * free.sum(), residual_noise._LEAST_READINGS)
        if free[near].sum() <= most:
            break
        scale = costs[near].sum() / free[near].sum()
    if not scale < residual_noise._CLEARLY_LESS * whole:
        return pieces, math.inf
    # The scale that is found last tells which are left out.
    kept = costs <= scale * (free + residual_noise._ABOVE * np.sqrt(2 * free))
    return [piece for piece, near in zip(pieces, kept, strict=True) if near], scale


def wall_unevenness(points, cut):
    """Variance that walls have beyond the noise; a wall is a run of pieces at shallow angles."""
    walls = []
    for pieces in cut:
        for k, piece in enumerate(pieces):
            if k and is_one_wall(points, walls[-1], piece):
                walls[-1] = (walls[-1][0], piece[1])
            else:
                walls.append(piece)
    errors, alike, free, variances = [], np.zeros(2), 0, []
    for first, last in walls:
        if last - first + 1 >= unevenness._LEAST_POINTS:
            span, (ab, _) = slice(first, last + 1), points.line(first, last)
            own = points.errors(ab, first, last)
            near = own <= unevenness._OUT
            errors += own[near].tolist()
            off = near * (1 - points.xy[span] @ ab)
            for lag in (1, 2):
                alike[lag - 1] += (points.weight[span] * off)[lag:] @ off[:-lag]
            alike += 2 * own[near].sum() / max(near.sum(), 1)
            middle = points.rho[(first + last) // 2]
            variances.append((last - first - 1) * range_variance(middle, points.noise))
            free += near.sum() - 2
    if free < unevenness._LEAST_POINTS:
        return 0.0
    is_alike = max(alike) * math.sqrt(free) > unevenness._ALIKE * sum(errors)
    sure = unevenness._SURE if is_alike else unevenness._ALONE
    excess = sum(errors) / free - 1 - sure * math.sqrt(2 / free)
    variance = unevenness._CUT_AWAY * max(excess, 0.0) * sum(variances) / free
    return min(variance, unevenness.MOST_UNEVEN**2)
