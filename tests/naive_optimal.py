"""Slow twins of method optimal: the model of ``docs/optimal.md``, with numbers of their own."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from naive_fit import beamwise_line
from scipy.special import wrightomega

from lineament import LaserScan

#: Scale of the surface [m]; measurements of a line; deviations that differ; tangent of 86°.
SURFACE, FEWEST, DEVIATIONS, STEEP = 0.03, 4, 3.0, 14.3


class Measured(NamedTuple):
    """Usable measurements in the order of the partition, and where a break is before each."""

    beam: np.ndarray
    xy: np.ndarray
    rho: np.ndarray
    broken: np.ndarray


def variance_of(rho, noise):
    return noise[0] + noise[1] * rho**2


# Noise


def third_of(errors, squares):
    """Variance of normal errors by the third that is least; mean square of range, and number."""
    if len(errors) == 0:
        return 0.0, 0.0, 0
    third = min(math.ceil(len(errors) / 3), len(errors) - 1)
    kept = errors <= 9 * np.sort(errors)[third] / 0.4307**2
    return 1.03 * errors[kept].mean(), squares[kept].mean(), int(kept.sum())


def expected_variance(square, degrees, prior=0.012**2, spread=4.5):
    """Mean of a variance with this mean square, and the deviation of half its logarithm.

    The peak of -(λ - c)²/2s - (k/2)(λ + u exp(-λ)) solves λ = c - w + w u exp(-λ), w = s k/2.
    """
    ratio, weight, peaks = min(max(square / prior, 1e-30), 1e4), spread * degrees / 2, []
    for centre in (-spread / 2, spread / 2):
        level = centre
        if weight:
            level -= weight
            level += wrightomega(math.log(weight * ratio) - level)
        pull = degrees / 2 * ratio * math.exp(-level)
        height = -((level - centre) ** 2) / (2 * spread) - degrees / 2 * level - pull
        peaks.append((height, pull + 1 / spread))
    (height, curvature), (raised, other) = peaks
    mean = prior * math.sqrt(curvature / other) * math.exp(raised - height)
    return mean, 0.5 / math.sqrt(curvature)


def estimated_noise(scan: LaserScan) -> tuple[float, float, float, float]:
    """Constant, growth, uncertainty, and mean square, of what is off the line of neighbours."""
    usable = np.flatnonzero(scan.valid & (scan.ranges >= 1e-6) & (scan.ranges < 1e3))
    rho, bearing = scan.ranges, scan.angles
    middle = [b for a, b, c in zip(usable, usable[1:], usable[2:], strict=False) if c - a == 2]
    if not middle:
        constant, uncertainty = expected_variance(0.0, 0.0)
        return constant, 0.0, uncertainty, 0.0
    i = np.array(middle)
    whole = np.sin(bearing[i + 1] - bearing[i - 1])
    through = np.sin(bearing[i + 1] - bearing[i]) / rho[i - 1]
    through = (through + np.sin(bearing[i] - bearing[i - 1]) / rho[i + 1]) / whole
    errors, squares = (rho[i] ** 2 * (through - 1 / rho[i])) ** 2 / 1.5, rho[i] ** 2
    far = squares >= squares.mean()
    v, square, count = np.transpose([third_of(errors[h], squares[h]) for h in (~far, far)])
    pooled, growth = (v @ count) / count.sum(), 0.0
    constant, uncertainty = expected_variance(pooled, count.sum() / 1.94)
    chance = 3 * math.sqrt(2 * 1.94 * (1 / np.maximum(count, 1)).sum())
    if v[1] - v[0] > chance * pooled:
        v *= constant / pooled
        growth = (v[1] - v[0]) / (square[1] - square[0])
        constant = v[0] - growth * square[0]
        if constant < 1e-8:
            growth = 0.5 * (v[0] / square[0] + v[1] / square[1])
    constant = min(max(constant, 1e-8), 0.01)
    growth = max(0.0, min(growth, (0.01 - constant) / rho[usable].max() ** 2))
    return constant, growth, uncertainty, pooled


# Clustering


def parts(scan, a, b, noise, max_missing):
    """Whether no surface goes on from beam a to b."""
    near, far = sorted((scan.ranges[a], scan.ranges[b]))
    if (b - a) % len(scan) - 1 > max_missing:
        return True
    slope = STEEP * near * abs(math.sin(scan.angles[b] - scan.angles[a]))
    return far - near > slope + 2 * DEVIATIONS * math.sqrt(variance_of(far, noise))


def neighbours(scan, beams):
    """List the pairs of neighbours among some beams, over the seam of a full circle."""
    around = [(beams[-1], beams[0])] if scan.is_full_circle and beams else []
    return [*pairwise(beams), *around]


def spikes(scan: LaserScan, noise, max_missing) -> tuple[list[int], set[int]]:
    """Usable beams, and those that are broken from both neighbours while these hold together."""
    usable = scan.valid & (scan.ranges >= 1e-6) & (scan.ranges < 1e3)
    beams, found = np.flatnonzero(usable).tolist(), set()
    pairs = neighbours(scan, beams)
    broken = {b: parts(scan, a, b, noise, max_missing) for a, b in pairs}
    after = dict(pairs)
    for a, b in pairs:
        alone = b in after and broken[b] and broken[after[b]]
        if alone and not parts(scan, a, after[b], noise, max_missing):
            found.add(b)
    return beams, found


def measured(scan: LaserScan, beams: list[int], noise, max_missing) -> Measured:
    """Measurements of some beams in their order."""
    broken = {b: parts(scan, a, b, noise, max_missing) for a, b in neighbours(scan, sorted(beams))}
    i = np.array(beams, int)
    xy = scan.ranges[i, None] * np.column_stack((np.cos(scan.angles[i]), np.sin(scan.angles[i])))
    return Measured(i, xy, scan.ranges[i], np.array([broken.get(b, True) for b in beams], bool))


# Partition


def chi_square(xy, rho, noise):
    """χ² of a x + b y = 1 of least squares, at the scale of the surface, through points."""
    weight = rho / np.sqrt(variance_of(rho, noise) + SURFACE**2)
    return float(np.sum((weight - weight * (xy @ surface_line(xy, rho, noise))) ** 2))


def least_energies(points: Measured, noise, evidence) -> np.ndarray:
    """Least energy of the measurements before each one: every beginning of every line is tried.

    By sums of each line for itself, with more digits than a float has.
    """
    n, x, y = len(points.rho), *points.xy.T.astype(np.longdouble)
    weight = points.rho**2 / (variance_of(points.rho, noise) + SURFACE**2)
    terms = weight * np.array([x * x, x * y, y * y, x, y, np.ones_like(x)])
    energy, begin = np.zeros(n + 1, np.longdouble), 0
    sums = np.zeros((6, n), np.longdouble)
    for j in range(n):
        begin = j if points.broken[j] else begin
        sums[:, begin : j + 1] += terms[:, j : j + 1]
        energy[j + 1] = energy[j] + evidence / 2
        if j + 1 - FEWEST >= begin:
            some = slice(begin, j + 2 - FEWEST)
            lines = energy[some] + evidence + cheapest(sums[:, some])
            energy[j + 1] = min(energy[j + 1], lines.min())
    return energy.astype(float)


def cheapest(sums):
    """χ² of lines by sums of w (xx, xy, yy, x, y, 1); inf where bearings are all one."""
    xx, xy, yy, x, y, s = sums
    determinant = xx * yy - xy * xy
    with np.errstate(divide="ignore", invalid="ignore"):
        chi = s - (x * x * yy - 2 * x * y * xy + y * y * xx) / determinant
    return np.where(determinant > 1e-12 * xx * yy, np.maximum(chi, 0), np.inf)


def energy_of(points: Measured, lines, noise, evidence) -> float:
    """Energy of given lines (first, last): what it costs, whether or not it is the least."""
    own = [chi_square(points.xy[a : b + 1], points.rho[a : b + 1], noise) for a, b in lines]
    clutter = len(points.rho) - sum(b - a + 1 for a, b in lines)
    return sum(own) + evidence * (len(lines) + clutter / 2)


# Fits


def surface_line(xy, rho, noise):
    """Line a x + b y = 1 of least squares of ρ, at the scale of the surface."""
    weight = rho / np.sqrt(variance_of(rho, noise) + SURFACE**2)
    return np.linalg.lstsq(weight[:, None] * xy, weight, rcond=None)[0]


def border_covariances(xy, rho, noise, border, segments, evidence):
    """What comes to the covariances of two segments as the border between them may be elsewhere.

    Farther off by 1, 4, 16 ... measurements, as long as that is not out of the question; or
    nowhere, if they turn by less than 20°, where they become one line at a rise of 8 β.
    """
    n, before, after = len(rho), slice(0, border), slice(border, len(rho))
    lines = [surface_line(xy[own], rho[own], noise) for own in (before, after)]
    variance = noise[0] + noise[1] * rho[border - 1] * rho[border]
    share = variance / (variance + SURFACE**2)

    def energy(i):
        return chi_square(xy[:i], rho[:i], noise) + chi_square(xy[i:], rho[i:], noise)

    def odds_of(rise, differences):
        weight = 1 / (variance_of(rho, noise) + SURFACE**2)
        deviation = 2 * math.sqrt(share * sum(weight * (rho * differences) ** 2))
        z = max(rise, 0) / deviation
        return math.exp(-1.6 * z - 0.07 * z**3)

    others, first = [], np.arange(n) < border
    for way in (-1, 1):
        step, odds = 1, 1.0
        while odds > 1e-6 and 4 <= border + way * step <= n - 4:
            i = border + way * step
            pair = surface_line(xy[:i], rho[:i], noise), surface_line(xy[i:], rho[i:], noise)
            # By how much each measurement's line is another one, with both refitted.
            apart = np.where(np.arange(n) < i, xy @ pair[0], xy @ pair[1])
            apart -= np.where(first, xy @ lines[0], xy @ lines[1])
            odds = odds_of(energy(i) - energy(border), apart)
            others.append((odds, pair))
            step *= 4
    angles = [math.atan2(line[0], -line[1]) for line in lines]
    if abs(math.remainder(angles[1] - angles[0], 2 * math.pi)) < math.radians(20):
        joint = surface_line(xy, rho, noise)
        apart = xy @ joint - np.where(first, xy @ lines[0], xy @ lines[1])
        rise = chi_square(xy, rho, noise) - energy(border) - 8 * evidence
        others.append((odds_of(rise, apart), (joint, joint)))
    total, found = 1 + sum(odds for odds, _ in others), []
    for k, segment in enumerate(segments):
        own = at_centroid(lines[k], segment)
        changes = [(odds, at_centroid(pair[k], segment) - own) for odds, pair in others]
        found.append(sum(odds * np.outer(change, change) for odds, change in changes) / total)
    return found


def at_centroid(line, segment):
    """Offset and angle of a line a x + b y = 1 off a segment, at its centroid."""
    along = np.array([math.cos(segment["angle"]), math.sin(segment["angle"])])
    across = line @ (-along[1], along[0])
    return np.array([(1 - line @ segment["centroid"]) / across, -math.atan(line @ along / across)])


def fitted_line(xy, rho, noise):
    """Centroid, direction, variances of offset and angle, rms, misfit, number of what counts.

    The variances are those of the first order.
    """
    normal = surface_line(xy, rho, noise)
    distance = 1 / np.linalg.norm(normal)
    normal = normal * distance
    share = (xy @ normal / rho) ** 2
    across = variance_of(rho, noise) * share
    counts = (xy @ normal - distance) ** 2 <= DEVIATIONS**2 * (across + SURFACE**2 * share)
    xy, across = xy[counts], across[counts]
    centroid = np.average(xy, axis=0, weights=1 / across)
    _, angle = beamwise_line(xy, 1 / across)
    direction = np.array([math.cos(angle), math.sin(angle)])
    direction *= np.sign(direction @ (xy[-1] - xy[0]))
    along = np.sum(((xy - centroid) @ direction) ** 2 / across)
    total = np.sum(1 / across)
    off = (xy - centroid) @ [-direction[1], direction[0]]
    square = np.average(off**2, weights=1 / across)
    misfit = math.sqrt(max(square - (len(xy) - 2) / total, 0))
    return centroid, direction, (1 / total, 1 / along), math.sqrt(square), misfit, len(xy)


def arc_residuals(circle, xy, rho, noise, at):
    """Errors along the normals of a circle, in deviations at the circle `at`."""
    x, y, _ = at
    normal = (xy - (x, y)) / np.linalg.norm(xy - (x, y), axis=1)[:, None]
    variance = variance_of(rho, noise)
    cosine = np.sum(normal * xy, axis=1) / rho
    deviation = np.sqrt(variance * (cosine**2 + np.sqrt(variance) / (2 * at[2])))
    return (np.linalg.norm(xy - circle[:2], axis=1) - circle[2]) / deviation
