"""Features as points with named fields: each field worked by hand."""

import math

import numpy as np
import pytest
from handmade import arc, corner, features, random_features, segment

from lineament.features import ARC, CORNER, SEGMENT
from lineament.motion import Tracks
from lineament.output.feature_points import (
    FEATURE_POINT,
    SEGMENT_POINT,
    feature_points,
)


def filled(point):
    """Fields of a record that its kind fills, as plain numbers."""
    return {
        name: value
        for name, value in zip(point.dtype.names, point.item(), strict=True)
        if not (value == -1 if FEATURE_POINT[name].kind == "i" else math.isnan(value))
    }


def named(names, *values):
    return dict(zip(names.split(), values, strict=True))


def test_all_fields_are_words_without_gaps():
    assert FEATURE_POINT.itemsize == 4 * len(FEATURE_POINT.names) == 116
    for name in FEATURE_POINT.names:
        assert FEATURE_POINT[name].str in {"<f4", "<i4", "<u4"}


def test_segment():
    row = np.zeros((), SEGMENT)
    row["start"], row["end"], row["centroid"], row["angle"] = (1, 2), (4, 6), (2.5, 4.25), 0.75
    row["covariance"] = [[4, 1], [1, 2]]
    row["first_beam"], row["last_beam"], row["n_points"], row["rms"] = 90, 3, 14, 0.5
    row["misfit"], row["length"] = 0.25, 5.0
    (point,) = feature_points(features(segments=[row]))
    assert filled(point) == (
        named("x y z kind", 2.5, 4.25, 0, 0)
        | named("start_x start_y end_x end_y angle", 1, 2, 4, 6, 0.75)
        | named("c00 c01 c11 rms misfit length", 4, 1, 2, 0.5, 0.25, 5)
        | named("first_beam last_beam n_points", 90, 3, 14)
    )


@pytest.mark.parametrize("is_convex", [False, True])
@pytest.mark.parametrize(("kind", "number"), [("corner", 0), ("slit", 1), ("edge", 2), ("", -1)])
def test_corner(is_convex, kind, number):
    row = np.zeros((), CORNER)
    row["position"], row["covariance"] = (1, 2), [[4, 1], [1, 2]]
    row["opening"], row["convex"], row["beam"], row["segments"] = 1.5, is_convex, 7, (3, 0)
    row["quality"], row["kind"] = 0.75, kind
    (point,) = feature_points(features(corners=[row]))
    assert filled(point) == (
        named("x y z kind opening convex", 1, 2, 0, 1, 1.5, float(is_convex))
        | named("c00 c01 c11", 4, 1, 2)
        | named("first_beam last_beam segment_a segment_b quality", 7, 7, 3, 0, 0.75)
        | ({"corner": number} if kind else {})
    )


def test_arc():
    row = np.zeros((), ARC)
    row["center"], row["radius"], row["rms"] = (1, 2), 0.25, 0.5
    row["covariance"] = [[1, 2, 3], [2, 4, 5], [3, 5, 6]]
    row["first_beam"], row["last_beam"], row["n_points"] = 3, 9, 7
    (point,) = feature_points(features(arcs=[row]))
    assert filled(point) == (
        named("x y z kind radius rms", 1, 2, 0, 2, 0.25, 0.5)
        | named("c00 c01 c02 c11 c12 c22", 1, 2, 3, 4, 5, 6)
        | named("first_beam last_beam n_points", 3, 9, 7)
    )


@pytest.mark.parametrize("seed", range(5))
def test_segments_of_corners_are_indices_of_points(seed):
    found = random_features(seed)
    points = feature_points(found)
    n, m = len(found.segments), len(found.corners)
    assert points["kind"].tolist() == [0] * n + [1] * m + [2] * len(found.arcs)
    corners = points[n : n + m]
    for name in ("segment_a", "segment_b"):
        sides = corners[name][corners[name] >= 0]
        assert (points["kind"][sides] == SEGMENT_POINT).all()


def test_nothing_found_is_no_points():
    points = feature_points(features())
    assert (points.shape, points.dtype) == ((0,), FEATURE_POINT)


def test_what_is_not_finite_keeps_its_place():
    corners = [corner(np.nan, 0), corner(1e300, -math.inf), corner(1, 2)]
    segments = [segment((1e300, 0), (1, 1), 0, 1)]
    points = feature_points(features(segments=segments, corners=corners))
    assert points["x"][[1, 2, 3]].tolist() == [pytest.approx(math.nan, nan_ok=True), math.inf, 1]
    assert points["y"][2] == -math.inf


def tracks_of(*numbers):
    nothing = np.empty(0, np.int64)
    return Tracks(*(np.array(n, np.int64) for n in numbers), nothing, nothing, None)


def test_tracks_have_their_numbers():
    found = features(
        segments=[segment((0, 0), (1, 0), 0, 1)],
        corners=[corner(0, 0), corner(1, 0)],
        arcs=[arc(2, 1, 0.25, 0, 1)],
    )
    assert feature_points(found)["track"].tolist() == [-1] * 4
    points = feature_points(found, tracks_of([7], [0, 123_456], [9]))
    assert points["track"].tolist() == [7, 0, 123_456, 9]
    with pytest.raises(ValueError, match=r"tracks have 1, 1, 1 .* expected 1, 2, 1"):
        feature_points(found, tracks_of([7], [0], [9]))
