"""Slow twins of the methods that find their lines one by one: growing, consensus, votes.

They take the points of the clusters of a scan, and find lines by eigenvectors and loops.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from naive_fit import principal_line, range_variance

from lineament.features import noise_row
from lineament.kernels import layout as at
from lineament.methods.workspace import Block


@dataclass
class Clusters:
    """Points of a scan (m, 2), their ranges, and the first and last point of each cluster."""

    points: np.ndarray
    rho: np.ndarray
    noise: np.ndarray
    spans: list[tuple[int, int]]
    closed: bool


def assert_same_pieces(method, scan, find, noise=None) -> int:
    """Hold the pieces of a method equal to those that a twin finds. Returns their number."""
    block = Block(scan, noise_row(noise), 1, method.own_arrays(len(scan)))
    block.load(scan.ranges)
    method.run(block)
    clusters = clusters_in(block)
    found = sorted(piece for span in find(clusters, method) for piece in span)
    expected = (settle if method.settling else left)(clusters, found, method)
    n = block.counts[at.PIECES]
    pieces = block.work.pieces[[at.FIRST, at.LAST, at.BEFORE], :n].T.tolist()
    assert pieces == [[a, b, before] for a, b, before, _ in expected]
    sines = [sine for *_, sine in expected]
    np.testing.assert_allclose(block.work.response[:n], sines, rtol=1e-5)
    return n


def clusters_in(block) -> Clusters:
    """Take the clusters out of a block."""
    m, points = int(block.counts[at.POINTS]), block.work.points
    label = block.work.marks[at.LABEL, :m].tolist()
    edges = [0, *(i for i in range(1, m) if label[i] != label[i - 1]), m] if m else []
    spans = [(a, b - 1) for a, b in pairwise(edges) if label[a] >= 0]
    xy, closed = points[[at.X, at.Y], :m].T.copy(), bool(block.counts[at.CLOSED])
    return Clusters(xy, points[at.RHO, :m], block.noises[0], spans, closed)


def line(points):
    """Unit normal, distance from the origin, sum of squared distances."""
    centroid, angle = principal_line(points, np.ones(len(points)))
    normal = np.array([-math.sin(angle), math.cos(angle)])
    return normal, normal @ centroid, float((((points - centroid) @ normal) ** 2).sum())


def tolerance(clusters, i, d, method):
    """How far a point may lie from its line: the noise of range and bearing, and misfit."""
    rho, noise = clusters.rho[i], clusters.noise
    of_range = math.sqrt(range_variance(rho, noise)) * abs(d) / rho
    return method.epsilon + method.sigmas * (of_range + noise[2] * rho)


def is_near(clusters, i, normal, d, method, margin=0.0):
    return abs(normal @ clusters.points[i] - d) <= tolerance(clusters, i, d, method) + margin


def long_enough(clusters, a, b, least):
    return np.linalg.norm(clusters.points[b] - clusters.points[a]) >= least


# Finding


def grow(clusters, method):
    """Regions of each cluster, which may overlap."""

    def fits(i, normal, d):
        along = normal @ clusters.points[i] / clusters.rho[i]
        to_predicted = abs(clusters.rho[i] * along - d) / abs(along) if along else math.inf
        noise = method.sigmas * math.sqrt(range_variance(clusters.rho[i], clusters.noise))
        return is_near(clusters, i, normal, d, method) and to_predicted <= method.delta + noise

    def through(a, b):
        return line(clusters.points[a : b + 1])[:2]

    for start, stop in clusters.spans:
        regions, i, floor = [], start, start
        while i + method.s_num - 1 <= stop:
            a, b = i, i + method.s_num - 1
            if not all(fits(k, *through(a, b)) for k in range(a, b + 1)):
                i += 1
                continue
            while b < stop and fits(b + 1, *through(a, b)):
                b += 1
            while a > floor and fits(a - 1, *through(a, b)):
                a -= 1
            if b - a + 1 >= method.p_min and long_enough(clusters, a, b, method.l_min):
                regions.append((a, b))
                floor = a + 2
            i = b + 1 - method.s_num // 2
        yield regions


def longest_run(clusters, free, span, normal, d, method, margin=0.0):
    """(number of near points, first, last) of the longest run; the first of equal ones."""
    runs: list[list[int]] = [[]]
    for i in range(span[0], span[1] + 1):
        run = runs[-1]
        if i not in free or (run and i - run[-1] > method.max_misses + 1):
            runs.append([])
        if i in free and is_near(clusters, i, normal, d, method, margin):
            runs[-1].append(i)
    best = max(runs, key=len)
    return (len(best), best[0], best[-1]) if best else (0, -1, -1)


def refined_run(clusters, free, span, normal, d, method, margin, passes):
    near, a, b = longest_run(clusters, free, span, normal, d, method, margin)
    for _ in range(passes):
        if near >= 3:
            normal, d, _ = line(clusters.points[a : b + 1])
            near, a, b = longest_run(clusters, free, span, normal, d, method)
    return near, a, b


def sample(clusters, method):
    """Pieces of each cluster by consensus."""
    state = method.seed

    def draw(n):
        nonlocal state
        state = 48271 * state % (2**31 - 1)
        return state % n

    for span in clusters.spans:
        pieces, free = [], set(range(span[0], span[1] + 1))
        while len(free) >= 2:
            left, best = sorted(free), (0, None, None)
            for _ in range(method.trials):
                k = draw(len(left) - 1)
                i, j = left[k], left[k + 1 + draw(min(method.window, len(left) - 1 - k))]
                u = clusters.points[j] - clusters.points[i]
                if j - i > method.window or not u.any():
                    continue
                normal = np.array([u[1], -u[0]]) / np.linalg.norm(u)
                d = normal @ clusters.points[i]
                near, _, _ = longest_run(clusters, free, span, normal, d, method)
                best = max(best, (near, normal, d), key=lambda one: one[0])
            if not best[0]:
                break
            near, a, b = refined_run(clusters, free, span, *best[1:], method, 0.0, 3)
            if near < method.min_points or not long_enough(clusters, a, b, method.min_length):
                break
            pieces.append((a, b))
            free -= set(range(a, b + 1))
        yield pieces


def vote(clusters, method):
    """Pieces of each cluster by votes from its chord on, counted again for each peak."""
    alpha = math.pi / method.angles * np.arange(method.angles)
    for span in clusters.spans:
        points = clusters.points[span[0] : span[1] + 1]
        u = points[-1] - points[0]
        u = u if math.hypot(*u) > 0 else points[0]
        u = u / math.hypot(*u)
        axes = np.array([u, (-u[1], u[0])])
        box = (points - points[0]) @ axes.T
        centre = points[0] + 0.5 * (box.min(axis=0) + box.max(axis=0)) @ axes
        normals = np.column_stack((np.cos(alpha), np.sin(alpha))) @ axes
        radius = max(math.hypot(*(p - centre)) for p in points)
        noise = math.sqrt(range_variance(clusters.rho[span[0]], clusters.noise))
        width = max(method.resolution, 2 * noise, 2 * radius / (method.distances - 1))
        dx, dy = (clusters.points - centre).T
        c, s = normals.T[:, :, np.newaxis] / width
        cells = (c * dx + s * dy + radius / width).astype(int)
        pieces, free, spent = [], set(range(span[0], span[1] + 1)), set()
        while True:
            votes = np.zeros((method.angles, method.distances), int)
            for i in free:
                votes[np.arange(method.angles), cells[:, i]] += 1
            for cell in spent:
                votes[cell] = 0
            cell = np.unravel_index(votes.argmax(), votes.shape)
            if votes[cell] < method.min_points:
                break
            normal = normals[cell[0]]
            d = normal @ centre + (cell[1] + 0.5) * width - radius
            near, a, b = refined_run(clusters, free, span, normal, d, method, width / 2, 4)
            if near == 0:
                spent.add(cell)
                continue
            free -= set(range(a, b + 1))
            if near >= method.min_points and long_enough(clusters, a, b, method.min_length):
                pieces.append((a, b))
        yield pieces


# Settling


def left(clusters, found, method):
    """What a method as published leaves: no corners; Gao's regions do not overlap."""
    for k in range(1, len(found) if method.name == "region_growing" else 0):
        if found[k][0] <= found[k - 1][1]:
            found[k - 1 : k + 1] = cut_apart(clusters.points, *found[k - 1 : k + 1])
    return [(*piece, -1, math.nan) for piece in found]


def settle(clusters, found, method):
    """(first, last, piece before a corner or -1, sine there) of the pieces that are left."""
    pieces = merged(clusters, found, method)
    for _ in range(2):
        for k in range(1, len(pieces)):
            if are_neighbours(clusters, *pieces[k - 1 : k + 1]):
                pieces[k - 1 : k + 1] = cut_apart(clusters.points, *pieces[k - 1 : k + 1])
    pieces = merged(clusters, pieces, method)
    sines = [0.0] * len(pieces)
    if clusters.closed and len(pieces) > 1:
        for _ in range(2):
            pieces[-1], pieces[0] = left_opening(clusters.points, pieces[-1], pieces[0])
        if pieces[0][0] + len(clusters.points) - 1 - pieces[-1][1] <= 4:
            sines[0] = meet(clusters.points, pieces[-1], pieces[0], method.reach)
    for k in range(1, len(pieces)):
        if are_neighbours(clusters, *pieces[k - 1 : k + 1]):
            sines[k] = meet(clusters.points, *pieces[k - 1 : k + 1], method.reach)
    return [
        (*piece, (k - 1) % len(pieces) if sine else -1, sine or math.nan)
        for k, (piece, sine) in enumerate(zip(pieces, sines, strict=True))
    ]


def are_neighbours(clusters, one, other):
    (start, stop), *_ = (span for span in clusters.spans if span[0] <= one[1] <= span[1])
    return start <= other[0] <= stop and other[0] - one[1] <= 4


def merged(clusters, pieces, method):
    """Pieces of which no neighbours cost less than 36 variances more as one."""
    out = []
    for a, b in pieces:
        if out and are_neighbours(clusters, out[-1], (a, b)):
            one = list(range(out[-1][0], out[-1][1] + 1))
            other = list(range(max(a, one[-1] + 1), b + 1))
            if not other:
                continue
            _, d, both = line(clusters.points[one + other])
            apart = sum(line(clusters.points[some])[2] for some in (one, other))
            rho, noise = clusters.rho[one[-1]], clusters.noise
            square = min(max((d / rho) ** 2, 1e-6), 1.0)  # cos²ψ
            variance = range_variance(rho, noise) * square + (noise[2] * rho) ** 2 * (1 - square)
            if both - apart <= 36 * (variance + method.epsilon**2):
                out[-1] = (one[0], b)
                continue
        out.append((a, b))
    return out


def cut_apart(points, one, other):
    """Both pieces with the border of least squares, within 20 points of the one they had."""
    (a, b), (c, d) = one, other
    near, far = max(min(b, c - 1), a + 1), min(max(b, c - 1), d - 2)
    borders = range(max(near - 20, a + 2), min(far + 20, d - 3) + 1)
    if not borders:
        begin = max(c, near + 1)
        return ((a, near), (begin, d)) if begin < d else (one, other)
    best, least = None, math.inf
    for i in borders:
        cost = line(points[a : i + 1])[2] + line(points[i + 1 : d + 1])[2]
        if cost < (1 - 1e-9) * least - 1e-12:
            best, least = i, cost
    return (a, best), (best + 1, d)


def left_opening(points, one, other):
    """Both pieces without the points at the opening that are nearer to the other's line."""
    (a, b), (c, d) = one, other
    lines = line(points[a : b + 1]), line(points[c : d + 1])
    first, second = (abs(points @ normal - distance) for normal, distance, _ in lines)
    while c < d - 2 and first[c] < second[c]:
        c += 1
    while b > a + 2 and second[b] < first[b]:
        b -= 1
    return (a, b), (c, d)


def meet(points, one, other, reach):
    """Sine of the angle at which the lines of two pieces meet near their ends; else 0."""
    (a, b), (c, d) = one, other
    (n1, d1, _), (n2, d2, _) = line(points[a : b + 1]), line(points[c : d + 1])
    sine = abs(np.linalg.det([n1, n2]))
    if sine < 0.05:
        return 0.0
    at = np.linalg.solve([n1, n2], [d1, d2])
    steps = [points[b] - points[b - 1], points[c] - points[b], points[c + 1] - points[c]]
    off = max(np.linalg.norm(at - points[i]) for i in (b, c))
    return sine if off <= reach * max(map(np.linalg.norm, steps)) else 0.0
