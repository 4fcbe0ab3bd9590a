"""PLE: vertices removed while the scan stays likely, against a twin and its authors' figures."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lineament_lab.evaluation.ple import load_benchmark, score_map
from lineament_lab.kernels.vertex_removal import remove_vertices
from worlds import BOX, NOISE, fan, full_circle, room, scan_of, vertex

from lineament import Extractor, LaserScan
from lineament.kernels import layout as at
from lineament.methods import get_method
from lineament.methods.workspace import Block


def removal(method, scan, rise=-math.inf):
    """Run the kernel alone. Returns the polylines, of points, and the rise at each corner."""
    block = Block(scan, np.array([NOISE.sigma, 0.0, 0.0, 0.0, 0.0]), 1)
    block.load(scan.ranges)
    block.take(0)
    method.part(block, method.min_points)
    remove_vertices(*block.workspace, rise, method.line_error, method.max_vertices)
    work, lines, rises = block.work, [], []
    for k in range(block.counts[at.PIECES]):
        first, last, before = work.pieces[:, k].tolist()
        if before != k - 1 or k == 0:
            lines.append([first])
        else:
            rises.append(float(work.response[k]))
        lines[-1].append(last)
    return block, lines, rises


def pieces_of(scan, rise, **parameters):
    """Polylines of vertices by beam, where all beams are one cluster."""
    method = get_method("ple", clusters="none", min_points=2, **parameters)
    block, lines, rises = removal(method, scan, rise)
    return [[int(block.work.marks[at.BEAM, i]) for i in line] for line in lines], rises


def cost_of(scan, vertices):
    """Σ ((ρ - ρ̂)/σ)² of the beams along a polyline, each ray cast at each of its links."""
    total = 0.0
    for first, last in pairwise(vertices):
        start, end = scan.points[first], scan.points[last]
        for beam in range(first + 1, last):
            if not scan.valid[beam]:
                continue
            ray = np.array([math.cos(scan.angles[beam]), math.sin(scan.angles[beam])])
            # ray * range = start + share * (end - start)
            matrix = np.column_stack((ray, start - end))
            if abs(np.linalg.det(matrix)) < 1e-12:
                return math.inf
            reach, share = np.linalg.solve(matrix, start)
            if reach <= 0.0 or not 0.0 <= share <= 1.0:
                return math.inf
            total += ((scan.ranges[beam] - reach) / NOISE.sigma) ** 2
    return total


def removed(scan, lines, rise, line_error, most):
    """Remove by the definition: each time every removal is tried, and its cost taken anew."""
    lines = [list(line) for line in lines]

    def price(line, k):
        if 0 < k < len(line) - 1:
            return cost_of(scan, line[:k] + line[k + 1 :]) - cost_of(scan, line)
        first, last = (line[0], line[1]) if k == 0 else (line[-2], line[-1])
        gone = [b for b in range(first, last + 1) if scan.valid[b]]
        if len(line) > 2:
            gone.remove(last if k == 0 else first)
        return len(gone) * (line_error / NOISE.sigma) ** 2 - cost_of(scan, [first, last])

    while lines:
        tried = [(price(line, k), i, k) for i, line in enumerate(lines) for k in range(len(line))]
        least, i, k = min(tried)
        left = sum(map(len, lines))
        if math.isinf(least) or (least > rise and (most == 0 or left <= most)):
            break
        if len(lines[i]) == 2:
            del lines[i]
        else:
            del lines[i][k]
    return lines, [price(line, k) for line in lines for k in range(1, len(line) - 1)]


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([3.0, 30.0, 300.0, -math.inf]),
    st.sampled_from([0, 4, 9]),
    st.sampled_from([0.05, 1.0]),
)
def test_every_removal_is_the_cheapest(seed, rise, most, line_error):
    rng = np.random.default_rng(seed)
    angles = np.linspace(-0.6, 0.6, int(rng.integers(3, 25)))
    ranges = 2.0 + 0.3 * rng.random() * np.abs(angles - rng.uniform(-0.5, 0.5))
    ranges += rng.normal(0.0, 0.02, len(angles)) + rng.integers(0, 2) * (angles > 0.2)
    scan = LaserScan(np.where(rng.random(len(angles)) < 0.05, np.nan, ranges), angles=angles)
    if scan.valid.sum() < 2 or (math.isinf(rise) and most == 0):
        return
    beams = np.flatnonzero(scan.valid).tolist()
    found, rises = pieces_of(scan, rise=rise, max_vertices=most, line_error=line_error)
    expected, prices = removed(scan, [beams], rise, line_error, most)
    assert found == expected
    np.testing.assert_allclose(rises, prices, rtol=1e-6, atol=1e-6)


def test_a_corner_by_hand():
    """Three beams at 2, 2, 2 m before a corner of two walls: one vertex stays, at the corner."""
    angles = fan(20)
    scan = scan_of(vertex(angles, 3.0, 90, convex=False), angles)
    assert pieces_of(scan, rise=1.0)[0] == [[0, len(angles) // 2, len(angles) - 1]]


@pytest.mark.parametrize("turn", [0, 1, 100, 359])
def test_a_ring_is_a_polygon_wherever_it_is_opened(turn):
    ranges = np.roll(room(full_circle(), BOX), turn)
    scan = LaserScan(ranges, 0.0, 2 * math.pi / len(ranges))
    for name in ("ple", "ple:paper"):
        features = Extractor(name, noise=NOISE)(scan)
        # As published, the wall at which the circle begins is in two pieces without a corner.
        at_a_corner = len(features.segments) == 4
        assert len(features.corners) == 4
        assert at_a_corner or (name == "ple:paper" and len(features.segments) == 5)


def test_without_a_threshold_the_budget_alone_decides():
    angles = fan(30)
    ranges = vertex(angles, 3.0, 90, convex=False)
    scan = scan_of(ranges + 0.01 * np.random.default_rng(1).normal(size=len(angles)), angles)
    for most in (2, 3, 5, 11):
        lines, _ = pieces_of(scan, -math.inf, max_vertices=most, line_error=10.0)
        assert sum(map(len, lines)) == most


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ple_real", "ple_sim"])
def test_the_authors_figures(data_dir, name):
    """The maps are as near to the scans as the authors' PLE, at every budget."""
    benchmark = load_benchmark(data_dir / "benchmark" / f"{name}.npz")
    theirs = benchmark.scores["rmse"][:, benchmark.methods.index("ple")]
    for k, most in enumerate(benchmark.max_vertices):
        # Simulated scans have no gap: their maps are polygons, which have no ends to remove.
        more = {} if name == "ple_real" else {"clusters": "none", "line_error": 1e6}
        method = get_method("ple:paper", max_vertices=most, **more)
        ours = [score_map(chords(method, scan), scan).rmse for scan in benchmark.scans]
        assert np.nanmean(ours) == pytest.approx(np.nanmean(theirs[:, k]), rel=0.01)


def chords(method, scan):
    """Polylines of the vertices that are left, as PLE has them."""
    block, lines, _ = removal(method, scan)
    return [block.work.points[[at.X, at.Y]][:, line].T for line in lines]
