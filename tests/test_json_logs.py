"""Logs of JSON, CSM and RPLIDAR: known values, faults, what is broken or without end."""

import gzip
import json
import math

import numpy as np
import pytest
from text_logs import at_most, check_fault, csm_scan

from lineament import LogError
from lineament.logs import json_stream, open_log

GOOD = json.dumps(csm_scan())
DEEP = "[" * 10_000 + "]" * 10_000

# CSM


def test_csm_fields(write):
    (scan,) = open_log(write(GOOD))
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
    assert scan.ranges[[0, 2]].tolist() == [2.5, 1.5]  # Reversed.
    assert scan.angles.tolist() == [0.0, 0.7, 1.5]
    (scan,) = open_log(write(json.dumps(csm_scan(theta=None, timestamp=None))))
    assert scan.angles.tolist() == pytest.approx([-math.pi / 2, 0, math.pi / 2])
    assert scan.stamp == 0
    (scan,) = open_log(write(json.dumps(csm_scan(theta=[], readings=[], valid=[]))))
    assert len(scan) == 0
    (scan,) = open_log(write(json.dumps(csm_scan(readings=[1, 2, 3], valid=[1, None, 0]))))
    np.testing.assert_array_equal(scan.ranges, [1, np.nan, np.nan])


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
    assert [scan.stamp for scan in check_fault(path, f": scan 1: .*{problem}", 2)] == [1.25, 3.25]
    assert len(open_log(path)) == 3


@pytest.mark.parametrize(
    ("text", "problem", "scans", "skipped"),
    [
        # What stands on the line behind the broken one begins with no brace.
        (f'{GOOD}\n{{"readings": [1, }}\n 5 {GOOD} [1]\n{GOOD}', ":2: JSON is broken: ", 2, 1),
        (f"{GOOD} 5 {GOOD} [1]\n{GOOD}", ":1: is no JSON object", 3, 2),
        (f'{GOOD}\n{{"readings": {DEEP}}}\n{GOOD}', ":2: has 33 levels of JSON", 2, 1),
        (f'{GOOD}\n{{"a": {"9" * 5000}}}\n{GOOD}', ":2: JSON is broken: ", 2, 1),
    ],
)
def test_broken_json_between_scans(write, text, problem, scans, skipped):
    check_fault(write(text), problem, scans, skipped)


@pytest.mark.parametrize(
    ("broken", "most"),
    [
        ('{"a":[' + "1," * 500 + "\n", 10),
        ("{\n" * 1000, 2000),
        ('{"a":[1,\n' + '{"a":[]},\n' * 99, 500),
    ],
)
def test_json_that_is_broken_all_over_ends(write, monkeypatch, broken, most):
    """Each place is read up to its fault, and these nest: without an end it would take hours."""
    monkeypatch.setattr(json_stream, "SPARE", 1 << 20)
    log = open_log(write(f"{GOOD}\n{broken * 300}", "a.csm"), keep_going=True)
    assert len(list(log)) == 1
    assert 1 < log.skipped < most


def test_json_of_which_half_is_cut_off_is_read(write, monkeypatch):
    monkeypatch.setattr(json_stream, "SPARE", 0)
    good = json.dumps(csm_scan(readings=[1.0] * 300, valid=None, theta=None))
    text = "".join(f"{good}\n{good[: 9 * i]}\n" for i in range(1, 100))
    log = open_log(write(text, "a.csm"), keep_going=True)
    assert len(list(log)) > 90
    assert log.skipped > 90


@pytest.mark.parametrize("junk", ["x" * 64 + "\n", "x" * 65])
def test_what_is_no_json_is_passed_over_in_bounded_memory(write, junk):
    path = write(f"{GOOD}\n{junk * (1 << 17)}\n{GOOD}", pack=gzip.compress)
    log = open_log(path, keep_going=True)
    with at_most(24):
        assert (len(list(log)), log.skipped) == (2, 1)


# RPLIDAR


def test_rplidar_pairs_and_points(write):
    units = {
        "polar": [[2.0, 0.0], [3.0, 1.0], [0.0, 2.0]],
        "degrees": [[2.0, 350.0], [3.0, 90.0], [4.0, 10.0]],
        "backwards": [[2.0, 1.0], [3.0, 0.5], [3.5, 0.5]],
        "points": [[1.0, 0.0], [3.0, 4.0], [-1.0, 0.0], [0.0, -2.0]],
    }
    polar, degrees, backwards, points = open_log(write(json.dumps(units)))
    assert (polar.ranges.tolist(), polar.angles.tolist()) == ([2, 3, 0], [0, 1, 2])
    assert polar.valid.tolist() == [True, True, False]
    assert degrees.ranges.tolist() == [4, 3, 2]
    np.testing.assert_allclose(np.degrees(degrees.angles), [10, 90, 350])
    assert (backwards.ranges.tolist(), backwards.angles.tolist()) == ([3, 2], [0.5, 1])
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
    for text in ("[" * 10_000, "[]", "{"):
        write(text, "transforms.json")
        assert [scan.pose for scan in open_log(path)] == [None] * 3


def test_faulty_rplidar_units(write):
    path = write(json.dumps({"a": [[1.0, 0.0]], "b": [[1.0, 2.0], [3.0]], "c": 5}))
    (scan,) = check_fault(path, ": unit b: expected a list of pairs of numbers", 1, skipped=2)
    assert scan.frame_id == "a"


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        ('{"a": [[1, 2]], "b": ' + DEEP + "}", "has 33 levels of JSON"),
        ('{"a": [[1, 2]], "b": ' + "[" * 30 + "]" * 30 + "}", "unit b: expected a list of pairs"),
        # What is left of two faults, of the first object and of the checksum behind it.
        (gzip.compress(b'{"a": [[1, 2],\n{}\n')[:-1] + b"?", "is no RPLIDAR JSON"),
    ],
)
def test_json_that_is_broken_behind_a_good_beginning(write, data, problem):
    with pytest.raises(LogError, match=problem):
        list(open_log(write(data)))


def test_names_of_units_stay_on_one_line(write):
    path = write(json.dumps({"a\nb": [[1.0, 0.0]], "c": 5}))
    assert open_log(path).topics == ["'a\\nb'", "c"]
    with pytest.raises(LogError) as caught:
        open_log(path, "d")
    assert str(caught.value).isprintable()


def test_recorded_units_see_the_same_circle(data_dir):
    """The circle that each unit saw lies in one place once their poses are applied."""
    folder = data_dir / "text" / "rplidar_kitchenette"
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
