"""Features as points with named fields: each field worked by hand."""

import math

import numpy as np
import pytest
from handmade import arc, corner, features, random_features, segment

from lineament.features import make_records
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


def only(name, **fields):
    """The point of one feature, of which these fields are known."""
    (point,) = feature_points(features(**{name: make_records(name, [fields])}))
    return filled(point)


def test_segment():
    ends = {"start": (1, 2), "end": (4, 6), "centroid": (2.5, 4.25), "angle": 0.75}
    beams = {"first_beam": 90, "last_beam": 3, "n_points": 14}
    sizes = {"rms": 0.5, "misfit": 0.25, "length": 5.0}
    assert only("segments", **ends, **beams, **sizes, covariance=[[4, 1], [1, 2]]) == (
        named("x y z kind", 2.5, 4.25, 0, 0)
        | named("start_x start_y end_x end_y angle", 1, 2, 4, 6, 0.75)
        | named("c00 c01 c11", 4, 1, 2)
        | beams
        | sizes
    )


@pytest.mark.parametrize("is_convex", [False, True])
@pytest.mark.parametrize(("kind", "number"), [("corner", 0), ("slit", 1), ("edge", 2), ("", -1)])
def test_corner(is_convex, kind, number):
    place = {"position": (1, 2), "covariance": [[4, 1], [1, 2]], "beam": 7, "segments": (3, 0)}
    shape = {"opening": 1.5, "quality": 0.75}
    assert only("corners", **place, **shape, convex=is_convex, kind=kind) == (
        named("x y z kind convex", 1, 2, 0, 1, float(is_convex))
        | named("c00 c01 c11", 4, 1, 2)
        | named("first_beam last_beam segment_a segment_b", 7, 7, 3, 0)
        | shape
        | ({"corner": number} if kind else {})
    )


def test_arc():
    covariance = [[1, 2, 3], [2, 4, 5], [3, 5, 6]]
    same = {"radius": 0.25, "rms": 0.5, "first_beam": 3, "last_beam": 9, "n_points": 7}
    assert only("arcs", center=(1, 2), covariance=covariance, **same) == (
        named("x y z kind", 1, 2, 0, 2) | named("c00 c01 c02 c11 c12 c22", 1, 2, 3, 4, 5, 6) | same
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
