"""Features of two frames compared pair by pair, and paired one to one."""

import math

from .. import helper, kernel
from .assignment import assign
from ...features.records import (
    A_CENTER,
    A_COVARIANCE,
    A_RADIUS,
    C_COVARIANCE,
    C_POSITION,
    S_ANGLE,
    S_CENTROID,
    S_COVARIANCE,
    S_END,
    S_MISFIT,
    S_START,
)

#: Length over which a surface, or a sensor, is off by the same [m].
_PATCH = 0.3
#: Share of the shorter of two segments along which they must lie side by side.
_OVERLAP = 0.5
#: No segment counts as shorter [m].
_LEAST_LENGTH = 2.220446049250313e-16


@kernel
def move(segments, corners, arcs, x, y, theta):
    """Move the words of features (see `records`) by a pose, and their covariances with them."""
    c, s = math.cos(theta), math.sin(theta)
    for k in range(len(segments)):
        row = segments[k]
        for at in (S_START, S_END, S_CENTROID):
            p, q = row[at], row[at + 1]
            row[at], row[at + 1] = c * p - s * q + x, s * p + c * q + y
        row[S_ANGLE] = turned(row[S_ANGLE] + theta)
    for k in range(len(corners)):
        _move_point(corners[k], C_POSITION, C_COVARIANCE, 2, c, s, x, y)
    for k in range(len(arcs)):
        row = arcs[k]
        _move_point(row, A_CENTER, A_COVARIANCE, 3, c, s, x, y)
        a, b = row[A_COVARIANCE + 2], row[A_COVARIANCE + 5]
        row[A_COVARIANCE + 2], row[A_COVARIANCE + 5] = c * a - s * b, s * a + c * b
        a, b = row[A_COVARIANCE + 6], row[A_COVARIANCE + 7]
        row[A_COVARIANCE + 6], row[A_COVARIANCE + 7] = c * a - s * b, s * a + c * b


@helper
def _move_point(row, at, covariance, size, c, s, x, y):
    """Move a point, and the first two lines and columns of its covariance, of so many lines."""
    row[at], row[at + 1] = c * row[at] - s * row[at + 1] + x, s * row[at] + c * row[at + 1] + y
    xx, xy = row[covariance], row[covariance + 1]
    yx, yy = row[covariance + size], row[covariance + size + 1]
    row[covariance], row[covariance + 1], row[covariance + size + 1] = rotated(xx, xy, yx, yy, c, s)
    row[covariance + size] = row[covariance + 1]


@kernel
def associate(
    before, now, sides, spread, origin, roughness, gates, cost, paths, prices, via, owners
):
    """Find which features of two frames are the same.

    Parameters
    ----------
    before, now : (segments, corners, arcs)
        Words of the features (see `records`), the later ones moved into the earlier frame.
    sides : (before, now)
        int8 arrays: 1 for convex corners, 0 for others. Only corners with the same number pair.
    spread : float64 array, shape (3, 3)
        Covariance of the motion by which they were moved.
    origin : (x, y)
        Where the later sensor is [m].
    roughness : float
        How far surfaces are from straight and round [m].
    gates : (float, float)
        Largest squares e'S⁻¹e of two and of three components.
    cost : float64 array, shape (m, n + m)
        Scratch for the largest numbers m of later and n of earlier features of a kind.
    paths, prices, via
        Scratch of `assign` for as many.
    owners : int64 array, shape (3, n + m + 1)
        Written: for each earlier segment, corner and arc the later one, or -1.
    """
    a, b = before[0], now[0]
    within = _fresh_cost(cost, len(b), len(a), gates[0])
    for j in range(len(a)):
        _compare_segment(a[j], b, j, spread, origin, roughness, gates[0], within)
    assign(within, paths, prices, via, owners[0])
    a, b = before[1], now[1]
    within = _fresh_cost(cost, len(b), len(a), gates[0])
    for i in range(len(b)):
        x, y = b[i, C_POSITION], b[i, C_POSITION + 1]
        xx, xy, yy = _point_spread(x - origin[0], y - origin[1], spread, roughness)
        for j in range(len(a)):
            if sides[0][j] == sides[1][i]:
                square = _square(
                    x - a[j, C_POSITION],
                    y - a[j, C_POSITION + 1],
                    xx + a[j, C_COVARIANCE] + b[i, C_COVARIANCE],
                    xy + a[j, C_COVARIANCE + 1] + b[i, C_COVARIANCE + 1],
                    yy + a[j, C_COVARIANCE + 3] + b[i, C_COVARIANCE + 3],
                )
                if square <= gates[0]:
                    within[i, j] = square
    assign(within, paths, prices, via, owners[1])
    a, b = before[2], now[2]
    within = _fresh_cost(cost, len(b), len(a), gates[1])
    for i in range(len(b)):
        for j in range(len(a)):
            square = _compare_arcs(a[j], b[i], spread, origin, roughness)
            if square <= gates[1]:
                within[i, j] = square
    assign(within, paths, prices, via, owners[2])


@helper
def _fresh_cost(cost, rows, columns, gate):
    """Costs where nothing is allowed but to stay alone: each row in a column of its own."""
    within = cost[:rows, : columns + rows]
    for i in range(rows):
        for j in range(columns + rows):
            within[i, j] = 2.0 * gate if j == columns + i else math.inf
    return within


@helper
def _compare_segment(a, now, j, spread, origin, roughness, gate, cost):
    """Fill the costs of the later segments with the j-th earlier one, where they are within."""
    tx, ty = math.cos(a[S_ANGLE]), math.sin(a[S_ANGLE])
    length = segment_length(a)
    for i in range(len(now)):
        b = now[i]
        turn = turned(b[S_ANGLE] - a[S_ANGLE])
        if not abs(turn) < 0.5 * math.pi:
            continue
        first = (b[S_START] - a[S_START]) * tx + (b[S_START + 1] - a[S_START + 1]) * ty
        last = (b[S_END] - a[S_START]) * tx + (b[S_END + 1] - a[S_START + 1]) * ty
        shared, union = side_by_side(length, first, last)
        shorter = min(length, segment_length(b))
        px, py = b[S_CENTROID] - origin[0], b[S_CENTROID + 1] - origin[1]
        xx, xy, yy = _point_spread(px, py, spread, roughness)
        slack = 2.0 * math.sqrt(tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy)
        if not shared + slack >= _OVERLAP * shorter:
            continue
        ax, ay = b[S_CENTROID] - a[S_CENTROID], b[S_CENTROID + 1] - a[S_CENTROID + 1]
        normal = (-ty, tx, tx * px + ty * py)
        of_offset, of_angle = rough_variances(shorter, roughness)
        oo, oa, aa = offset_spread(a, ax * tx + ay * ty)
        bow = a[S_MISFIT] * a[S_MISFIT] + b[S_MISFIT] * b[S_MISFIT]
        oo += b[S_COVARIANCE] + of_offset + bow
        oa += b[S_COVARIANCE + 1]
        aa += b[S_COVARIANCE + 3] + of_angle + 12.0 * bow / (shorter * shorter) + spread[2, 2]
        for k in range(3):
            oa += normal[k] * spread[k, 2]
            for m in range(3):
                oo += normal[k] * spread[k, m] * normal[m]
        square = _square(ay * tx - ax * ty, turn, oo, oa, aa)
        if square <= gate:
            # Of the pieces of one wall, the one that has most in common with it.
            cost[i, j] = square + gate * (1.0 - max(shared / union, 0.0))


@helper
def _compare_arcs(a, b, spread, origin, roughness):
    """Square e'S⁻¹e of the distance of two arcs in place and radius; NaN if S is not known."""
    x, y = b[A_CENTER], b[A_CENTER + 1]
    p, q, r = x - a[A_CENTER], y - a[A_CENTER + 1], b[A_RADIUS] - a[A_RADIUS]
    xx, xy, yy = _point_spread(x - origin[0], y - origin[1], spread, roughness)
    xx += a[A_COVARIANCE] + b[A_COVARIANCE]
    xy += a[A_COVARIANCE + 1] + b[A_COVARIANCE + 1]
    yy += a[A_COVARIANCE + 4] + b[A_COVARIANCE + 4]
    xr = a[A_COVARIANCE + 2] + b[A_COVARIANCE + 2]
    yr = a[A_COVARIANCE + 5] + b[A_COVARIANCE + 5]
    rr = a[A_COVARIANCE + 8] + b[A_COVARIANCE + 8] + roughness * roughness
    # By Schur's complement of the radius.
    rest = _square(p - xr * r / rr, q - yr * r / rr, xx - xr * xr / rr, xy - xr * yr / rr,
                   yy - yr * yr / rr)  # fmt: skip
    return rest + r * r / rr if rr > 0.0 else math.nan


@helper
def turned(angle):
    """Angle brought into [-π, π)."""
    if -math.pi <= angle < math.pi:
        return angle
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@helper
def rotated(xx, xy, yx, yy, c, s):
    """R S R' of a symmetric S, whose halves may differ by rounding: its xx, xy, yy."""
    both = xy + yx
    return (
        c * c * xx - c * s * both + s * s * yy,
        c * s * (xx - yy) + 0.5 * (c * c - s * s) * both,
        s * s * xx + c * s * both + c * c * yy,
    )


@helper
def segment_length(row):
    """Length of a segment [m], more than 0."""
    length = math.hypot(row[S_END] - row[S_START], row[S_END + 1] - row[S_START + 1])
    return max(length, _LEAST_LENGTH)


@helper
def side_by_side(length, first, last):
    """Length along which two segments lie side by side, less than 0 if they do not, and of both.

    The one goes from 0 to its length, the other's ends are `first` and `last` along it [m].
    """
    low, high = min(first, last), max(first, last)
    return min(high, length) - max(low, 0.0), max(high, length) - min(low, 0.0)


@helper
def rough_variances(length, roughness):
    """Variances of offset [m²] and angle [rad²] of a line on a surface that is not straight.

    Deviations r are one over a patch of a surface, and independent from patch to patch: the mean
    of 1 + L/patch of them is known to r²/(1 + L/patch), and their slope to 12/L² times that.
    """
    offset = roughness * roughness / (1.0 + length / _PATCH)
    return offset, 12.0 * offset / (length * length)


@helper
def offset_spread(row, along):
    """Covariance of a segment's offset and angle, so far along its line.

    The offset is the less known the farther it is from the centroid.
    """
    both = row[S_COVARIANCE + 1] + row[S_COVARIANCE + 2]
    angle = row[S_COVARIANCE + 3]
    offset = row[S_COVARIANCE] + along * both + along * along * angle
    return offset, row[S_COVARIANCE + 1] + along * angle, angle


@helper
def _point_spread(px, py, spread, roughness):
    """Covariance (xx, xy, yy) of a point that a motion has moved, (px, py) from the sensor."""
    rough = roughness * roughness
    return (
        rough + spread[0, 0] - py * (spread[0, 2] + spread[2, 0]) + py * py * spread[2, 2],
        spread[0, 1] + px * spread[0, 2] - py * spread[2, 1] - px * py * spread[2, 2],
        rough + spread[1, 1] + px * (spread[1, 2] + spread[2, 1]) + px * px * spread[2, 2],
    )


@helper
def _square(p, q, pp, pq, qq):
    """e'S⁻¹e of e = (p, q); inf if S is not known."""
    determinant = pp * qq - pq * pq
    square = (qq * p * p - 2.0 * pq * p * q + pp * q * q) / determinant
    return square if determinant > 0.0 and math.isfinite(square) else math.inf
