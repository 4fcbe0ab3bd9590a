"""Features as points with named fields: those of the table of features, under their own names."""

import math

import numpy as np
import pytest
from handmade import arc, corner, edge, features, segment
from test_tables import random_features

from lineament.features.tables import features_table
from lineament.motion import Tracks
from lineament.output.feature_points import FEATURE_POINT, feature_points

KINDS = ("segment", "corner", "arc", "edge")
CORNERS, SIDES = ("corner", "slit"), ("start", "end")
#: Fields that the table has under another name.
COLUMNS = {f"c{n}": f"cov_{n}" for n in ("00", "01", "02", "11", "12", "22")}
COLUMNS |= {"segment_a": "segment_before", "segment_b": "segment_after"}


def point_of(row):
    """Numbers of a point from a row of the table; what its kind does not fill is -1 or NaN."""
    known = {"z": 0.0, "kind": KINDS.index(row["kind"])}
    if row["kind"] in ("corner", "edge"):
        known |= {"first_beam": row["beam"], "last_beam": row["beam"]}
    if row["kind"] == "corner":
        known |= {"corner": CORNERS.index(row["corner"])}
    if row["kind"] == "edge":
        known |= {"segment_a": row["segment"], "side": SIDES.index(row["side"])}
    point = []
    for name in FEATURE_POINT.names:
        value = known.get(name, row.get(COLUMNS.get(name, name)))
        missing = -1 if FEATURE_POINT[name].kind == "i" else math.nan
        point.append(missing if value is None else value)
    return tuple(point)


@pytest.mark.parametrize("seed", range(10))
def test_points_are_the_rows_of_the_table(seed):
    found = random_features(seed, counts=(4, 6, 5, 3, 2))
    rows = [row for row in features_table([found]).to_pylist() if row["kind"] in KINDS]
    expected = [point_of(row) for row in sorted(rows, key=lambda row: KINDS.index(row["kind"]))]
    points = feature_points(found)
    assert points.tobytes() == np.array(expected, FEATURE_POINT).tobytes()
    # Segments come first: segments_a are their indices.
    assert points["kind"].tolist() == [0] * 4 + [1] * 6 + [2] * 3 + [3] * 5
    found.corners["kind"][2] = ""
    found.edges["side"][1] = ""
    points = feature_points(found)
    assert (points["corner"][6], points["side"][14]) == (-1, -1)


def test_all_fields_are_words_without_gaps():
    assert FEATURE_POINT.itemsize == 4 * len(FEATURE_POINT.names) == 120
    for name in FEATURE_POINT.names:
        assert FEATURE_POINT[name].str in {"<f4", "<i4", "<u4"}
    points = feature_points(features())
    assert (points.shape, points.dtype) == ((0,), FEATURE_POINT)


def test_what_is_not_finite_keeps_its_place():
    corners = [corner(np.nan, 0), corner(1e300, -math.inf), corner(1, 2)]
    segments = [segment((1e300, 0), (1, 1), 0, 1)]
    points = feature_points(features(segments=segments, corners=corners))
    assert points["x"][[1, 2, 3]].tolist() == [pytest.approx(math.nan, nan_ok=True), math.inf, 1]
    assert points["y"][2] == -math.inf


def test_tracks_have_their_numbers():
    found = features(
        segments=[segment((0, 0), (1, 0), 0, 1)],
        corners=[corner(0, 0), corner(1, 0)],
        arcs=[arc(2, 1, 0.25, 0, 1)],
        edges=[edge(1, 1)],
    )
    assert feature_points(found)["track"].tolist() == [-1] * 5
    numbers = [np.array(n, np.int64) for n in ([7], [0, 123_456], [9], [], [])]
    assert feature_points(found, Tracks(*numbers, None))["track"].tolist() == [7, 0, 123_456, 9, -1]
    numbers[1] = numbers[1][:1]
    with pytest.raises(ValueError, match=r"tracks have 1, 1, 1 .* expected 1, 2, 1"):
        feature_points(found, Tracks(*numbers, None))
