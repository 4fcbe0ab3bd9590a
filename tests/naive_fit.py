"""Slow twins of what is measured: lines, corners, breakpoints."""

import math

import numpy as np
from liu_2023 import Paper, line_of


def range_variance(rho, noise):
    s, proportional, _, quantum, *_ = noise
    return np.maximum(s**2 + (proportional * rho) ** 2 + quantum**2 / 12, 1e-8)


def normal_variances(angle, bearings, rho, noise):
    """Variance of each point along the normal of a line: σ_r² cos²ψ + ρ² σ_φ² sin²ψ."""
    cosine = np.maximum(np.cos(bearings - (angle + math.pi / 2)) ** 2, 1e-6)
    return range_variance(rho, noise) * cosine + (rho * noise[2]) ** 2 * (1 - cosine)


def principal_line(points, weights):
    """Centroid and direction of least weighted orthogonal distances, by eigenvectors."""
    centroid = np.average(points, axis=0, weights=weights)
    centred = points - centroid
    _, vectors = np.linalg.eigh((centred * weights[:, np.newaxis]).T @ centred)
    return centroid, math.atan2(vectors[1, 1], vectors[0, 1])


def beamwise_line(points, weights):
    """Centroid, and direction of the line a x + b y = 1 of least weighted squares of 1 - a x - b y.

    By eigenvectors where all points are on one beam.
    """
    root = np.sqrt(weights)
    normal, _, rank, _ = np.linalg.lstsq(root[:, np.newaxis] * points, root, rcond=1e-9)
    centroid, angle = principal_line(points, weights)
    return centroid, math.atan2(normal[0], -normal[1]) if rank == 2 else angle


def second_order(covariance, centroid, angle):
    """Covariance with variances by which the squares of errors are 1, not to first order only.

    The slope m across the beams is normal with variance s, the angle atan m, and the offset by the
    cosine of it what the error along the beams is: E e²/v by the derivatives of the arctangent.
    """
    off = math.cos(angle) * centroid[1] - math.sin(angle) * centroid[0]
    m = math.sqrt(max(centroid @ centroid / max(off**2, 1e-6 * centroid @ centroid) - 1, 0.0))
    first = 1 / (1 + m**2)
    second, third = -2 * m * first**2, (6 * m**2 - 2) * first**3
    s = covariance[1, 1] / first**2
    angles = 1 + s * (15 / 4 * (second / first) ** 2 - 2 * third / first)
    both = covariance.diagonal() * [1 + s * first, angles]
    both[1] = min(both[1], math.pi**2 / 12)
    most = math.sqrt(1 - 2e-9) * math.sqrt(both[0] * both[1])
    cross = min(max(covariance[0, 1], -most), most)
    return np.array([[both[0], cross], [cross, both[1]]])


def estimate(points, bearings, rho, noise, fit, passes=2):
    """Centroid, direction from first to last, weights."""
    weights = np.ones(len(points))
    if not np.ptp(points, axis=0).any():
        return points[0], 0.0, weights
    if fit in ("y_of_x", "slope_intercept"):
        centroid, (run, rise) = line_of(points, Paper(fit=fit))
        angle = math.atan2(rise, run)
    else:
        fitted = beamwise_line if fit == "weighted" else principal_line
        centroid, angle = fitted(points, weights)
    for _ in range(passes if fit == "weighted" else 0):
        weights = 1 / normal_variances(angle, bearings, rho, noise)
        centroid, angle = beamwise_line(points, weights)
    if np.array([math.cos(angle), math.sin(angle)]) @ (points[-1] - points[0]) < 0:
        angle += math.pi
    return centroid, math.remainder(angle, 2 * math.pi), weights


def fit_line(points, bearings, rho, noise, fit, passes=2):
    """Line with its covariance: to first order offset = Σwe/W, angle = Σwte/Σwt².

    The angle of an eigenvector is, by the perturbation of a matrix, Σte/(Σt² - Σe²).
    """
    centroid, angle, _ = estimate(points, bearings, rho, noise, fit, passes)
    u = np.array([math.cos(angle), math.sin(angle)])
    t, e = (points - centroid) @ u, (points - centroid) @ [-u[1], u[0]]
    variances = normal_variances(angle, bearings, rho, noise)
    weights = 1 / variances if fit == "weighted" else np.ones(len(points))
    offset_gain = weights / weights.sum()
    spread = weights @ t**2 - (e @ e if fit == "total" else 0.0)
    if spread > 0:
        gain = np.array([offset_gain, weights * t / spread])
        covariance = gain * variances @ gain.T
        if fit == "weighted":
            covariance[[0, 1], [1, 0]] = 0.0  # independent at the centroid of these weights
    else:
        # No direction: uniform over half a turn.
        covariance = np.diag([offset_gain**2 @ variances, math.pi**2 / 12])
    return {
        "start": centroid + t[0] * u,
        "end": centroid + t[-1] * u,
        "centroid": centroid,
        "angle": angle,
        "covariance": second_order(covariance, centroid, angle),
        "n_points": len(points),
        "rms": math.sqrt(np.mean(e**2)),
    }


def misfit(line, own_rho, noise):
    """What is left of the mean square beyond that of the noise, at the middle of the beams."""
    n, middle = len(own_rho), own_rho[(len(own_rho) - 1) // 2]
    u = np.array([math.cos(line["angle"]), math.sin(line["angle"])])
    distance = u[0] * line["centroid"][1] - u[1] * line["centroid"][0]
    share = max((distance / middle) ** 2, 1e-6)
    expected = range_variance(middle, noise) * share + (middle * noise[2]) ** 2 * (1 - share)
    return math.sqrt(max(line["rms"] ** 2 - (1 - 2 / n) * expected, 0.0))


def quality(n, m, opening):
    """Share of corners found again, by √(1/n + 1/m) over the sine of the turn."""
    return 1 / (1 + (math.sqrt(1 / n + 1 / m) / max(math.sin(opening), 1e-9) / 0.78) ** 2.4)


def along(line, point):
    """The point of a line nearest to `point`."""
    u = np.array([math.cos(line["angle"]), math.sin(line["angle"])])
    return line["centroid"] + ((point - line["centroid"]) @ u) * u


def jacobian_covariance(bearings, rho, noise, fit):
    """Covariance of (offset, angle) by moving each range and each bearing, and fitting again."""
    range_noise = np.sqrt(range_variance(rho, noise))

    def line(phi, r):
        points = np.column_stack((r * np.cos(phi), r * np.sin(phi)))
        # Weights are held at those of the sensor; their own change is of second order.
        return estimate(points, phi, r, noise, fit, passes=8)

    at, angle, _ = line(bearings, rho)

    def moved(phi, r):
        centroid, turned, _ = line(phi, r)
        off = centroid - at
        turn = math.remainder(turned - angle, 2 * math.pi)
        return np.array([math.cos(turned) * off[1] - math.sin(turned) * off[0], turn])

    total = np.zeros((2, 2))
    h = 1e-5
    for i in range(len(rho)):
        step = h * (np.arange(len(rho)) == i)
        by_range = (moved(bearings, rho + step) - moved(bearings, rho - step)) / (2 * h)
        by_bearing = (moved(bearings + step, rho) - moved(bearings - step, rho)) / (2 * h)
        total += np.outer(by_range, by_range) * range_noise[i] ** 2
        total += np.outer(by_bearing, by_bearing) * noise[2] ** 2
    return total


def has_length(line):
    """Whether the ends are apart, by more than rounding: along their beams they may not be."""
    ahead = (line["end"] - line["start"]) @ [math.cos(line["angle"]), math.sin(line["angle"])]
    return ahead > 1e-12 * np.abs([line["start"], line["end"]]).sum()


def offset_variance(line, point):
    lever = (point - line["centroid"]) @ [math.cos(line["angle"]), math.sin(line["angle"])]
    return np.array([1.0, lever]) @ line["covariance"] @ [1.0, lever]


def intersection(a, b, near, reach):
    """Where two lines meet, Σ = A⁻¹ diag A⁻ᵀ; None if that is not within `reach` of a point.

    Nor where it would come before the start or the middle of the first, or after those of the
    second.
    """
    normals = np.array([[-math.sin(k["angle"]), math.cos(k["angle"])] for k in (a, b)])
    if abs(np.linalg.det(normals)) < 1e-6:
        return None
    offsets = [n @ k["centroid"] for n, k in zip(normals, (a, b), strict=True)]
    point = np.linalg.solve(normals, offsets)
    if np.linalg.norm(point - near) > reach:
        return None
    ends = (a, "start", 1), (b, "end", -1)
    for line, end, way in ends:
        u = way * np.array([math.cos(line["angle"]), math.sin(line["angle"])])
        if any((point - at) @ u <= 0 for at in (line["centroid"], line[end])):
            return None
    inverse = np.linalg.inv(normals)
    spread = np.diag([offset_variance(a, point), offset_variance(b, point)])
    return point, inverse @ spread @ inverse.T


def corner_at_beam(bearing, rho, spacing, noise):
    along = np.array([math.cos(bearing), math.sin(bearing)])
    covariance = np.eye(2) * spacing**2 / 12
    return rho * along, covariance + np.outer(along, along) * range_variance(rho, noise)


def opening_and_side(before, after):
    """Angle between the arms, and whether the corner points at the sensor: a right turn."""
    turn = math.remainder(after - before, 2 * math.pi)
    return math.pi - abs(turn), turn < 0


def breakpoints(scan, found, rho, points, gap):
    """(beams, position, kind, occluder) where surfaces end."""
    if not found.groups:
        return []
    ends = [(members[0], members[-1]) for members in found.groups]
    breaks = []
    is_open = scan.is_full_circle and not found.closed
    following = ends[1:] + (ends[:1] if is_open else [])
    for (_, a), (b, _) in zip(ends, following, strict=False):
        near = a if rho[a] <= rho[b] else b
        if (b - a) % len(scan) > gap:
            breaks.append(((a, b), points[near], "gap", -1))
        else:
            breaks.append(((a, b), points[near], "jump", near))
    if not scan.is_full_circle:
        first, last = ends[0][0], ends[-1][1]
        breaks.append(((-1, first), points[first], "scan_end", -1))
        breaks.append(((last, -1), points[last], "scan_end", -1))
    return breaks
