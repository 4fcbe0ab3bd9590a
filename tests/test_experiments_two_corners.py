"""Figure 13 and Table 2: the distance of two corners from five places."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from handmade import corner, features

import lineament as ln
from lineament.reproduce import Setting, two_corners
from lineament.reproduce.frames import batch_of
from lineament.reproduce.two_corners import (
    DISTANCE,
    POSES,
    WORLD,
    A,
    B,
    distance_bound,
    found_distances,
)
from lineament.simulation import SENSORS, truth

PAPER = SENSORS["paper"]


def test_both_corners_are_seen_well_from_all_five_places():
    assert math.dist(A, B) == pytest.approx(2.302, abs=1e-12)
    for pose in POSES:
        seen = truth(WORLD, pose, PAPER).transform(*pose)
        for vertex, convex in ((A, True), (B, False)):
            is_it = np.hypot(*(seen.corners["position"] - vertex).T) < 1e-9
            assert is_it.sum() == 1
            assert seen.corners["convex"][is_it][0] == convex
            sides = seen.corners["segments"][is_it][0]
            assert (seen.segments["n_points"][sides] >= 6).all()
        # No wall is a side of both: their errors are independent.
        assert len(set(seen.corners["segments"].ravel())) >= 4


def test_distance_is_of_the_nearest_corners_and_of_nothing_too_far():
    pose = (0.0, 0.0, 0.0)
    along = (B - A) / DISTANCE
    both = features(corners=[corner(*(A - 0.01 * along)), corner(*(A + 0.2 * along)), corner(*B)])
    one = features(corners=[corner(*A)])
    away = features(corners=[corner(*A), corner(*(B + 0.3 * along))])
    assert found_distances([both, one, away], pose) == pytest.approx([DISTANCE + 0.01])
    assert len(found_distances([features()], pose)) == 0


def test_distances_do_not_depend_on_the_frame():
    for pose in POSES:
        seen = truth(WORLD, pose, PAPER)
        assert found_distances([seen], pose) == pytest.approx([DISTANCE], abs=1e-9)


def test_bound_is_that_of_both_corners_along_their_line(monkeypatch):
    """Variances of 4 and 9 mm² along the line from A to B add up, those across do not count."""
    along = (B - A) / DISTANCE
    across = np.array((-along[1], along[0]))
    rows = [corner(*A), corner(*B)]
    for row, variance in zip(rows, (4e-6, 9e-6), strict=True):
        row["covariance"] = variance * np.outer(along, along) + 1e-2 * np.outer(across, across)
    monkeypatch.setattr(two_corners, "truth", lambda *_: features(corners=rows))
    assert distance_bound((0.0, 0.0, 0.0)) == pytest.approx(math.sqrt(13e-6))


@pytest.mark.slow
def test_good_method_spreads_like_the_bound_and_none_spreads_less():
    pose, rng = POSES[4], np.random.default_rng(2)
    scans = [PAPER.scan(WORLD, pose, rng) for _ in range(200)]
    distances = found_distances(batch_of(ln.Extractor("ransac", noise=PAPER.noise), scans), pose)
    assert len(distances) > 190
    error = np.sqrt(np.mean((distances - DISTANCE) ** 2))
    # 4 standard deviations of a standard deviation of 190 draws are 0.2 of it.
    assert 0.8 < error / distance_bound(pose) < 1.4


@pytest.mark.slow
def test_run_tells_what_the_paper_says_and_what_is_lost():
    findings = two_corners.run(Setting(frames=1), lambda _: None)
    overall, by_place = findings.tables
    rows = {row[0]: dict(zip(overall.columns, row, strict=True)) for row in overall.rows}
    assert "pdbs" not in rows
    for name, row in rows.items():
        assert row["paper: mean [m]"] == ("2.302" if name.startswith("liu") else None)
        assert row["paper: spread"] == ("lost" if name.startswith("liu") else None)
    assert rows["ransac"]["share of scans with both"] > 0.9
    assert rows["bound"]["RMS error ÷ bound"] == 1.0
    assert len(by_place.columns) == 6
    assert findings.figures[0].png.startswith(b"\x89PNG")
    assert json.loads(json.dumps(findings.to_dict()))["numbers"]["bound"]
