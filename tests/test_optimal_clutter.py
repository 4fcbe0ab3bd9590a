"""Method optimal and measurements that are on no surface, and those that are missing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_optimal_scenes import extractors, noisy, of_kind
from worlds import BOX, NOISE, fan, room, scan_of, vertex, wall

from lineament import Extractor


@extractors
@pytest.mark.parametrize("between", [(2.7,), (2.5, 3.2), (3.6,)])
def test_mixed_pixels_between_two_depths_are_noise(extractor, between):
    angles = fan(30)
    ranges, edge = np.where(angles < 0, wall(angles, 2.0, 0.0), wall(angles, 4.0, 0.0)), 90
    ranges[edge : edge + len(between)] = between
    features = extractor(scan_of(noisy(ranges), angles))
    assert len(features.segments) == 2
    assert features.corners["kind"].tolist() == ["edge"]
    assert (features.clusters[edge : edge + len(between)] == -1).all()
    assert features.segments["last_beam"][0] == edge - 1
    assert features.segments["first_beam"][1] == edge + len(between)


@extractors
@pytest.mark.parametrize("off", [-1.0, -0.3, 0.3, 2.0])
def test_spike_on_a_wall_is_dropped(extractor, off):
    angles = fan(30)
    ranges = noisy(wall(angles, 2.0, 10.0))
    ranges[60] += off
    features = extractor(scan_of(ranges, angles))
    (line,) = features.segments
    assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
    assert line["n_points"] == len(angles) - 1
    assert features.clusters[60] == -1
    assert (np.delete(features.clusters, 60) == 0).all()
    assert features.breakpoints["kind"].tolist() == ["scan_end", "scan_end"]


@extractors
@pytest.mark.parametrize("far", [30.0, 1e3, 1e5])
def test_what_is_far_away_does_not_disturb_what_is_near(extractor, far):
    angles = fan(80)
    ranges = noisy(room(angles, BOX), 1)
    ranges[20:22] = far, 1.01 * far
    features = extractor(scan_of(ranges, angles))
    assert 3 <= len(features.segments) <= 4
    assert len(of_kind(features, "corner")) == 2
    assert features.segments["rms"].max() < 0.012


@extractors
def test_panels_of_one_wall_beside_a_slit_have_no_corner(extractor):
    """Their lines cross somewhere, as all lines do."""
    angles = fan(30)
    for seed in range(40):
        ranges = noisy(wall(angles, 2.0, 20.0), seed)
        ranges[8:10] = 9.0
        features = extractor(scan_of(ranges, angles))
        assert len(of_kind(features, "slit")) == len(of_kind(features, "corner")) == 0


@extractors
def test_drop_outs_do_not_cut_a_wall(extractor):
    angles = fan(30)
    ranges = noisy(wall(angles, 2.0, 10.0))
    lost = np.random.default_rng(1).random(len(angles)) < 0.2
    ranges[lost] = np.inf
    (line,) = extractor(scan_of(ranges, angles)).segments
    assert line["n_points"] == (~lost).sum()
    assert line["rms"] == pytest.approx(NOISE.sigma, rel=0.2)


@pytest.mark.parametrize("max_missing", [0, 3, 6])
def test_wall_goes_on_over_as_many_missing_beams_as_are_allowed(max_missing):
    angles, extractor = fan(30), Extractor("optimal", max_missing=max_missing)
    for missing, pieces in ((max_missing, 1), (max_missing + 1, 2)):
        ranges = noisy(wall(angles, 2.0, 0.0))
        ranges[50 : 50 + missing] = np.nan
        assert len(extractor(scan_of(ranges, angles)).segments) == pieces


@extractors
@pytest.mark.parametrize("normal", [0, 90, 180, 270, 30])
def test_wall_ends_at_its_last_measurements(extractor, normal):
    angles = math.radians(normal) + fan(30)
    scan = scan_of(noisy(wall(angles, 2.0, normal)), angles)
    (line,) = extractor(scan).segments
    direction = [math.cos(line["angle"]), math.sin(line["angle"])]
    for end, point in ((line["start"], scan.points[0]), (line["end"], scan.points[-1])):
        assert (end - point) @ direction == pytest.approx(0.0, abs=1e-9)
        assert np.hypot(*(end - point)) < 4 * NOISE.sigma


def test_evidence_is_what_a_corner_must_have():
    """A faint corner is two walls for who asks for little, one wall for who asks for much."""
    angles = fan(6)
    scan = scan_of(noisy(vertex(angles, 3.0, 150, convex=False), 2), angles)
    (corner,) = Extractor("optimal", evidence=10.0, noise=NOISE)(scan).corners
    for evidence, corners in ((0.9 * corner["response"], 1), (1.1 * corner["response"], 0)):
        found = Extractor("optimal", evidence=evidence, noise=NOISE)(scan)
        assert len(found.corners) == corners
