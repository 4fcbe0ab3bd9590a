"""How far matched features are from each other under a motion, by kind, with its derivatives."""

import math

from .. import helper
from .association import (
    offset_spread,
    rotated,
    rough_variances,
    segment_length,
    side_by_side,
    turned,
)
from ...features import records as at

#: Where a row of the table of pairs has two errors e; their derivatives J by (x, y, theta) of the
#: motion, shape (2, 3); their information Σ⁻¹ as (xx, xy, yy), singular where only a part of them
#: counts; how many deviations of its offset a segment seems to change by, with each part of the
#: motion, because its direction is off by one deviation (0 of corners and arcs); and e'Σ⁻¹e.
ERROR, JACOBIAN, INFORMATION, FEIGNED, SQUARE = 0, 2, 8, 11, 14
COLUMNS = 15
#: Segments whose direction is known worse than this are too short to show a motion [rad].
_DIRECTED = 0.1


@helper
def fill_residuals(before, now, sides, pairs, counted, motion, roughness, rows):
    """Fill a row of `rows` for each pair, of segments first, then corners and arcs.

    `sides` says between which segments the later corners are; `counted`, which is filled too, of
    each later segment whether it is in a pair that counts. A pair whose covariance is not known
    does not.
    """
    c, s = math.cos(motion[2]), math.sin(motion[2])
    n = 0
    for k in range(len(pairs[0])):
        i, j = pairs[0][k, 0], pairs[0][k, 1]
        # One that shows no motion leaves it to its corners.
        counted[j] = _of_segments(before[0][i], now[0][j], motion, c, s, roughness, rows[n])
        n += 1
    for k in range(len(pairs[1])):
        i, j = pairs[1][k, 0], pairs[1][k, 1]
        a, b = before[1][i], now[1][j]
        _of_points(a, b, at.C_POSITION, at.C_COVARIANCE, 2, motion, c, s, roughness, rows[n])
        _leave_known(now[0], sides, j, counted, motion[2], rows[n])
        n += 1
    for k in range(len(pairs[2])):
        i, j = pairs[2][k, 0], pairs[2][k, 1]
        a, b = before[2][i], now[2][j]
        _of_points(a, b, at.A_CENTER, at.A_COVARIANCE, 3, motion, c, s, roughness, rows[n])
        n += 1
    for k in range(n):
        p, q = rows[k, ERROR], rows[k, ERROR + 1]
        xx, xy, yy = rows[k, INFORMATION], rows[k, INFORMATION + 1], rows[k, INFORMATION + 2]
        rows[k, SQUARE] = xx * p * p + 2.0 * xy * p * q + yy * q * q
    return n


@helper
def _of_segments(a, b, motion, c, s, roughness, row):
    """Offset of the later centroid from the earlier line, and the angle between; if it counts, 1.

    The misfit of a wall is the same in both frames, so far as both saw the same of it: it counts by
    the part that one of them saw alone.
    """
    tx, ty = math.cos(a[at.S_ANGLE]), math.sin(a[at.S_ANGLE])
    px, py = b[at.S_CENTROID], b[at.S_CENTROID + 1]
    px, py = c * px - s * py, s * px + c * py
    ax, ay = px + motion[0] - a[at.S_CENTROID], py + motion[1] - a[at.S_CENTROID + 1]
    length = segment_length(a)
    # Ends of the later segment along the earlier one.
    ux, uy = c * tx + s * ty, c * ty - s * tx
    begin = (motion[0] - a[at.S_START]) * tx + (motion[1] - a[at.S_START + 1]) * ty
    first = begin + ux * b[at.S_START] + uy * b[at.S_START + 1]
    last = begin + ux * b[at.S_END] + uy * b[at.S_END + 1]
    shared, union = side_by_side(length, first, last)
    alone = 1.0 - max(shared / union, 0.0)
    # The offset of the earlier line is asked for where the later one has its centroid.
    oo, oa, aa = offset_spread(a, ax * tx + ay * ty)
    other_oo, other_oa, other_aa = offset_spread(b, 0.0)
    oo, oa, aa = oo + other_oo, oa + other_oa, aa + other_aa
    shorter = min(length, segment_length(b))
    of_offset, of_angle = rough_variances(shorter, roughness)
    bow = alone * (a[at.S_MISFIT] * a[at.S_MISFIT] + b[at.S_MISFIT] * b[at.S_MISFIT])
    oo, aa = oo + of_offset + bow, aa + of_angle + 12.0 * bow / (shorter * shorter)
    for k in range(COLUMNS):
        row[k] = 0.0
    determinant = oo * aa - oa * oa
    if aa > _DIRECTED * _DIRECTED or not determinant > 0.0:
        return 0
    turn = turned(b[at.S_ANGLE] + motion[2] - a[at.S_ANGLE])
    row[ERROR], row[ERROR + 1] = ay * tx - ax * ty, turn
    row[JACOBIAN], row[JACOBIAN + 1], row[JACOBIAN + 2] = -ty, tx, tx * px + ty * py
    row[JACOBIAN + 5] = 1.0
    row[INFORMATION] = aa / determinant
    row[INFORMATION + 1] = -oa / determinant
    row[INFORMATION + 2] = oo / determinant
    slope = math.sqrt(aa / oo)
    row[FEIGNED], row[FEIGNED + 1] = slope * tx, slope * ty
    row[FEIGNED + 2] = slope * (px * ty - py * tx)
    return 1


@helper
def _of_points(a, b, place, covariance, size, motion, c, s, roughness, row):
    """Distance of two points, whose covariances are the first of so many rows and columns."""
    px, py = c * b[place] - s * b[place + 1], s * b[place] + c * b[place + 1]
    below, last = covariance + size, covariance + size + 1
    xx, xy, yy = rotated(b[covariance], b[covariance + 1], b[below], b[last], c, s)
    xx += a[covariance] + roughness * roughness
    xy += a[covariance + 1]
    yy += a[last] + roughness * roughness
    for k in range(COLUMNS):
        row[k] = 0.0
    determinant = xx * yy - xy * xy
    if not determinant > 0.0:
        return
    row[ERROR], row[ERROR + 1] = px + motion[0] - a[place], py + motion[1] - a[place + 1]
    row[JACOBIAN] = row[JACOBIAN + 4] = 1.0
    row[JACOBIAN + 2], row[JACOBIAN + 5] = -py, px
    row[INFORMATION], row[INFORMATION + 1] = yy / determinant, -xy / determinant
    row[INFORMATION + 2] = xx / determinant


@helper
def _leave_known(segments, sides, j, counted, turn, row):
    """Leave out of a corner what its segments say that count: it is where they meet."""
    matches, angle = 0, 0.0
    for side in range(2):
        segment = sides[j, side]
        if 0 <= segment < len(counted) and counted[segment]:
            matches += 1
            if matches == 1:
                angle = segments[segment, at.S_ANGLE] + turn
    if matches == 0:
        return
    # What remains is the place along the one of them, if it is one: u u' / u'Σu.
    x, y = math.cos(angle), math.sin(angle)
    xx, xy, yy = row[INFORMATION], row[INFORMATION + 1], row[INFORMATION + 2]
    determinant = xx * yy - xy * xy
    along = (x * x * yy - 2.0 * x * y * xy + y * y * xx) / determinant
    known = 1.0 / along if matches == 1 and determinant > 0.0 else 0.0
    row[INFORMATION], row[INFORMATION + 1] = known * x * x, known * x * y
    row[INFORMATION + 2] = known * y * y
