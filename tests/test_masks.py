"""Masks of what a scanner sees of its own robot, and the sectors that `info` suggests."""

import math
from itertools import islice

import numpy as np
import pytest

from lineament import LaserScan
from lineament.cli import run
from lineament.live import LiveConfig
from lineament.live.pipeline import Pipeline
from lineament.logs import open_log, save_npz, summarize
from lineament.scan.changes import in_mask
from lineament.simulation import SENSORS, building, drive

WORLD, WAY = building()
#: Where a mast stands: these beams see it, 5 cm away, but for every fifth scan's tenth beam.
MAST = range(100, 160)


def with_mast(scans, rng):
    """Scans, as of a robot that carries a mast before its scanner."""
    for k, scan in enumerate(scans):
        ranges = scan.ranges.copy()
        ranges[MAST] = rng.normal(0.05, 0.003, len(MAST))
        if k % 5 == 0:
            ranges[MAST[10]] = math.nan
        yield scan._changed(ranges=ranges, range_min=0.02)


def drive_of(sensor, count):
    return list(islice(drive(WORLD, WAY, SENSORS[sensor], rate=1.0, seed=4), count))


@pytest.mark.parametrize("sensor", ["paper", "rplidar"])
def test_the_mast_of_a_robot_that_moves_is_suggested_and_left_out(tmp_path, capsys, sensor):
    scans = drive_of(sensor, 60)
    log = tmp_path / "mast.npz"
    save_npz(log, with_mast(scans, np.random.default_rng(1)))
    (topic,) = summarize(open_log(log)).topics
    step, first = scans[0].angle_increment, float(scans[0].angles[MAST[0]])
    expected = first - step, first + len(MAST) * step
    np.testing.assert_allclose(topic.own, [expected], atol=6e-5)

    assert run(["info", str(log)]) == 0
    shown = capsys.readouterr().out
    suggested = "--mask " + " ".join(f"{value:g}" for value in topic.own[0])
    assert f"leave it out by {suggested}" in shown
    command = ["extract", str(log), "-o", str(tmp_path / "f.csv"), *suggested.split()]
    assert run(command) == 0
    for masked, scan in zip(open_log(log, mask=topic.own), scans, strict=True):
        inside = np.isnan(masked.ranges)
        assert inside[MAST].all()
        kept = [i for i in range(len(scan)) if not MAST[0] - 1 <= i <= MAST[-1] + 1]
        np.testing.assert_array_equal(masked.ranges[kept], scan.ranges[kept])


def test_a_sector_behind_a_full_circle_goes_over_its_seam(tmp_path):
    scans = [
        LaserScan(np.roll(scan.ranges, -130), -math.pi, scan.angle_increment, range_min=0.02)
        for scan in with_mast(drive_of("rplidar", 40), np.random.default_rng(1))
    ]
    save_npz(tmp_path / "seam.npz", scans)
    (((low, high),),) = (t.own for t in summarize(open_log(tmp_path / "seam.npz")).topics)
    step = scans[0].angle_increment
    assert low == pytest.approx(-math.pi + (len(scans[0]) - 30 - 1) * step, abs=1e-3)
    assert high == pytest.approx(-math.pi + 30 * step, abs=1e-3)


def test_nothing_is_suggested_where_nothing_is_the_robots_own(tmp_path):
    """Of a robot that stands, that follows a wall, or that carries nothing."""
    rng, (still, *_) = np.random.default_rng(2), drive_of("paper", 1)
    beams = len(still)
    standing = [still._changed(ranges=rng.normal(still.ranges, 0.01)) for _ in range(40)]
    follows = rng.uniform(1.5, 6.0, (40, beams))
    follows[:, 30:90] = rng.normal(0.6, 0.03, (40, 60))
    following = [still._changed(ranges=row) for row in follows]
    for name, scans in (
        ("standing", list(with_mast(standing, rng))),
        ("following", following),
        ("nothing", drive_of("paper", 40)),
        ("few", list(with_mast(drive_of("paper", 15), rng))),
    ):
        save_npz(tmp_path / f"{name}.npz", scans)
        assert [t.own for t in summarize(open_log(tmp_path / f"{name}.npz")).topics] == [()], name


@pytest.mark.parametrize(
    ("mask", "expected"),
    [
        ([(0.0, 1.0)], [0.0, 0.5, 1.0]),
        ([(1.0, 0.0)], [-3.0, -0.5, 0.0, 1.0, 1.5, 3.0]),
        ([(3.0, -3.0), (0.4, 0.6)], [-3.0, 0.5, 3.0]),
        ([(3.0, 2 * math.pi - 3.0)], [-3.0, 3.0]),
        ([], []),
    ],
)
def test_sectors_go_counter_clockwise(mask, expected):
    bearings = np.array([-3.0, -0.5, 0.0, 0.5, 1.0, 1.5, 3.0])
    assert bearings[in_mask(bearings, mask)].tolist() == expected


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        ([(-90, 30)], "mask has -90 to 30 rad, more than a turn: are they in degrees"),
        ([(1.0, 1.0)], "mask has 1 to 1 rad, expected two bearings, less than a turn apart"),
        ([(0.0, 2 * math.pi)], "mask has 0 to 6.28319 rad, expected two bearings"),
        ([0.3, 0.5], r"mask is \[0.3, 0.5\], expected pairs of bearings"),
        ([(0.3, math.nan)], "expected pairs of bearings .* expected a finite number"),
        ("ab", "expected pairs of bearings"),
        (3, "expected pairs of bearings"),
    ],
)
def test_what_is_no_mask_is_refused(tmp_path, mask, message):
    save_npz(tmp_path / "a.npz", drive_of("paper", 1))
    with pytest.raises(ValueError, match=message):
        open_log(tmp_path / "a.npz", mask=mask)
    with pytest.raises(ValueError, match=message if mask != 3 else "mask"):
        LiveConfig(mask=mask)
    with pytest.raises(ValueError, match=message):
        drive_of("paper", 1)[0].masked(mask)


def test_the_command_line_refuses_degrees(tmp_path, refused):
    save_npz(tmp_path / "a.npz", drive_of("paper", 1))
    assert "are they in degrees?" in refused(f"info {tmp_path / 'a.npz'} --mask -90 30", 2)


def test_the_node_masks_as_logs_do():
    (scan,) = drive_of("paper", 1)
    mask = ((-0.2, 0.4),)
    frame = Pipeline(LiveConfig(mask=mask))("robot", scan)
    alone = Pipeline(LiveConfig())("robot", scan.masked(mask))
    assert frame.features.segments.tobytes() == alone.features.segments.tobytes()
    inside = in_mask(scan.angles, mask)
    beams = np.concatenate([frame.features.segments[name] for name in ("first_beam", "last_beam")])
    assert inside.any()
    assert not inside[beams].any()
