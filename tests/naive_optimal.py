"""Slow twin of method optimal: whole runs, from the noise to what is measured.

Steps are written from the docstrings of the kernels, whose constants are taken as they stand.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from naive import Clusters, polar, valid
from naive_fit import (
    along,
    breakpoints,
    fit_line,
    intersection,
    normal_variances,
    opening_and_side,
    principal_line,
    range_variance,
)
from naive_optimal_arcs import find_arcs
from naive_optimal_noise import first_noise, refined_noise
from naive_optimal_pieces import (
    Points,
    agglomerate,
    drop_crooked,
    excess,
    move_borders,
    settle,
    straighten,
    stretches,
)

from lineament import LaserScan
from lineament.kernels import joining, line_fit, optimal, spikes
from lineament.methods.optimal import PARTS


def within_reach(scan):
    """Leave out what no scanner reports."""
    nearest, farthest = (
        max(scan.range_min, optimal._NEAREST),
        min(scan.range_max, optimal._FARTHEST),
    )
    limits = {"range_min": nearest, "range_max": farthest}
    if scan.is_regular:
        return LaserScan(scan.ranges, scan.angle_min, scan.angle_increment, **limits)
    return LaserScan(scan.ranges, angles=scan.angles, **limits)


# Clusters


def without_spikes(scan, noise, reach):
    """Ranges, NaN where they are not valid or stand alone on a surface that goes on."""
    ok, r = valid(scan), scan.ranges
    kept = np.where(ok, r, np.nan)
    for i in range(1, len(scan) - 1):
        if not (ok[i - 1] and ok[i] and ok[i + 1]):
            continue
        apart, deviation = abs(r[i - 1] - r[i + 1]), math.sqrt(range_variance(r[i], noise))
        off = abs(r[i] - (r[i - 1] + r[i + 1]) / 2)
        agree = apart <= reach * min(r[i - 1], r[i + 1]) + 4 * deviation
        if agree and off > spikes._OFF * deviation + apart / 2:
            kept[i] = np.nan
    return kept


def clusters(scan, ranges, noise, max_missing):
    """Classes of neighbours; that of a closed ring ends with its first beam."""
    points, n, out = polar(ranges, scan.angles), len(scan), Clusters()
    beams = [i for i in range(n) if not math.isnan(ranges[i])]

    def joins(before, b):
        if (b - before - 1) % n > max_missing:
            return False
        near, far = sorted((ranges[before], ranges[b]))
        step = scan.angles[b] - scan.angles[before]
        floor = optimal._FLOOR * math.sqrt(2 * range_variance(far, noise))
        limit = optimal._STEEPEST * near * abs(math.sin(step)) + floor
        return np.linalg.norm(points[b] - points[before]) <= limit

    classes = [beams[:1]]
    for before, b in pairwise(beams):
        if joins(before, b):
            classes[-1].append(b)
        else:
            classes.append([b])
    if scan.is_full_circle and len(beams) >= 3 and joins(beams[-1], beams[0]):
        out.closed = len(classes) == 1
        if not out.closed:
            classes = [classes[-1] + classes[0], *classes[1:-1]]
    out.classes = [members for members in classes if len(members) >= 3]
    if out.closed:
        turn = int(np.argmax(ranges[beams]))
        out.classes = [beams[turn:] + beams[:turn]]
    return out


# Corners


def end_share(points, piece):
    """Variance of a piece's offset at its end, in variances of a reading."""
    n = piece[1] - piece[0] + 1
    return 4 / n + 4 * excess(points.line(*piece)[1], n)


def meet(points, one, other, step):
    """Whether two pieces meet between their readings, but for a beam and three deviations."""
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
    deviation = math.sqrt(range_variance(rho, points.noise) * share) / sine
    tolerance = step * rho + 3 * deviation
    # Distances from the beams of both, positive between them.
    after = np.linalg.det([points.xy[i], at]) / points.rho[i]
    before = np.linalg.det([at, points.xy[j]]) / points.rho[j]
    return points.xy[i] @ at > 0 and min(after, before) > -tolerance


def touch(points, one, other):
    """Whether the readings next to a border are no farther apart than those within a piece."""
    i, j, beams = one[1], other[0], points.beams
    apart, before, after = (
        np.linalg.norm(points.xy[b] - points.xy[a]) / max(beams[b] - beams[a], 1)
        for a, b in ((i, j), (i - 1, i), (j, j + 1))
    )
    deviation = math.sqrt(range_variance(points.rho[[i, j]].max(), points.noise))
    floor = 3 * deviation / max(beams[j] - beams[i], 1)
    return apart <= joining._APART * max(before, after) + floor


def join(points, classes, cut, step, closed):
    """Pieces with the piece before that a corner joins them to, its response; classes anew."""
    joined, out = [], []
    for (start, end), pieces in zip(classes, cut, strict=True):
        base = len(joined)
        for k, piece in enumerate(pieces):
            joined.append({"piece": piece, "before": -1, "response": math.nan})
            if k == 0 or piece[0] - pieces[k - 1][1] > joining._BETWEEN + 1:
                continue
            one, both = pieces[k - 1], points.line(pieces[k - 1][0], piece[1])[1]
            if meet(points, one, piece, step):
                rise = both - points.line(*one)[1] - points.line(*piece)[1]
                joined[-1] |= {"before": base + k - 1, "response": rise}
            elif not touch(points, one, piece):
                out.append((start, piece[0] - 1))
                start = piece[0]
        if closed and len(pieces) > 2 and meet(points, pieces[-1], pieces[0], step):
            joined[base] |= {"before": len(joined) - 1, "response": math.inf}
        out.append((start, end))
    return joined, out


# Measuring


def refined_line(points, piece, bearings, cuts):
    """Maximum likelihood with the weights of the line that is known; what is far off is out.

    What χ² has too much is put down to the wall, that bows as a few parts. A cut at a corner is
    chosen by the same readings, and costs some.
    """
    first, last = piece
    span, noise = slice(first, last + 1), points.noise
    xy, rho = points.xy[span], points.rho[span]
    (a, b), chi_square = points.line(first, last)
    normal, distance = np.array([a, b]) / math.hypot(a, b), 1 / math.hypot(a, b)
    angle, middle = math.atan2(-a, b), points.rho[(first + last) // 2]
    cosine = min(distance / middle, 1.0)
    uneven = excess(chi_square, len(xy)) * range_variance(middle, noise) * cosine**2
    variances = normal_variances(angle, bearings, rho, noise) + uneven
    near = (xy @ normal - distance) ** 2 <= line_fit.FAR_OFF * variances
    if not near.any():
        return fit_line(xy, bearings, rho, noise, "weighted")
    weights = near / variances
    centroid, angle = principal_line(xy, weights)
    u = np.array([math.cos(angle), math.sin(angle)])
    if u @ (xy[-1] - xy[0]) < 0:
        u, angle = -u, math.remainder(angle + math.pi, 2 * math.pi)
    t, e = (xy - centroid) @ u, (xy - centroid) @ [-u[1], u[0]]
    total, spread, common = weights.sum(), weights @ t**2, uneven / line_fit.BOWS
    scale = 1 + line_fit.CUT * cuts / len(xy)
    # No angle is less known than one that may be any.
    var_angle = min(scale * (1 + common * total) / spread, math.pi**2 / 12)
    return {
        "centroid": centroid,
        "angle": angle,
        "covariance": np.diag([scale * (1 / total + common), var_angle]),
        "rms": math.sqrt(weights @ e**2 / total),
    }


def measured(points, joined, labels, angles):
    """Segments and corners as records."""
    segments, corners, beams = [], [], points.beams
    for k, own in enumerate(joined):
        first, last = own["piece"]
        cuts = (own["before"] >= 0) + sum(other["before"] == k for other in joined)
        line = refined_line(points, own["piece"], angles[beams[first : last + 1]], cuts)
        line |= {"first_beam": beams[first], "last_beam": beams[last], "n_points": last - first + 1}
        line |= {"start": along(line, points.xy[first]), "end": along(line, points.xy[last])}
        segments.append(line | {"cluster": labels[beams[first]]})
    for k, own in enumerate(joined):
        if own["before"] < 0:
            continue
        a, b, at = segments[own["before"]], segments[k], own["piece"][0]
        opening, convex = opening_and_side(a["angle"], b["angle"])
        corner = {"beam": beams[at], "segments": (own["before"], k), "response": own["response"]}
        corner |= {"opening": opening, "convex": convex}
        position, covariance = intersection(a, b, points.xy[at], math.inf)
        a["end"] = b["start"] = position
        corners.append(corner | {"position": position, "covariance": covariance})
    return segments, corners


def optimal_features(scan, method, given=None):
    """All of the method, without a budget of vertices."""
    parts, scan = set(PARTS) - set(method.without), within_reach(scan)
    noise = given or first_noise(scan, "growth" in parts)
    reach = 2 * optimal._STEEPEST * scan.angle_increment if "spikes" in parts else -math.inf
    ranges = without_spikes(scan, noise, reach)
    found = clusters(scan, ranges, noise, method.max_missing)
    beams = [b for members in found.classes for b in members]
    points = Points(polar(ranges, scan.angles)[beams], beams, noise)
    classes, cut = [], []
    for members in found.classes:
        start = classes[-1][1] + 1 if classes else 0
        classes.append((start, start + len(members) - 1))
        pieces = stretches(*classes[-1])
        pieces = agglomerate(points, pieces, optimal._FIRST_SHARE * method.evidence)
        if "borders" in parts:
            pieces = move_borders(points, pieces, optimal._MARGIN)
        cut.append(agglomerate(points, pieces, method.evidence))
    if given is None and beams:
        noise = refined_noise(points, [piece for pieces in cut for piece in pieces])
        points = Points(points.xy, beams, noise)
    arcs = []
    for c, pieces in enumerate(cut):
        pieces = settle(points, pieces, method.evidence, parts)
        if "arcs" in parts:
            pieces, more = find_arcs(points, pieces, method.evidence)
            arcs += more
        if "straightening" in parts:
            pieces = drop_crooked(points, straighten(points, pieces))
        cut[c] = pieces
    joined, classes = join(points, classes, cut, scan.angle_increment, found.closed)
    found.classes = [beams[a : b + 1] for a, b in classes]
    labels = found.labels(len(scan))
    segments, corners = measured(points, joined, labels, scan.angles)
    xy = polar(ranges, scan.angles)
    return {
        "noise": noise,
        "clusters": labels,
        "segments": segments,
        "corners": corners,
        "arcs": arcs,
        "breakpoints": breakpoints(scan, found, ranges, xy, method.max_missing),
    }
