"""Method optimal on any scan: sound features, the same ones however they are asked for."""

from __future__ import annotations

import math
from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_optimal_symmetry import simulated
from worlds import BOX, NOISE, degenerate_scans, full_circle, random_scan, room

from lineament import Extractor, LaserScan, LogError
from lineament.logs import find_logs, open_log
from lineament.simulation import SENSORS

EXTRACTORS = {
    "default": Extractor("optimal"),
    "noise given": Extractor("optimal", noise=NOISE),
    "weak evidence": Extractor("optimal", evidence=5.0, max_missing=0),
}
every_extractor = pytest.mark.parametrize("extractor", EXTRACTORS.values(), ids=EXTRACTORS)
TABLES = ("segments", "corners", "arcs", "breakpoints", "clusters")
#: Scale of a surface [m], distance of a corner from its measurements and its deviation [m].
SURFACE, REACH, MOST = 0.03, 0.3, 0.1


def deviation(features, rho):
    """Deviation of a measurement about its surface."""
    noise = features.noise
    return math.hypot(noise.sigma, noise.proportional * rho, noise.quantum / 12**0.5, SURFACE)


def assert_sound(scan, features, extractor):
    """Hold what is true of the features of any scan."""
    n, segments, corners, arcs = len(scan), features.segments, features.corners, features.arcs
    for table in (segments, corners, arcs):
        for name in table.dtype.names:
            assert name == "kind" or np.isfinite(table[name]).all(), (name, table[name])
        if len(table):
            assert (np.linalg.eigvalsh(table["covariance"]) > 0).all()
    assert np.isfinite(features.breakpoints["position"]).all()
    for table in (segments, arcs):
        first, last = table["first_beam"], table["last_beam"]
        assert ((first >= 0) & (first < n) & (last >= 0) & (last < n)).all()
        assert (table["n_points"] <= (last - first) % max(n, 1) + 1).all()
        assert (table["n_points"] >= 2).all()
        assert scan.valid[first].all()
        assert scan.valid[last].all()
    assert (features.clusters[segments["first_beam"]] == segments["cluster"]).all()
    assert (segments["misfit"] >= 0).all()
    assert (arcs["radius"] > 0).all()
    beams = features.breakpoints["beam"]
    assert ((beams >= -1) & (beams < n)).all()
    assert (features.clusters[~scan.valid] == -1).all()
    labels = set(features.clusters.tolist()) - {-1}
    assert labels == set(range(len(labels)))
    if features.noise is not None and extractor.noise is None:
        farthest = features.noise.proportional * scan.ranges[scan.valid & (scan.ranges < 1e6)].max()
        assert 0 < math.hypot(features.noise.sigma, farthest) <= MOST * (1 + 1e-9)
    for segment in segments:
        assert_drawn_where_it_was_measured(scan, features, segment)
    for corner in corners:
        assert_known(corner, segments)


def assert_drawn_where_it_was_measured(scan, features, segment):
    """Its direction is that of its ends; these are near its own measurements, or at a corner."""
    first, last, start, end = (
        segment[name] for name in ("first_beam", "last_beam", "start", "end")
    )
    beams = (first + np.arange((last - first) % len(scan) + 1)) % len(scan)
    beams = beams[scan.valid[beams]]
    own = scan.points[beams]
    along = np.array([math.cos(segment["angle"]), math.sin(segment["angle"])])
    across = np.array([-along[1], along[0]])
    assert (end - start) @ along > 0
    assert (end - start) @ across == pytest.approx(0, abs=1e-6 * scan.ranges[first])
    assert (start - segment["centroid"]) @ along < 0 < (end - segment["centroid"]) @ along
    spacing = np.hypot(*np.diff(own, axis=0).T)
    step = abs(math.sin(scan.angles[beams[1]] - scan.angles[beams[0]]))
    assert np.hypot(*(end - start)) >= step * scan.ranges[beams].min()
    sharp = features.corners[features.corners["kind"] == "corner"]["position"].tolist()
    for place, nearest, step in ((start, own[0], spacing[0]), (end, own[-1], spacing[-1])):
        error = 3 * deviation(features, scan.ranges[beams].max())
        if place.tolist() in sharp:
            assert np.hypot(*(place - nearest)) <= max(REACH, step + error)
        else:
            assert np.hypot(*(own - place).T).min() <= step + error


def assert_known(corner, segments):
    """It is of one of three kinds, between the right segments, and its place is known."""
    assert 0 <= corner["quality"] <= 1
    assert math.sqrt(np.linalg.eigvalsh(corner["covariance"])[-1]) <= MOST
    a, b = corner["segments"]
    assert min(a, b) >= -1
    assert max(a, b) < len(segments)
    if corner["kind"] == "edge":
        assert min(a, b) == -1 < max(a, b)
        assert corner["opening"] == corner["response"] == 0
        end, beam = ("end", "last_beam") if b < 0 else ("start", "first_beam")
        assert segments[end][max(a, b)].tolist() == corner["position"].tolist()
        assert segments[beam][max(a, b)] == corner["beam"]
        return
    assert min(a, b) >= 0 != a - b
    assert corner["beam"] == segments["first_beam"][b]
    assert 0 < corner["opening"] < math.pi
    ends = segments["end"][a].tolist(), segments["start"][b].tolist()
    at = corner["position"].tolist()
    assert corner["kind"] in ("corner", "slit")
    assert ends == (at, at) if corner["kind"] == "corner" else at not in ends


def hostile_scans(n, rng):
    """Make scans that show nothing, by name."""
    mixed = rng.uniform(2, 4, n)
    mixed[rng.random(n) < 0.2] = np.nan
    spike = np.full(n, 2.0)
    spike[n // 2] = 5.0
    return {
        "white noise": rng.uniform(0.1, 10, n),
        "white noise of all sizes": 10.0 ** rng.uniform(-3, 3, n),
        "constant": np.full(n, 3.0),
        "one spike": spike,
        "near and far": np.where(np.arange(n) % 2, 1.0, 5.0),
        "near and far in twos": np.where(np.arange(n) // 2 % 2, 1.0, 5.0),
        "near and far in threes": np.where(np.arange(n) // 3 % 2, 1.0, 1.2),
        "all mixed": mixed,
        "walk": np.abs(2 + np.cumsum(rng.normal(0, 0.05, n))),
        "lattice": np.round(rng.uniform(0.5, 2, n), 1),
        "huge": np.full(n, 1e300),
        "huge and noisy": 1e300 * rng.uniform(0.9, 1, n),
        "large": 1e9 * rng.uniform(0.9, 1, n),
        "tiny": np.full(n, 1e-300),
        "tiny and noisy": 1e-9 * rng.uniform(0.9, 1, n),
        "all NaN": np.full(n, np.nan),
        "all infinite": np.full(n, np.inf),
        "negative": -rng.uniform(1, 2, n),
        "every sort": rng.choice([np.nan, np.inf, -np.inf, 0, -1, 1e-320, 1e308, 1, 2], n),
    }


def all_hostile():
    """Scans of few and many beams, that go around and that do not."""
    for k, n in enumerate((1, 2, 3, 4, 7, 61, 360)):
        for first, step in ((-0.5, 0.005), (-math.pi, 2 * math.pi / n)):
            for ranges in hostile_scans(n, np.random.default_rng(k)).values():
                yield LaserScan(ranges, first, step)


@every_extractor
def test_features_of_hostile_scans_are_sound(extractor):
    for scan in [*all_hostile(), *degenerate_scans().values()]:
        assert_sound(scan, extractor(scan), extractor)


@every_extractor
def test_features_of_random_scans_are_sound(extractor):
    for scan in map(random_scan, range(40)):
        assert_sound(scan, extractor(scan), extractor)


@pytest.mark.parametrize("sensor", SENSORS)
def test_features_of_simulated_scans_are_sound(sensor):
    for scan in simulated(sensor):
        assert_sound(scan, EXTRACTORS["default"](scan), EXTRACTORS["default"])


@pytest.mark.slow
def test_features_of_recorded_scans_are_sound(data_dir):
    checked = 0
    for path in find_logs(data_dir):
        try:
            log = open_log(path)
        except LogError:
            continue
        for scan in islice(log, 3, None, max(len(log) // 25, 1)):
            extractor = EXTRACTORS["default"]
            assert_sound(scan, extractor(scan), extractor)
            checked += 1
    assert checked > 400


@pytest.mark.slow
@every_extractor
def test_features_of_thousands_of_scans_are_sound(extractor):
    rng = np.random.default_rng(1)
    for seed in range(1000, 1400):
        scan = random_scan(seed)
        assert_sound(scan, extractor(scan), extractor)
    for _ in range(30):
        n = int(rng.integers(1, 500))
        # With beams as near as the last digits, points determine no line.
        step = rng.choice([2 * math.pi / n, 0.01, 1e-9])
        for ranges in hostile_scans(n, rng).values():
            scan = LaserScan(ranges, -math.pi, step, range_max=rng.choice([5.0, np.inf]))
            assert_sound(scan, extractor(scan), extractor)


@pytest.mark.slow
@given(
    arrays(np.float64, st.integers(0, 80), elements=st.floats(width=64)),
    st.sampled_from([1e-6, 0.001, 0.01, 0.0775, 2 * math.pi / 40]),
)
@settings(max_examples=500)
def test_features_of_any_floats_are_sound(ranges, step):
    step = min(step, 2 * math.pi / max(len(ranges), 1))
    scan = LaserScan(ranges, -1.0, step)
    assert_sound(scan, EXTRACTORS["default"](scan), EXTRACTORS["default"])


def test_ranges_that_no_scanner_reports_are_no_features():
    for value in (1e-300, 1e-9, 1e7, 1e150, 1e300):
        features = EXTRACTORS["default"](LaserScan(np.full(50, value), 0.0, 0.01))
        assert len(features.segments) == len(features.breakpoints) == 0
        assert (features.clusters == -1).all()


# However they are asked for


def assert_equal_features(one, other):
    for name in TABLES:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    np.testing.assert_equal(one.noise, other.noise)


@every_extractor
def test_a_scan_has_the_same_features_each_time(extractor):
    """Whatever came before: nothing of the last scan is left in the workspace."""
    scans = [random_scan(k, n=150) for k in range(15)]
    first = [extractor(scan) for scan in scans]
    fresh = [Extractor(extractor.method, noise=extractor.noise)(scan) for scan in scans]
    again = [extractor(scan) for scan in reversed(scans)][::-1]
    for one, other, third in zip(first, fresh, again, strict=True):
        assert_equal_features(one, other)
        assert_equal_features(one, third)


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_batches_are_those_of_scans_alone(workers):
    extractor, n = EXTRACTORS["default"], 360
    rng, step = np.random.default_rng(1), 2 * math.pi / n
    rows = room(full_circle(n), BOX) + 0.02 * rng.normal(size=(20, n))
    rows[rng.random(rows.shape) < 0.03] = np.nan
    rows[7], rows[8] = rng.uniform(0, 5, n), np.nan
    batch = extractor.batch(rows, angle_min=-math.pi, angle_increment=step, workers=workers)
    for features, row in zip(batch, rows, strict=True):
        assert_equal_features(features, extractor(LaserScan(row, -math.pi, step)))
