"""The vertex budget: fewer pieces, by the least squared error, never more vertices than allowed."""

import math
from itertools import pairwise

import numpy as np
import pytest
from worlds import random_scan

import lineament as ln
from lineament.evaluation.ple import polylines_of
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
    bearings, tables = (
        np.stack((np.cos(angles), np.sin(angles))),
        budget_scratch(len(ranges), budget),
    )
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


@pytest.mark.parametrize("seed", range(40))
def test_no_way_costs_less(seed):
    rng = np.random.default_rng(seed)
    ranges, angles, pieces = random_pieces(rng)
    worst, link = float(rng.choice([0.1, 0.5, 3.0])), float(rng.choice([0.3, 1.0]))
    ways = list(all_ways(ranges, angles, pieces, link))
    for budget in range(1, vertices(pieces)):
        found, _ = simplified(ranges, angles, pieces, budget, link, worst)
        assert vertices(found) <= budget
        allowed = [way for way in ways if vertices(way) <= budget]
        spans = [[piece[:2] for piece in way] for way in allowed]
        assert [piece[:2] for piece in found] in spans
        least = min(cost(ranges, angles, pieces, way, worst) for way in allowed)
        assert cost(ranges, angles, pieces, found, worst) == pytest.approx(least, abs=1e-9)


def l_shape():
    """Return the walls x = 2 and y = 2, whose corner is beam 40 of 81."""
    angles = math.pi / 4 + np.radians(np.arange(-40, 41))
    return 2.0 / np.maximum(np.cos(angles), np.sin(angles)), angles


def test_a_corner_on_a_straight_wall_goes_first():
    ranges, angles = l_shape()
    pieces = [(0, 20, -1), (20, 40, 0), (40, 80, 1)]
    assert simplified(ranges, angles, pieces, 4) == (pieces, [0.0, 1.0, 2.0])
    assert simplified(ranges, angles, pieces, 3) == ([(0, 40, -1), (40, 80, 0)], [0.0, 2.0])


def test_what_has_no_room_is_left_out():
    ranges, angles = l_shape()
    pieces = [(0, 40, -1), (40, 60, 0)]
    assert simplified(ranges, angles, pieces, 2)[0] == [(0, 40, -1)]
    assert simplified(ranges, angles, pieces, 1)[0] == []


def test_an_end_left_out_takes_its_corner_along():
    ranges, angles = l_shape()
    pieces = [(0, 10, -1), (10, 40, 0), (40, 80, 1)]
    found, responses = simplified(
        ranges + np.where(np.arange(81) < 10, 9.0, 0.0), angles, pieces, 3
    )
    assert found == [(10, 40, -1), (40, 80, 0)]
    assert responses == [1.0, 2.0]


@pytest.mark.parametrize(
    ("gap", "silent", "joined"), [(0.4, False, True), (1.2, False, False), (0.4, True, False)]
)
def test_clusters_become_one_across_a_small_gap_that_all_beams_see(gap, silent, joined):
    y = np.concatenate((np.linspace(-1.0, 0.0, 12), np.linspace(gap, gap + 1.0, 11)))
    if silent:
        y = np.insert(y, 12, gap / 2)
    ranges, angles = np.hypot(y, 3.0), np.arctan2(y, 3.0)
    if silent:
        ranges[12] = np.nan
    found, _ = simplified(ranges, angles, [(0, 11, -1), (12, 22, -1)], 3)
    assert found == ([(0, 22, -1)] if joined else [(0, 11, -1)])


def square(false_corner):
    """Return a square room seen all around, opened at a vertex, cut once too often."""
    angles = math.pi / 4 + 2 * math.pi / 80 * np.arange(81)
    ranges = 2.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    cuts = sorted({0, 20, 40, 60, 80, false_corner})
    pieces = [(a, b, k - 1) for k, (a, b) in enumerate(pairwise(cuts))]
    pieces[0] = (*pieces[0][:2], len(pieces) - 1)
    return ranges, angles, pieces


@pytest.mark.parametrize("false_corner", [10, 30, 70])
def test_a_ring_stays_closed(false_corner):
    ranges, angles, pieces = square(false_corner)
    found, _ = simplified(ranges, angles, pieces, 5)
    assert found == [(0, 20, 3), (20, 40, 0), (40, 60, 1), (60, 80, 2)]


def test_a_ring_that_loses_a_wall_opens():
    ranges, angles, pieces = square(20)
    found, _ = simplified(ranges, angles, pieces, 4)
    assert [before for _, _, before in found] == [-1, 0, 1]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_features_of_any_scan_stay_within_the_budget(seed):
    scan = random_scan(seed)
    method = {"method": "liu:scale_free", "threshold": 0.05}
    had = vertices_of(ln.extract(scan, **method), scan)
    for budget in (1, 2, 3, 5, 8, 13, 21):
        used = vertices_of(ln.extract(scan, **method, max_vertices=budget), scan)
        assert used <= min(budget, had)
