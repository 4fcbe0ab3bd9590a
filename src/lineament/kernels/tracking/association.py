"""Features of two frames compared pair by pair, and paired one to one."""

import math

from .. import helper, kernel
from ..arrays import Bytes1, Floats2, Ints1, Ints2
from .assignment import OWNER, assign
from ...features import records as at

#: Words of segments, corners and arcs, a row each (see `records`).
Tracked = tuple[Floats2, Floats2, Floats2]

#: Length over which a surface, or a sensor, is off by the same [m].
_PATCH = 0.3
#: Share of the shorter of two segments along which they must lie side by side.
_OVERLAP = 0.5
#: No segment counts as shorter [m].
_LEAST_LENGTH = 2.220446049250313e-16


@kernel
def move(
    segments: Floats2,
    corners: Floats2,
    arcs: Floats2,
    x: float,
    y: float,
    theta: float,
):
    """Move the words of features (see `records`) by a pose, and their covariances with them."""
    c, s = math.cos(theta), math.sin(theta)
    for k in range(len(segments)):
        row = segments[k]
        for place in (at.S_START, at.S_END, at.S_CENTROID):
            p, q = row[place], row[place + 1]
            row[place], row[place + 1] = c * p - s * q + x, s * p + c * q + y
        row[at.S_ANGLE] = turned(row[at.S_ANGLE] + theta)
    for k in range(len(corners)):
        _move_point(corners[k], at.C_POSITION, at.C_COVARIANCE, 2, c, s, x, y)
    for k in range(len(arcs)):
        row = arcs[k]
        _move_point(row, at.A_CENTER, at.A_COVARIANCE, 3, c, s, x, y)
        a, b = row[at.A_COVARIANCE + 2], row[at.A_COVARIANCE + 5]
        row[at.A_COVARIANCE + 2], row[at.A_COVARIANCE + 5] = c * a - s * b, s * a + c * b
        a, b = row[at.A_COVARIANCE + 6], row[at.A_COVARIANCE + 7]
        row[at.A_COVARIANCE + 6], row[at.A_COVARIANCE + 7] = c * a - s * b, s * a + c * b


@helper
def _move_point(row, place, covariance, size, c, s, x, y):
    """Move a point, and the first two rows and columns of its covariance, of so many rows."""
    p, q = row[place], row[place + 1]
    row[place], row[place + 1] = c * p - s * q + x, s * p + c * q + y
    xx, xy = row[covariance], row[covariance + 1]
    yx, yy = row[covariance + size], row[covariance + size + 1]
    row[covariance], row[covariance + 1], row[covariance + size + 1] = rotated(xx, xy, yx, yy, c, s)
    row[covariance + size] = row[covariance + 1]


@kernel
def associate(
    before: Tracked,
    now: Tracked,
    sides: tuple[Bytes1, Bytes1],
    spread: Floats2,
    origin: tuple[float, float],
    roughness: float,
    gates: tuple[float, float],
    scratch: tuple[Floats2, Floats2, Ints2],
    owners: tuple[Ints1, Ints1, Ints1],
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
    scratch : (cost, floats, ints)
        Of m rows and n columns, 3 and n + 1, 3 and n + 1, for m later features of a kind and n of
        both frames.
    owners : (segments, corners, arcs)
        Written: for each earlier feature the later one, or -1.
    """
    cost = scratch[0]
    a, b = before[0], now[0]
    _forbid_all(cost, len(b), len(a), gates[0])
    for j in range(len(a)):
        _compare_segment(a[j], b, j, spread, origin, roughness, gates[0], cost)
    _assign(len(b), len(a), scratch, owners[0])
    a, b = before[1], now[1]
    _forbid_all(cost, len(b), len(a), gates[0])
    for i in range(len(b)):
        x, y = b[i, at.C_POSITION], b[i, at.C_POSITION + 1]
        xx, xy, yy = _point_spread(x - origin[0], y - origin[1], spread, roughness)
        for j in range(len(a)):
            if sides[0][j] == sides[1][i]:
                square = _square(
                    x - a[j, at.C_POSITION],
                    y - a[j, at.C_POSITION + 1],
                    xx + a[j, at.C_COVARIANCE] + b[i, at.C_COVARIANCE],
                    xy + a[j, at.C_COVARIANCE + 1] + b[i, at.C_COVARIANCE + 1],
                    yy + a[j, at.C_COVARIANCE + 3] + b[i, at.C_COVARIANCE + 3],
                )
                if square <= gates[0]:
                    cost[i, j] = square
    _assign(len(b), len(a), scratch, owners[1])
    a, b = before[2], now[2]
    _forbid_all(cost, len(b), len(a), gates[1])
    for i in range(len(b)):
        for j in range(len(a)):
            square = _compare_arcs(a[j], b[i], spread, origin, roughness)
            if square <= gates[1]:
                cost[i, j] = square
    _assign(len(b), len(a), scratch, owners[2])


@helper
def _forbid_all(cost, rows, columns, gate):
    """Fill costs where nothing is allowed but to stay alone: each row in a column for itself."""
    for i in range(rows):
        for j in range(columns + rows):
            cost[i, j] = math.inf
        cost[i, columns + i] = 2.0 * gate


@helper
def _assign(rows, columns, scratch, owner):
    """Write the later feature of each earlier one, or -1, at the least total cost."""
    cost, floats, ints = scratch
    assign(cost, rows, columns + rows, ints, floats)
    for j in range(columns):
        owner[j] = ints[OWNER, j]


@helper
def _compare_segment(a, now, j, spread, origin, roughness, gate, cost):
    """Fill the costs of the later segments with the j-th earlier one, where they are within."""
    tx, ty = math.cos(a[at.S_ANGLE]), math.sin(a[at.S_ANGLE])
    length = segment_length(a)
    for i in range(len(now)):
        b = now[i]
        turn = turned(b[at.S_ANGLE] - a[at.S_ANGLE])
        if not abs(turn) < 0.5 * math.pi:
            continue
        first = (b[at.S_START] - a[at.S_START]) * tx + (b[at.S_START + 1] - a[at.S_START + 1]) * ty
        last = (b[at.S_END] - a[at.S_START]) * tx + (b[at.S_END + 1] - a[at.S_START + 1]) * ty
        shared, union = side_by_side(length, first, last)
        shorter = min(length, segment_length(b))
        px, py = b[at.S_CENTROID] - origin[0], b[at.S_CENTROID + 1] - origin[1]
        xx, xy, yy = _point_spread(px, py, spread, roughness)
        slack = 2.0 * math.sqrt(tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy)
        if not shared + slack >= _OVERLAP * shorter:
            continue
        ax, ay = b[at.S_CENTROID] - a[at.S_CENTROID], b[at.S_CENTROID + 1] - a[at.S_CENTROID + 1]
        normal = (-ty, tx, tx * px + ty * py)
        of_offset, of_angle = rough_variances(shorter, roughness)
        oo, oa, aa = offset_spread(a, ax * tx + ay * ty)
        bow = a[at.S_MISFIT] * a[at.S_MISFIT] + b[at.S_MISFIT] * b[at.S_MISFIT]
        oo += b[at.S_COVARIANCE] + of_offset + bow
        oa += b[at.S_COVARIANCE + 1]
        aa += b[at.S_COVARIANCE + 3] + of_angle + 12.0 * bow / (shorter * shorter) + spread[2, 2]
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
    x, y = b[at.A_CENTER], b[at.A_CENTER + 1]
    p, q, r = x - a[at.A_CENTER], y - a[at.A_CENTER + 1], b[at.A_RADIUS] - a[at.A_RADIUS]
    xx, xy, yy = _point_spread(x - origin[0], y - origin[1], spread, roughness)
    xx += a[at.A_COVARIANCE] + b[at.A_COVARIANCE]
    xy += a[at.A_COVARIANCE + 1] + b[at.A_COVARIANCE + 1]
    yy += a[at.A_COVARIANCE + 4] + b[at.A_COVARIANCE + 4]
    xr = a[at.A_COVARIANCE + 2] + b[at.A_COVARIANCE + 2]
    yr = a[at.A_COVARIANCE + 5] + b[at.A_COVARIANCE + 5]
    rr = a[at.A_COVARIANCE + 8] + b[at.A_COVARIANCE + 8] + roughness * roughness
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
    length = math.hypot(row[at.S_END] - row[at.S_START], row[at.S_END + 1] - row[at.S_START + 1])
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
    both = row[at.S_COVARIANCE + 1] + row[at.S_COVARIANCE + 2]
    angle = row[at.S_COVARIANCE + 3]
    offset = row[at.S_COVARIANCE] + along * both + along * along * angle
    return offset, row[at.S_COVARIANCE + 1] + along * angle, angle


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
