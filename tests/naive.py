"""Slow twins of the kernels, written from the equations: loops, lists, textbook algebra.

They take scans and the parameters of a method, by its attributes, and know no kernel.
"""

import math
from dataclasses import fields

import numpy as np
from liu_2023 import Paper, adaptive_clusters, pieces_of, polar, primary_corners
from naive_fit import (
    along,
    breakpoints,
    corner_at_beam,
    fit_line,
    has_length,
    intersection,
    misfit,
    opening_and_side,
    quality,
)
from naive_optimal import estimated_noise

LEAST_SIGMA = 1e-4


def valid(scan) -> list[bool]:
    def one(r):
        return math.isfinite(r) and r > 0 and scan.range_min <= r < scan.range_max

    return [one(r) for r in scan.ranges.tolist()]


def noise_of(scan) -> tuple[float, ...]:
    """Noise of the rivals: that of `optimal`, but of a lattice too."""
    constant, growth, uncertainty, pooled = estimated_noise(scan)
    if not any(valid(scan)):
        return (math.nan, 0.0, 0.0, 0.0, uncertainty)
    if pooled <= LEAST_SIGMA**2:
        steps = second_differences(scan)
        lattice = [step for step in steps if LEAST_SIGMA < step < 0.15]
        if len(lattice) > len(steps) / 8:
            constant = max(constant, min(lattice) ** 2 / 12)
    return (math.sqrt(constant), math.sqrt(growth), 0.0, 0.0, uncertainty)


def second_differences(scan) -> list[float]:
    """What each range is off the mean of its neighbours, twice."""
    usable = [ok and 1e-6 <= r < 1e3 for ok, r in zip(valid(scan), scan.ranges, strict=True)]
    r, inner = scan.ranges, range(1, len(scan) - 1)
    return [abs(r[i - 1] - 2 * r[i] + r[i + 1]) for i in inner if all(usable[i - 1 : i + 2])]


def fitted(method, own, corner_before, corner_after):
    """Beams of a piece that its line is fitted to: those next to corners are left out."""
    if method.corner == "beam":
        return own
    core = own[method.corner_trim :] if corner_before else own
    if corner_after and method.corner_trim:
        core = core[: -method.corner_trim]
    return core if len(core) >= 3 else own


def paper_of(method, noise_sigma=math.nan):
    """Parameters of a method as those of the paper."""
    own = {each.name: getattr(method, each.name) for each in fields(Paper)}
    return Paper(**own | {"noise_floor": method.noise_floor * math.sqrt(2) * noise_sigma})


def liu(scan, method, filtered, noise=None):  # noqa: C901
    """All of the method, from filtered ranges."""
    if noise is None:
        noise = noise_of(scan)
    paper = paper_of(method, noise[0])
    found = adaptive_clusters(
        filtered, scan.angles, scan.angle_increment, scan.is_full_circle, paper
    )
    measured = scan.ranges if method.measure == "raw" else filtered
    points = polar(measured, scan.angles)
    seen = polar(filtered, scan.angles)
    segments, corners, candidates = [], [], []
    for label, beams in enumerate(found.groups):
        examined = primary_corners(seen[beams], found.closed, paper)
        candidates += [(beams[i], distance, value) for i, distance, value in examined]
        strong = {i: value for i, _, value in examined if value > method.threshold}
        numbers, pieces = [], pieces_of(len(beams), strong, found.closed)
        for k, (first, last) in enumerate(pieces):
            own = beams[first : last + 1]
            # After the last piece comes the first again, or nothing.
            after = pieces[k + 1] if k + 1 < len(pieces) else pieces[0] if found.closed else None
            core = fitted(method, own, first in strong, after is not None and after[0] in strong)
            line = fit_line(points[core], scan.angles[core], measured[core], noise, method.fit)
            # Without the points next to its corners it may lead the other way.
            way = points[own[-1]] - points[own[0]]
            if way @ [math.cos(line["angle"]), math.sin(line["angle"])] < 0:
                line["angle"] = math.remainder(line["angle"] + math.pi, 2 * math.pi)
                line["covariance"] = line["covariance"] * [[1, -1], [-1, 1]]
            line |= {"first_beam": own[0], "last_beam": own[-1], "cluster": label}
            line |= {"start": along(line, points[own[0]]), "end": along(line, points[own[-1]])}
            line["n_points"] = len(own)
            line["misfit"] = misfit(line, measured[own], noise)
            numbers.append(len(segments) if has_length(line) else None)
            if has_length(line):
                segments.append(line)
        for k, (first, _) in enumerate(pieces):
            joined = numbers[k - 1], numbers[k]
            if first in strong and None not in joined:
                around = [beams[first + 1], beams[first - 1] if first else beams[-2]]
                corner = {"segments": joined, "beam": beams[first]}
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
        "found": found,
        "clusters": found.labels(),
        "segments": segments,
        "corners": corners,
        "candidates": candidates,
        "breakpoints": breakpoints(scan, found, measured, points, method.spacing_scale),
    }
