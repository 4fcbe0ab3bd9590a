"""Slow twin of how method optimal joins neighbours at corners, and parts those that do not meet."""

from __future__ import annotations

import math

import numpy as np
from naive_fit import range_variance
from naive_optimal_pieces import excess

from lineament.kernels import joining, parting


def end_share(points, piece):
    """Variance of a piece's offset at its end, in variances of a reading."""
    n = piece[1] - piece[0] + 1
    return 4 / n + 4 * excess(points.line(*piece)[1], n)


def meet(points, one, other, step):
    """Whether two pieces meet between their readings, but for half a beam.

    Or for three deviations more, if they are less than six apart at their readings. If one is more
    than both are long together, they may meet anywhere.
    """
    lines = np.array([points.line(*piece)[0] for piece in (one, other)])
    norms = np.linalg.norm(lines, axis=1)
    sine = abs(np.linalg.det(lines)) / norms.prod() if norms.all() else 0.0
    if sine <= joining._LEAST_SINE:
        return False
    at = np.linalg.solve(lines, [1, 1])
    i, j = one[1], other[0]
    rho = (points.rho[i] + points.rho[j]) / 2
    # 1 is that of the reading at the border.
    share = 1 + end_share(points, one) + end_share(points, other)
    sigma = math.sqrt(range_variance(rho, points.noise) * share)
    ends = points.xy[[*one, *other]]
    if sigma / sine > np.linalg.norm(ends[1] - ends[0]) + np.linalg.norm(ends[3] - ends[2]):
        return False
    # Distances from the beams of both, positive between them.
    after = np.linalg.det([points.xy[i], at]) / points.rho[i]
    before = np.linalg.det([at, points.xy[j]]) / points.rho[j]
    outside = -min(after, before) - joining._MISSED * step * rho
    is_near = abs(gap(points, one, other)) <= joining._APART * sigma
    return points.xy[i] @ at > 0 and outside <= (3 * sigma / sine if is_near else 0)


def gap(points, one, other):
    """How far a piece is in front of the next where they come nearest; 0 where they cross."""
    i, j = one[1], other[0]
    difference = points.line(*one)[0] - points.line(*other)[0]
    here, there = (points.rho[k] * (points.xy[k] @ difference) for k in (i, j))
    return 0.0 if here * there <= 0 else min(here, there, key=abs)


def behind(points, piece, i):
    """How far a point is behind the line of a piece, along its beam."""
    inverse = points.line(*piece)[0] @ points.xy[i]
    return points.rho[i] * (1 - 1 / inverse) if inverse > 0 else -points.rho[i]


def face(points, piece, i, others):
    """Sine in which a face at right angles to a piece is seen, from point i as far as others."""
    ab, p = points.line(*piece)[0], points.xy[i]
    depth = max(0.0, *((points.xy[others] @ ab - 1) / (ab @ ab)))
    back = p + depth * ab
    way = 1 if others[0] > i else -1
    return way * np.linalg.det([p, back]) / (points.rho[i] * np.linalg.norm(back))


def parted_at(points, one, other, step):
    """Where the next class begins between pieces that do not meet; None if it goes on."""
    i, j = one[1], other[0]
    far = max(points.rho[i], points.rho[j])
    limit = parting.OFF * math.sqrt(range_variance(far, points.noise))
    if j == i + 1:
        front = gap(points, one, other)
        share = parting._SHARE + end_share(points, one) + end_share(points, other)
        nearer = (one, i, [j]) if front > 0 else (other, j, [i])
        if abs(front) <= limit * math.sqrt(share):
            return None
        return j if face(points, *nearer) <= parting._SWALLOWED * step else None
    between = range(i + 1, j)
    seen = parting._SEEN * step
    before = behind(points, one, i + 1) > limit and (face(points, one, i, [*between, j]) <= seen)
    after = behind(points, other, j - 1) > limit and (
        face(points, other, j, [*reversed(between), i]) <= seen
    )
    if not before and not after:
        front = [max(behind(points, piece, k) for piece in (one, other)) for k in between]
        before = after = sum(value < -limit for value in front) > 1
    if before and (not after or points.rho[i] <= points.rho[j]):
        return i + 1
    return j if after else None


def is_clear(points, arc, j, way):
    """Whether an arc is farther from its neighbour at j than that one's readings are apart."""
    spacing = np.linalg.norm(points.xy[j + way] - points.xy[j])
    deviation = math.sqrt(range_variance(points.rho[j], points.noise))
    clearance = np.linalg.norm(points.xy[j] - arc["center"]) - arc["radius"]
    return clearance > spacing + parting.OFF * deviation


def joined_piece(points, one, piece, step):
    """Response of the corner between neighbours, NaN for none, and where the next class begins."""
    if piece[0] - one[1] <= joining._BETWEEN + 1 and meet(points, one, piece, step):
        both = points.line(one[0], piece[1])[1]
        return both - points.line(*one)[1] - points.line(*piece)[1], None
    return math.nan, parted_at(points, one, piece, step)


def border(points, before, element, step):
    """Response of the corner between neighbours, NaN for none, and where the next class begins."""
    (one, arc_before), (span, arc) = before, element
    if arc:
        return math.nan, span[0] if is_clear(points, arc, one[1], -1) else None
    if arc_before:
        return math.nan, one[1] + 1 if is_clear(points, arc_before, span[0], 1) else None
    return joined_piece(points, one, span, step)


def join(points, classes, cut, arcs, step, closed):
    """Pieces with the piece before that a corner joins them to, its response; classes anew."""
    joined, out = [], []
    for (start, end), pieces in zip(classes, cut, strict=True):
        elements = [(piece, None) for piece in pieces]
        elements += [(arc["span"], arc) for arc in arcs if start <= arc["span"][0] <= end]
        elements.sort(key=lambda element: element[0])
        for k, element in enumerate(elements):
            response, at = border(points, elements[k - 1], element, step) if k else (math.nan, None)
            if element[1] is None:
                before = -1 if math.isnan(response) else len(joined) - 1
                joined.append({"piece": element[0], "before": before, "response": response})
            if at is not None:
                out.append((start, at - 1))
                start = at
        out.append((start, end))
    if closed and len(joined) > 2:
        closed = closes(points, joined, step)
    return joined, out, closed


def closes(points, joined, step):
    """Join the last piece of a ring to the first; whether nothing parts them."""
    one, other = joined[-1]["piece"], joined[0]["piece"]
    if meet(points, one, other, step):
        joined[0] |= {"before": len(joined) - 1, "response": math.inf}
        return True
    deviation = math.sqrt(range_variance(points.rho[other[0]], points.noise))
    return abs(gap(points, one, other)) <= parting.OFF * deviation
