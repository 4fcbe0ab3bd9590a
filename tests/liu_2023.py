"""The method of Liu et al. 2023 in NumPy, written from the text of the paper.

Y. Liu, L. Sui, P. Li, L. Zhang, Q. Wu, J. Du, Y. Liu, H. Yu, *Journal of Sensors* 2023, article
6991467. One part for each stage, with the numbers of its equations; nothing of `lineament` is used.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Paper:
    """The paper's numbers; what it leaves open is as ``docs/equations.md`` says."""

    sigma_d: float = 4.0
    sigma_r: float = 0.3
    half_width: int = 2  # open
    spacing_scale: float = 6.0  # open: λ
    noise_floor: float = 0.0  # added to T_d [m]; not in the paper
    density_k: float = 3.0  # open: k
    min_points: int = 3
    support_radius: int = 6
    threshold: float = 0.66
    response: str = "tangent"  # 22; open: others
    recursion: str = "both"  # open: "after" is step 7 to the letter
    ends: str = "truncated"  # open
    fit: str = "y_of_x"  # "slope_intercept" is equation 23 to the letter


# ----- Stage 1: equations 2 to 9, points and the bilateral filter.


def polar(ranges, bearings):
    """Points of ranges, shape (n, 2) (2, 3)."""
    with np.errstate(invalid="ignore"):  # of infinite ranges
        return np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])


def bilateral_filter(ranges, full, paper):
    """Average each range over its window, weighted by nearness in index and in range.

    Invalid ranges are NaN, have no weight, and stay NaN. A `full` circle wraps, if it is longer
    than half the window.
    """
    n = len(ranges)
    valid = np.isfinite(ranges)
    weighted, weights = np.zeros(n), np.zeros(n)
    wraps = full and n > paper.half_width
    for offset in range(-paper.half_width, paper.half_width + 1):
        neighbours = np.arange(n) + offset
        inside = wraps | ((neighbours >= 0) & (neighbours < n))
        neighbours %= max(n, 1)
        difference = ranges - ranges[neighbours]
        weight = np.exp(
            -(offset**2) / (2 * paper.sigma_d**2) - difference**2 / (2 * paper.sigma_r**2)
        )  # 5-8
        used = inside & valid & valid[neighbours]
        weighted[used] += (weight * ranges[neighbours])[used]
        weights[used] += weight[used]
    return np.divide(weighted, weights, out=np.full(n, np.nan), where=valid)  # 4, 9


# ----- Stage 2: equations 10 to 13, steps 3 and 4, adaptive clusters.


class Clusters(NamedTuple):
    """Beams of each cluster in order, and by beam the spacing d, and T_d, T_K where needed.

    A cluster over the seam of a full circle begins before the seam. One that goes all the way
    round is closed: it begins and ends with the same beam.
    """

    groups: list
    spacing: np.ndarray
    distance_threshold: np.ndarray
    density_threshold: np.ndarray

    @property
    def closed(self):
        """Whether one cluster goes all the way round."""
        return any(group[0] == group[-1] for group in self.groups if len(group) > 1)

    def labels(self):
        """Index of the cluster of each beam, -1 for none."""
        labels = np.full(len(self.spacing), -1)
        for index, group in enumerate(self.groups):
            labels[group] = index
        return labels


def adaptive_clusters(ranges, bearings, step, full, paper):
    """Divide the beams that have a range into clusters."""
    points = polar(ranges, bearings)
    found = Clusters([], *np.full((3, len(ranges)), np.nan))
    spacing, linear, density = found[1:]
    beams = np.flatnonzero(np.isfinite(ranges))

    def joins(cluster, beam):
        before = cluster[-1]
        spacing[beam] = np.hypot(*(points[beam] - points[before]))
        reach = paper.spacing_scale * max(ranges[beam], ranges[before]) * step
        linear[beam] = reach + paper.noise_floor  # 10
        if spacing[beam] <= linear[beam]:
            return True
        inner = spacing[cluster[1:]]
        if len(inner) < 3:
            return False
        density[beam] = np.mean(inner) + paper.density_k * np.std(inner)  # 11-13
        return spacing[beam] <= density[beam]

    groups = [[beam] for beam in beams[:1]]
    for beam in beams[1:]:  # Step 3.
        if joins(groups[-1], beam):
            groups[-1].append(beam)
        else:
            groups.append([beam])
    closed = False
    if full and len(beams) and joins(groups[-1], beams[0]) and len(beams) > 2:  # Step 4.
        closed = len(groups) == 1
        if not closed:
            groups[0] = groups.pop() + groups[0]
    found.groups.extend(np.array(group) for group in groups if len(group) >= paper.min_points)
    if closed and found.groups:
        turned = np.roll(beams, -np.argmax(ranges[beams]))
        found.groups[0] = np.append(turned, turned[0])
    return found


# ----- Stage 3: equation 14, steps 5 to 7, primary corners.


def distances(points, origin, direction):
    """Distances of points to the line through `origin` in a direction (14, 21)."""
    x, y = (points - origin).T
    if not np.any(direction):
        return np.hypot(x, y)
    return np.abs(direction[1] * x - direction[0] * y) / np.hypot(*direction)


def primary_corners(points, closed, paper):
    """Examine the points of a cluster: (index, distance to the chord, response) of candidates.

    A candidate leaves at least `min_points` points in both pieces, itself included. Of a closed
    cluster, the point at which it is opened is one as well.
    """
    candidates = []

    def accepts(index, to_chord):
        response = corner_response(points, index, closed, paper)  # Step 6.
        candidates.append((index, to_chord, response))
        return response > paper.threshold

    if closed:
        accepts(0, 0.0)
    pieces = [(0, len(points) - 1)]
    while pieces:
        first, last = pieces.pop()
        inner = slice(first + paper.min_points - 1, last - paper.min_points + 2)
        if inner.start >= inner.stop:
            continue
        to_chord = distances(points[inner], points[first], points[last] - points[first])  # 14
        index = inner.start + int(np.argmax(to_chord))  # Step 5.
        if accepts(index, to_chord.max()):
            pieces.append((index, last))  # Step 7.
            if paper.recursion == "both":
                pieces.append((first, index))
    return candidates


# ----- Stage 3: equations 15 to 22, the corner operator.


def support_of(index, count, closed, paper):
    """Indices of the support of a point and where it is among them; none where it has none.

    It is cut short at the ends of the cluster; with `ends="excluded"` there is none there.
    """
    if closed:  # The last point is the first.
        reach = min(paper.support_radius, (count - 2) // 2)
        return np.arange(index - reach, index + reach + 1) % (count - 1), reach
    first, last = index - paper.support_radius, index + paper.support_radius
    cut = first < 0 or last >= count
    if index in (0, count - 1) or (cut and paper.ends == "excluded"):
        return np.array([], int), 0
    first = max(first, 0)
    return np.arange(first, min(last, count - 1) + 1), index - first


def tangent(arc, offsets):
    """Direction (b1, b2) at s = 0 of the parabolas x = a1 s² + b1 s, y = a2 s² + b2 s (16-19)."""
    s = arc / (np.ptp(arc) or 1.0)  # The unit does not change the direction.
    return np.linalg.lstsq(np.column_stack([s**2, s]), offsets, rcond=1e-12)[0][1]


def corner_response(points, index, closed, paper):
    """Response of the corner operator at a point of a cluster (22); 0 where it has none."""
    support, target = support_of(index, len(points), closed, paper)
    points = points[support]
    if len(points) < 3:
        return 0.0
    arc = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    arc -= arc[target]  # 15
    direction = tangent(arc, points - points[target])
    if not direction.any():
        return 0.0
    to_tangent = distances(points, points[target], direction)  # 20, 21
    chord = points[-1] - points[0]
    to_chord = distances(points, points[0], chord)
    match paper.response:
        case "tangent":
            return to_tangent.sum()  # 22
        case "product":
            return to_tangent.sum() * to_chord.sum()
        case "relative":
            return to_tangent.sum() / np.abs(arc).sum()
        case _ if not chord.any():
            return 0.0
        case "product_scaled":
            return to_tangent.sum() * to_chord.sum() / (chord @ chord)
        case "chord_scaled":
            return to_tangent.sum() / np.hypot(*chord)
    raise ValueError(paper.response)


# ----- Stage 4: equations 23 and 24, step 8, lines.


def pieces_of(count, corners, closed):
    """First and last point of the pieces of a cluster, from corner to corner.

    A closed cluster without corners but that at which it is opened has none.
    """
    inner = sorted(index for index in corners if 0 < index < count - 1)
    if closed and not inner:
        return []
    return list(pairwise([0, *inner, count - 1]))


def line_of(points, paper):
    """Fit y = kx + b by least squares; return the centroid and the direction of the line.

    `fit="y_of_x"` fits x = ky + b where the points vary more in y than in x.
    """
    centroid = points.mean(axis=0)
    x, y = (points - centroid).T
    if paper.fit == "y_of_x" and y @ y > x @ x:
        return centroid, np.array([x @ y, y @ y])
    return centroid, np.array([x @ x, x @ y])  # 24: k = Σxy / Σx²


# ----- Stages 2 to 4.


class Found(NamedTuple):
    """Clusters, candidates (beam, distance, response), corners (beams), lines (beams, fit)."""

    clusters: Clusters
    candidates: list
    corners: list
    lines: list


def liu_2023(filtered, bearings, step, full, paper):
    """Extract clusters, corners on measurements, and lines from filtered ranges."""
    clusters = adaptive_clusters(filtered, bearings, step, full, paper)
    points = polar(filtered, bearings)
    found = Found(clusters, [], [], [])
    for beams in clusters.groups:
        examined = primary_corners(points[beams], clusters.closed, paper)
        corners = [index for index, _, response in examined if response > paper.threshold]
        found.candidates.extend((beams[index], *values) for index, *values in examined)
        found.corners.extend(beams[sorted(corners)])
        for first, last in pieces_of(len(beams), corners, clusters.closed):
            piece = beams[first : last + 1]
            found.lines.append((piece, *line_of(points[piece], paper)))
    return found
