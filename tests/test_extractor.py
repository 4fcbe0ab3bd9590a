"""Extractor: one scan or many, any order, any threads; invariances; hostile scans."""

import math

import numpy as np
import pytest
from equality import assert_sound
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import BOX, NOISE, STEP, degenerate_scans, full_circle, random_scan, room

import lineament as ln
from lineament import Extractor, LaserScan
from lineament.checks.sound import difference
from lineament.features import TABLES
from lineament.methods import method_names
from lineament.methods.stages import estimate_noise

DEGENERATE = degenerate_scans()
PRESETS = ("liu", "liu:paper", "liu:scale_free")


def test_a_batch_has_the_same_bytes_whatever_the_threads():
    """Also the gaps in its records, and with more workers than scans."""
    rows = room(full_circle(360), BOX) + 0.01 * np.random.default_rng(0).normal(size=(14, 360))
    rows[7] = np.nan
    extractor, data = Extractor("liu", sigma_d=0.5), {name: set() for name in (*TABLES, "clusters")}
    for workers in (1, 2, np.int64(3), 64):
        batch = extractor.batch(rows, angles=full_circle(360), workers=workers, stamps=range(14))
        assert (len(batch), batch.stamps.tolist()) == (14, list(range(14)))
        for name, of in data.items():
            of.add(getattr(batch, name).tobytes())
    assert len(batch.corners) > 20
    assert {len(of) for of in data.values()} == {1}


def test_scans_that_differ_in_a_field_are_not_taken_for_each_other():
    frame = {"angle_min": 0.0, "angle_increment": 0.01}
    changes = {"angle_min": 1.0, "angle_increment": 0.02, "range_max": 2.0, "range_min": 2.5}
    scans = []
    for name, value in changes.items():
        other = frame | {name: value}
        scans += [LaserScan([2.0] * 60, **fields) for fields in (frame, other, frame)]
    angles = 0.01 * np.arange(60)
    scans += [LaserScan([2.0] * 60, angles=angles + k * np.sin(angles)) for k in (0, 0.1, 0.2, 0)]
    for name in PRESETS:
        kept = Extractor(name)
        assert not any(difference(kept(scan), Extractor(name)(scan)) for scan in scans)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ranges": [1.0, 2.0]}, r"ranges has shape \(2,\), expected \(m, n\)"),
        ({"ranges": [[1.0] * 3, [1.0]]}, "3 in row 0 and 1 in row 1, expected as many in each"),
        ({"ranges": [["a"]]}, r"ranges is \[\['a'\]\], expected numbers"),
        ({"workers": 0}, "workers is 0"),
        ({"workers": 1.5}, r"workers is 1\.5"),
        ({"workers": True}, "workers is True"),
        ({"stamps": [1.0]}, r"stamps has shape \(1,\), expected \(2,\)"),
        ({"stamps": [math.nan, 1.0]}, "stamps have one that is not finite, expected numbers"),
        ({"angle_min": None}, "angle_min and angle_increment, or angles"),
        ({"angle_increment": 0.0}, "angle_increment is 0"),
        ({"range_max": 0.0}, r"range_max is 0\.0"),
        ({"angles": [0.0]}, "angles are given together"),
    ],
)
def test_batch_refuses(changes, message):
    given = {"ranges": [[1.0] * 3] * 2, "angle_min": 0.0, "angle_increment": 0.1, **changes}
    with pytest.raises(ValueError, match=message):
        Extractor("liu").batch(**given)


def test_features_carry_stamp_frame_and_noise():
    scan = LaserScan([2.0] * 30, 0.0, 0.01, stamp=4.5, frame_id="front")
    features = ln.extract(scan, method="liu", noise=NOISE)
    assert (features.stamp, features.frame_id, features.noise) == (4.5, "front", NOISE)
    assert ln.extract(scan, method="liu").noise.sigma > 0
    for name in ("zero beams", "all invalid", "two of nothing"):
        assert ln.extract(DEGENERATE[name], method="liu").noise is None


# Invariances


@pytest.mark.parametrize("seed", range(4))
def test_twice_the_world_gives_twice_the_features(seed):
    scan = random_scan(seed)
    noise = {"noise": ln.RangeNoise(sigma=0.01)}
    twice = {"noise": ln.RangeNoise(sigma=0.02), "sigma_r": 0.6}
    limits = {"range_min": 2 * scan.range_min, "range_max": 2 * scan.range_max}
    large = LaserScan(2 * scan.ranges, angles=scan.angles, **limits)
    a = Extractor("liu:scale_free", **noise)(scan)
    b = Extractor("liu:scale_free", **twice)(large)
    assert len(a.segments) == len(b.segments) > 0
    for name in ("start", "end", "centroid", "rms"):
        np.testing.assert_allclose(b.segments[name], 2 * a.segments[name], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(b.segments["angle"], a.segments["angle"], atol=1e-12)
    units = np.array([[4.0, 2.0], [2.0, 1.0]])
    np.testing.assert_allclose(
        b.segments["covariance"], units * a.segments["covariance"], 1e-6, 1e-15
    )
    np.testing.assert_allclose(b.corners["position"], 2 * a.corners["position"], rtol=1e-9)
    np.testing.assert_allclose(b.corners["response"], a.corners["response"], rtol=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_missing_beams_at_the_ends_change_nothing_but_indices(seed):
    rng = np.random.default_rng(seed)
    ranges = np.repeat(rng.uniform(1, 5, 6), 20) + 0.01 * rng.normal(size=120)
    plain = LaserScan(ranges, 0.0, STEP)
    padded = LaserScan([np.nan] * 9 + ranges.tolist() + [np.inf] * 5, -9 * STEP, STEP)
    extractor = Extractor("liu", noise=NOISE)
    a, b = extractor(plain), extractor(padded)
    assert b.clusters[9:-5].tolist() == a.clusters.tolist()
    assert (b.clusters[:9] == -1).all()
    shifted = {"segments": ("first_beam", "last_beam"), "corners": ("beam",)}
    for table, names in shifted.items():
        for name in names:
            assert (getattr(b, table)[name] == getattr(a, table)[name] + 9).all()
    for name in ("start", "end", "angle", "covariance", "rms"):
        np.testing.assert_allclose(b.segments[name], a.segments[name], rtol=1e-9, atol=1e-12)
    assert b.breakpoints["kind"].tolist() == a.breakpoints["kind"].tolist()


# Hostile scans

NASTY = [np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1e-9, 0.05, 0.1, 30.0, 29.999, 1e9, 1e-300]
measurement = st.one_of(
    st.sampled_from(NASTY), st.floats(0.1, 40.0), st.sampled_from([2.0, 2.0, 2.01, 5.0])
)


METHODS = [name for name in method_names() if not name.startswith(("optimal", "pdbs"))]


@settings(max_examples=150)
@given(
    ranges=st.lists(measurement, max_size=60),
    name=st.sampled_from(METHODS),
    full=st.booleans(),
    limited=st.booleans(),
    given=st.booleans(),
)
def test_hostile_scans_give_sound_features(ranges, name, full, limited, given):
    limits = {"range_min": 0.05, "range_max": 30.0} if limited else {}
    step = 2 * math.pi / max(len(ranges), 1) if full else 0.01
    scan = LaserScan(ranges, -math.pi, step, **limits)
    extractor = Extractor(name, noise=NOISE if given else None)
    assert_sound(extractor(scan), scan, extractor.method)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize(
    ("noise", "seeds"),
    [
        (None, range(12)),
        (NOISE, range(12)),
        pytest.param(None, range(1000, 1150), marks=pytest.mark.slow),
    ],
)
def test_degenerate_and_random_scans_give_sound_features(name, noise, seeds):
    extractor = Extractor(name, noise=noise)
    for scan in [*DEGENERATE.values(), *map(random_scan, seeds)]:
        assert_sound(extractor(scan), scan, extractor.method)


def test_huge_ranges_do_not_drown_their_neighbours():
    ranges = np.full(41, 2.0)
    ranges[[5, 20, 21]] = 3.4e38, 1e50, 1e7
    filtered = ln.trace(LaserScan(ranges, -0.2, 0.01), method="liu").filtered
    np.testing.assert_allclose(filtered, ranges, rtol=1e-6)


def test_a_jump_without_noise_is_no_lattice():
    scan = LaserScan([2.0] * 20 + [4.0] * 20, 0.0, 0.01)
    # Seen from the centre, arcs are off the lines of neighbours by 0.1 and 0.2 mm.
    assert estimate_noise(scan).sigma < 0.0002
    assert len(set(ln.extract(scan).clusters)) == 2
