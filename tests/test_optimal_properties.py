"""Method optimal on any scan: sound features, the same ones however they are asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from worlds import BOX, NOISE, degenerate_scans, full_circle, random_scan, room, scan_of

from lineament import Extractor, LaserScan

EXTRACTORS = {
    "default": Extractor("optimal"),
    "noise given": Extractor("optimal", noise=NOISE),
    "weak evidence": Extractor("optimal", evidence=5.0, max_missing=0),
}
every_extractor = pytest.mark.parametrize("extractor", EXTRACTORS.values(), ids=EXTRACTORS)
TABLES = ("segments", "corners", "arcs", "breakpoints", "clusters")


def assert_sound(scan, features):
    """Hold what is true of the features of any scan."""
    n, segments, corners, arcs = len(scan), features.segments, features.corners, features.arcs
    for table in (segments, corners, arcs):
        for name in table.dtype.names:
            # A corner at which a ring opens has no rise of χ².
            assert np.isfinite(table[name]).all() or name == "response", (name, table[name])
        if len(table):
            assert (np.linalg.eigvalsh(table["covariance"]) > 0).all()
    assert not np.isnan(corners["response"]).any()
    assert np.isfinite(features.breakpoints["position"]).all()
    for table in (segments, arcs):
        first, last = table["first_beam"], table["last_beam"]
        assert ((first >= 0) & (first < n) & (last >= 0) & (last < n)).all()
        assert (table["n_points"] <= (last - first) % max(n, 1) + 1).all()
        assert (table["n_points"] >= 2).all()
        assert scan.valid[first].all()
        assert scan.valid[last].all()
    assert (features.clusters[segments["first_beam"]] == segments["cluster"]).all()
    assert ((corners["segments"] >= 0) & (corners["segments"] < len(segments))).all()
    assert (corners["beam"] == segments["first_beam"][corners["segments"][:, 1]]).all()
    assert (arcs["radius"] > 0).all()
    beams = features.breakpoints["beam"]
    assert ((beams >= -1) & (beams < n)).all()
    assert (features.clusters[~scan.valid] == -1).all()
    labels = set(features.clusters.tolist()) - {-1}
    assert labels == set(range(len(labels)))
    if features.noise is not None:
        assert features.noise.sigma > 0


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


def geometries():
    """(number of beams, first bearing, step) of scans that go around and that do not."""
    for n in (1, 2, 3, 4, 7, 61, 360):
        yield n, -0.5, 0.005
        yield n, -math.pi, 2 * math.pi / n


def all_hostile():
    for k, (n, first, step) in enumerate(geometries()):
        for ranges in hostile_scans(n, np.random.default_rng(k)).values():
            yield LaserScan(ranges, first, step)


@every_extractor
def test_features_of_hostile_scans_are_sound(extractor):
    for scan in all_hostile():
        assert_sound(scan, extractor(scan))


@every_extractor
def test_features_of_degenerate_and_random_scans_are_sound(extractor):
    for scan in [*degenerate_scans().values(), *map(random_scan, range(40))]:
        assert_sound(scan, extractor(scan))


@pytest.mark.slow
@every_extractor
def test_features_of_thousands_of_scans_are_sound(extractor):
    rng = np.random.default_rng(1)
    for seed in range(1000, 2000):
        scan = random_scan(seed)
        assert_sound(scan, extractor(scan))
    for _ in range(100):
        n = int(rng.integers(1, 500))
        # With beams as near as the last digits, points determine no line.
        step = rng.choice([2 * math.pi / n, 0.01, 1e-9])
        for ranges in hostile_scans(n, rng).values():
            scan = LaserScan(ranges, -math.pi, step, range_max=rng.choice([5.0, np.inf]))
            assert_sound(scan, extractor(scan))


@pytest.mark.slow
@given(
    arrays(np.float64, st.integers(0, 80), elements=st.floats(width=64)),
    st.sampled_from([1e-6, 0.001, 0.01, 0.0775, 2 * math.pi / 40]),
)
@settings(max_examples=1500)
def test_features_of_any_floats_are_sound(ranges, step):
    step = min(step, 2 * math.pi / max(len(ranges), 1))
    scan = LaserScan(ranges, -1.0, step)
    assert_sound(scan, EXTRACTORS["default"](scan))


def test_garbage_has_few_features():
    for n, first, step in ((481, -1.4, math.radians(1 / 3)), (720, -math.pi, 2 * math.pi / 720)):
        for name, ranges in hostile_scans(n, np.random.default_rng(3)).items():
            found = EXTRACTORS["default"](LaserScan(ranges, first, step))
            # A walk is made of straight pieces, and near ones hold few readings of all sizes.
            many = ("white noise of all sizes", "walk", "every sort")
            limit = n // 12 if name in many else 12
            assert len(found.segments) + len(found.arcs) <= limit, name
            assert len(found.corners) <= limit, name


@pytest.mark.parametrize("n", [60, 360, 1440])
def test_a_circle_around_the_scanner_is_no_polygon(n):
    extractor, noise = EXTRACTORS["default"], np.random.default_rng(n).normal(size=n)
    for sigma in (0.0, 0.003, 0.02):
        for radius in (0.5, 2.0, 10.0):
            found = extractor(LaserScan(radius + sigma * noise, -math.pi, 2 * math.pi / n))
            assert len(found.segments) + len(found.corners) + len(found.arcs) <= 6


def test_readings_behind_each_other_are_no_segment():
    """Three and four along a beam, between two walls."""
    angles = math.radians(1.0) * np.arange(-30, 31)
    ranges = 3.0 / np.cos(angles)
    for count in (3, 4):
        behind = ranges.copy()
        behind[30 : 30 + count] = np.linspace(1.0, 1.5, count)
        found = EXTRACTORS["noise given"](LaserScan(behind, angles[0], math.radians(1.0)))
        deviations = np.sqrt(found.segments["covariance"][:, 1, 1])
        assert (np.degrees(deviations) < 15).all()


def test_ranges_that_no_scanner_reports_are_no_features():
    for value in (1e-300, 1e-9, 1e7, 1e150, 1e300):
        features = EXTRACTORS["default"](LaserScan(np.full(50, value), 0.0, 0.01))
        assert len(features.segments) == len(features.breakpoints) == 0
        assert (features.clusters == -1).all()


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


def rotated(points, turn):
    c, s = math.cos(turn), math.sin(turn)
    return points @ [[c, s], [-s, c]]


@pytest.mark.parametrize("turn", [0.3, math.pi / 2, -2.0])
def test_features_turn_with_the_bearings(turn):
    """All directions are alike: no axis is special."""
    extractor = EXTRACTORS["default"]
    for seed in range(20):
        scan = random_scan(seed)
        limits = {"range_min": scan.range_min, "range_max": scan.range_max}
        one = extractor(scan)
        if scan.is_regular:
            fields = {"angle_min": scan.angle_min + turn, "angle_increment": scan.angle_increment}
        else:
            fields = {"angles": scan.angles + turn}
        other = extractor(LaserScan(scan.ranges, **fields, **limits))
        assert other.clusters.tolist() == one.clusters.tolist()
        for table, names in (
            ("segments", ("start", "end", "centroid")),
            ("corners", ("position",)),
        ):
            before, after = getattr(one, table), getattr(other, table)
            assert len(after) == len(before)
            for name in names:
                np.testing.assert_allclose(after[name], rotated(before[name], turn), atol=1e-6)
        for name in ("first_beam", "last_beam"):
            assert other.segments[name].tolist() == one.segments[name].tolist()
        np.testing.assert_allclose(
            other.segments["covariance"], one.segments["covariance"], rtol=1e-5, atol=1e-12
        )
        np.testing.assert_allclose(
            other.arcs["center"], rotated(one.arcs["center"], turn), atol=1e-6
        )


def test_wherever_the_seam_lies_the_room_is_the_same():
    n = 720
    ring, step = full_circle(n), 2 * math.pi / n
    ranges = room(ring, BOX) + 0.01 * np.random.default_rng(2).normal(size=n)
    one = EXTRACTORS["noise given"](scan_of(ranges, ring))
    assert len(one.corners) == len(one.segments) == 4
    for shift in range(0, n, 45):
        turned = LaserScan(np.roll(ranges, shift), -math.pi - shift * step, step)
        other = EXTRACTORS["noise given"](turned)
        assert len(other.breakpoints) == 0
        for table, name in (("segments", "centroid"), ("corners", "position")):
            before, after = getattr(one, table)[name], getattr(other, table)[name]
            order = [int(np.hypot(*(after - p).T).argmin()) for p in before]
            assert sorted(order) == [0, 1, 2, 3]
            np.testing.assert_allclose(after[order], before, atol=1e-9)
