"""What is given in another unit, masked, clockwise or misspelt: taken as meant, or refused."""

import math

import numpy as np
import pytest

import lineament as ln
from lineament import Extractor, LaserScan, LineamentWarning, LogError, RangeNoise
from lineament.cli import run
from lineament.errors import heard
from lineament.logs import open_log, save_npz, summarize
from lineament.scan.units import doubt
from lineament.tasks.bulk import Manifest, extract_logs
from lineament.tasks.extract import extract_log

BEARINGS = {"angle_min": -1.0, "angle_increment": 0.01}
WALL = 2.5 / np.cos(np.linspace(-1.0, 1.0, 201))
MILLIMETRES = 1000 * WALL
IN_MILLIMETRES = r"millimetres\? \(scale=0.001"


def same(a, b):
    return all(np.array_equal(a[name], b[name]) for name in a) and a.noise == b.noise


# Ranges


@pytest.mark.parametrize("limits", [{}, {"range_max": 30.0}, {"range_min": 0.1, "range_max": 60.0}])
@pytest.mark.parametrize("function", [ln.extract, ln.trace])
def test_millimetres_are_warned_of_where_they_are_given(function, limits):
    with pytest.warns(LineamentWarning, match=IN_MILLIMETRES) as caught:
        function(MILLIMETRES, **BEARINGS, **limits)
    assert [warning.filename for warning in caught] == [__file__]


def test_millimetres_with_a_scale_are_metres():
    metres = ln.extract(WALL, **BEARINGS, range_max=30.0)
    assert len(metres.segments) == 1
    found = ln.extract(MILLIMETRES, **BEARINGS, range_max=30.0, scale=0.001)
    np.testing.assert_allclose(found.segments["start"], metres.segments["start"], atol=1e-9)
    scan = LaserScan(MILLIMETRES, **BEARINGS, range_max=30_000.0).scaled(0.001)
    assert scan.range_max == 30.0
    np.testing.assert_allclose(scan.ranges, WALL)
    batch = Extractor().batch([MILLIMETRES], **BEARINGS, range_max=30.0, scale=0.001)
    assert same(batch[0], found)


def test_a_scale_is_for_ranges_and_limits_are_in_metres():
    with pytest.raises(ValueError, match="range_max is 30000 m: scale is for the ranges alone"):
        LaserScan(MILLIMETRES, **BEARINGS, range_max=30_000.0, scale=0.001)
    for scale in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="scale is"):
            LaserScan(WALL, **BEARINGS, scale=scale)


def test_a_batch_warns_once():
    for limits in ({}, {"range_max": 30.0}):
        with pytest.warns(LineamentWarning, match=IN_MILLIMETRES) as caught:
            Extractor().batch([MILLIMETRES] * 5, **BEARINGS, **limits)
        assert len(caught) == 1


@pytest.mark.parametrize(
    ("ranges", "low", "high"),
    [
        ([math.inf] * 9, 0.0, 30.0),
        ([math.nan] * 9, 0.0, math.inf),
        ([0.0] * 9, 0.0, 30.0),
        ([30.0] * 9, 0.0, 30.0),
        ([31.0] * 9, 0.0, 30.0),
        ([65.533, 65.535] * 5, 0.0, 30.0),
        ([81.83, 81.91] * 5, 0.0, 50.0),
        ([65_535.0] * 9, 0.0, 30.0),
        ([3.4e38] * 9, 0.0, math.inf),
        ([0.006, 0.019] * 5, 0.02, 5.6),  # Error codes of a Hokuyo.
        ([190.0] * 9, 0.0, 250.0),
        ([2.0, 2.0, 2500.0], 0.0, math.inf),
        ([], 0.0, math.inf),
    ],
)
def test_a_scanner_that_sees_nothing_or_far_is_no_reason_to_warn(ranges, low, high):
    assert doubt(np.array(ranges), low, high) == ""
    scan = LaserScan(ranges, 0.0, 0.01, range_min=low, range_max=high)
    assert Extractor()(scan).scan is scan  # Warnings are errors.


@pytest.mark.parametrize(
    ("ranges", "low", "high", "expected"),
    [
        ([2500.0] * 9, 0.0, math.inf, "half of the ranges are beyond 200 m"),
        ([199.0, 201.0, 202.0], 0.0, math.inf, "half of the ranges are beyond 200 m"),
        ([900.0, 2500.0], 0.1, 30.0, "all ranges are beyond range_max = 30 m"),
        ([2.5, 2.6], 20.0, 30_000.0, "all ranges are below range_min = 20 m"),
        ([2.5, 2.6], 0.0, 0.03, "all ranges are beyond range_max = 0.03 m"),
    ],
)
def test_what_speaks_against_metres(ranges, low, high, expected):
    assert doubt(np.array(ranges), low, high).startswith(expected)


# Logs


def log_of(path, ranges, **fields):
    save_npz(path, [LaserScan(r, **BEARINGS, **fields) for r in ranges])
    return path


def test_a_log_without_a_valid_range_is_an_error(tmp_path):
    extractor = Extractor()
    for name, ranges, why in (
        ("mm", MILLIMETRES, "all ranges are beyond range_max = 30 m: .*scale=0.001"),
        ("one", np.full(201, 2500.0), "they are 2500 to 2500 m, outside of the limits of 0 to 30"),
        ("nothing", np.full(201, math.inf), "no beam returned anything"),
        ("negative", -WALL, r"all ranges are negative or beyond 1e\+06 m"),
    ):
        path = log_of(tmp_path / f"{name}.npz", [ranges] * 3, range_max=30.0)
        with heard(), pytest.raises(LogError, match=f"has no valid range in 3 scans: {why}"):
            extract_log(path, tmp_path / "out.parquet", extractor)
        assert not (tmp_path / "out.parquet").exists()
        assert len(list(open_log(path))) == 3  # Reading it is none.


def test_ranges_of_no_metres_are_warned_of():
    """Negative ones, and those that are read from the wrong bytes; but codes are silent."""
    for ranges in (-WALL, 1e6 * WALL):
        with pytest.warns(LineamentWarning, match=r"all ranges are negative or beyond 1e\+06 m"):
            assert ln.extract(ranges, **BEARINGS).segments.size == 0
    codes = np.resize([-1.0, -2.0, math.inf, math.nan, 0.0], 201)
    assert ln.extract(codes, **BEARINGS).segments.size == 0


@pytest.mark.parametrize("dtype", [np.uint16, np.int32])
def test_integers_are_no_metres(dtype):
    """Not even where they are few enough: a wall at 15 cm is 146 to 264 mm."""
    near = (58.6 * WALL).astype(dtype)
    match = r"ranges are whole numbers: .* millimetres\? \(scale=0.001;"
    for given in (near, np.ma.masked_array(near, near == 146), near.tolist()):
        with pytest.warns(LineamentWarning, match=match):
            LaserScan(given, **BEARINGS)
    with pytest.warns(LineamentWarning, match=match):
        Extractor().batch(near[None], **BEARINGS)
    for given in (near.astype(float), np.full(201, 3, dtype), np.arange(201, dtype=dtype) % 8):
        assert len(LaserScan(given, **BEARINGS)) == 201
    assert len(LaserScan(near, scale=0.001, **BEARINGS)) == 201


@pytest.mark.parametrize("largest", [30.0, 81.83, 65.535])
def test_one_range_of_many_beams_is_no_wall(largest):
    """A wall is not that round: of 50 beams, half a radian; of 49, and below `range_max`, none."""
    ranges = WALL.copy()
    ranges[100:150] = largest
    match = rf"many beams have exactly .* {largest:g} m: .* no return\? \(range_max={largest:g}\)"
    with pytest.warns(LineamentWarning, match=match):
        round_wall = ln.extract(ranges, **BEARINGS)
    found = ln.extract(ranges, **BEARINGS, range_max=largest)
    assert len(round_wall.segments) > len(found.segments)
    with pytest.warns(LineamentWarning, match=match):
        Extractor().batch([WALL, ranges], **BEARINGS)
    ranges[100] = 2.5
    ln.extract(ranges, **BEARINGS)
    Extractor().batch([ranges], **BEARINGS)


def test_a_log_in_millimetres_with_its_limits_is_scaled(tmp_path):
    path = log_of(tmp_path / "mm.npz", [MILLIMETRES], range_max=30_000.0, pose=(1.0, 2.0, 3.0))
    assert "in millimetres? (scale=0.001)" in str(summarize(open_log(path)))
    (scan,) = open_log(path, scale=0.001)
    assert (scan.range_max, scan.pose) == (30.0, (1.0, 2.0, 3.0))
    np.testing.assert_allclose(scan.ranges, WALL)
    with pytest.raises(ValueError, match="scale is 0"):
        open_log(path, scale=0)


def test_commands_warn_in_one_line_once(tmp_path, capsys, refused):
    far = log_of(tmp_path / "far.npz", [MILLIMETRES] * 4)
    output = str(tmp_path / "out.parquet")
    assert run(["extract", str(far), "-o", output, "-q"]) == 3
    line, nothing = capsys.readouterr().err.splitlines()
    assert line.startswith("lineament: half of the ranges are beyond 200 m, where no 2-D scanner")
    assert nothing == f"lineament: {far}: no feature in 4 scans, expected some"
    assert run(["extract", str(far), "-o", output, "-q", "--scale", "0.001"]) == 0
    assert capsys.readouterr().err == ""
    none = log_of(tmp_path / "none.npz", [np.full(201, 2500.0)] * 4, range_max=30.0)
    for command in (f"extract {none} -o {output}", f"info {none}"):
        assert run([*command.split(), "-q"]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"lineament: {none}: has no valid range in 4 scans: they are 2500")
    for option, problem in (
        ("--scale 0", "scale is 0.0, expected > 0"),
        ("--noise 10", "noise has sigma = 10"),
        ("--laser-pose 0 0 90", "theta = 90 rad, more than a turn"),
    ):
        assert problem in refused(f"extract {far} -o {output} {option}", 2)


def test_logs_in_bulk_warn_each_for_itself(tmp_path):
    for name, ranges in (("a", MILLIMETRES), ("b", WALL), ("c", MILLIMETRES)):
        log_of(tmp_path / f"{name}.npz", [ranges] * 3)
    bulk = extract_logs(tmp_path, tmp_path / "out", Extractor())
    assert bulk.failed == 0
    begun = [text.partition(": half of the ranges are")[0] for text in bulk.warnings]
    assert begun == [str(tmp_path / "a.npz"), str(tmp_path / "c.npz")]
    rows = Manifest(tmp_path / "out").rows
    assert [len(rows[str(tmp_path / f"{name}.npz")].warnings) for name in "abc"] == [1, 0, 1]


# Bearings and noise


def test_degrees_are_named_where_they_show():
    for bearings in (
        {"angle_min": -90.0, "angle_increment": 0.9},
        {"angle_min": -90.0, "angle_increment": 0.01},
        {"angle_min": 90.0, "angle_increment": -0.9},
        {"angles": np.linspace(-135.0, 135.0, 201)},
        {"angles": np.linspace(88.0, 92.0, 201)},
    ):
        with pytest.raises(ValueError, match=r"in degrees\? \(numpy.radians\)"):
            LaserScan(WALL, **bearings)
    with pytest.raises(ValueError, match=r"once around$"):
        LaserScan(WALL, angle_min=0.0, angle_increment=0.04)


def test_a_noise_that_no_scanner_has():
    for noise, hint in (
        (10.0, "sigma = 10, .*millimetres"),
        (RangeNoise(sigma=3.0), "sigma = 3, .*millimetres"),
        (RangeNoise(proportional=1.0), "proportional = 1, .*percent"),
        (RangeNoise(bearing=0.25), "bearing = 0.25, .*degrees"),
        (RangeNoise(quantum=10.0), "quantum = 10, .*millimetres"),
    ):
        with pytest.raises(ValueError, match=hint):
            Extractor(noise=noise)
    for noise in (0.0, 0.2, RangeNoise(0.05, 0.04, 0.01, 0.05)):
        Extractor(noise=noise)


# What is masked, null, or no number


def test_masked_beams_are_invalid():
    hidden = np.arange(201) % 7 == 3
    masked = np.ma.masked_where(hidden, WALL)
    expected = np.where(hidden, np.nan, WALL)
    scan = LaserScan(masked, **BEARINGS, intensities=masked)
    assert np.array_equal(scan.ranges, expected, equal_nan=True)
    assert np.array_equal(scan.intensities, expected, equal_nan=True)
    of_ints = LaserScan(np.ma.masked_where(hidden, np.full(201, 2)), **BEARINGS)
    assert (~of_ints.valid == hidden).all()
    rows = np.ma.masked_array([WALL, WALL], [hidden, ~hidden])
    batch = Extractor().batch(rows, **BEARINGS)
    assert same(batch[0], Extractor().batch([expected], **BEARINGS)[0])
    assert (batch[1].clusters[~hidden] < 0).all()
    angles = np.linspace(-1.0, 1.0, 201)
    LaserScan(WALL, angles=np.ma.masked_array(angles))
    with pytest.raises(ValueError, match="angles are masked, expected a bearing of each beam"):
        LaserScan(WALL, angles=np.ma.masked_where(hidden, angles))
    points = np.ma.masked_array([[1.0, 0.0], [2.0, 1.0], [3.0, 3.0]], [[0, 0], [0, 1], [0, 0]])
    assert len(LaserScan.from_points(points)) == 2


@pytest.mark.parametrize(
    "ranges",
    [
        [True, False, True],
        np.ones(3, bool),
        np.array(["2020-01-01"] * 3, "M8[D]"),
        np.ones(3, "m8[s]"),
        np.array(["1", "2", "3"]),
        np.array([1.0, True, 2.0], object),
        np.array([1.0, "2", 2.0], object),
    ],
)
def test_what_numpy_would_make_numbers_of_is_refused(ranges):
    with pytest.raises(ValueError, match=r"ranges is .*expected numbers in an array"):
        LaserScan(ranges, 0.0, 0.1)
    with pytest.raises(ValueError, match=r"ranges is .*expected numbers in an array"):
        Extractor().batch(np.array([ranges]), angle_min=0.0, angle_increment=0.1)


def test_nulls_of_tables_are_nan():
    pandas, pyarrow = pytest.importorskip("pandas"), pytest.importorskip("pyarrow")
    polars = pytest.importorskip("polars")
    for column in (
        [1.0, None, 3.0],
        pandas.Series([1, None, 3], dtype="Int64"),
        pandas.Series([1.0, pandas.NA, 3.0], dtype="Float64"),
        pandas.Series([1.0, None, 3.0]),
        pyarrow.array([1, None, 3]),
        polars.Series([1, None, 3]),
    ):
        assert LaserScan(column, 0.0, 0.1).valid.tolist() == [True, False, True]


# Clockwise


def test_clockwise_beams_are_reversed():
    ranges, times = np.arange(1.0, 5.0), {"scan_time": 0.5, "time_increment": 0.1}
    scan = LaserScan(ranges, 1.0, -0.1, intensities=10 * ranges, **times)
    assert scan.ranges.tolist() == [4.0, 3.0, 2.0, 1.0]
    assert scan.intensities.tolist() == [40.0, 30.0, 20.0, 10.0]
    np.testing.assert_allclose(scan.angles, [0.7, 0.8, 0.9, 1.0])
    assert (scan.stamp_beam, scan.scan_time, scan.time_increment) == (3.0, -0.5, -0.1)
    angles = np.array([1.0, 0.8, 0.75, 0.7])
    scan = LaserScan(ranges, angles=angles, **times)
    assert scan.angles.tolist() == angles[::-1].tolist()
    assert (scan.ranges[0], scan.stamp_beam, scan.time_increment) == (4.0, 3.0, -0.1)
    with pytest.raises(ValueError, match=r"angles\[1\] is 0.8 after 1.0"):
        LaserScan(ranges, angles=[1.0, 0.8, 0.9, 0.7])
    assert LaserScan([1.0], 0.0, -0.1).stamp_beam == 0


def test_clockwise_beams_give_the_same_features():
    room = np.where(np.arange(201) < 90, WALL, WALL + 1)
    expected = ln.extract(room, **BEARINGS)
    found = ln.extract(room[::-1], angle_min=1.0, angle_increment=-0.01)
    np.testing.assert_allclose(found.segments["start"], expected.segments["start"], atol=1e-9)
    assert found.clusters.tolist() == expected.clusters.tolist()
    assert found.scan.ranges.tolist() == room.tolist()
    batch = Extractor().batch([room[::-1]], angle_min=1.0, angle_increment=-0.01)
    assert same(batch[0], found)


# Names


def test_a_misspelt_name_is_named_with_what_it_may_be():
    for given, message in (
        ({"angle_max": 1.0}, r"angle_increment, \(angle_max - angle_min\)/\(n - 1\)"),
        ({"angle_inc": 0.01}, "no parameter 'angle_inc': is it angle_increment, a field of the"),
        ({"max_range": 30}, "no parameter 'max_range': is it range_max, a field of the scan"),
        ({"rangemax": 30}, "no parameter 'rangemax': is it range_max, a field of the scan"),
        ({"evdence": 9}, r"no parameter 'evdence': is it evidence\? expected one of: evidence"),
        ({"xyz": 9}, "no parameter 'xyz': expected one of: evidence"),
    ):
        with pytest.raises(ValueError, match=message):
            ln.extract(WALL, angle_min=-1.0, **given)
    with pytest.raises(TypeError, match=r"Optimal has no parameter 'evdence': is it evidence\?"):
        ln.methods.Optimal(evdence=3)
    with pytest.raises(TypeError, match=r"Liu has no parameter 'min_point': is it min_points\?"):
        ln.extract(WALL, **BEARINGS, method=ln.methods.Liu, min_point=3)


def test_other_fields_of_a_scan_are_taken():
    found = ln.extract(WALL, **BEARINGS, stamp=7.5, frame_id="laser", pose=(1, 2, 3), evidence=13)
    assert (found.stamp, found.frame_id, found.scan.pose) == (7.5, "laser", (1.0, 2.0, 3.0))
    for fields in ({"stamp": 1.0}, {"scale": 0.001}, {"range_max": 3.0}, BEARINGS):
        with pytest.raises(TypeError, match=r"a LaserScan has its own .* pass it alone"):
            ln.extract(found.scan, **fields)


def test_scaled_scans_keep_irregular_bearings():
    """Bearings that were given are those of the scan, not multiples of their median step."""
    angles = np.array([0.0, 0.1, 0.35, 0.4])
    scan = ln.LaserScan([1000.0, 2000.0, 3000.0, np.nan], angles=angles, range_max=9000.0)
    assert scan.points.shape == (4, 2)
    scaled = scan.scaled(0.001)
    assert scaled.angles.tolist() == angles.tolist()
    np.testing.assert_allclose(scaled.points, scan.points / 1000, rtol=1e-12)
    assert scaled.valid.tolist() == [True, True, True, False]


def test_a_log_is_warned_of_once(tmp_path):
    """What is wrong differs from scan to scan, and the warning does not."""
    scans = [WALL + 0.01 * k for k in range(5)]
    rounds = [ranges.copy() for ranges in scans]
    for k, ranges in enumerate(rounds):
        ranges[100 : 160 + k] = 40.0
    for name, rows in (
        ("negative", [-ranges for ranges in scans]),
        ("round", rounds),
        ("far", [1000 * ranges for ranges in scans]),
        ("integers", [(60 * ranges).astype(np.int16) for ranges in scans]),
    ):
        with heard() as found:
            for row in rows:
                ln.extract(LaserScan(row, **BEARINGS))
        assert len(found) == 1, name
    np.savez(
        tmp_path / "a.npz", ranges=np.array([(60 * r).astype(np.int16) for r in scans]), **BEARINGS
    )
    with heard() as found:
        assert len(list(open_log(tmp_path / "a.npz"))) == 5
    assert len(found) == 1
