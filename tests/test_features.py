"""Features and FeatureBatch: moving, tables, views; their fields, declared once."""

import copy
import json
import math
import pickle

import numpy as np
import pytest
from test_tables import random_features
from worlds import NOISE, random_scan

import lineament as ln
from lineament.features import TABLES, Features, make_records, noise_of, noise_row
from lineament.features import records as at

PLACES = {"start", "end", "centroid", "position", "center"}


@pytest.mark.parametrize("pose", [(10.0, -5.0, math.pi / 2), (1.0, 2.0, -3.0), (0.0, 0.0, 7.0)])
def test_each_field_moves_as_it_must(pose):
    features, (x, y, theta) = random_features(1, counts=(9, 5, 6, 4, 3), frame_id="laser"), pose
    features.segments["angle"] = np.linspace(-math.pi, math.pi, 9)
    moved = features.transform(*pose, frame_id="map")
    turn = np.eye(3)
    turn[:2, :2] = [[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]]
    for name, dtype in TABLES.items():
        for field in dtype.names:
            was, now = getattr(features, name)[field], getattr(moved, name)[field]
            if field in PLACES:
                np.testing.assert_allclose(now, was @ turn[:2, :2].T + (x, y), atol=1e-12)
            elif field == "angle":
                np.testing.assert_allclose(np.exp(1j * now), np.exp(1j * (was + theta)))
                assert (abs(now) <= math.pi).all()
            elif field == "covariance" and name != "segments":
                some = turn[: was.shape[1], : was.shape[1]]
                np.testing.assert_allclose(now, some @ was @ some.T, atol=1e-12)
            else:
                np.testing.assert_array_equal(now, was)
    assert (moved.frame_id, moved.stamp, moved.noise) == ("map", 0.1, features.noise)
    assert features.transform(*pose).frame_id == "laser"
    assert moved.clusters is features.clusters


def test_dict_is_json():
    scan = ln.LaserScan([2.0] * 9 + [1.0] * 9, 0.0, 0.01, stamp=2.5, frame_id="laser")
    features = ln.extract(scan, noise=NOISE)
    again = json.loads(json.dumps(features.to_dict(), allow_nan=False))
    for name, dtype in TABLES.items():
        for record, row in zip(getattr(features, name), again[name], strict=True):
            assert {field: record[field].tolist() for field in dtype.names} == row
    assert again["clusters"] == features.clusters.tolist()
    others = dict.fromkeys(("proportional", "bearing", "quantum", "uncertainty"), 0)
    assert again["noise"] == {"sigma": 0.01} | others
    assert (again["stamp"], again["frame_id"]) == (2.5, "laser")
    empty = ln.extract(ln.LaserScan([np.nan] * 3, 0.0, 0.1)).to_dict()
    assert (empty["noise"], empty["clusters"]) == (None, [-1, -1, -1])


def test_what_is_not_known_is_none_in_a_dict():
    scan = ln.LaserScan([2.0] * 9, 0.0, 0.01)
    found = ln.extract(scan, method=lambda _: ([[0, 8]], [4]), noise=NOISE)
    (corner,) = json.loads(json.dumps(found.to_dict(), allow_nan=False))["corners"]
    assert corner["quality"] is None
    assert corner["position"] == found.corners["position"][0].tolist()


def test_reprs_and_counts():
    features = random_features(1, counts=(3, 4, 5, 2, 1))
    n = features.clusters.max() + 1
    assert repr(features) == (
        "Features(3 segments, 4 corners, 5 edges, 2 arcs, 1 breakpoints, "
        f"{n} clusters, stamp=0.100)"
    )
    counted = {"segments": 3, "corners": 4, "edges": 5, "arcs": 2, "breakpoints": 1}
    assert features.counts() == counted
    assert len(features) == 15
    batch = ln.Extractor("liu").batch(np.full((2, 9), 2.0), angle_min=0.0, angle_increment=0.01)
    assert repr(batch) == (
        "FeatureBatch(2 scans: 2 segments, 0 corners, 0 edges, 0 arcs, 4 breakpoints)"
    )


def test_features_are_made_by_name():
    """As the tables are more than they were: by place, one would be taken for another."""
    with pytest.raises(TypeError, match="positional"):
        Features(*(make_records(name, []) for name in TABLES), np.zeros(0, np.int32))


def pickled(features):
    return pickle.loads(pickle.dumps(features))


@pytest.mark.parametrize("noise", [None, NOISE])
@pytest.mark.parametrize("copied", [lambda of: of, copy.copy, copy.deepcopy, pickled])
def test_fields_are_those_of_their_scan_whenever_they_are_asked_for(copied, noise):
    extractor = ln.Extractor(noise=noise)
    scans = [random_scan(seed, 90) for seed in range(6)]
    later = [copied(extractor(scan)) for scan in scans]
    for scan, features in zip(scans, later, strict=True):
        now = ln.Extractor(noise=noise)(scan)
        assert features.to_dict() == now.to_dict()
        assert features.segments is features.segments
        assert not hasattr(features, "lines")


def test_a_table_that_is_set_counts():
    found = ln.extract(ln.LaserScan([2.0] * 9 + [3.0] * 9, -0.09, 0.01))
    assert found.counts()["segments"] == 2
    found.segments = found.segments[:1]
    assert found.counts()["segments"] == 1
    assert found.to_arrow()["kind"].to_pylist().count("segment") == 1


def test_batch_views():
    ranges = np.array([[np.nan] * 9, [2.0] * 9, [1.0] * 4 + [3.0] * 5, [np.inf] * 9])
    batch = ln.Extractor("liu", noise=NOISE).batch(
        ranges, angle_min=0.0, angle_increment=0.01, stamps=[1, 2, 3, 4], frame_id="laser"
    )
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


@pytest.mark.parametrize("shape", [(0, 5), (3, 0)])
def test_empty_batch(shape):
    batch = ln.Extractor("liu").batch(np.empty(shape), angle_min=0.0, angle_increment=0.1)
    assert (len(batch), batch.clusters.shape) == (shape[0], shape)
    assert [len(f.clusters) for f in batch] == [0] * shape[0]


def test_noise_rows():
    noise = ln.RangeNoise(0.1, 0.2, 0.03, 0.4, 0.5)
    assert noise_row(noise).tolist() == [0.1, 0.2, 0.03, 0.4, 0.5]
    assert noise_of(noise_row(noise)) == noise
    assert np.isnan(noise_row(None)).all()
    assert noise_of(noise_row(None)) is None


# Fields


def test_layout_of_the_records_is_the_one_that_others_read():
    """Sizes and offsets, of which files and other programs know."""
    offsets = {name: [dtype.fields[f][1] for f in dtype.names] for name, dtype in TABLES.items()}
    assert offsets == {
        "segments": [0, 16, 32, 48, 56, 88, 92, 96, 104, 112, 120, 128],
        "corners": [0, 16, 48, 56, 60, 64, 72, 80, 88],
        "edges": [0, 16, 48, 56, 60, 64],
        "arcs": [0, 16, 24, 96, 100, 104, 112],
        "breakpoints": [0, 8, 24, 56],
    }
    assert [dtype.itemsize for dtype in TABLES.values()] == [136, 112, 88, 120, 64]


def test_columns_of_the_kernels_are_where_the_fields_are():
    short = {"first_beam": "first", "last_beam": "last", "n_points": "points"}
    for table, dtype in TABLES.items():
        for name, (form, offset) in dtype.fields.items():
            column = getattr(at, f"{table[0]}_{short.get(name, name)}".upper())
            assert column == offset // (8 if form.base.kind == "f" else 4), name
    records = np.zeros(2, at.CORNER)
    records["kind"] = "slit"
    words = at.words(records).view(np.int32)[1, at.C_KIND : at.C_KIND + 6]
    assert words.tolist() == at.CORNER_WORDS[at.SLIT].tolist()
    records = np.zeros(2, at.EDGE)
    records["side"] = "start"
    words = at.words(records).view(np.int32)[1, at.E_SIDE : at.E_SIDE + 5]
    assert words.tolist() == at.SIDE_WORDS[at.AT_START].tolist()
    # A kernel writes either with the same function.
    assert (at.E_POSITION, at.E_COVARIANCE) == (at.C_POSITION, at.C_COVARIANCE)


def test_records_are_made_by_name():
    (arc,) = make_records("arcs", [{"radius": 2.0, "center": (1, 2)}])
    assert (arc["radius"], arc["center"].tolist(), arc["n_points"]) == (2.0, [1.0, 2.0], 0)
    none = make_records("corners", [])
    assert (none.dtype, none.shape) == (at.CORNER, (0,))
    assert not none.flags.writeable
    with pytest.raises(ValueError, match="no field"):
        make_records("arcs", [{"size": 2.0}])
