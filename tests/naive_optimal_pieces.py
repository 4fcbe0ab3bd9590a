"""Slow twin of how method optimal cuts a class into pieces: least squares anew for every stretch.

Pieces are lists of (first point, last point). Constants are those of the kernels: they are tuned,
and what is compared is the way.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from naive_fit import range_variance

from lineament.kernels import agglomeration, borders, line_fit, optimal, sifting, unevenness
from lineament.kernels import straightening as bowing


@dataclass
class Points:
    """Points of a scan in the order of its classes.

    `noise` is (sigma, proportional, 0, quantum). Walls are `uneven`, a variance that is added to
    that of the noise, and what is off a line costs more.
    """

    xy: np.ndarray
    beams: list[int]
    noise: tuple[float, ...]
    uneven: float = 0.0
    lines: dict = field(default_factory=dict)

    def __post_init__(self):
        self.rho = np.hypot(*self.xy.T)
        self.noise = (math.sqrt(self.noise[0] ** 2 + self.uneven), *self.noise[1:])
        share = self.uneven / unevenness.MOST_UNEVEN**2
        self.price = optimal._PRICE * (1 + optimal._DEARER * share)
        self.arc_price = optimal._ARC_PRICE * (1 + optimal._ARC_DEARER * share)
        self.weight = self.rho**2 / range_variance(self.rho, self.noise)

    def decided_by(self, noise):
        """Return the points with the same lines, and another noise by which is decided."""
        other = copy(self)
        other.noise = noise
        return other

    def line(self, first, last):
        """(a, b) of the line a x + b y = 1 of least χ² through a stretch, and its χ²."""
        if (first, last) not in self.lines:
            self.lines[first, last] = self._fit(slice(first, last + 1))
        return self.lines[first, last]

    def _fit(self, span):
        xy, root = self.xy[span], np.sqrt(self.weight[span])
        rows = xy * root[:, np.newaxis]
        moments = rows.T @ rows
        if np.linalg.det(moments) <= 1e-13 * moments[0, 0] * moments[1, 1]:
            return np.zeros(2), 0.0
        ab = np.linalg.lstsq(rows, root, rcond=None)[0]
        return ab, float(((root - rows @ ab) ** 2).sum())

    def errors(self, ab, first, last, price=math.inf):
        """Squares of what points are off a line, in variances of their range; `price` at most."""
        span = slice(first, last + 1)
        return np.minimum(self.weight[span] * (1 - self.xy[span] @ ab) ** 2, price)

    def error(self, ab, i):
        return self.errors(ab, i, i)[0]


def stretches(first, last):
    n = last - first + 1
    parts = max(n // optimal._STRETCH, 1)
    edges = [first + n * j // parts for j in range(parts + 1)]
    return [(a, b - 1) for a, b in pairwise(edges)]


def agglomerate(points, pieces, evidence):
    """Merge the pairs that cost less than those beside them, and again."""
    pieces = list(pieces)
    own = [min(points.line(a, b)[1], agglomeration._GOOD * (b - a + 1)) for a, b in pieces]
    while True:
        joint = [points.line(a, d)[1] for (a, _), (_, d) in pairwise(pieces)]
        rises = [both - sum(own[k : k + 2]) for k, both in enumerate(joint)]
        around = [math.inf, *rises, math.inf]
        merged = [
            k
            for k, rise in enumerate(rises)
            if rise <= evidence and rise <= around[k] and rise < around[k + 2]
        ]
        if not merged:
            return pieces
        for k in reversed(merged):
            pieces[k : k + 2] = [(pieces[k][0], pieces[k + 1][1])]
            own[k : k + 2] = [joint[k]]


def part_again(points, pieces, evidence):
    """Part each piece, and its parts, where two lines explain it better by the evidence."""
    out, rest = [], list(pieces)
    while rest:
        a, b = piece = rest.pop(0)
        whole, keep = points.line(a, b)[1], agglomeration._LEAST
        parts = [((a, k - 1), (k, b)) for k in range(a + keep, b - keep + 2)]
        if parts and whole - (b - a + 1) > evidence:
            costs = [points.line(*one)[1] + points.line(*other)[1] for one, other in parts]
            k = next(k for k, cost in enumerate(costs) if cost <= min(costs) * (1 + 1e-12))
            if whole - costs[k] > evidence:
                rest[:0] = parts[k]
                continue
        out.append(piece)
    return out


def end_on(points, ab, inner, old, new, way):
    """Where a piece ends on its line, between `inner` and `new`, going to the right or left.

    It ended at `old`, and gains points until two in a row are off, or one far off.
    """

    def is_on(i):
        return points.error(ab, i) <= points.price

    end = min(old, new) if way == 1 else max(old, new)
    while end != inner and not is_on(end):
        end -= way
    for i in range(end + way, new + way, way):
        if is_on(i):
            end = i
        elif abs(i - end) == 2 or points.error(ab, i) > borders._GROSS * points.price:
            break
    return end


def best_border(before, after):
    """Where to part points whose costs on either side are given; the first of the best."""
    costs = [before[:k].sum() + after[k:].sum() for k in range(len(before) + 1)]
    least = min(costs)
    return next(k for k, cost in enumerate(costs) if cost <= least + 1e-9), least


def move_border(points, one, other, margin):
    (a, b), (c, d) = one, other
    keep = borders._LEAST
    low, high = max(a + keep, b + 1 - margin), min(d + 1 - keep, c + margin)
    if low > high:
        return one, other
    left, right = points.line(a, b)[0], points.line(c, d)[0]
    shift, _ = best_border(
        points.errors(left, low, high - 1, points.price),
        points.errors(right, low, high - 1, points.price),
    )
    at = low + shift
    return (
        (a, end_on(points, left, a + keep - 1, b, at - 1, 1)),
        (end_on(points, right, d + 1 - keep, c, at, -1), d),
    )


def dissolve(points, pieces, evidence):
    kept, rest = [], list(pieces)
    while rest:
        piece = rest.pop(0)
        small = piece[1] - piece[0] < optimal._SMALL and len(pieces) > 1
        if not (small and shared(points, kept, piece, rest, evidence)):
            kept.append(piece)
    return kept


def shared(points, kept, piece, rest, evidence):
    """Give the points of a piece to its neighbours, if they explain them as well."""
    a, b = piece
    nothing = np.full(b - a + 1, points.price)
    left = points.line(*kept[-1])[0] if kept else None
    right = points.line(*rest[0])[0] if rest else None
    # What ends before is no neighbour.
    goes_on = kept and end_on(points, left, kept[-1][1], kept[-1][1], a - 1, 1) >= a - 2
    comes_on = rest and end_on(points, right, rest[0][0], rest[0][0], b + 1, -1) <= b + 2
    shift, least = best_border(
        points.errors(left, a, b, points.price) if goes_on else nothing,
        points.errors(right, a, b, points.price) if comes_on else nothing,
    )
    if least > evidence + min(points.line(a, b)[1], nothing.sum()):
        return False
    if goes_on:
        first, last = kept[-1]
        kept[-1] = (first, end_on(points, left, last, last, a + shift - 1, 1))
    if comes_on:
        first, last = rest[0]
        rest[0] = (end_on(points, right, first, first, a + shift, -1), last)
    return True


def trimmed(points, piece):
    """Leave out up to two points at either end that the line through the others does not hold."""
    a, b = start, end = piece
    while b - a > borders._LEAST and a - start < borders._ENDS:
        if points.error(points.line(a + 1, b)[0], a) <= points.price:
            break
        a += 1
    while b - a > borders._LEAST and end - b < borders._ENDS:
        if points.error(points.line(a, b - 1)[0], b) <= points.price:
            break
        b -= 1
    return a, b


def move_borders(points, pieces, margin):
    pieces = list(pieces)
    for k in range(1, len(pieces)):
        pieces[k - 1 : k + 1] = move_border(points, *pieces[k - 1 : k + 1], margin)
    return pieces


def settle(points, pieces, evidence, parts):
    pieces = agglomerate(points, pieces, evidence)
    for _ in range(2):
        if "borders" in parts:
            pieces = move_borders(points, pieces, 3 * optimal._MARGIN)
        if "dissolving" in parts:
            pieces = dissolve(points, pieces, evidence)
            pieces = [trimmed(points, piece) for piece in pieces]
    return agglomerate(points, pieces, evidence)


def straighten(points, pieces):
    out = []
    for piece in pieces:
        out.append(piece)
        while len(out) > 1 and is_one_wall(points, *out[-2:]):
            out[-2:] = [(out[-2][0], out[-1][1])]
    return out


def is_one_wall(points, one, other):
    (start, i), (j, end) = one, other
    if j - i > bowing._BETWEEN + 1:
        return False
    xy, lines = points.xy, np.array([points.line(*one)[0], points.line(*other)[0]])
    norms = np.linalg.norm(lines, axis=1)
    if not norms.all():
        return False
    (n1, n2), distances = lines / norms[:, np.newaxis], 1 / norms
    if n1 @ n2 <= 0 or abs(np.linalg.det([n1, n2])) > bowing._SHALLOW:
        return False
    middle = (xy[i] + xy[j]) / 2
    step = abs((distances[0] - n1 @ middle) - (distances[1] - n2 @ middle))
    length = np.linalg.norm(xy[end] - xy[start])
    deviation = math.sqrt(range_variance(points.rho[i], points.noise))
    if step > max(min(bowing._STEP * length, bowing._FRAME), bowing._SIGMAS * deviation):
        return False
    most = math.hypot(bowing._MOST_BOW, deviation)
    return is_straight(points, (start, end), min(bowing._BOW * length, most))


def is_straight(points, piece, bow):
    """Whether points are off the line through them by at most `bow`, root mean square."""
    xy, (ab, _) = points.xy[piece[0] : piece[1] + 1], points.line(*piece)
    off = (1 - xy @ ab) / np.linalg.norm(ab)
    return math.sqrt(np.mean(off**2)) <= bow


def excess(chi_square, n):
    """What χ² has too much for noise alone, over its degrees of freedom."""
    free = n - 2
    if free < 1 or chi_square < free + line_fit.FAIR * math.sqrt(2 * free):
        return 0.0
    return chi_square / free - 1


def drop_crooked(points, pieces):
    """Leave out what is neither a line nor a wall that bows."""
    kept = []
    for a, b in pieces:
        bow = bowing._CROOKED * np.linalg.norm(points.xy[b] - points.xy[a])
        is_fair = not excess(points.line(a, b)[1], b - a + 1)
        if is_fair or is_straight(points, (a, b), bow):
            kept.append((a, b))
    return kept


def drop_round(points, pieces):
    """Leave out runs of pieces on a circle around the sensor."""
    kept, rest = [], list(pieces)
    while rest:
        a, b = rest[0]
        r = points.rho[(a + b) // 2]
        variance = range_variance(r, points.noise)
        near = [
            all(abs(points.rho[[a, (a + b) // 2, b]] - r) <= sifting._NEAR * math.sqrt(variance))
            for a, b in rest
        ]
        count = [*near, False].index(False)
        if count >= sifting._LEAST_PIECES and is_round(points, rest[:count]):
            rest = rest[count:]
        else:
            kept.append(rest.pop(0))
    return kept


def is_round(points, pieces):
    """Whether one range explains the readings of pieces."""
    rho = np.concatenate([points.rho[a : b + 1] for a, b in pieces])
    variance = range_variance(points.rho[pieces[0][0]], points.noise)
    return len(rho) * np.var(rho) < (2 * len(rho) + 12) * variance


def drop_radial(points, pieces):
    """Leave out pieces that may be along their beams: by the inverse of their normal matrix."""
    kept = []
    for a, b in pieces:
        ab, _ = points.line(a, b)
        if not ab.any():
            continue
        rows = points.xy[a : b + 1] * np.sqrt(points.weight[a : b + 1])[:, np.newaxis]
        # That the angle atan2(b, a) moves by, if a and b do.
        gradient = np.array([-ab[1], ab[0]]) / (ab @ ab)
        deviation = math.sqrt(gradient @ np.linalg.solve(rows.T @ rows, gradient))
        turn = math.asin(min(1 / np.linalg.norm(ab) / points.rho[(a + b) // 2], 1.0))
        few = b - a + 1 < sifting._FEW
        if deviation < sifting._VAGUE or (not few and turn > sifting._TURNS * deviation):
            kept.append((a, b))
    return kept
