"""Logs of JSON: known values, faults, what is broken or without end, recordings."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from text_logs import csm_scan

from lineament import LogError
from lineament.logs import json_stream as objects
from lineament.logs import open_log

UNITS = "rplidar_kitchenette"


# CSM


def test_csm_fields(write):
    (scan,) = open_log(write(json.dumps(csm_scan())))
    np.testing.assert_array_equal(scan.ranges, [1.5, np.nan, 2.5])
    assert (scan.angle_min, scan.angle_increment) == (-math.pi / 2, math.pi / 2)
    assert (scan.stamp, scan.pose) == (7.25, (1, 2, 0.5))


@pytest.mark.parametrize(
    ("changes", "pose"),
    [
        ({"estimate": [3, 4, 0]}, (3, 4, 0)),
        ({"true_pose": [5, 6, 0], "estimate": [3, 4, 0]}, (5, 6, 0)),
        ({"odometry": None}, None),
    ],
)
def test_csm_poses(write, changes, pose):
    (scan,) = open_log(write(json.dumps(csm_scan(**changes))))
    assert scan.pose == pose


def test_csm_bearings(write):
    (scan,) = open_log(write(json.dumps(csm_scan(theta=[1.5, 0.7, 0.0]))))
    assert scan.ranges[[0, 2]].tolist() == [2.5, 1.5]  # Turned round.
    assert scan.angles.tolist() == [0.0, 0.7, 1.5]
    (scan,) = open_log(write(json.dumps(csm_scan(theta=None))))
    assert scan.angles.tolist() == pytest.approx([-math.pi / 2, 0, math.pi / 2])


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"theta": [0.0, 1.0]}, "theta has 2 values, expected 3"),
        ({"readings": 5}, "readings is 5, expected a list of numbers"),
        ({"readings": [1, "2", 3]}, "readings has a value that is no number"),
        ({"theta": None, "max_theta": None}, "has neither theta nor finite"),
        ({"theta": [0, 0, 1]}, "expected bearings that increase"),
        ({"timestamp": [1]}, "timestamp has 1 values, expected 2"),
        ({"odometry": [1, 2]}, "odometry has 2 values, expected 3"),
        ({"readings": [10**400, 1, 2]}, "too large"),
    ],
)
def test_faulty_csm_scans(write, changes, problem):
    texts = [json.dumps(scan) for scan in (csm_scan(1), csm_scan(**changes), csm_scan(3))]
    path = write("\n".join(texts))
    with pytest.raises(LogError, match=f"scan 1: .*{problem}"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    assert [scan.stamp for scan in log] == [1.25, 3.25]
    assert (log.skipped, len(log)) == (1, 3)


def test_broken_json_between_scans(write):
    good = json.dumps(csm_scan())
    path = write(f'{good}\n{{"readings": [1, }}\n 5 {good} [1]\n{good}')
    with pytest.raises(LogError, match=":2: JSON is broken: "):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    # What stands on the line behind the broken one begins with no brace.
    assert len(list(log)) == 2
    assert log.skipped == 1
    path = write(f"{good} 5 {good} [1]\n{good}")
    log = open_log(path, keep_going=True)
    assert (len(list(log)), log.skipped) == (3, 2)
    assert "is no JSON object" in log.faults[0]


def test_json_that_is_nested_too_deep(write):
    deep = '{"readings": ' + "[" * 10_000 + "]" * 10_000 + "}"
    with pytest.raises(LogError, match=":1: JSON is nested too deep"):
        open_log(write(deep, "a.json"))
    path = write(json.dumps(csm_scan()) + "\n" + deep + "\n" + json.dumps(csm_scan()))
    log = open_log(path, keep_going=True)
    assert (len(list(log)), log.skipped) == (2, 1)


def test_a_json_object_without_end_is_refused(write, monkeypatch):
    monkeypatch.setattr(objects, "MAX_OBJECT", 1 << 12)
    with pytest.raises(LogError, match="JSON object is broken or longer"):
        open_log(write('{"readings": [' + "1, " * 9999, "a.json"))


# RPLIDAR


def test_rplidar_pairs_and_points(write):
    units = {
        "polar": [[2.0, 0.0], [3.0, 1.0], [0.0, 2.0]],
        "degrees": [[2.0, 350.0], [3.0, 90.0], [4.0, 10.0]],
        "points": [[1.0, 0.0], [3.0, 4.0], [-1.0, 0.0], [0.0, -2.0]],
    }
    polar, degrees, points = open_log(write(json.dumps(units)))
    assert (polar.ranges.tolist(), polar.angles.tolist()) == ([2, 3, 0], [0, 1, 2])
    assert polar.valid.tolist() == [True, True, False]
    assert degrees.ranges.tolist() == [4, 3, 2]
    np.testing.assert_allclose(np.degrees(degrees.angles), [10, 90, 350])
    assert points.ranges.tolist() == [2, 1, 5, 1]
    np.testing.assert_allclose(points.points, [[0, -2], [1, 0], [3, 4], [-1, 0]], atol=1e-12)
    assert [scan.frame_id for scan in (polar, points)] == ["polar", "points"]
    assert polar.pose is None


def test_rplidar_poses(write):
    path = write(json.dumps({name: [[1.0, 0.0], [1.0, 1.0]] for name in "abc"}))
    turned = [[0.0, -1.0, 5.0], [1.0, 0.0, 6.0], [0.0, 0.0, 1.0]]
    write(json.dumps({"b": {"a": turned}, "c": {"a": "no matrix"}}), "transforms.json")
    poses = [scan.pose for scan in open_log(path)]
    assert poses == [(0, 0, 0), pytest.approx((5, 6, math.pi / 2)), None]


def test_faulty_rplidar_units(write):
    path = write(json.dumps({"a": [[1.0, 0.0]], "b": [[1.0, 2.0], [3.0]], "c": 5}))
    with pytest.raises(LogError, match="unit b: expected a list of pairs of numbers"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    assert ([scan.frame_id for scan in log], log.skipped) == (["a"], 2)


def test_recorded_units_see_the_same_circle(data_dir):
    """The circle that each unit saw lies in one place once their poses are applied."""
    folder = data_dir / "text" / UNITS
    circles = json.loads((folder / "circle1.json").read_text())
    places = []
    for unit, scan in open_log(folder / "scans_2025-09-04-16-43-09.json").items():
        x, y = circles[unit]["center"]
        off = np.hypot(*(scan.points - (x, y)).T)
        assert np.nanmin(np.abs(off - circles[unit]["radius"])) < 0.02
        if scan.pose is not None:
            a, b, c = scan.pose
            cos, sin = math.cos(c), math.sin(c)
            places.append((a + cos * x - sin * y, b + sin * x + cos * y))
    assert len(places) == 4
    assert np.ptp(places, axis=0).max() < 0.05


def test_names_of_units_stay_on_one_line(write):
    path = write(json.dumps({"a\nb": [[1.0, 0.0]], "c": 5}))
    assert open_log(path).topics == ["'a\\nb'", "c"]
    with pytest.raises(LogError) as caught:
        open_log(path, "d")
    assert "\n" not in str(caught.value)
