"""Step 3: arcs in the place of lines, where one circle explains their measurements better."""

import math

import numpy as np

from .. import helper, inlined, sums
from . import layout as at
from .constants import (
    ARC_PRICE, ARC_RADIUS, ARC_STEPS, ARC_TURN, CLUTTER, LEAST, LEAST_CHORD, MOST_DEVIATION,
    MOST_LINES, RARE, SEED_STEPS, SIGMAS, SINGULAR, STEP_SIGMAS, STRAIGHT, TAU,
)  # fmt: skip
from .costs import solve
from .geometry import distance, range_variance


@inlined
def find_arcs(work, scan, lines):
    """Take the runs of lines that one circle explains better for arcs.

    It is decided at the scale of the noise: a column is no rounder than a wall may be uneven.
    Returns how many surfaces are left, in the order of their measurements.
    """
    points, spans, pieces, noise = work.points, work.spans, work.pieces, work.noise
    first, last, kind = spans[at.FIRST], spans[at.LAST], spans[at.KIND]
    kept, k, free = 0, 0, np.int64(0)
    while k < lines:
        price, gain, end, i, j = 0.0, 0.0, k, first[k], last[k]
        for m in range(k, min(k + MOST_LINES, lines)):
            if m > k and work.beams[at.BROKEN, first[m]]:
                break
            hidden = first[m] - last[m - 1] - 1 if m > k else 0
            price += scan.evidence * (1.0 + CLUTTER * hidden)
            if _looks_round(points, first[k], last[m], noise):
                after = first[m + 1] if m + 1 < lines else scan.count
                better, low, high = _replace(
                    work, scan, first[k], last[m], free, after, pieces[kept]
                )
                if better > -math.inf:
                    better += price
                    for line in range(k, m + 1):
                        a, b = solve(work.sums, first[line], last[line] + 1)
                        better += _noise_cost(points, first[line], last[line] + 1, a, b, noise)
                if better > gain:
                    gain, end, i, j = better, m, low, high
        first[kept], last[kept], kind[kept] = i, j, at.ARC if gain > 0.0 else at.LINE
        if gain > 0.0:
            fit_arc(points, i, j, noise, ARC_STEPS, pieces[kept])
            spans[at.COUNT, kept], pieces[kept, at.GAIN] = j - i + 1, gain
        free, k, kept = j + 1, end + 1, kept + 1
    return kept


@sums
def _noise_cost(points, first, end, a, b, noise):
    """χ² of a line at the scale of the noise."""
    x, y, rho = points[at.X, first:end], points[at.Y, first:end], points[at.RHO, first:end]
    total = 0.0
    for i in range(len(x)):
        square, off = rho[i] * rho[i], 1.0 - a * x[i] - b * y[i]
        total += off * off * square / (noise[at.CONSTANT] + noise[at.GROWTH] * square)
    return total


@helper
def _looks_round(points, first, last, noise):
    """Whether the measurements at the quarters are near the circle through the ends and the middle.

    It must bulge towards the scanner, and turn enough. It costs little, and hardly anything else
    gets further.
    """
    x, y, quarter = points[at.X], points[at.Y], (3 * first + last) // 4
    mx, my = _middle(points, first, last)
    ax, ay, bx, by = x[first] - mx, y[first] - my, x[last] - mx, y[last] - my
    cross, a, b = ax * by - ay * bx, ax * ax + ay * ay, bx * bx + by * by
    # Beams run counter-clockwise: seen from the middle, the ends of a bulge span a right turn.
    if not cross > 0.0:
        return False
    ux, uy = (by * a - ay * b) / (2.0 * cross), (ax * b - bx * a) / (2.0 * cross)
    # Most lines are straight, and ask for no root.
    if ux * ux + uy * uy > 4.0 * ARC_RADIUS * ARC_RADIUS:
        return False
    r, square = math.sqrt(ux * ux + uy * uy), mx * mx + my * my
    near = STEP_SIGMAS * math.sqrt(noise[at.CONSTANT] + noise[at.GROWTH] * square)
    for i in (quarter, first + last - quarter):
        dx, dy = x[i] - mx - ux, y[i] - my - uy
        if not abs(distance(dx, dy) - r) <= near:
            return False
    dx, dy, least = ax - bx, ay - by, LEAST_CHORD * ARC_TURN * r
    return dx * dx + dy * dy >= least * least


@helper
def _middle(points, first, last):
    """Return the place in the middle of some measurements, the mean of two of an even number."""
    i = (first + last) // 2
    j = first + last - i
    return 0.5 * (points[at.X, i] + points[at.X, j]), 0.5 * (points[at.Y, i] + points[at.Y, j])


@inlined
def _replace(work, scan, first, last, free, after, arc):
    """Energy, less that of the lines it replaces, which an arc saves, -inf if it cannot; its ends.

    From the ends of the lines on it goes as far as measurements are near the circle, `free` to
    `after`. An arc has three parameters where a line has two, and costs one and a half times as
    much; much more where another surface goes on from it, for what is round mostly stands free.
    """
    points, broken, noise, low, high = work.points, work.beams[at.BROKEN], work.noise, first, last
    if not fit_arc(points, low, high, noise, SEED_STEPS, arc) < math.inf:
        return -math.inf, low, high
    while low < high and not is_on(points, arc, low, noise, 0.0):
        low += 1
    while low < high and not is_on(points, arc, high, noise, 0.0):
        high -= 1
    low = _follow(points, broken, arc, low, free - 1, -1, noise)
    high = _follow(points, broken, arc, high, after, 1, noise)
    free_of = high - low - 2.0
    if free_of < LEAST - 1:
        return -math.inf, low, high
    chi_square = fit_arc(points, low, high, noise, ARC_STEPS, arc)
    ax, ay = points[at.X, low] - arc[at.CX], points[at.Y, low] - arc[at.CY]
    bx, by = points[at.X, high] - arc[at.CX], points[at.Y, high] - arc[at.CY]
    turn = math.atan2(bx * ay - by * ax, ax * bx + ay * by) % (2.0 * math.pi)
    x, y = _middle(points, low, high)
    bulges = x * (arc[at.CX] - x) + y * (arc[at.CY] - y) > 0.0
    likely = chi_square <= free_of + SIGMAS * math.sqrt(2.0 * free_of)
    vague = arc[at.RR] > MOST_DEVIATION * MOST_DEVIATION
    if not likely or vague or turn < ARC_TURN or not bulges:
        return -math.inf, low, high
    price = ARC_PRICE
    if low > 0 and not broken[low] and is_on(points, arc, low - 1, noise, TAU):
        price += RARE
    if high + 1 < scan.count and not broken[high + 1] and is_on(points, arc, high + 1, noise, TAU):
        price += RARE
    more = (high - low) - (last - first)
    return scan.evidence * (CLUTTER * more - price) - chi_square, low, high


@helper
def _follow(points, broken, arc, i, stop, way, noise):
    """Return the last of the measurements from i on, in direction `way`, that are on an arc."""
    while i + way != stop and not broken[max(i, i + way)]:
        if not is_on(points, arc, i + way, noise, 0.0):
            break
        i += way
    return i


@helper
def is_on(points, arc, i, noise, scale):
    """Whether a measurement is as near to an arc as by chance, at a scale of its surface [m]."""
    dx, dy = points[at.X, i] - arc[at.CX], points[at.Y, i] - arc[at.CY]
    off = distance(dx, dy) - arc[at.RADIUS]
    variance = range_variance(points, i, noise) + scale * scale
    return off * off <= SIGMAS * SIGMAS * variance


@sums
def fit_arc(points, first, last, noise, steps, piece):
    """Fit a circle to the measurements first … last. Returns its χ², inf where no circle fits.

    From that of least squares of |p - c|² - r² (Kåsa 1976) to that of least Σ (|p - c| - r)²/v by
    Gauss and Newton. A range moves a point along the normal by its cos ψ, and no less than the
    circle bends over it: v = σ² (cos² ψ + σ/2r).
    """
    end = last + 1
    x, y, rho = points[at.X, first:end], points[at.Y, first:end], points[at.RHO, first:end]
    n, mx, my, constant, growth = len(x), 0.0, 0.0, noise[at.CONSTANT], noise[at.GROWTH]
    for i in range(n):
        mx, my = mx + x[i], my + y[i]
    mx, my = mx / n, my / n
    xx, xy, yy, xz, yz, z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        dx, dy = x[i] - mx, y[i] - my
        square = dx * dx + dy * dy
        xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        xz, yz, z = xz + dx * square, yz + dy * square, z + square
    determinant = xx * yy - xy * xy
    if not determinant > STRAIGHT * xx * yy:
        return math.inf
    ux, uy = 0.5 * (xz * yy - yz * xy) / determinant, 0.5 * (yz * xx - xz * xy) / determinant
    cx, cy, r = mx + ux, my + uy, math.sqrt(ux * ux + uy * uy + z / n)
    chi_square, squares = math.inf, 0.0
    for step in range(steps + 1):
        if not 0.0 < r <= ARC_RADIUS:
            return math.inf
        hxx, hxy, hxr, hyy, hyr, hrr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        gx, gy, gr, chi_square, squares, bends = 0.0, 0.0, 0.0, 0.0, 0.0, 0.5 / r
        for i in range(n):
            dx, dy = x[i] - cx, y[i] - cy
            d = math.sqrt(dx * dx + dy * dy)
            inverse, square, e = 1.0 / d, rho[i] * rho[i], d - r
            nx, ny = dx * inverse, dy * inverse
            # With cos ψ times the range, so that fewer numbers are divided.
            across, variance = nx * x[i] + ny * y[i], constant + growth * square
            bend = bends * math.sqrt(variance)
            w = square / (variance * (across * across + bend * square))
            squares, chi_square = squares + e * e, chi_square + w * e * e
            hxx, hxy, hxr = hxx + w * nx * nx, hxy + w * nx * ny, hxr + w * nx
            hyy, hyr, hrr = hyy + w * ny * ny, hyr + w * ny, hrr + w
            gx, gy, gr = gx + w * nx * e, gy + w * ny * e, gr + w * e
        # The inverse of the normal matrix, by its cofactors.
        ixx, ixy, ixr = hyy * hrr - hyr * hyr, hxr * hyr - hxy * hrr, hxy * hyr - hxr * hyy
        iyy, iyr, irr = hxx * hrr - hxr * hxr, hxy * hxr - hxx * hyr, hxx * hyy - hxy * hxy
        determinant = hxx * ixx + hxy * ixy + hxr * ixr
        if not determinant > SINGULAR * hxx * hyy * hrr:
            return math.inf
        if step < steps:
            cx += (ixx * gx + ixy * gy + ixr * gr) / determinant
            cy += (ixy * gx + iyy * gy + iyr * gr) / determinant
            r += (ixr * gx + iyr * gy + irr * gr) / determinant
        else:
            scale = 1.0 / determinant
            piece[at.XX], piece[at.XY], piece[at.XR] = scale * ixx, scale * ixy, scale * ixr
            piece[at.YY], piece[at.YR], piece[at.RR] = scale * iyy, scale * iyr, scale * irr
    piece[at.CX], piece[at.CY], piece[at.RADIUS], piece[at.RMS] = cx, cy, r, math.sqrt(squares / n)
    return chi_square
