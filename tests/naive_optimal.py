"""Slow twin of method optimal: whole runs, from the noise to what is measured.

Steps are written from the docstrings of the kernels, whose constants are taken as they stand.
"""

from __future__ import annotations

import math

import numpy as np
from naive import polar
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
from naive_optimal_arcs import find_arcs, fit_arc
from naive_optimal_clusters import clusters, within_reach, without_spikes
from naive_optimal_joining import join
from naive_optimal_noise import first_noise, refined_noise, wall_unevenness
from naive_optimal_pieces import (
    Points,
    agglomerate,
    drop_crooked,
    drop_radial,
    drop_round,
    excess,
    move_borders,
    part_again,
    settle,
    straighten,
    stretches,
)

from lineament.kernels import line_fit, optimal
from lineament.methods.optimal import PARTS


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


def cut_roughly(points, classes, method, parts):
    """Pieces of each class by merging, and parted again."""
    cut = []
    for span in classes:
        pieces = agglomerate(points, stretches(*span), optimal._FIRST_SHARE * method.evidence)
        if "borders" in parts:
            pieces = move_borders(points, pieces, optimal._MARGIN)
        pieces = agglomerate(points, pieces, method.evidence)
        cut.append(part_again(points, pieces, method.evidence))
    return cut


def settled(points, classes, cut, method, parts):
    """Pieces that are left of each class, and arcs."""
    kept, arcs = [], []
    for span, pieces in zip(classes, cut, strict=True):
        pieces = settle(points, pieces, method.evidence, parts)
        if "arcs" in parts:
            pieces, more = find_arcs(points, span, pieces, method.evidence)
            arcs += more
        if "straightening" in parts:
            pieces = drop_crooked(points, straighten(points, pieces))
        kept.append(drop_round(points, pieces))
    return kept, arcs


def optimal_features(scan, method, given=None):
    """All of the method, without a budget of vertices."""
    parts, scan = set(PARTS) - set(method.without), within_reach(scan)
    noise = given or first_noise(scan, "growth" in parts)
    reach = 2 * optimal._STEEPEST * scan.angle_increment if "spikes" in parts else -math.inf
    ranges = without_spikes(scan, noise, reach)
    found = clusters(scan, ranges, noise, method.max_missing)
    beams = [b for members in found.classes for b in members]
    classes = []
    for members in found.classes:
        start = classes[-1][1] + 1 if classes else 0
        classes.append((start, start + len(members) - 1))
    points = Points(polar(ranges, scan.angles)[beams], beams, noise)
    cut = cut_roughly(points, classes, method, parts)
    if given is None and beams:
        noise = refined_noise(points, [piece for pieces in cut for piece in pieces])
        points = Points(points.xy, beams, noise)
    rough = points
    if "unevenness" in parts and (uneven := wall_unevenness(points, cut)) > 0:
        rough = Points(points.xy, beams, noise, uneven)
    cut, arcs = settled(rough, classes, cut, method, parts)
    arcs = [fit_arc(points, *arc["span"]) or arc for arc in arcs]
    cut = [drop_radial(points, pieces) for pieces in cut]
    points = points.decided_by(rough.noise)
    joined, classes, found.closed = join(
        points, classes, cut, arcs, scan.angle_increment, found.closed
    )
    found.classes = [beams[a : b + 1] for a, b in classes]
    labels = found.labels(len(scan))
    if found.closed:
        labels[found.classes[-1]] = 0
    points = points.decided_by(noise)
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
