"""The motion between two frames, by weighted least squares over matched features."""

import math

from .. import helper, kernel
from ..arrays import Floats1, Floats2, Floats3, Ints1, Ints2, Shorts2
from .association import Tracked, turned
from ...features import records as at
from .residuals import ERROR, FEIGNED, INFORMATION, JACOBIAN, SQUARE, fill_residuals
from .symmetric import diagonalise, invert

#: What it returns for a bad prior or bad pairs.
NOT_POSITIVE, NOT_THERE = -1, -2
#: A direction that the features show with a larger deviation than this counts as unobserved [m].
_KNOWN = 0.1
#: What the errors of the walls' own directions feign is this many deviations at most.
_FEIGNED = 3.0
_ROUNDS, _SMALL = 20, 1e-7


@kernel
def estimate_motion(
    before: Tracked,
    now: Tracked,
    sides: Shorts2,
    pairs: tuple[Ints2, Ints2, Ints2],
    prior: tuple[float, float, float],
    spread: Floats2,
    roughness: float,
    quantiles: tuple[float, float],
    scratch: tuple[Floats3, Floats2, Floats2, Floats1, Ints1],
    found: Floats3,
) -> int:
    """Estimate a motion by Gauss-Newton.

    Parameters
    ----------
    before, now : (segments, corners, arcs)
        Words of the features (see `records`), each in its sensor's frame.
    sides : int32 array, shape (number of later corners, 2)
        Indices of the segments between which the later corners are.
    pairs : (segments, corners, arcs)
        int64 arrays of shape (m, 2): which is which.
    prior : (x, y, theta)
        The motion as known before.
    spread : float64 array, shape (3, 3)
        Covariance of the prior.
    roughness : float
        How far surfaces are from straight and round [m].
    quantiles : (float, float)
        Of e'Σ⁻¹e: beyond the first, pairs count less; the second is the median.
    scratch : (float64 arrays, int64 array)
        Of shape (5, 3, 3); (3, 3); (pairs, COLUMNS); (pairs,); zeros, one for each later segment.
    found : float64 array, shape (3, 3, 3)
        Written: the motion in the first row of all, its covariance, and by row the directions
        that are not observed.

    Returns
    -------
    int
        The number of directions that are not observed; NOT_POSITIVE if `spread` is not positive
        definite, NOT_THERE if pairs name features that are not there.
    """
    matrices, vectors, rows, squares, counted = scratch
    known, information, feigned = matrices[0], matrices[1], matrices[2]
    total, kept = matrices[3], matrices[4]
    scale, gradient, off = vectors[0], vectors[1], vectors[2]
    state, covariance, directions = found[0, 0], found[1], found[2]
    if not invert(spread, known):
        return NOT_POSITIVE
    if not _are_there(before, now, pairs):
        return NOT_THERE
    for k in range(3):
        state[k], scale[k] = prior[k], 1.0
    scale[2] = _distance(now, pairs)
    lost = 0
    for _ in range(_ROUNDS):
        n = fill_residuals(before, now, sides, pairs, counted, state, roughness, rows)
        _add_up(rows, n, _limit(rows, n, squares, quantiles), information, gradient, feigned)
        lost = _unobserved(information, feigned, scale, total, kept, directions)
        # Nothing is taken from the features in directions that they do not show.
        _project(directions, lost, scale, kept)
        for k in range(3):
            off[k] = state[k] - prior[k]
        off[2] = turned(off[2])
        _normal_equations(information, gradient, kept, known, off, total)
        invert(total, covariance)
        if _step(covariance, off, state) < _SMALL:
            break
    return lost


@helper
def _are_there(before, now, pairs):
    """Whether all pairs name features of the two scans."""
    for kind in range(3):
        for k in range(len(pairs[kind])):
            i, j = pairs[kind][k, 0], pairs[kind][k, 1]
            if not (0 <= i < len(before[kind]) and 0 <= j < len(now[kind])):
                return False
    return True


@helper
def _distance(now, pairs):
    """Root of the mean squared distance of what was matched, 1 m at least [m]."""
    total, count = 0.0, 0
    for kind in range(3):
        table, place = now[kind], (at.S_CENTROID, at.C_POSITION, at.A_CENTER)[kind]
        for k in range(len(pairs[kind])):
            row = table[pairs[kind][k, 1]]
            total += row[place] ** 2 + row[place + 1] ** 2
            count += 1
    return max(1.0, math.sqrt(total / max(count, 1)))


@helper
def _limit(rows, n, squares, quantiles):
    """Square from which on pairs count less.

    Far from the solution all are far off: what counts is which are more so than others.
    """
    count = 0
    for k in range(n):
        square = rows[k, SQUARE]
        if square > 0.0:
            at = count
            while at > 0 and squares[at - 1] > square:
                squares[at] = squares[at - 1]
                at -= 1
            squares[at] = square
            count += 1
    if count == 0:
        return quantiles[0]
    median = 0.5 * (squares[(count - 1) // 2] + squares[count // 2])
    return quantiles[0] * max(1.0, median / quantiles[1])


@helper
def _add_up(rows, n, limit, information, gradient, feigned):
    """Information (3, 3), gradient (3,), and information that is feigned (3, 3) of all pairs."""
    for i in range(3):
        gradient[i] = 0.0
        for j in range(3):
            information[i, j], feigned[i, j] = 0.0, 0.0
    for k in range(n):
        row = rows[k]
        weight = limit / max(row[SQUARE], limit)
        xx, xy, yy = row[INFORMATION], row[INFORMATION + 1], row[INFORMATION + 2]
        for i in range(3):
            p, q = row[JACOBIAN + i], row[JACOBIAN + 3 + i]
            x, y = weight * (p * xx + q * xy), weight * (p * xy + q * yy)
            gradient[i] += x * row[ERROR] + y * row[ERROR + 1]
            for j in range(3):
                information[i, j] += x * row[JACOBIAN + j] + y * row[JACOBIAN + 3 + j]
                feigned[i, j] += weight * row[FEIGNED + i] * row[FEIGNED + j]


@helper
def _unobserved(information, feigned, scale, scaled, vectors, directions):
    """List the directions of which the information says nothing, in scaled units; their number.

    `scaled` and `vectors` are scratch, shape (3, 3).
    """
    for i in range(3):
        for j in range(3):
            scaled[i, j] = information[i, j] / (scale[i] * scale[j])
    diagonalise(scaled, vectors)
    lost = 0
    for k in range(3):
        seeming = 0.0
        for i in range(3):
            for j in range(3):
                seeming += vectors[i, k] * feigned[i, j] * vectors[j, k] / (scale[i] * scale[j])
        if scaled[k, k] <= 1.0 / (_KNOWN * _KNOWN) + _FEIGNED * _FEIGNED * seeming:
            for i in range(3):
                directions[lost, i] = vectors[i, k]
            lost += 1
    return lost


@helper
def _project(directions, lost, scale, kept):
    """Fill the projection that leaves nothing of the directions."""
    for i in range(3):
        for j in range(3):
            kept[i, j] = 1.0 if i == j else 0.0
            for k in range(lost):
                kept[i, j] -= directions[k, i] * directions[k, j] * scale[j] / scale[i]


@helper
def _normal_equations(information, gradient, kept, known, off, total):
    """Fill the information in all, of the features and the prior; its gradient is put in `off`."""
    p, q, r = off[0], off[1], off[2]
    for i in range(3):
        off[i] = known[i, 0] * p + known[i, 1] * q + known[i, 2] * r
        for j in range(3):
            off[i] += kept[j, i] * gradient[j]
            total[i, j] = known[i, j]
            for k in range(3):
                for m in range(3):
                    total[i, j] += kept[k, i] * information[k, m] * kept[m, j]


@helper
def _step(covariance, gradient, state):
    """Take a step down the gradient; its largest part."""
    largest = 0.0
    for k in range(3):
        change = 0.0
        for m in range(3):
            change -= covariance[k, m] * gradient[m]
        state[k] += change
        largest = max(largest, abs(change))
    return largest
