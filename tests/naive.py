"""Slow twins of the kernels, written from the equations: loops, lists, textbook algebra.

They take scans and the parameters of a method, by its attributes, and know no kernel.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from naive_fit import (
    along,
    breakpoints,
    corner_at_beam,
    fit_line,
    intersection,
    misfit,
    opening_and_side,
    quality,
)

LEAST_SIGMA = 1e-4


def valid(scan) -> list[bool]:
    def one(r):
        return math.isfinite(r) and r > 0 and scan.range_min <= r < scan.range_max

    return [one(r) for r in scan.ranges.tolist()]


def bilateral(scan, sigma_d=4.0, sigma_r=0.3, half_width=8):
    """Equations 4-9. A full circle wraps, if it is longer than half the window."""
    n, ok, r = len(scan), valid(scan), scan.ranges.tolist()
    wraps = scan.is_full_circle and n > half_width
    out = np.full(n, np.nan)
    for i in range(n):
        if not ok[i]:
            continue
        above = below = 0.0
        for offset in range(-half_width, half_width + 1):
            j = (i + offset) % n if wraps else i + offset
            if not 0 <= j < n or not ok[j]:
                continue
            w = math.exp(-(offset**2) / (2 * sigma_d**2) - (r[i] - r[j]) ** 2 / (2 * sigma_r**2))
            above, below = above + w * r[j], below + w
        out[i] = above / below
    return out


def sigma(scan):
    """Range noise by the lower median of second differences; None where nothing is valid."""
    ok, r = valid(scan), scan.ranges
    if not any(ok):
        return None
    sizes = sorted(
        abs(r[i - 1] - 2 * r[i] + r[i + 1])
        for i in range(1, len(scan) - 1, 3)
        if ok[i - 1] and ok[i] and ok[i + 1]
    )
    if not sizes:
        return LEAST_SIGMA
    # The median of |N(0, s)| is 0.6745 s; s² = (1 + 4 + 1) σ².
    value = 1.4826 * sizes[(len(sizes) - 1) // 2] / math.sqrt(6)
    if value >= LEAST_SIGMA:
        return value
    lattice = [size for size in sizes if size > LEAST_SIGMA]
    return max(min(lattice) / math.sqrt(12), LEAST_SIGMA) if lattice else LEAST_SIGMA


@dataclass
class Clusters:
    """Clusters as lists of beams; the one of a closed ring ends with its first beam."""

    groups: list[list[int]] = field(default_factory=list)
    closed: bool = False
    spacing: dict[int, float] = field(default_factory=dict)
    distance_threshold: dict[int, float] = field(default_factory=dict)
    density_threshold: dict[int, float] = field(default_factory=dict)

    def labels(self, n: int) -> np.ndarray:
        labels = np.full(n, -1, np.int32)
        for k, members in enumerate(self.groups):
            labels[members] = k
        return labels


def clusters(scan, ranges, noise_sigma, *, scale, floor, density_k, min_points) -> Clusters:
    """Step 3 and step 4, with equations 10-13."""
    out = Clusters()
    point = polar(ranges, scan.angles)
    beams = [i for i in range(len(scan)) if not math.isnan(ranges[i])]

    def joins(before, b, inner):
        out.spacing[b] = d = float(np.linalg.norm(point[b] - point[before]))
        t = scale * max(ranges[b], ranges[before]) * scan.angle_increment
        out.distance_threshold[b] = t = t + floor * math.sqrt(2) * noise_sigma
        if d <= t:
            return True
        if len(inner) < 3:
            return False
        out.density_threshold[b] = np.mean(inner) + density_k * np.std(inner)
        return d <= out.density_threshold[b]

    groups, inner = [], []
    for before, b in zip([None, *beams], beams, strict=False):
        if before is not None and joins(before, b, inner):
            groups[-1].append(b)
            inner.append(out.spacing[b])
        else:
            groups.append([b])
            inner = []
    if scan.is_full_circle and beams:
        over_seam = joins(beams[-1], beams[0], inner)
        if over_seam and len(beams) >= 3:
            if len(groups) == 1:
                out.closed = True
            else:
                groups = [groups[-1] + groups[0], *groups[1:-1]]
    out.groups = [members for members in groups if len(members) >= min_points]
    if out.closed and out.groups:
        turn = int(np.argmax(np.asarray(ranges)[beams]))
        out.groups = [beams[turn:] + beams[: turn + 1]]
    return out


def polar(ranges, angles):
    return np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))


def chord_distances(points):
    """Equation 14: what is left of a point less its projection to the chord of the ends."""
    from_first, chord = points - points[0], points[-1] - points[0]
    if not chord.any():
        return np.linalg.norm(from_first, axis=1)
    along = (from_first @ chord / (chord @ chord))[:, np.newaxis] * chord
    return np.linalg.norm(from_first - along, axis=1)


def response(points, i, radius, reading, closed=False):
    """Equations 15-22 at one point of a cluster; that of a closed cluster ends with its first."""
    m = len(points)
    if closed:
        ring = m - 1
        reach = min(radius, (ring - 1) // 2)
        before = [points[(i - k) % ring] for k in range(1, reach + 1)]
        after = [points[(i + k) % ring] for k in range(1, reach + 1)]
    else:
        before = [points[i - k] for k in range(1, radius + 1) if i - k >= 0]
        after = [points[i + k] for k in range(1, radius + 1) if i + k < m]
    if not before or not after:
        return 0.0
    arcs, deltas = [], []
    for sign, side in ((-1, before), (1, after)):
        steps = np.diff([points[i], *side], axis=0)
        arcs.append(sign * np.cumsum(np.hypot(*steps.T)))
        deltas.append(np.array(side) - points[i])
    s, delta = np.concatenate(arcs), np.concatenate(deltas)
    # In units of the support, for the sake of the condition only.
    unit = abs(s).max() or 1.0
    columns = np.column_stack(((s / unit) ** 2, s / unit))
    b = np.linalg.lstsq(columns, delta, rcond=1e-12)[0][1]
    if np.linalg.norm(b) == 0:
        return 0.0
    to_tangent = distances_to_line(delta, np.zeros(2), b).sum()
    if reading == "tangent":
        return to_tangent
    if reading == "relative":
        return to_tangent / abs(s).sum()
    support = np.array([*before[::-1], points[i], *after])
    to_chord = distances_to_line(support, support[0], support[-1] - support[0]).sum()
    return to_tangent * to_chord


def distances_to_line(points, through, direction):
    offset, length = points - through, np.linalg.norm(direction)
    if length == 0:
        return np.linalg.norm(offset, axis=1)
    u = direction / length
    return np.linalg.norm(offset - np.outer(offset @ u, u), axis=1)


def primary_corners(points, closed, *, radius, threshold, reading, min_points):
    """Steps 5-7 by recursion: (point, distance, response) of each candidate, in their order."""
    found = []

    def candidate(i, distance):
        found.append((i, distance, response(points, i, radius, reading, closed)))
        return found[-1][2] > threshold

    def search(a, b):
        margin = min_points - 1
        inner = chord_distances(points[a : b + 1])[margin : b - a - margin + 1]
        if b - a < 2 * margin or len(inner) == 0:
            return
        c = a + margin + int(np.argmax(inner))
        if candidate(c, inner[c - a - margin]):
            search(a, c)
            search(c, b)

    if closed:
        candidate(0, 0.0)
    search(0, len(points) - 1)
    return found


def pieces_of(n_points, corners, closed):
    """(first, last, whether a corner stands at the first) of the pieces of one cluster."""
    inner = sorted(c for c in corners if 0 < c < n_points - 1)
    if closed and not inner:
        return []
    ends = [0, *inner, n_points - 1]
    return [(a, b, a in corners) for a, b in pairwise(ends)]


def fitted(method, own, corner_before, corner_after):
    """Beams of a piece that its line is fitted to: those next to corners are left out."""
    if method.corner == "beam":
        return own
    core = own[method.corner_trim :] if corner_before else own
    if corner_after and method.corner_trim:
        core = core[: -method.corner_trim]
    return core if len(core) >= 3 else own


def liu(scan, method, noise=None, filtered=None):
    """All of the method; `filtered` are filtered ranges from elsewhere, to hold the rest equal."""
    if noise is None:
        noise = (sigma(scan) or math.nan, 0.0, 0.0, 0.0)
    if filtered is None:
        filtered = bilateral(scan, method.sigma_d, method.sigma_r, method.half_width)
    found = clusters(
        scan,
        filtered,
        noise[0],
        scale=method.spacing_scale,
        floor=method.noise_floor,
        density_k=method.density_k,
        min_points=method.min_points,
    )
    measured = scan.ranges if method.measure == "raw" else filtered
    points = polar(measured, scan.angles)
    seen = polar(filtered, scan.angles)
    segments, corners, candidates = [], [], []
    for label, beams in enumerate(found.groups):
        examined = primary_corners(
            seen[beams],
            found.closed,
            radius=method.support_radius,
            threshold=method.threshold,
            reading=method.response,
            min_points=method.min_points,
        )
        candidates += [(beams[i], distance, value) for i, distance, value in examined]
        strong = {i: value for i, _, value in examined if value > method.threshold}
        base, pieces = len(segments), pieces_of(len(beams), strong, found.closed)
        for k, (first, last, is_corner) in enumerate(pieces):
            own = beams[first : last + 1]
            # After the last piece comes the first again, or nothing.
            after = pieces[k + 1] if k + 1 < len(pieces) else pieces[0] if found.closed else None
            core = fitted(method, own, is_corner, after is not None and after[2])
            line = fit_line(points[core], scan.angles[core], measured[core], noise, method.fit)
            line |= {"first_beam": own[0], "last_beam": own[-1], "cluster": label}
            line |= {"start": along(line, points[own[0]]), "end": along(line, points[own[-1]])}
            line["n_points"] = len(own)
            line["misfit"] = misfit(line, measured[own], noise)
            segments.append(line)
        for k, (first, _, is_corner) in enumerate(pieces):
            if is_corner:
                before = (k - 1) % len(pieces)
                around = [beams[first + 1], beams[first - 1] if first else beams[-2]]
                corner = {"segments": (base + before, base + k), "beam": beams[first]}
                corner["response"] = strong[first]
                corner["spacing"] = np.linalg.norm(points[around] - points[beams[first]], axis=1)
                corners.append(corner)
    for corner in corners:
        a, b = (segments[k] for k in corner["segments"])
        corner["opening"], corner["convex"] = opening_and_side(a["angle"], b["angle"])
        corner["kind"] = "corner"
        corner["quality"] = quality(a["n_points"], b["n_points"], corner["opening"])
        at, spacing = corner["beam"], corner.pop("spacing").max()
        placed = None
        if method.corner == "intersection":
            placed = intersection(a, b, points[at], method.support_radius / 2 * spacing)
        if placed is None:
            placed = corner_at_beam(scan.angles[at], measured[at], spacing, noise)
        else:
            a["end"] = b["start"] = placed[0]
        corner["position"], corner["covariance"] = placed
    return {
        "noise": noise,
        "filtered": filtered,
        "found": found,
        "clusters": found.labels(len(scan)),
        "segments": segments,
        "corners": corners,
        "candidates": candidates,
        "breakpoints": breakpoints(scan, found, measured, points, method.spacing_scale),
    }
