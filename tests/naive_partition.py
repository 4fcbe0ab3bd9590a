"""Slow twins of how scans are parted, split and tracked: lists, recursion, a fit at every step."""

import math
from dataclasses import astuple
from itertools import pairwise

import numpy as np
from lineament_lab.kernels.line_tracking import track_lines
from lineament_lab.methods.pdbs import PDBS
from liu_2023 import Clusters, distances, pieces_of, polar
from naive import noise_of as estimated
from naive import valid
from naive_fit import breakpoints, estimate, principal_line, range_variance

from lineament import LaserScan
from lineament.features import noise_row
from lineament.kernels import layout as at
from lineament.methods.workspace import Block


def untied(scan: LaserScan) -> LaserScan:
    """Move each range by micrometres, so that no two points of a wall are equally far off it."""
    ranges = scan.ranges * (1 + 1e-6 * np.random.default_rng(0).normal(size=len(scan)))
    limits = {"range_min": scan.range_min, "range_max": scan.range_max}
    if scan.is_regular:
        return LaserScan(ranges, scan.angle_min, scan.angle_increment, **limits)
    return LaserScan(ranges, angles=scan.angles, **limits)


def noise_of(scan, extractor) -> tuple[float, ...]:
    noise = extractor.noise
    if noise is not None:
        return astuple(noise)
    return estimated(scan)


# Parting


def clusters_of(method) -> PDBS:
    """Make the method pdbs that parts scans as another method does."""
    if method.clusters == "borges_aldon":
        return PDBS(
            grazing_angle=method.grazing_angle,
            max_missing=method.max_missing,
            min_points=method.min_points,
        )
    distance = method.distance if method.clusters == "fixed" else 1e300
    return PDBS(rule="fixed", distance=distance, max_missing=10**6, min_points=method.min_points)


def threshold(rule, before, rho, step, noise, method):
    """Distance up to which two measurements, `step` apart in bearing, lie on one surface."""
    if rule == "fixed":
        return method.distance
    c1 = math.sqrt(2 * (1 - math.cos(step)))
    if rule == "dietmayer":
        return method.c0 + c1 * min(before, rho)
    if rule == "santos":
        below = (math.cos(step / 2) - math.sin(step / 2)) / math.tan(method.beta)
        return method.c0 + c1 * min(before, rho) / below if below > 0 else math.nan
    if rule == "borges_aldon":
        opposite = math.sin(method.grazing_angle - step)
        if opposite <= 0:
            return math.nan
        floor = method.noise_factor * math.sqrt(range_variance(before, noise))
        return before * math.sin(step) / opposite + floor
    raise AssertionError(rule)


def parted(scan, method: PDBS, noise) -> Clusters:
    """Clusters of neighbours by a rule, Lee's by its ratio."""
    rule = method.rule
    ok, rho, n = valid(scan), scan.ranges, len(scan)
    out = Clusters([], *np.full((3, n), np.nan))
    points = polar(rho, scan.angles)
    beams = [i for i in range(n) if ok[i]]

    def joins(before, b):
        out.spacing[b] = d = float(np.linalg.norm(points[b] - points[before]))
        if (b - before - 1) % n > method.max_missing:
            return False
        step = (scan.angles[b] - scan.angles[before]) % (2 * math.pi)
        if rule == "lee":
            # By the cosine rule, two points of this ratio and this sum.
            total = rho[b] + rho[before]
            a, c = total * (1 + method.ratio) / 2, total * (1 - method.ratio) / 2
            equivalent = math.sqrt(a * a + c * c - 2 * a * c * math.cos(step))
            out.distance_threshold[b] = equivalent
            return abs(rho[b] - rho[before]) / total <= method.ratio
        out.distance_threshold[b] = threshold(rule, rho[before], rho[b], step, noise, method)
        return d <= out.distance_threshold[b]

    groups = [[beams[0]]] if beams else []
    for before, b in pairwise(beams):
        if joins(before, b):
            groups[-1].append(b)
        else:
            groups.append([b])
    if scan.is_full_circle and beams and joins(beams[-1], beams[0]) and len(beams) >= 3:
        if len(groups) == 1:
            turn = int(np.argmax(rho[beams]))
            groups = [beams[turn:] + beams[: turn + 1]]
        else:
            groups = [groups[-1] + groups[0], *groups[1:-1]]
    out.groups.extend(group for group in groups if len(set(group)) >= method.min_points)
    return out


# Splitting


def split(scan, found, noise, *, tolerance, min_piece, by_line):
    """Candidates (beam, distance, excess), and pieces (first beam, last beam, piece before).

    `tolerance` returns that of a range; `by_line` whether the fitted line decides.
    """
    points = polar(scan.ranges, scan.angles)
    candidates, pieces = [], []
    for beams in found.groups:
        own, rho = points[beams], scan.ranges[beams]
        allowed = tolerance(rho)
        cuts = {}

        def search(a, b, own=own, rho=rho, beams=beams, allowed=allowed, cuts=cuts):
            margin = min_piece - 1
            inner = distances(own, own[a], own[b] - own[a])[a + margin : b - margin + 1]
            if b - a < 2 * margin or len(inner) == 0:
                return
            c = a + margin + int(np.argmax(inner))
            distance = inner[c - a - margin]
            if by_line:
                part = slice(a, b + 1)
                bearings = scan.angles[beams][part]
                excess = off_line(own[part], bearings, rho[part], noise, allowed[part])
            else:
                excess = distance / allowed[c]
            candidates.append((beams[c], distance, excess))
            if excess > 1:
                cuts[c] = excess
                search(a, c)
                search(c, b)

        search(0, len(beams) - 1)
        if found.closed and cuts:
            before, after = own[max(cuts)], own[min(cuts)]
            (distance,) = distances(own[:1], before, after - before)
            candidates.append((beams[0], distance, distance / allowed[0]))
            if distance > allowed[0]:
                cuts[0] = distance / allowed[0]
        base, own_pieces = len(pieces), pieces_of(len(beams), cuts, found.closed)
        for k, (first, last) in enumerate(own_pieces):
            before = base + (k - 1) % len(own_pieces) if first in cuts else -1
            pieces.append((beams[first], beams[last], before))
    return candidates, pieces


def off_line(points, bearings, rho, noise, allowed):
    """Return by how much of their tolerances two neighbours are off one side of the fitted line."""
    if not np.ptp(points, axis=0).any():
        return 0.0
    centroid, angle, _ = estimate(points, bearings, rho, noise, "weighted")
    off = (points - centroid) @ [-math.sin(angle), math.cos(angle)] / allowed
    pairs = [min(abs(a), abs(b)) for a, b in pairwise(off) if a * b > 0]
    return max(pairs, default=0.0)


# Tracking


def track(scan, found, noise, method):
    """First and last beam of the lines that grow along the clusters."""
    points = polar(scan.ranges, scan.angles)
    lines = []
    for beams in found.groups:
        begin = 0
        while begin < len(beams):
            gained, missed = [], 0
            for b in beams[begin:]:
                if len(gained) < 3 or is_predicted(scan, points, gained, b, noise, method):
                    gained.append(b)
                    missed = 0
                    continue
                missed += 1
                if missed > method.max_misses:
                    break
            length = beams.index(gained[-1], begin) - begin + 1
            if length >= method.min_piece:
                lines.append((beams[begin], gained[-1]))
                begin += length
            else:
                begin += 1
    return lines


def is_predicted(scan, points, gained, b, noise, method):
    own = points[gained]
    centroid, angle = principal_line(own, np.ones(len(own)))
    along = np.array([math.cos(angle), math.sin(angle)])
    normal = np.array([-along[1], along[0]])
    t = (own - centroid) @ along
    lever = (points[b] - centroid) @ along
    bearing_of_normal = abs(normal @ centroid) / scan.ranges[b]
    cosine2 = max(bearing_of_normal**2, 1e-6)
    variance = range_variance(scan.ranges[b], noise) * cosine2
    variance += (scan.ranges[b] * noise[2]) ** 2 * (1 - cosine2)
    variance *= 1 + 1 / len(own) + (lever**2 / (t @ t) if t @ t > 0 else 0.0)
    allowed = method.threshold + method.noise_factor * math.sqrt(variance)
    return abs((points[b] - centroid) @ normal) <= allowed


# The methods themselves


def assert_same_partition(scan, extractor):
    trace = extractor.trace(scan)
    found = parted(scan, extractor.method, noise_of(scan, extractor))
    assert trace.clusters.tolist() == found.labels().tolist()
    for kernel, expected in (
        (trace.spacing, found.spacing),
        (trace.distance_threshold, found.distance_threshold),
    ):
        # Near its pole the rule of Santos has thresholds beyond all distances, and no digits.
        kernel, expected = np.minimum(kernel, 1e6), np.minimum(expected, 1e6)
        np.testing.assert_allclose(kernel, expected, rtol=1e-6, atol=1e-12)
    assert np.isnan(trace.density_threshold).all()
    features = trace.features
    assert len(features.segments) == len(features.corners) == len(trace.candidates) == 0
    gap = extractor.method.max_missing + 1
    points = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))
    points *= scan.ranges[:, np.newaxis]
    expected = breakpoints(scan, found, scan.ranges, points, gap)
    assert [
        (tuple(b["beam"].tolist()), str(b["kind"]), int(b["occluder"]))
        for b in features.breakpoints
    ] == [(beams, kind, occluder) for beams, _, kind, occluder in expected]
    return len(found.groups)


def assert_same_split(scan, extractor):
    """Hold candidates equal to the twin's, and pieces if none are merged. Returns the cuts."""
    method, noise = extractor.method, noise_of(scan, extractor)
    by_line = method.name == "split_and_merge"

    def tolerance(rho):
        sigma = np.sqrt(range_variance(rho, noise))
        growing = 0.0 if by_line else method.proportion * rho
        return method.threshold + growing + method.noise_factor * sigma

    found = parted(scan, clusters_of(method), noise)
    candidates, pieces = split(
        scan, found, noise, tolerance=tolerance, min_piece=method.min_piece, by_line=by_line
    )
    trace = extractor.trace(scan)
    assert trace.candidates["beam"].tolist() == [beam for beam, _, _ in candidates]
    for name, k in (("chord_distance", 1), ("response", 2)):
        expected = [candidate[k] for candidate in candidates]
        rtol, atol = (1e-6, 1e-7) if by_line else (1e-7, 1e-9)
        np.testing.assert_allclose(trace.candidates[name], expected, rtol=rtol, atol=atol)
    assert len(trace.cuts) == sum(excess > 1 for _, _, excess in candidates)
    if not by_line:
        segments, corners = trace.features.segments, trace.features.corners
        ends = list(zip(segments["first_beam"], segments["last_beam"], strict=True))
        assert ends == [(first, last) for first, last, _ in pieces]
        assert corners["segments"].tolist() == [
            [before, k] for k, (_, _, before) in enumerate(pieces) if before >= 0
        ]
    return len(trace.cuts)


def tracked(scan, extractor):
    """First and last beam of the lines that the kernel tracks, before they are merged."""
    method, block = extractor.method, Block(scan, noise_row(extractor.noise), 1)
    block.load(scan.ranges)
    block.take(0)
    method.part(block, method.min_points)
    track_lines(
        *block.workspace, method.threshold, method.noise_factor, method.max_misses,
        method.min_piece,
    )  # fmt: skip
    ends = block.work.pieces[[at.FIRST, at.LAST], : block.counts[at.PIECES]]
    return list(map(tuple, block.work.marks[at.BEAM][ends].T.tolist()))


def assert_same_lines(scan, extractor):
    noise = noise_of(scan, extractor)
    lines = track(scan, parted(scan, clusters_of(extractor.method), noise), noise, extractor.method)
    assert tracked(scan, extractor) == lines
    return len(lines)
