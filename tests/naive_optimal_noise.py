"""Slow twin of how method optimal estimates the noise: medians and least squares of lists."""

from __future__ import annotations

import math

import numpy as np
from naive import LEAST_SIGMA, sigma, valid
from naive_fit import range_variance

from lineament.kernels import noise as noise_kernel
from lineament.kernels import residual_noise


def second_differences(scan):
    """(size, range in the middle) of every other triple of valid neighbours."""
    ok, r = valid(scan), scan.ranges
    triples = [i for i in range(1, len(scan) - 1, 2) if ok[i - 1] and ok[i] and ok[i + 1]]
    sizes = [abs(r[i - 1] - 2 * r[i] + r[i + 1]) for i in triples]
    return np.array(sizes), r[triples]


def clipped_variance(sizes):
    limit = 3 * 1.4826 * np.sort(sizes)[(len(sizes) - 1) // 2]
    if limit < LEAST_SIGMA:  # They lie on a lattice.
        steps = sizes[(sizes > LEAST_SIGMA) & (sizes < noise_kernel.COARSEST_QUANTUM)]
        quantum = steps.min() if len(steps) else 0.0
        return max(quantum**2 / 12, LEAST_SIGMA**2)
    inside = sizes[sizes <= limit]
    return max(1.03 * np.mean(inside**2) / 6, LEAST_SIGMA**2)


def first_noise(scan, grows):
    """Estimate the noise from the near and the far half of the readings."""
    sizes, at = second_differences(scan)
    near = at <= np.sort(at)[(len(at) - 1) // 2] if len(at) else np.zeros(0, bool)
    if min(near.sum(), (~near).sum()) < noise_kernel._LEAST_TRIPLES:
        return (math.nan if sigma(scan) is None else sigma(scan), 0.0, 0.0, 0.0)
    halves = [(clipped_variance(sizes[half]), np.mean(at[half] ** 2)) for half in (near, ~near)]
    (v_near, x_near), (v_far, x_far) = halves
    if not grows or x_far < 1.2 * x_near or v_far < 1.7 * v_near:
        together = np.average([v_near, v_far], weights=[near.sum(), (~near).sum()])
        return (math.sqrt(together), 0.0, 0.0, 0.0)
    growth = (v_far - v_near) / (x_far - x_near)
    constant = v_near - growth * x_near
    if constant < 0:
        constant, growth = 0.0, (v_near / x_near + v_far / x_far) / 2
    return (max(math.sqrt(constant), LEAST_SIGMA), math.sqrt(growth), 0.0, 0.0)


def refined_noise(points, pieces):
    """Estimate it again: e² = σ² + p² ρ² by least squares over the readings of long pieces."""
    squares, at = [], []
    for first, last in pieces:
        n = last - first + 1
        if n < residual_noise._LEAST_POINTS:
            continue
        (a, b), _ = points.line(first, last)
        rho = points.rho[first : last + 1]
        with np.errstate(divide="ignore"):
            expected = rho / (points.xy[first : last + 1] @ (a, b))
        squares += ((rho - expected) ** 2 * n / (n - 2)).tolist()
        at += rho.tolist()
    q, x = np.array(squares), np.array(at) ** 2
    variance = range_variance(np.sqrt(x), points.noise)
    near = q <= residual_noise._OUT * variance
    q, x, w = q[near], x[near], 1 / variance[near] ** 2
    if len(q) < residual_noise._LEAST_READINGS:
        return points.noise
    constant, growth = np.average(q, weights=w), 0.0
    moments = np.array([[w.sum(), w @ x], [w @ x, w @ x**2]])
    spread = np.linalg.det(moments) > 1e-6 * moments[0, 0] * moments[1, 1]
    if points.noise[1] > 0 and spread:
        both = np.linalg.solve(moments, [w @ q, w @ (q * x)])
        if both.min() >= 0:
            constant, growth = both
        elif both[1] >= 0:
            constant, growth = 0.0, w @ (q * x) / (w @ x**2)
    return (max(math.sqrt(constant), LEAST_SIGMA), math.sqrt(growth), 0.0, 0.0)
