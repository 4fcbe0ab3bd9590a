"""Slow twin of how method optimal finds arcs: circles by least squares, each step solved anew."""

from __future__ import annotations

import math

import numpy as np
from naive_fit import range_variance

from lineament.kernels import arcs


def circle_of(xy):
    """Centre and radius of least squares of |p - c|² - r² = 0; None where there is none (Kåsa)."""
    middle = xy.mean(axis=0)
    off = xy - middle
    moments = off.T @ off
    if np.linalg.det(moments) <= 1e-9 * moments[0, 0] * moments[1, 1]:
        return None
    columns, squares = np.column_stack((2 * off, np.ones(len(xy)))), (off**2).sum(axis=1)
    *u, k = np.linalg.lstsq(columns, squares, rcond=None)[0]
    return np.array([*(middle + u), math.sqrt(k + np.dot(u, u))])


def fit_arc(points, first, last):
    """Circle of least Σ e²/b by Gauss and Newton, with covariance; None where there is none."""
    xy, rho = points.xy[first : last + 1], points.rho[first : last + 1]
    variance = range_variance(rho, points.noise)
    circle = circle_of(xy)
    if circle is None:
        return None
    for _ in range(arcs._STEPS):
        center, r = circle[:2], circle[2]
        if not 0 < r < arcs._LARGEST:
            return None
        off = xy - center
        d = np.linalg.norm(off, axis=1)
        normals = off / d[:, np.newaxis]
        cosine = (normals * xy).sum(axis=1) / rho
        w = 1 / (variance * (cosine**2 + np.sqrt(variance) / (2 * r)))
        gradient, e = np.column_stack((normals, np.ones(len(xy)))), d - r
        hessian = gradient.T @ (w[:, np.newaxis] * gradient)
        if np.linalg.det(hessian) <= 1e-12 * np.diag(hessian).prod():
            return None
        covariance = np.linalg.inv(hessian)
        circle = circle + covariance @ gradient.T @ (w * e)
    middle = xy[(first + last) // 2 - first]
    if middle @ (center - middle) <= 0 or np.diag(covariance).min() <= 0:
        return None
    return {
        "center": center,
        "radius": r,
        "covariance": covariance,
        "span": (first, last),
        "first_beam": points.beams[first],
        "last_beam": points.beams[last],
        "n_points": len(xy),
        "rms": math.sqrt(np.mean(e**2)),
        "chi_square": w @ e**2,
    }


def circle_through(a, b, c):
    """Centre of the circle through three points: as far from each of them."""
    rows = np.array([b - a, c - a])
    return a + np.linalg.solve(2 * rows, (rows**2).sum(axis=1))


def may_be_arc(points, first, last):
    """Whether the points at the quarters are near a circle through three, that bulges this way."""
    xy, middle = points.xy, (first + last) // 2
    if np.linalg.det([xy[first] - xy[middle], xy[last] - xy[middle]]) <= 0:
        return False
    center = circle_through(xy[middle], xy[first], xy[last])
    r = np.linalg.norm(xy[middle] - center)
    near = arcs._NEAR * math.sqrt(range_variance(points.rho[middle], points.noise))
    quarters = [(first + middle) // 2, (middle + last + 1) // 2]
    off = np.linalg.norm(xy[quarters] - center, axis=1) - r
    return r <= arcs._LARGEST and (abs(off) <= near).all()


def find_arcs(points, bounds, pieces, evidence):
    """Pieces that are left of a class, and the arcs that explain the others better."""
    kept, found, rest, free = [], [], list(pieces), bounds[0]
    while rest:
        best, most, taken = None, 0.0, 0
        for count in range(1, min(len(rest), arcs._MOST_PIECES) + 1):
            run = rest[:count]
            after = rest[count][0] - 1 if count < len(rest) else bounds[1]
            left = min(run[0][0] - free, arcs._ENDS)
            right = min(after - run[-1][1], arcs._ENDS)
            for b in range(right + 1):
                for a in range(left + 1):
                    gain, arc = arc_of(points, bounds, run, a, b, evidence)
                    if gain > most:
                        best, most, taken = arc, gain, count
        if best is None:
            kept.append(rest.pop(0))
            free = kept[-1][1] + 1
        else:
            found.append(best)
            rest, free = rest[taken:], best["span"][1] + 1
    return kept, found


def arc_of(points, bounds, run, left, right, evidence):
    """What a circle explains better than the lines of a run, with so many points beside it."""
    first, last = run[0][0] - left, run[-1][1] + right
    costs = [points.line(*piece)[1] for piece in run]
    n, own = last - first + 1, run[-1][1] - run[0][0] + 1
    alone = first <= bounds[0] + 1 and last >= bounds[1] - 1
    straight = len(run) == 1 and costs[0] < own + 2 * math.sqrt(2 * own)
    if n < arcs._LEAST_POINTS or (straight and own == n and not alone):
        return 0.0, None
    arc = fit_arc(points, first, last) if may_be_arc(points, first, last) else None
    variance = range_variance(points.rho[last], points.noise)
    # Walls may be uneven, which is part of that; what is round is not.
    if arc is None or arc["chi_square"] * variance >= (2 * n + 12) * (variance - points.uneven):
        return 0.0, None
    lines = sum(costs) + len(run) * evidence + arcs._OUT * (n - own)
    price = points.arc_price - (arcs._ALONE if alone else 0)
    return lines - arc["chi_square"] - price * evidence, arc
