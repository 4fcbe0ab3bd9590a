"""Features and FeatureBatch: moving, tables, views."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from worlds import BOX, NOISE, full_circle, room, scan_of

import lineament as ln
from lineament.features import ARC, TABLES, FeatureBatch, Features, noise_of, noise_row

RING = full_circle()


@pytest.fixture(scope="module")
def features() -> Features:
    rng = np.random.default_rng(1)
    ranges = room(RING, BOX) + 0.01 * rng.normal(size=len(RING))
    ranges[120:140] = 0.7  # a post before the wall
    scan = scan_of(ranges, RING, stamp=2.5, frame_id="laser")
    settings = {"response": "relative", "threshold": 0.1}
    found = ln.extract(scan, method="liu", noise=NOISE, **settings)
    assert min(len(found.segments), len(found.corners), len(found.breakpoints)) > 0
    # The method finds no arcs: one by hand.
    arcs = np.zeros(1, ARC)
    root = rng.normal(size=(3, 3))
    arcs["center"], arcs["radius"], arcs["covariance"] = [(1.0, -2.0)], 0.4, root @ root.T
    found.arcs = arcs
    return found


def test_move_by_hand(features):
    moved = features.transform(10.0, -5.0, math.pi / 2, frame_id="map")
    for table, name in (
        ("segments", "start"),
        ("segments", "end"),
        ("segments", "centroid"),
        ("corners", "position"),
        ("arcs", "center"),
        ("breakpoints", "position"),
    ):
        x, y = getattr(features, table)[name].T
        expected = np.column_stack((10.0 - y, -5.0 + x))
        np.testing.assert_allclose(getattr(moved, table)[name], expected, atol=1e-12)
    turn = moved.segments["angle"] - features.segments["angle"] - math.pi / 2
    np.testing.assert_allclose(np.sin(turn), 0, atol=1e-12)
    assert (np.cos(turn) > 0).all()
    assert (abs(moved.segments["angle"]) <= math.pi).all()
    # A quarter turn swaps the variances and the sign of the covariance.
    (a, b), (_, c) = features.corners["covariance"][0]
    np.testing.assert_allclose(moved.corners["covariance"][0], [(c, -b), (-b, a)], atol=1e-15)
    p = features.arcs["covariance"][0]
    expected = [
        [p[1, 1], -p[0, 1], -p[1, 2]],
        [-p[0, 1], p[0, 0], p[0, 2]],
        [-p[1, 2], p[0, 2], p[2, 2]],
    ]
    np.testing.assert_allclose(moved.arcs["covariance"][0], expected, atol=1e-12)
    np.testing.assert_array_equal(moved.segments["covariance"], features.segments["covariance"])
    assert (moved.frame_id, moved.stamp, moved.noise) == ("map", 2.5, features.noise)
    assert features.transform(0, 0, 1).frame_id == "laser"
    assert moved.clusters is features.clusters


def test_what_does_not_move(features):
    moved = features.transform(1.0, 2.0, -3.0)
    for name, dtype in TABLES.items():
        for field in dtype.names:
            if field in ("start", "end", "centroid", "position", "center", "angle", "covariance"):
                continue
            found, expected = getattr(moved, name)[field], getattr(features, name)[field]
            np.testing.assert_array_equal(found, expected)


def test_new_columns_do_not_move(features):
    segments, corners = features.segments.copy(), features.corners.copy()
    segments["misfit"] = 0.001 * np.arange(len(segments))
    corners["quality"], corners["kind"] = 0.25, "edge"
    moved = replace(features, segments=segments, corners=corners).transform(1.0, 2.0, -3.0)
    assert moved.segments["misfit"].tolist() == segments["misfit"].tolist()
    assert set(moved.corners["quality"]) == {0.25}
    assert set(moved.corners["kind"].tolist()) == {"edge"}


def test_moved_covariance_is_that_of_moved_samples(features):
    corner = features.corners[0]
    rng = np.random.default_rng(0)
    samples = rng.multivariate_normal(corner["position"], corner["covariance"], 40_000)
    c, s = math.cos(0.7), math.sin(0.7)
    turned = samples @ np.array([[c, -s], [s, c]]).T
    expected = features.transform(3, 4, 0.7).corners["covariance"][0]
    scale = np.sqrt(np.outer(*[np.diag(expected)] * 2))
    assert (abs(np.cov(turned.T) - expected) / scale < 0.03).all()


def test_moving_there_and_back(features):
    back = features.transform(0.0, 0.0, 2.0).transform(1.0, 2.0, 0.0)
    back = back.transform(-1.0, -2.0, 0.0).transform(0.0, 0.0, -2.0)
    for name, dtype in TABLES.items():
        for field in dtype.names:
            if getattr(features, name)[field].dtype.kind == "f":
                np.testing.assert_allclose(
                    getattr(back, name)[field], getattr(features, name)[field], atol=1e-12
                )


def test_dict_is_json(features):
    text = json.dumps(features.to_dict(), allow_nan=False)
    again = json.loads(text)
    assert again["segments"][0]["centroid"] == features.segments["centroid"][0].tolist()
    assert again["corners"][0]["convex"] is bool(features.corners["convex"][0])
    assert again["corners"][0]["kind"] == "corner"
    assert again["corners"][0]["quality"] == features.corners["quality"][0]
    assert again["segments"][0]["misfit"] == features.segments["misfit"][0]
    assert again["breakpoints"][0]["kind"] == features.breakpoints["kind"][0]
    assert len(again["clusters"]) == len(RING)
    assert again["noise"] == {"sigma": 0.01, "proportional": 0, "bearing": 0, "quantum": 0}
    assert (again["stamp"], again["frame_id"]) == (2.5, "laser")
    empty = ln.extract(ln.LaserScan([np.nan] * 3, 0.0, 0.1)).to_dict()
    assert json.loads(json.dumps(empty, allow_nan=False))["noise"] is None
    assert empty["clusters"] == [-1, -1, -1]


def test_arrow_has_a_row_a_feature(features):
    kinds = features.to_arrow()["kind"].to_pylist()
    for name in TABLES:
        assert kinds.count(name[:-1]) == len(getattr(features, name))
    assert kinds.count("cluster") == features.clusters.max() + 1


def test_reprs(features):
    s, c, b = (len(getattr(features, name)) for name in ("segments", "corners", "breakpoints"))
    n = features.clusters.max() + 1
    assert repr(features) == (
        f"Features({s} segments, {c} corners, 1 arcs, {b} breakpoints, {n} clusters, stamp=2.500)"
    )
    batch = ln.Extractor("liu").batch(np.full((2, 9), 2.0), angle_min=0.0, angle_increment=0.01)
    assert repr(batch) == ("FeatureBatch(2 scans: 2 segments, 0 corners, 0 arcs, 4 breakpoints)")


@pytest.fixture(scope="module")
def batch() -> FeatureBatch:
    ranges = np.array([[np.nan] * 9, [2.0] * 9, [1.0] * 4 + [3.0] * 5, [np.inf] * 9])
    return ln.Extractor("liu", noise=NOISE).batch(
        ranges, angle_min=0.0, angle_increment=0.01, stamps=[1, 2, 3, 4], frame_id="laser"
    )


def test_batch_views(batch):
    assert len(batch) == 4
    assert [len(f.segments) for f in batch] == [0, 1, 2, 0]
    assert [f.stamp for f in batch] == [1, 2, 3, 4]
    assert batch[-2].frame_id == "laser"
    assert batch[-2].segments.tobytes() == batch[2].segments.tobytes()
    assert batch[2].breakpoints["kind"].tolist() == ["jump", "scan_end", "scan_end"]
    assert np.shares_memory(batch[2].segments, batch.segments)
    assert batch.offsets["segments"].tolist() == [0, 0, 1, 3, 3]
    for index in (4, -5):
        with pytest.raises(IndexError):
            batch[index]
    assert batch.to_arrow().num_rows == sum(f.to_arrow().num_rows for f in batch)


def test_empty_batch():
    batch = ln.Extractor("liu").batch(np.empty((0, 5)), angle_min=0.0, angle_increment=0.1)
    assert (len(batch), list(batch), batch.clusters.shape) == (0, [], (0, 5))
    with pytest.raises(IndexError):
        batch[0]
    batch = ln.Extractor("liu").batch(np.empty((3, 0)), angle_min=0.0, angle_increment=0.1)
    assert [len(f.clusters) for f in batch] == [0, 0, 0]


def test_arrays_are_read_only():
    found = ln.extract(ln.LaserScan([2.0] * 9, 0.0, 0.01), method="liu")
    for features in (found, found.transform(1.0, 2.0, 3.0)):
        assert len(features.segments) == 1
        for name in (*TABLES, "clusters"):
            assert not getattr(features, name).flags.writeable, name


def test_noise_rows():
    noise = ln.RangeNoise(0.1, 0.2, 0.3, 0.4)
    assert noise_row(noise).tolist() == [0.1, 0.2, 0.3, 0.4]
    assert noise_of(noise_row(noise)) == noise
    assert np.isnan(noise_row(None)).all()
    assert noise_of(noise_row(None)) is None
