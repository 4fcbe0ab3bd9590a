"""Steps 3 and 4 of Liu et al. 2023: clusters of consecutive points (equations 10-13)."""

import math

import numpy as np

from . import helper, kernel
from .arrays import Floats1, Floats2, Ints2
from . import layout as at


@kernel
def cluster(
    floats: Floats2,
    ints: Ints2,
    bearings: Floats2,
    step: float,
    circular: bool,
    noise: Floats1,
    scale: float,
    floor: float,
    density_k: float,
    min_points: int,
):
    """Part the usable beams of a scan into clusters.

    A point joins the cluster before it if its spacing is at most T_d = λ max(ρ_i, ρ_{i-1}) Δφ plus
    a noise floor (equation 10), or else at most T_K = μ_K + k σ_K of the cluster, once that has
    three spacings (11-13): density only joins. Clusters under `min_points` are noise.

    From FILTERED, the points with their thresholds (DENSITY_THRESHOLD is NaN where it is not
    needed), and the clusters. `step` is Δφ [rad]; `scale`, `floor` and `density_k` are λ, the noise
    floor in units of √2 σ, and k.
    """
    work = at.named(floats, ints)
    points = work.points
    count = list_points(work.beams, points, work.marks, bearings)
    rho, limit = points[at.RHO], points[at.DISTANCE_THRESHOLD]
    second = points[at.DENSITY_THRESHOLD]
    scaled_step, noise_floor = scale * step, floor * math.sqrt(2.0) * noise[0]
    after, limit_after = rho[1:], limit[1:]
    for i in range(count - 1):
        limit_after[i] = scaled_step * max(after[i], rho[i]) + noise_floor
    limit[0] = scaled_step * max(rho[0], rho[max(count - 1, 0)]) + noise_floor
    for i in range(count):
        second[i] = math.nan
    part_points(work, bearings, circular, count, density_k, min_points)


@helper
def list_points(beams, points, marks, bearings):
    """List the beams whose range is not NaN, place their points, and measure their spacings.

    The spacing of the first point is that from the last. Returns how many there are.
    """
    ranges, beam, spacing = beams[at.FILTERED], marks[at.BEAM], points[at.SPACING]
    count = np.int64(0)
    for i in range(bearings.shape[1]):
        beam[count] = i
        count += not math.isnan(ranges[i])
    place(ranges, points, beam, bearings, count)
    x, y = points[at.X], points[at.Y]
    x_after, y_after, spacing_after = x[1:], y[1:], spacing[1:]
    for i in range(count - 1):
        dx, dy = x_after[i] - x[i], y_after[i] - y[i]
        spacing_after[i] = math.sqrt(dx * dx + dy * dy)
    if count > 0:
        dx, dy = x[0] - x[count - 1], y[0] - y[count - 1]
        spacing[0] = math.sqrt(dx * dx + dy * dy)
    return count


@helper
def place(ranges, points, beam, bearings, count):
    """X = ρ cos θ, y = ρ sin θ of the beams listed (equations 2, 3)."""
    rho, x, y = points[at.RHO], points[at.X], points[at.Y]
    cosines, sines = bearings[0], bearings[1]
    for i in range(count):
        b = beam[i]
        rho[i] = ranges[b]
        x[i], y[i] = rho[i] * cosines[b], rho[i] * sines[b]


@helper
def part_points(work, bearings, circular, count, density_k, min_points):
    """Label the points by cluster, from their spacings and the DISTANCE_THRESHOLD.

    On a full circle whose last cluster goes on in the first, the points are turned so that they
    begin with it. Where all are one cluster that closes, the first point is repeated at the end.
    """
    points, counts = work.points, work.counts
    beam, label = work.marks[at.BEAM], work.marks[at.LABEL]
    clusters, turn = _label(points, label, count, density_k, circular)
    closed = clusters == 1 and turn == 0
    if turn >= 0:
        if closed:
            # Opened at its farthest point: that of a polygon is always a vertex.
            turn = _farthest(points[at.RHO], count)
        _rotate(beam, label, count, turn)
        if closed:
            beam[count], label[count] = beam[0], label[0]
            count += 1
        place(work.beams[at.FILTERED], points, beam, bearings, count)
    counts[at.POINTS], counts[at.CLOSED] = count, closed
    # The first point of a closed cluster, which is repeated at its end, counts once.
    counts[at.CLUSTERS] = _list_clusters(label, count, min_points + closed, work.clusters)


@helper
def _label(points, label, count, density_k, circular):
    """Write the cluster of each point to `label`.

    Returns the number of clusters, and the point at which the last begins if it goes on in the
    first (and then has its number), else -1.
    """
    spacing, t_d = points[at.SPACING], points[at.DISTANCE_THRESHOLD]
    t_k = points[at.DENSITY_THRESHOLD]
    current, start = -1, 0
    # Sums over the spacings of the cluster, as far as they were needed.
    total, squares, summed = 0.0, 0.0, 0
    for turn in range(count + (circular and count >= 3)):
        i = turn if turn < count else 0
        joins = turn > 0 and spacing[i] <= t_d[i]
        inside = turn - 1 - start
        if turn > 0 and not joins and inside >= 3:
            while summed < turn - 1:
                summed += 1
                total += spacing[summed]
                squares += spacing[summed] * spacing[summed]
            t_k[i] = _density_threshold(inside, total, squares, density_k)
            joins = spacing[i] <= t_k[i]
        if turn == count:
            if not joins:
                break
            for k in range(start, count):
                label[k] = 0
            return max(current, 1), start
        if not joins:
            current += 1
            start, summed = turn, turn
            total, squares = 0.0, 0.0
        label[i] = current
    return current + 1, -1


@helper
def _density_threshold(count, total, squares, density_k):
    """T_K = μ_K + k σ_K of the spacings inside a cluster (equations 11-13)."""
    mean = total / count
    return mean + density_k * math.sqrt(max(squares / count - mean * mean, 0.0))


@helper
def _rotate(beam, label, count, start):
    """Rotate both lists so that they begin at `start`, by three reversals."""
    first = np.int64(0)
    _reverse(beam, label, first, start - 1)
    _reverse(beam, label, start, count - 1)
    _reverse(beam, label, first, count - 1)


@helper
def _farthest(rho, count):
    """Point of the greatest range."""
    best = 0
    for i in range(count):
        if rho[i] > rho[best]:
            best = i
    return best


@helper
def _reverse(beam, label, i, j):
    while i < j:
        beam[i], beam[j] = beam[j], beam[i]
        label[i], label[j] = label[j], label[i]
        i += 1
        j -= 1


@helper
def _list_clusters(label, count, min_points, clusters):
    """List the clusters; those under `min_points` become noise. Returns how many are left."""
    kept, start = np.int64(0), np.int64(0)
    for i in range(count):
        if i + 1 < count and label[i + 1] == label[i]:
            continue
        number = kept if i + 1 - start >= min_points else -1
        if label[start] != number:
            for k in range(start, i + 1):
                label[k] = number
        if number >= 0:
            clusters[at.FIRST, kept], clusters[at.LAST, kept] = start, i
            kept += 1
        start = i + 1
    return kept
