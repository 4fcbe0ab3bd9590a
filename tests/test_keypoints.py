"""FALKO and FLIRT: keypoints of scans worked by hand, their defining numbers by a plain twin."""

import math

import numpy as np
import pytest
from lineament_lab.methods.flirt import FLIRT, foreground
from lineament_lab.methods.keypoints import runs_of
from worlds import BOX, BOX_CORNERS, NOISE, fan, full_circle, room, scan_of, vertex

from lineament import Extractor, LaserScan
from lineament.methods import get_method


def corner_scan(opening=90, half=20, **shape):
    angles = fan(half)
    return scan_of(vertex(angles, 3.0, opening, convex=False, **shape), angles)


@pytest.mark.parametrize("name", ["falko", "falko:paper"])
def test_a_corner_is_one_keypoint_where_its_walls_meet(name):
    features = Extractor(name, noise=NOISE)(corner_scan())
    (corner,) = features.corners
    np.testing.assert_allclose(corner["position"], (3.0, 0.0), atol=1e-6)
    assert 0.5 < corner["quality"] <= 1.0
    assert corner["segments"].tolist() == [-1, -1]
    assert len(features.segments) == 0


@pytest.mark.parametrize("name", ["falko", "flirt"])
def test_a_wall_has_no_keypoint(name):
    angles = fan(40)
    scan = scan_of(2.0 / np.cos(angles), angles)
    assert len(Extractor(name, noise=NOISE)(scan).corners) == 0


def test_a_flat_corner_fails_the_triangle():
    """At 3 m the radius is .185 m: the height of 150° over it is 2·.185·cos 75°/2 < .4·.185."""
    for opening, found in ((90, 1), (120, 1), (150, 0)):
        assert len(Extractor("falko", noise=NOISE)(corner_scan(opening)).corners) == found


@pytest.mark.parametrize("turn", [0, 1, 57, 200])
def test_the_corners_of_a_box_wherever_its_circle_begins(turn):
    angles = full_circle()
    ranges = np.roll(room(angles, BOX), -turn)
    scan = LaserScan(ranges, angles[turn], 2 * math.pi / len(angles))
    assert scan.is_full_circle
    for name, off in (("falko", 0.02), ("flirt", 0.2)):
        found = Extractor(name, noise=NOISE)(scan).corners["position"]
        for corner in BOX_CORNERS:
            assert np.hypot(*(found - corner).T).min() < off


def twin_signal(points, trees, scale):
    """The signal by its definition: Kruskal's trees, Floyd's distances, sums in loops."""
    n = len(points)
    links = sorted(
        (math.dist(points[i], points[j]), i, j)
        for i in range(n)
        for j in range(i + 1, n)
        if (i, j) != (0, n - 1)
    )
    apart = np.full((n, n), np.inf)
    np.fill_diagonal(apart, 0.0)
    for _ in range(trees):
        of, rest = list(range(n)), []
        for length, i, j in links:
            if of[i] == of[j]:
                rest.append((length, i, j))
                continue
            of = [of[i] if one == of[j] else one for one in of]
            apart[i, j] = apart[j, i] = length
        links = rest
    for k in range(n):
        apart = np.minimum(apart, apart[:, k : k + 1] + apart[k])
    kernel = np.exp(-(apart**2) / (2 * scale**2))
    density = [sum(row) for row in kernel]
    signal = []
    for i in range(n):
        weights = [kernel[i, j] / (density[i] * density[j]) for j in range(n)]
        smooth = sum(w * p for w, p in zip(weights, points, strict=True)) / sum(weights)
        off = 2 * math.dist(points[i], smooth) / scale
        signal.append(off * math.exp(-off))
    return np.array(signal)


@pytest.mark.parametrize("seed", range(8))
def test_the_signal_of_flirt(seed):
    """Each keypoint's quality is its signal by definition, and each maximum is one."""
    rng = np.random.default_rng(seed)
    scan = corner_scan(60 + 10 * seed, half=12)
    scan = LaserScan(scan.ranges + rng.normal(0.0, 0.004, len(scan)), angles=scan.angles)
    method = get_method("flirt", scales=1, scale=0.15 + 0.02 * seed, least_signal=0.05)
    assert isinstance(method, FLIRT)
    places, scores = method.keypoints(scan)
    signal = twin_signal(scan.points, method.trees, method.scale)
    inner = np.arange(1, len(signal) - 1)
    peaks = inner[
        (signal[inner] > 0.05)
        & (signal[inner] > signal[inner - 1] + method.rise)
        & (signal[inner] > signal[inner + 1] + method.rise)
    ]
    assert len(places) <= len(peaks) > 0
    for score in scores:
        assert np.abs(signal[peaks] * math.e - score).min() < 1e-3
    for place in places:
        apart = [math.dist(place, other) for other in places]
        assert sorted(apart)[1:2] == [] or sorted(apart)[1] > 0.2
        assert min(math.dist(place, scan.points[k]) for k in (0, -1)) >= 2 * method.scale


def test_the_near_side_of_a_jump():
    ranges = np.array([2.0] * 5 + [3.5, 3.5, np.nan, 1.0, 1.0])
    scan = LaserScan(ranges, -0.6, 0.01)
    beams = np.flatnonzero(scan.valid)
    # Beam 6 is beside one without a range: the next that has one is no neighbour.
    assert [foreground(scan, beams, i) for i in (4, 5, 6, 7)] == [4, 4, 6, 7]


def test_runs_over_the_seam():
    flags = np.array([True, False, False, True])
    assert [run.tolist() for run in runs_of(flags, circular=True)] == [[3, 0]]
    assert [run.tolist() for run in runs_of(flags, circular=False)] == [[0], [3]]
    assert runs_of(np.zeros(3, dtype=bool), circular=True) == []
    assert [run.tolist() for run in runs_of(np.ones(3, dtype=bool), circular=True)] == [[0, 1, 2]]
