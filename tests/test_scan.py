"""LaserScan and RangeNoise: what is valid, what is refused, what cannot be changed."""

import math
from types import SimpleNamespace as Record

import numpy as np
import pytest

from lineament import LaserScan, RangeNoise

NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        *((value, True) for value in (1.0, 0.5, np.nextafter(10.0, 0))),  # range_min, to range_max
        *((value, False) for value in (np.nextafter(0.5, 0), 10.0, 1e9)),
        *((value, False) for value in (NAN, INF, -INF, 0.0, -0.0, -1.0)),
    ],
)
def test_what_is_valid(value, expected):
    scan = LaserScan([value], 0.0, 0.1, range_min=0.5, range_max=10.0)
    assert scan.valid.tolist() == [expected]
    assert np.isfinite(scan.points).all() == expected
    assert np.array_equal(scan.ranges, [value], equal_nan=True)  # Kept as it is.
    unlimited = LaserScan([5e-324, 1e299, 0.0, INF], 0.0, 0.1)
    assert unlimited.valid.tolist() == [True, True, False, False]


def test_points_by_hand():
    scan = LaserScan([1.0, 2.0, NAN], -math.pi / 2, math.pi / 2)
    np.testing.assert_allclose(scan.points[:2], [(0, -1), (2, 0)], atol=1e-15)
    assert np.isnan(scan.points[2]).all()
    np.testing.assert_array_equal(scan.angles, [-math.pi / 2, 0, math.pi / 2])
    assert repr(scan) == "LaserScan(3 beams, 2 valid, -90.0° + i·90.0000°, stamp=0.000)"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"ranges": [[1.0]]}, r"ranges has shape \(1, 1\)"),
        ({"ranges": 3.0}, r"ranges has shape \(\)"),
        ({"ranges": ["a"]}, r"ranges is \['a'\]"),
        ({"ranges": [1 + 2j]}, r"ranges is \[\(1\+2j\)\]"),
        ({"ranges": [[1.0], [1.0, 2.0]]}, "ranges is"),
        ({"angle_min": None}, "angle_min and angle_increment, or angles"),
        ({"angle_increment": None}, "angle_min and angle_increment, or angles"),
        ({"angle_min": NAN}, "angle_min is nan"),
        ({"angle_min": "0"}, "angle_min is '0'"),
        ({"angle_min": True}, "angle_min is True"),
        ({"angle_increment": 0.0}, r"angle_increment is 0, expected a step"),
        ({"angle_increment": INF}, "angle_increment is inf"),
        ({"ranges": np.ones(100), "angle_increment": 0.1}, "angle_increment: beams from 0 to 9.9"),
        ({"angles": [0.0, 0.1, 0.2], "angle_min": 0.0}, "angles are given together"),
        ({"angles": [0.0, 0.1]}, "angles has 2 values, expected 3"),
        ({"angles": [0.0, 0.1, NAN]}, r"angles\[2\] is nan"),
        ({"angles": [0.0, INF, 1.0]}, r"angles\[1\] is inf"),
        ({"angles": [0.0, 0.2, 0.2]}, r"angles\[2\] is 0\.2 after 0\.2"),
        ({"angles": [0.0, 0.2, 0.1]}, r"angles\[2\] is 0\.1 after 0\.2"),
        ({"angles": [0.0, 0.05, 6.4]}, "angles: beams from 0 to 6.4 rad go more than once around"),
        ({"angles": "abc"}, "angles is 'abc'"),
        ({"range_min": -0.1}, r"range_min is -0\.1"),
        ({"range_min": NAN}, "range_min is nan"),
        ({"range_min": INF}, "range_min is inf"),
        ({"range_min": 2.0, "range_max": 2.0}, r"range_max is 2\.0, expected more than range_min"),
        ({"range_max": 0.0}, r"range_max is 0\.0"),
        ({"range_max": NAN}, "range_max is nan"),
        ({"range_max": None}, "range_max is None"),
        ({"stamp": INF}, "stamp is inf"),
        ({"scan_time": NAN}, "scan_time is nan"),
        ({"time_increment": "x"}, "time_increment is 'x'"),
        ({"intensities": [1.0]}, "intensities has 1 values, expected 3"),
        ({"intensities": "abc"}, "intensities is 'abc'"),
        ({"pose": 3}, r"pose is 3, expected \(x, y, theta\)"),
        ({"pose": (1, 2)}, r"pose is \(1, 2\)"),
        ({"pose": (1, 2, NAN)}, r"pose is \(1, 2, nan\)"),
        ({"pose": (1, 2, 3, 4)}, r"pose is \(1, 2, 3, 4\)"),
    ],
)
def test_refusals_name_field_and_value(fields, message):
    steps = {} if "angles" in fields else {"angle_min": 0.0, "angle_increment": 0.1}
    with pytest.raises(ValueError, match=message):
        LaserScan(**{"ranges": [1.0, 1.0, 1.0], **steps, **fields})


def test_bearings_at_the_edge_of_what_they_can_be():
    assert len(LaserScan(np.ones(2), 1.0, 2.0**-51)) == 2
    with pytest.raises(ValueError, match=r"angle_increment .* too small for bearings from 1\.0"):
        LaserScan(np.ones(2), 1.0, 2.0**-52)
    scan = LaserScan(np.ones(4), angles=[0.0, 0.1, 0.4, 0.5])
    assert not scan.is_regular
    assert (scan.angle_min, scan.angle_increment) == (0.0, 0.1)
    assert LaserScan([1.0], angles=[0.3]).angle_increment == 0.0
    assert LaserScan([], angles=[]).angle_min == 0.0
    assert LaserScan([1.0], 0.0, 0.0).angles.tolist() == [0.0]  # One beam needs no step.


def test_scan_is_read_only_and_a_copy():
    ranges, intensities = np.array([1.0, 2.0]), np.array([5.0, 6.0])
    angles = np.array([0.0, 0.1])
    scan = LaserScan(ranges, angles=angles, intensities=intensities)
    ranges[0] = angles[0] = intensities[0] = -9.0
    assert (scan.ranges[0], scan.angles[0], scan.intensities[0]) == (1.0, 0.0, 5.0)
    for name in ("ranges", "angles", "intensities", "valid", "points"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(scan, name)[0] = 0
    for name in ("ranges", "stamp", "anything"):
        with pytest.raises(AttributeError, match=f"{name} cannot be set"):
            setattr(scan, name, 1.0)
    with pytest.raises(AttributeError, match="stamp cannot be deleted"):
        del scan.stamp
    regular = LaserScan([1, 2], 0, 1)
    assert regular.ranges.dtype == regular.angles.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        regular.angles[0] = 1.0
    # Numbers of any kind become floats.
    scan = LaserScan((1, 2), np.float32(0.5), np.int64(1), range_max=9, pose=(1, 2, np.float32(3)))
    assert scan.pose == (1.0, 2.0, 3.0)
    for value in (scan.angle_min, scan.angle_increment, scan.range_max, scan.stamp, *scan.pose):
        assert type(value) is float


@pytest.mark.parametrize("n", [3, 7, 360, 1081])
@pytest.mark.parametrize("first", [-math.pi, 0.3])
def test_full_circle_rule(n, first):
    # n Δφ ≥ 2π - 1.5 Δφ, so the border is at Δφ = 2π / (n + 1.5).
    border = 2 * math.pi / (n + 1.5)
    for sign in (1, -1):
        assert LaserScan(np.ones(n), first, border * (1 + sign * 1e-9)).is_full_circle == (sign > 0)
        angles = first + (border + sign * 1e-6) * np.arange(n)
        assert LaserScan(np.ones(n), angles=angles).is_full_circle == (sign > 0)


@pytest.mark.parametrize(
    ("n", "step", "full"),
    [
        *((n, math.pi / 180, n > 358) for n in (362, 361, 360, 359, 358)),  # 361: the first twice
        *((2, math.pi, False), (0, 0.1, False), (64, 0.1, True)),
        *((363, math.pi / 180, None), (65, 0.1, None)),
    ],
)
def test_full_circle_at_the_extremes(n, step, full):
    if full is None:
        with pytest.raises(ValueError, match="more than once around"):
            LaserScan(np.ones(n), -math.pi, step)
    else:
        assert LaserScan(np.ones(n), -math.pi, step).is_full_circle == full


MISSING = object()


def message(header, **changes):
    fields = {
        "header": header,
        "ranges": [1.0, 2.0],
        "intensities": [],
        "angle_min": -0.5,
        "angle_increment": 0.5,
        "range_min": 0.25,
        "range_max": 30.0,
        "scan_time": 0.125,
        "time_increment": 0.5,
    } | changes
    return Record(**{name: value for name, value in fields.items() if value is not MISSING})


ROS_1 = Record(stamp=Record(secs=7, nsecs=250_000_000), frame_id="base_laser")
ROS_2 = Record(stamp=Record(sec=7, nanosec=250_000_000), frame_id="base_laser")
PLAIN = Record(stamp=7.25, frame_id="base_laser")


@pytest.mark.parametrize("header", [ROS_1, ROS_2, PLAIN])
@pytest.mark.parametrize("kind", [list, tuple, lambda x: np.array(x, np.float32)])
def test_from_message(header, kind):
    scan = LaserScan.from_message(
        message(header, ranges=kind([1.0, 2.0]), intensities=kind([3.0, 4.0])), pose=(1, 2, 3)
    )
    assert scan.ranges.tolist() == [1.0, 2.0]
    assert scan.intensities.tolist() == [3.0, 4.0]
    assert (scan.angle_min, scan.angle_increment) == (-0.5, 0.5)
    assert (scan.range_min, scan.range_max) == (0.25, 30.0)
    assert (scan.scan_time, scan.time_increment) == (0.125, 0.5)
    assert (scan.stamp, scan.frame_id, scan.pose) == (7.25, "base_laser", (1.0, 2.0, 3.0))


def test_from_message_without_what_may_be_missing():
    for change in ({"intensities": MISSING}, {"intensities": np.array([])}):
        assert LaserScan.from_message(message(ROS_2, **change)).intensities is None
    scan = LaserScan.from_message(message(MISSING))
    assert (scan.stamp, scan.frame_id, scan.pose) == (0.0, "", None)
    with pytest.raises(ValueError, match="no sensor_msgs/LaserScan"):
        LaserScan.from_message(None)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        *(({name: MISSING}, rf"no sensor_msgs/LaserScan: .*'{name}'")
          for name in ("ranges", "angle_min", "angle_increment", "range_max", "scan_time")),
        ({"angle_increment": 0.0}, "angle_increment is 0"),
    ],
)  # fmt: skip
def test_from_message_refuses(changed, problem):
    with pytest.raises(ValueError, match=problem):
        LaserScan.from_message(message(ROS_2, **changed))


def test_noise_adds_up():
    noise = RangeNoise(sigma=0.03, proportional=0.01, bearing=0.5, quantum=math.sqrt(12) * 0.12)
    assert noise.range_variance(4.0) == pytest.approx(0.05**2 + 0.12**2)
    assert RangeNoise().range_variance(5.0) == 0.0
    for given in (1, np.float32(1), np.int64(1)):
        assert type(RangeNoise(given).sigma) is float
    with pytest.raises(AttributeError):
        noise.sigma = 1.0


@pytest.mark.parametrize("name", ["sigma", "proportional", "bearing", "quantum", "uncertainty"])
@pytest.mark.parametrize("value", [-1e-9, NAN, INF, "0.1", None, True, 1j])
def test_noise_refuses(name, value):
    with pytest.raises(ValueError, match=rf"RangeNoise\.{name} is {value!r:.4}"):
        RangeNoise(**{name: value})
