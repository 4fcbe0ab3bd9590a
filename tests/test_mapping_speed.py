"""Bare corridors without odometry: what beams alone leave open, and how far speeds carry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from small_room import placed

from lineament import Extractor, LaserScan
from lineament.mapping import LineMap
from lineament.mapping.adjust import edges_of, optimise
from lineament.mapping.chain import loosened, slid, unseen
from lineament.mapping.drive_map import KeyFrame
from lineament.mapping.making import make_map
from lineament.mapping.parts import between
from lineament.mapping.sessions import merge_onto, placements
from lineament.motion.estimate import Motion
from lineament.scan.poses import relative
from lineament.simulation import SENSORS, World

#: How long a speed lasts [s]; its deviation, which counts for ten seconds [m/s].
LASTING, USUAL = 2.5, 0.2
NOTHING = Extractor()(LaserScan(np.full(9, np.nan), 0.0, 0.1))
SURE, OPEN = np.diag((0.01, 0.01, 0.01)) ** 2, np.diag((1.4, 0.05, 0.02)) ** 2
#: The corridor is bare, but for what is at its ends.
ENDS = [
    *([-7, -3, -7, 4], [-7, -3, 0, -3], [-7, 4, 0, 4], [0, -3, 0, -1], [0, 1, 0, 4]),
    *([38, -3, 38, 4], [31, -3, 38, -3], [31, 4, 38, 4], [31, -3, 31, -1], [31, 1, 31, 4]),
    *([-4, -2, -3, -1.2], [-6, 2, -5, 3], [33, -2, 34, -1.4], [36, 1.2, 37, 2]),
]


def key(k, step, duration, is_bare=False):
    """Return key frame k, which was reached by a step forward [m] of so long [s]."""
    along = np.array([(1.0, 0.0, 0.0)])[: int(is_bare)]
    motion = Motion(step, 0.0, 0.0, SURE, along)
    return KeyFrame(
        index=k,
        scan=NOTHING.scan,
        features=NOTHING,
        walls=np.empty(0, np.int64),
        pose=(0.0, 0.0, 0.0),
        motion=motion,
        duration=duration,
        expected=SURE,
        beams_alone=OPEN if is_bare else None,
        is_lost=False,
        has_odometry=False,
        off=np.zeros(3),
    )


def along(frames):
    """Return the variances of the way that are not known of each key frame [m²]."""
    found = unseen(frames)
    assert not found[:, 1:].any()
    return found[:, 0, 0]


SHOWN = np.diag((0.25, 0.05, 0.02)) ** 2


@pytest.mark.parametrize(
    ("stretch", "doubted"),
    [
        ("s o o L s", "1 2"),
        ("s o b o L", "1 3"),  # one whose way beams show is not doubted, but those before are
        ("s o s o L", "3"),  # in between the way is seen
        ("s o o s L", ""),
        ("s o L o s", "1"),
        ("o O L s", "0"),  # lost itself, which is not sure anyway
        ("s o o s s", ""),
        ("b b L", ""),
    ],
)
def test_a_bare_stretch_at_whose_end_the_robot_is_lost_is_doubted(stretch, doubted):
    """Seen, open or shown by beams, and lost (open or not)."""
    frames = []
    for k, kind in enumerate(stretch.split()):
        frame = replace(key(k, 1.0, 1.0, is_bare=kind in "obO"), is_lost=kind in "LO")
        frames.append(replace(frame, beams_alone=SHOWN) if kind == "b" else frame)
    assert np.flatnonzero(slid(frames)).tolist() == [int(k) for k in doubted.split()]


def test_what_is_not_known_grows_with_the_time_since_the_speed_was_seen():
    """By hand: an hour at 0.5 m/s or 0.1 m/s by turns, so that the speed deviates by 0.2 m/s."""
    frames = [key(k, 0.5 if k % 2 else 0.1, 1.0) for k in range(3600)]
    bare = [key(3600 + k, 0.3, 2.5, True) for k in range(3)]
    variances = along([*frames, *bare, *frames[:2], bare[0]])
    assert not variances[:3600].any()
    once = 0.2**2 * 2.5**2 * (4 * math.exp(-1) - math.exp(-2) - 1)
    twice = 0.2**2 * 2.5**2 * (1 + 4 * math.exp(-2) - math.exp(-4))
    np.testing.assert_allclose(variances[3600:3602], (once, twice - once), rtol=1e-3)
    # Once it is seen, it is as it was.
    assert not variances[3603:3605].any()
    np.testing.assert_allclose(variances[3605], once, rtol=1e-3)


def test_beams_may_know_it_better():
    frames = [key(k, 0.3, 1.0, True) for k in range(30)]
    by_speed = along(frames)
    assert np.all(np.diff(by_speed) > 0)
    frames[20].beams_alone = np.diag((0.1, 0.05, 0.02)) ** 2
    by_both = along(frames)
    np.testing.assert_allclose(by_both[:20], by_speed[:20])
    np.testing.assert_allclose(by_both[20], 0.1**2)
    np.testing.assert_allclose(by_both[21:], by_speed[:9])


def test_of_a_drive_that_shows_little_a_usual_speed_is_taken():
    """At first a second of it, at one speed: ten of the eleven are the usual ones."""
    variances = along([key(0, 0.0, 0.0), key(1, 0.5, 1.0), key(2, 0.5, 2.5, True)])
    expected = 10 / 11 * USUAL**2 * LASTING**2 * (4 * math.exp(-1) - math.exp(-2) - 1)
    np.testing.assert_allclose(variances, (0.0, 0.0, expected))
    np.testing.assert_allclose(
        along([key(0, 0.0, 0.0), key(1, 0.5, 2.5, True)])[1], expected * 11 / 10
    )


def test_edges_are_loosened_where_the_motion_is_to_the_next_key_frame():
    spreads = np.array([np.diag((0.1, 0.2, 0.3)) ** 2] * 3)
    edges = edges_of([(0, 1), (1, 2), (0, 2)], np.zeros((3, 3)), spreads)
    unknown = np.zeros((3, 3, 3))
    unknown[2, 0, 0] = 0.25
    loose = np.linalg.inv(loosened(edges, unknown)["information"])
    np.testing.assert_allclose(loose[[0, 2]], spreads[[0, 2]], atol=1e-12)
    np.testing.assert_allclose(loose[1], spreads[1] + unknown[2], atol=1e-12)


def walked(rng, seconds, n):
    """Return the way in each of n times of so many seconds, of a speed that lasts 2.5 s."""
    fine, v, ways = 50, rng.normal(0, USUAL), []
    kept = math.exp(-seconds / fine / LASTING)
    for _ in range(n):
        speeds = []
        for _ in range(fine):
            v = kept * v + math.sqrt(1 - kept**2) * rng.normal(0, USUAL)
            speeds.append(v)
        ways.append(seconds * (0.6 + np.mean(speeds)))
    return np.array(ways)


@pytest.mark.parametrize("bare", [6, 20, 60])
def test_a_bare_way_is_known_as_well_as_speeds_last(bare):
    """Drives at random, placed as if the last speed that was seen came back to the mean one."""
    rng, squares = np.random.default_rng(bare), []
    seen = 60
    for _ in range(100):
        way = walked(rng, 0.5, seen + bare)
        mean, last = 0.3, way[seen - 1]
        goes_on = np.exp(-0.5 * (np.arange(bare) + 1) / LASTING)
        steps = np.concatenate((way[:seen], mean + goes_on * (last - mean)))
        frames = [key(0, 0.0, 0.0)]
        frames += [key(k, x, 0.5, k > seen) for k, x in enumerate(steps.tolist(), 1)]
        pairs = [(k, k + 1) for k in range(seen + bare)]
        chain = edges_of(pairs, [f.motion.pose for f in frames[1:]], [SURE] * len(pairs))
        poses = np.zeros((seen + bare + 1, 3))
        poses[1:, 0] = np.cumsum(steps)
        found = optimise(poses, loosened(chain, unseen(frames)), rounds=0)
        np.testing.assert_array_equal(found.poses, poses)
        spread = between(poses, np.array([(seen, seen + bare)]), found.solver())[0, 0, 0]
        squares.append((steps[seen:] - way[seen:]).sum() ** 2 / spread)
    assert 0.5 < np.mean(squares) < 1.5


def driven(speeds, walls):
    """Return the drive along a corridor of a scanner of 12 m, 10 scans a second, and its poses."""
    ways = -5 + np.cumsum(np.concatenate(([0.0], speeds))) / 10
    truth = [(x, 0.0, 0.05 * math.sin(k / 9)) for k, x in enumerate(ways.tolist())]
    scans = (
        SENSORS["ld19"].scan(World(walls), pose, np.random.default_rng((1, k)), 0.1 * k)
        for k, pose in enumerate(truth)
    )
    return placed(scans), truth


def test_a_robot_that_stops_in_a_bare_corridor_does_not_know_how_long_that_is():
    """It does not see that it stands: the map is in two parts, one for each end, and says where."""
    walls = [*ENDS, [0, -1, 31, -1], [0, 1, 31, 1]]
    slow, stops = np.full(30, 0.1), np.linspace(0.7, 0.1, 20)
    speeds = np.concatenate((np.full(230, 0.7), stops, slow, stops[::-1], np.full(250, 0.7)))
    drive, truth = driven(speeds, walls)
    at = np.array([truth[frame.index] for frame in drive.frames])
    off = np.subtract([frame.pose[0] for frame in drive.frames], at[:, 0] + 5)
    assert abs(off[-1]) > 0.75
    bare = [frame.beams_alone[0, 0] for frame in drive.frames if frame.beams_alone is not None]
    assert len(bare) > 20
    assert np.median(bare) > 1.0
    made = make_map(drive.frames, drive.scans)
    assert made.parts.count == 2
    first, last = (np.flatnonzero(made.parts.is_sure & (made.parts.numbers == k)) for k in (0, 1))
    assert at[first, 0].max() > 4
    assert at[last, 0].min() < 27
    ((before, after, _),) = made.unsure
    assert at[first, 0].max() == pytest.approx(truth[before][0])
    assert truth[after][0] - truth[before][0] > 5
    for of in (first, last):
        errors = np.subtract(made.survey.poses[of, 0], at[of, 0])
        assert np.ptp(errors) < 3 * made.parts.deviations.max()


#: A wall of the corridor with recesses of doors, the first two before the twelfth metre.
DOORS = [
    *([0, 1, 3, 1], [3, 1, 3, 1.2], [3, 1.2, 4, 1.2], [4, 1.2, 4, 1], [4, 1, 11, 1]),
    *([11, 1, 11, 1.2], [11, 1.2, 12, 1.2], [12, 1.2, 12, 1], [12, 1, 20, 1]),
    *([20, 1, 20, 1.2], [20, 1.2, 21, 1.2], [21, 1.2, 21, 1], [21, 1, 31, 1]),
]


@pytest.fixture(scope="module")
def by_doors():
    """The map of a drive along doors, and where its key frames were taken."""
    drive, truth = driven(np.full(520, 0.7), [*ENDS, [0, -1, 31, -1], *DOORS])
    return make_map(drive.frames, drive.scans), [truth[frame.index] for frame in drive.frames]


def test_doors_show_how_far(by_doors):
    """Beams alone know it better by the recesses of doors."""
    made, truth = by_doors
    last = len(truth) - 1
    spread = between(made.survey.poses, np.array([(0, last)]), made.adjusted.solver())[0]
    true = relative(truth[0], truth[last])
    off = np.subtract(relative(made.survey.pose(0), made.survey.pose(last)), true)
    assert made.parts.count == 1
    assert abs(off[0]) < 3 * math.sqrt(spread[0, 0]) < 1.5


def test_on_a_plan_of_one_end_the_other_is_known_as_the_way_to_it_is(by_doors):
    """The wall behind the second room, 38 m off, is not known as well as those of the plan."""
    made, _ = by_doors
    plan = LineMap.from_lines([*ENDS[:5], *ENDS[10:12], [0, -1, 12, -1], *DOORS[:8]])
    walls = merge_onto(made, plan, placements(made, plan)).made.map.walls
    behind = walls[(abs(walls["centroid"][:, 0] - 38) < 1) & (abs(np.cos(walls["angle"])) < 0.1)]
    claimed = np.sqrt(behind["covariance"][:, 0, 0])
    assert len(behind)
    assert 0.1 < claimed.min() <= claimed.max() < 0.6
    assert (abs(behind["centroid"][:, 0] - 38) < 2 * claimed).all()
