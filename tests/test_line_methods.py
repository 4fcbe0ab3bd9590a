"""What every method of lines must do, whatever its way: no fault of others is ours."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import (
    BOX,
    NOISE,
    degenerate_scans,
    fan,
    full_circle,
    random_scan,
    room,
    scan_of,
    vertex,
    wall,
)

from lineament import Extractor, LaserScan

NAMES = ["iepf", "split_and_merge", "line_tracking"]
EXTRACTORS = {name: Extractor(name, noise=NOISE) for name in NAMES}
DEGENERATE = degenerate_scans()
every_method = pytest.mark.parametrize("extractor", EXTRACTORS.values(), ids=EXTRACTORS)


def noisy(ranges, seed=0):
    return ranges + NOISE.sigma * np.random.default_rng(seed).normal(size=len(ranges))


def assert_sound(scan, features):
    """Hold what is true of the features of any scan."""
    segments, corners = features.segments, features.corners
    for table in (segments, corners):
        for name in set(table.dtype.names) - {"kind"}:
            assert np.isfinite(table[name]).all(), name
    assert (corners["kind"] == "corner").all()
    for table in (segments["covariance"], corners["covariance"]):
        assert (np.linalg.eigvalsh(table) > 0).all()
    valid = np.flatnonzero(scan.valid)
    for line in segments:
        first, last = int(line["first_beam"]), int(line["last_beam"])
        beams = valid[(valid - first) % len(scan) <= (last - first) % len(scan)]
        # On a ring, the reading at which it was opened belongs to its first and its last line.
        assert line["n_points"] in (len(beams), 1 + len(scan) * (first == last))
        assert set(features.clusters[beams]) == {line["cluster"]}
    for corner in corners:
        before, after = corner["segments"]
        assert segments["cluster"][before] == segments["cluster"][after]
        assert corner["beam"] == segments["first_beam"][after]
    assert (features.clusters[~scan.valid] == -1).all()


@every_method
def test_features_of_any_scan_are_sound(extractor):
    for scan in [*DEGENERATE.values(), *map(random_scan, range(20))]:
        for given in (extractor, Extractor(extractor.method)):
            assert_sound(scan, given(scan))


@every_method
@pytest.mark.parametrize("normal", [0, 90, 180, 270, 30])
def test_wall_has_its_ends_along_an_axis_too(extractor, normal):
    angles = math.radians(normal) + fan(30)
    scan = scan_of(wall(angles, 2.0, normal), angles)
    (line,) = extractor(scan).segments
    np.testing.assert_allclose(line["start"], scan.points[0], atol=1e-9)
    np.testing.assert_allclose(line["end"], scan.points[-1], atol=1e-9)
    assert line["n_points"] == len(angles)


@every_method
@pytest.mark.parametrize("opening", [60, 90, 120])
@pytest.mark.parametrize("convex", [True, False])
def test_vertex_is_found_and_no_beam_lost(extractor, opening, convex):
    angles = fan(15)
    ranges = noisy(vertex(angles, 3.0, opening, convex=convex))
    features = extractor(scan_of(ranges, angles))
    (corner,) = features.corners
    np.testing.assert_allclose(corner["position"], (3.0, 0.0), atol=0.02)
    assert corner["opening"] == pytest.approx(math.radians(opening), abs=0.05)
    assert corner["convex"] == convex
    first, second = features.segments
    assert first["end"].tolist() == second["start"].tolist() == corner["position"].tolist()
    assert (first["first_beam"], second["last_beam"]) == (0, len(angles) - 1)
    assert second["first_beam"] - first["last_beam"] in (0, 1)


@every_method
@pytest.mark.parametrize("short", [2.0, 4.0, 8.0])
def test_an_unequal_l_is_split(extractor, short):
    """The point farthest from the line fitted to both arms is the end of the shorter one."""
    angles = np.radians(np.arange(-30.0, short, 1 / 3))
    scan = scan_of(noisy(vertex(angles, 3.0, 90, convex=False)), angles)
    (corner,) = extractor(scan).corners
    np.testing.assert_allclose(corner["position"], (3.0, 0.0), atol=0.06)


@every_method
def test_one_missing_or_false_beam_does_not_end_a_segment(extractor):
    angles = fan(30)
    for false in (np.nan, np.inf, 0.0, 2.1):
        ranges = noisy(wall(angles, 2.0, 10.0))
        ranges[60] = false
        features = extractor(scan_of(ranges, angles))
        (line,) = features.segments
        assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
        assert features.breakpoints["kind"].tolist() == ["scan_end", "scan_end"]


@every_method
def test_walls_on_either_side_of_a_doorway_are_not_bridged(extractor):
    angles = fan(40)
    door = abs(angles) < math.radians(12)
    for behind, pieces in ((np.inf, 2), (5.0, 3)):
        ranges = noisy(np.where(door, wall(angles, behind, 0.0), wall(angles, 2.0, 0.0)))
        features = extractor(scan_of(ranges, angles))
        assert len(features.segments) == pieces
        assert len(features.corners) == 0
        for line in features.segments:
            assert len(set(door[line["first_beam"] : line["last_beam"] + 1])) == 1


@every_method
def test_closed_room_has_a_ring_of_corners(extractor):
    angles = full_circle()
    for turn in (0.0, 1.0, 2.5):
        ranges = noisy(room(angles + turn, BOX))
        features = extractor(scan_of(ranges, angles))
        corners, segments = features.corners, features.segments
        assert len(corners) == len(segments) == 4
        assert len(features.breakpoints) == 0
        c, s = math.cos(turn), math.sin(turn)
        own = corners["position"] @ [[c, s], [-s, c]]
        for vertex_at in ((2.0, 1.3), (-2.4, 1.3), (-2.4, -1.7), (2.0, -1.7)):
            assert np.hypot(*(own - vertex_at).T).min() < 0.02
        assert sorted(corners["segments"][:, 1]) == [0, 1, 2, 3]


@every_method
def test_wall_over_the_seam_is_one(extractor):
    angles = full_circle()
    ranges = np.where(abs(angles) > 2.6, wall(angles, 2.0, 180.0), np.inf)
    features = extractor(scan_of(noisy(ranges), angles))
    (line,) = features.segments
    assert line["first_beam"] > line["last_beam"]
    assert line["n_points"] == (abs(angles) > 2.6).sum()


@every_method
def test_tolerances_follow_the_noise(extractor):
    """Three times the noise, estimated from the scan, and the same corners: nothing is retuned."""
    angles = full_circle()
    unaware = Extractor(extractor.method)
    for sigma in (0.002, 0.01, 0.03):
        ranges = room(angles, BOX) + sigma * np.random.default_rng(5).normal(size=len(angles))
        assert len(unaware(scan_of(ranges, angles)).corners) == 4


@pytest.mark.slow
@every_method
def test_covariances_of_corners_have_the_lever_arm(extractor):
    """NEES of χ² with two degrees of freedom, its 95 % interval widened for cuts a beam off."""
    angles = fan(25)
    ideal = vertex(angles, 3.0, 90, convex=False)
    nees = []
    for seed in range(300):
        (corner,) = extractor(scan_of(noisy(ideal, seed), angles)).corners
        error = corner["position"] - (3.0, 0.0)
        nees.append(error @ np.linalg.solve(corner["covariance"], error))
    assert np.median(nees) == pytest.approx(2 * math.log(2), rel=0.2)
    assert 1.7 < np.mean(nees) < 2.6


@every_method
def test_batches_are_those_of_scans_alone(extractor):
    rng = np.random.default_rng(1)
    rows = room(full_circle(360), BOX) + 0.02 * rng.normal(size=(12, 360))
    rows[rng.random(rows.shape) < 0.03] = np.nan
    step = 2 * math.pi / 360
    batch = extractor.batch(rows, angle_min=-math.pi, angle_increment=step, workers=2)
    for features, row in zip(batch, rows, strict=True):
        alone = Extractor(extractor.method, noise=NOISE)(LaserScan(row, -math.pi, step))
        for name in ("segments", "corners", "breakpoints", "clusters"):
            np.testing.assert_array_equal(getattr(features, name), getattr(alone, name))
