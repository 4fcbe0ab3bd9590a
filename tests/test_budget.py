"""The vertex budget: fewer pieces, by the least squared error, never more vertices than allowed."""

import math
from itertools import pairwise

import numpy as np
import pytest
from lineament_lab.evaluation.ple import polylines_of
from worlds import random_scan

import lineament as ln
from lineament.kernels import layout as at
from lineament.kernels.budget import limit_pieces
from lineament.methods.workspace import budget_scratch

LINK, WORST = 1.0, 0.25


def simplified(ranges, angles, pieces, budget, link=LINK, worst=WORST):
    """Run the kernel on pieces (first, last, before) over beams; NaN ranges are no points."""
    ranges = np.asarray(ranges, float)
    memory = at.workspace(len(ranges))
    work, n = at.named(*memory), len(pieces)
    points = np.flatnonzero(~np.isnan(ranges))
    work.beams[at.RANGE, : len(ranges)] = ranges
    work.marks[at.BEAM, : len(points)] = points
    work.pieces[[at.FIRST, at.LAST, at.BEFORE], :n] = np.transpose(pieces)
    work.response[:n], work.counts[at.PIECES] = np.arange(n), n
    bearings = np.stack((np.cos(angles), np.sin(angles)))
    tables = budget_scratch(len(ranges), budget)
    limit_pieces(*memory, bearings, budget, link, worst, *tables)
    left = work.counts[at.PIECES]
    found = work.pieces[[at.FIRST, at.LAST, at.BEFORE], :left].T.tolist()
    return list(map(tuple, found)), work.response[:left].tolist()


def squares(ranges, angles, first, last):
    """Least Σ ρ⁴ (1/ρ - A cos φ - B sin φ)², by a solver."""
    points = np.flatnonzero(~np.isnan(ranges))[first : last + 1]
    r, phi = ranges[points], angles[points]
    rows = r[:, None] ** 2 * np.column_stack((np.cos(phi), np.sin(phi)))
    a_b = np.linalg.lstsq(rows, r, rcond=None)[0]
    return float(np.sum((rows @ a_b - r) ** 2))


def vertices_of(features, scan):
    return sum(len(polyline) for polyline in polylines_of(features, scan))


def vertices(pieces):
    return sum(2 - (k > 0 and before >= 0) for k, (_, _, before) in enumerate(pieces))


def cost(ranges, angles, original, pieces, worst):
    """Σ (χ² - worst² · points), a corner's point counting for the piece before it."""
    shared = {b[0] for a, b in pairwise(original) if a[1] == b[0]}
    total = 0.0
    for first, last, _ in pieces:
        points = last - first + (first not in shared)
        total += squares(ranges, angles, first, last) - worst**2 * points
    return total


def all_ways(ranges, angles, pieces, link):
    """Every list of pieces that joining and leaving out can lead to."""
    points = np.flatnonzero(~np.isnan(ranges))
    xy = ranges[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))

    def linked(k):
        a, b = pieces[k - 1][1], pieces[k][0]
        if pieces[k][2] >= 0:
            return True
        near = math.dist(xy[points[a]], xy[points[b]]) <= link
        return near and points[b] - points[a] == b - a

    def ways(k, is_kept):
        if k == len(pieces):
            yield []
            return
        yield from ways(k + 1, False)
        after = k
        while True:
            after += 1
            joints = {False, is_kept and pieces[k][2] >= 0}
            for joint in joints:
                for rest in ways(after, True):
                    yield [(pieces[k][0], pieces[after - 1][1], 0 if joint else -1), *rest]
            if after == len(pieces) or not linked(after):
                return

    yield from ways(0, False)


def random_pieces(rng):
    n = int(rng.integers(12, 40))
    ranges = np.abs(np.cumsum(rng.normal(0, 0.3, n)) + 3) + 0.5
    ranges[rng.random(n) < 0.08] = np.nan
    angles = rng.uniform(-3, 2) + 0.03 * np.arange(n)
    count = int((~np.isnan(ranges)).sum())
    pieces, at = [], 0
    while at + 2 < count and len(pieces) < 6:
        last = min(at + int(rng.integers(1, 7)), count - 1)
        joined = bool(pieces) and at == pieces[-1][1]
        pieces.append((at, last, len(pieces) - 1 if joined else -1))
        at = last + int(rng.choice([0, 0, 1, 2]))
    return ranges, angles, pieces


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_no_way_costs_less(seed):
    rng = np.random.default_rng(seed)
    ranges, angles, pieces = random_pieces(rng)
    worst, link = float(rng.choice([0.1, 0.5, 3.0])), float(rng.choice([0.3, 1.0]))
    ways, firsts = list(all_ways(ranges, angles, pieces, link)), [first for first, _, _ in pieces]
    for budget in range(1, vertices(pieces)):
        found, responses = simplified(ranges, angles, pieces, budget, link, worst)
        allowed = [way for way in ways if vertices(way) <= budget]
        assert [(first, last, min(before, 0)) for first, last, before in found] in allowed
        # What is left is numbered anew, and has the response of its first piece.
        assert all(before in (-1, k - 1) for k, (_, _, before) in enumerate(found))
        assert responses == [firsts.index(first) for first, _, _ in found]
        least = min(cost(ranges, angles, pieces, way, worst) for way in allowed)
        assert cost(ranges, angles, pieces, found, worst) == pytest.approx(least, abs=1e-9)
    assert simplified(ranges, angles, pieces, vertices(pieces), link, worst)[0] == pieces


def square(false_corner):
    """Return a square room seen all around, opened at a vertex, cut once too often."""
    angles = math.pi / 4 + 2 * math.pi / 80 * np.arange(81)
    ranges = 2.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    cuts = sorted({0, 20, 40, 60, 80, false_corner})
    pieces = [(a, b, k - 1) for k, (a, b) in enumerate(pairwise(cuts))]
    pieces[0] = (*pieces[0][:2], len(pieces) - 1)
    return ranges, angles, pieces


@pytest.mark.parametrize(
    ("false_corner", "budget", "before"),
    [*((cut, 5, [3, 0, 1, 2]) for cut in (10, 30, 70)), (20, 4, [-1, 0, 1])],
)
def test_a_ring_stays_closed_unless_it_loses_a_wall(false_corner, budget, before):
    found, _ = simplified(*square(false_corner), budget)
    assert [piece[2] for piece in found] == before
    walls = [(0, 20), (20, 40), (40, 60), (60, 80)]
    assert [piece[:2] for piece in found] == walls[: len(found)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_features_of_any_scan_stay_within_the_budget(seed):
    scan = random_scan(seed)
    method = {"method": "liu:scale_free", "threshold": 0.05}
    had = vertices_of(ln.extract(scan, **method), scan)
    for budget in (1, 2, 3, 5, 8, 13, 21):
        used = vertices_of(ln.extract(scan, **method, max_vertices=budget), scan)
        assert used <= min(budget, had)
