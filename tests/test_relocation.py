"""Pauses and clocks that jump: the tracker finds where it is, or says that it does not know."""

import math
from itertools import pairwise

import numpy as np
import pytest
from handmade import features, segment

import lineament as ln
from lineament.live import LiveConfig, Pipeline
from lineament.motion import Tracker
from lineament.motion.relocation import _surprise, is_contradicted, relocated
from lineament.scan.poses import compose, inverse, poses_along, relative
from lineament.simulation import SENSORS, World, scene

STILL, DRIVE, TURN = (0.0, 0.0, 0.0), (0.5, 0.0, 0.1), (0.3, 0.0, -0.3)
#: What is known of a motion after a pause.
WIDE = ((0.0, 0.0, 0.0), np.array((3.0, 3.0, 2.0)))


def closed(*corners):
    return World([[*a, *b] for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)])


ROOMS = {
    "L": closed((-3, -3), (5, -3), (5, 1), (1, 1), (1, 4), (-3, 4)),
    "rectangle": closed((-4, -2.5), (4, -2.5), (4, 2.5), (-4, 2.5)),
    "irregular": closed((-3, -3), (4, -3.5), (5, 0), (3, 1), (3.5, 4), (-1, 5), (-4, 2)),
}
#: Twist before a pause, its length [s], twist during it, and by how much the clock jumps [s].
PAUSES = [
    (DRIVE, 10.0, STILL, 0.0),
    (TURN, 3.0, STILL, 0.0),
    (DRIVE, 3.0, (0.1, 0.0, 0.1), 0.0),
    (DRIVE, 10.0, (0.0, 0.0, 0.05), 0.0),
    (TURN, 0.1, TURN, 100.0),
    (DRIVE, 0.1, DRIVE, -3.0),
    (DRIVE, 5.0, (0.2, 0.0, 0.1), -4.9),
    (DRIVE, 5.0, (0.2, 0.0, 0.1), -20.0),
]


def paused(room, sensor, pause, seed):
    """Poses, motions and world positions of numbered corners around a pause."""
    twist, gap, meanwhile, jump = pause
    chance = seed, round(10 * gap), round(jump + 100), len(room.segments)
    rng, extract, tracker = np.random.default_rng(chance), ln.Extractor(), Tracker(roughness=0.0)
    start = (*np.add((-1.0, -0.7), rng.uniform(-0.3, 0.3, 2)), rng.uniform(-3, 3))
    way = [compose(start, tuple(pose)) for pose in poses_along(twist, np.arange(8) * 0.1)]
    way.append(compose(way[-1], tuple(poses_along(meanwhile, [gap])[0])))
    way.append(compose(way[-1], (0.02, 0.0, 0.01)))
    stamps = np.arange(10) * 0.1 + np.where(np.arange(10) > 7, gap - 0.1 + jump, 0.0)
    for pose, stamp in zip(way, stamps.tolist(), strict=True):
        found = extract(SENSORS[sensor].scan(room, pose, rng, stamp))
        tracks = tracker(found)
        places = [compose(pose, (x, y, 0.0))[:2] for x, y in found.corners["position"].tolist()]
        numbers = tracks.corners.tolist()
        yield pose, tracks.motion, {n: p for n, p in zip(numbers, places, strict=True) if n >= 0}


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["utm30lx", "rplidar"])
def test_after_a_pause_or_a_jump_the_motion_is_right_or_not_observed(sensor):
    """NEES of some 900 motions a degree of freedom has a deviation of √(2/2700) = 0.03."""
    squares, observed, kept, corners = [], {}, 0, 0
    for name, room in ROOMS.items():
        for i, pause in enumerate(PAUSES):
            for seed in range(8):
                frames = list(paused(room, sensor, pause, seed))
                for before, now in pairwise(frames[4:]):
                    # A number stays at its corner, whatever happens.
                    same = before[2].keys() & now[2].keys()
                    assert all(math.dist(before[2][n], now[2][n]) < 0.4 for n in same), (name, i)
                    if now is frames[8]:
                        observed.setdefault((name, i), []).append(now[1].observable)
                        if now[1].observable:
                            kept, corners = kept + len(same), corners + len(now[2])
                    if now[1].observable:
                        off = np.subtract(now[1].pose, relative(before[0], now[0]))
                        off[2] = math.remainder(off[2], 2 * math.pi)
                        squares.append(off @ np.linalg.solve(now[1].covariance, off) / 3)
    assert 0.9 < np.mean(squares) < 1.1
    assert np.max(squares) < 7
    assert kept > 0.9 * corners
    # Only the rectangle is the same from both ends: elsewhere it is mostly known.
    for (name, i), of in observed.items():
        if name == "irregular" or i in (0, 1, 4, 5):
            assert all(of), (name, i)
    assert not all(observed["rectangle", 3])


@pytest.mark.slow
def test_nothing_is_sure_and_wrong_in_rooms_of_all_kinds():
    extract, known = ln.Extractor(), 0
    for seed in range(40):
        rng, (room, start) = np.random.default_rng(seed), scene("room", seed)
        for _ in range(3):
            motion = (*rng.uniform(-0.5, 0.5, 2), rng.uniform(-1.0, 1.0))
            pose = (*start[:2], rng.uniform(-3, 3))
            tracker, way = Tracker(roughness=0.0), [pose, compose(pose, (0.05, 0.0, 0.02))]
            way.append(compose(way[-1], motion))
            for place, stamp in zip(way, (0.0, 0.1, 10.0), strict=True):
                tracks = tracker(extract(SENSORS["utm30lx"].scan(room, place, rng, stamp)))
            off = np.subtract(tracks.motion.pose, motion)
            is_right = np.abs(off).max() < 0.05
            assert is_right or not tracks.motion.observable, seed
            known += is_right
    assert known > 95


@pytest.mark.parametrize("jolt", [0.052, -0.08, 0.3])
@pytest.mark.parametrize("is_closed", [True, False])
def test_a_wheel_that_spins_turns_a_corridor_in_odometry_alone(jolt, is_closed):
    """All walls are then far from where odometry has them, and they know better."""
    walls = [(-3, -1, 12, -1), (12, 1, -3, 1)] + [(12, -1, 12, 1)] * is_closed
    corridor, rng, extract = World(walls), np.random.default_rng(0), ln.Extractor()
    tracker = Tracker(roughness=0.0)
    for k in range(8):
        scan = SENSORS["utm30lx"].scan(corridor, (0.2 * k, 0.1, 0.0), rng, k / 5)
        turned = jolt * (k > 5)
        odometry = compose((1.0, 0.02, turned), (0.2 * (k - 5), 0.0, 0.0))
        tracks = tracker(extract(scan), odometry)
        if k == 5:
            before = tracks.segments.tolist()
        if k == 6:
            motion = tracks.motion
    assert len(before) == len(walls)
    if is_closed:
        assert tracks.segments.tolist() == before
        assert motion.observable
        assert abs(motion.theta) < 0.005
    else:
        assert not motion.observable


def test_odometry_of_a_node_holds_over_a_pause():
    """A robot stands for 10 s, in each room; where it is not sure, its covariance is wide."""
    for seed, room in enumerate(ROOMS.values()):
        pipeline, rng = Pipeline(LiveConfig(track=True)), np.random.default_rng(seed)
        way = [compose((-1.0, -0.7, 0.4), tuple(p)) for p in poses_along(DRIVE, np.arange(6) * 0.1)]
        way += [way[-1]] * 3
        for k, pose in enumerate(way):
            scan = SENSORS["utm30lx"].scan(room, pose, rng, k / 10 + 10.0 * (k > 5))
            travel = pipeline("a", scan).travel
            off = np.subtract(travel.pose, relative(way[0], pose))
            covariance = travel.covariance + np.eye(3) * 1e-12
            assert off @ np.linalg.solve(covariance, off) < 16
            assert k != 6 or np.abs(travel.twist).max() < 0.01


# Walls of a room of 8 by 5 m with a niche.
NICHE = [(-4, -2), (4, -2), (4, 3), (1, 3), (1, 2), (-4, 2)]
WALLS = features(
    segments=[segment(b, a, 10 * k, 10 * k + 9) for k, (a, b) in enumerate(
        zip(NICHE, [*NICHE[1:], NICHE[0]], strict=True))]
).segments  # fmt: skip
PARALLEL = WALLS[[0, 5]]


def seen_after(motion, walls=WALLS):
    return features(segments=list(walls)).transform(*inverse(motion)).segments


@pytest.mark.parametrize("motion", [(0.0, 0.0, 0.0), (2.0, -1.0, 1.5), (-1.0, 3.0, -2.0)])
def test_walls_show_the_motion(motion):
    np.testing.assert_allclose(relocated(WALLS, seen_after(motion), [WIDE]), motion, atol=1e-9)


@pytest.mark.parametrize(
    ("before", "now", "expected", "is_known"),
    [
        (WALLS, WALLS, [WIDE], True),
        # Too few walls, unless just this motion was expected.
        (WALLS[:2], WALLS[:2], [WIDE], False),
        (WALLS[:2], WALLS[:2], [WIDE, ((0.1, 0, 0), np.full(3, 0.1))], True),
        (PARALLEL, PARALLEL, [WIDE, ((0, 0, 0), np.full(3, 0.1))], True),
        (PARALLEL, PARALLEL, [WIDE], False),
        (WALLS[:0], WALLS, [WIDE], False),
        (WALLS, WALLS[:0], [WIDE], False),
        # Beyond four deviations of all that is expected.
        (WALLS, seen_after((2.1, 0, 0)), [((0, 0, 0), np.full(3, 0.5))], False),
        (WALLS, seen_after((1.9, 0, 0)), [((0, 0, 0), np.full(3, 0.5))], True),
    ],
)
def test_when_a_motion_is_known(before, now, expected, is_known):
    assert (relocated(before, now, expected) is not None) == is_known


def test_two_walls_of_which_one_is_turned_to_either_side_give_the_turn_between():
    """Of a corner of 3 m by 3 m the walls are off by 55 mrad, about their middles."""
    middles, motion = [(1.5, 0.0), (0.0, 1.5)], (2.0, -1.0, 1.5)
    before, later = (
        features(segments=[wall(m, 3.0, a) for m, a in zip(middles, angles, strict=True)]).segments
        for angles in ((0.0, math.pi / 2), (0.055, math.pi / 2 - 0.055))
    )
    expected = [WIDE, ((1.6, -0.6, 1.1), np.full(3, 0.4))]
    found = relocated(before, seen_after(motion, later), expected)
    np.testing.assert_allclose(found, motion, atol=3e-3)


@pytest.mark.parametrize(("turn", "is_known"), [(0.34, True), (0.27, False)])
def test_walls_cross_at_more_than_17_degrees(turn, is_known):
    walls = [wall((0.0, 0.0), 4.0), wall((3.0, 1.0), 3.0, turn), wall((9.0, 6.0), 2.0)]
    before = features(segments=walls).segments
    found = relocated(before, seen_after((1.0, -0.5, 0.4), before), [WIDE])
    assert (found is not None) == is_known


def test_the_density_of_what_is_expected_by_hand():
    """Deviations of .5, .5 and .1: -2 log is χ² + 2 log .025; beyond four deviations nothing is."""
    deviations = np.array((0.5, 0.5, 0.1))
    motions = np.array([(1.0, 2.0, 3.1), (1.5, 1.0, -3.0), (3.1, 2.0, 3.1), (1.0, 2.0, 3.45)])
    square = 1.0 + 4.0 + ((2 * math.pi - 6.1) / 0.1) ** 2
    expected = [0.0, square, math.inf, 3.5**2] + 2 * np.log(0.025)
    np.testing.assert_allclose(_surprise(motions, (1.0, 2.0, 3.1), deviations), expected)


def test_a_room_that_is_the_same_from_both_ends():
    ends = [(-4, -2), (4, -2), (4, 2), (-4, 2)]
    walls = [segment(b, a, 0, 9) for a, b in zip(ends, [*ends[1:], ends[0]], strict=True)]
    same = features(segments=walls).segments
    assert relocated(same, same, [WIDE]) is None
    # To stand is more probable than to have turned round on the very spot.
    near = ((0.0, 0.0, 0.0), np.full(3, 0.1))
    assert relocated(same, same, [WIDE, near]) == pytest.approx((0, 0, 0), abs=1e-9)


@pytest.mark.parametrize(
    ("motion", "n", "is_so"),
    [((0, 0, 0), 6, False), ((0.05, 0.05, 0.03), 6, False), ((0.5, 0.4, 0.0), 6, True),
     ((0, 0, 0.1), 6, True), ((0.5, 0.4, 0.0), 3, True), ((0.5, 0.4, 0.0), 2, False)],
)  # fmt: skip
def test_walls_contradict_a_motion(motion, n, is_so):
    assert is_contradicted(motion, WALLS[:n], WALLS) == is_so


def wall(middle, length, turn=0.0):
    c, s = 0.5 * length * math.cos(turn), 0.5 * length * math.sin(turn)
    x, y = middle
    return segment((x - c, y - s), (x + c, y + s), 0, 9)


@pytest.mark.parametrize(
    ("later", "is_found"),
    [
        (wall((0.0, 0.09), 4.0), True),
        (wall((0.0, -0.11), 4.0), False),
        (wall((0.0, 0.0), 1.0, 0.05), True),
        (wall((0.0, 0.0), 1.0, -0.07), False),
        # Two metres are shared with a wall of 4 m, half of the shorter.
        (wall((1.9, 0.0), 4.0), True),
        (wall((-2.1, 0.0), 4.0), False),
        (wall((1.9, 0.0), 1.0), True),
        (wall((2.1, 0.0), 1.0), False),
        (wall((3.0, 0.0), 8.0), True),
        (wall((4.5, 0.0), 8.0), False),
    ],
)
def test_a_wall_is_found_again_near_its_line_beside_half_of_it(later, is_found):
    """One of 4 m; of 10 cm off it, 60 mrad, and half of the shorter beside each other."""
    before = features(segments=[wall((0.0, 0.0), 4.0), wall((0, 50), 9.0), wall((0, 60), 9.0)])
    # Of three walls a share of less than 0.3 contradicts: this one alone is nearly all of them.
    now = features(segments=[later, wall((0, 90), 0.1), wall((0, 91), 0.1)])
    assert is_contradicted((0.0, 0.0, 0.0), before.segments, now.segments) != is_found
    place, turn = np.array((1.0, -2.0)), 1.1
    moved = now.transform(*inverse((*place, turn)))
    assert is_contradicted((*place, turn), before.segments, moved.segments) != is_found


def test_the_ten_longest_walls_decide():
    """Ten walls of 4 m that are found again, and of 1 m any number that are not; or ten of 5."""
    same = [wall((0.0, 2.0 * k), 4.0) for k in range(10)]
    for length, is_so in ((1.0, False), (5.0, True)):
        others = [wall((50.0, 2.0 * k), length) for k in range(10)]
        later = [wall((90.0, 2.0 * k), length) for k in range(10)]
        before, now = (features(segments=same + rest).segments for rest in (others, later))
        assert is_contradicted((0.0, 0.0, 0.0), before, now) == is_so


@pytest.mark.parametrize(("missing", "is_known"), [(0, True), (1, True), (4, False)])
def test_half_of_the_walls_must_be_found_again(missing, is_known):
    """Of six walls some stand elsewhere, where no motion explains them."""
    motion = (0.3, 0.2, 0.1)
    others = [wall((40.0 + 7 * k, 9.0 * k * k), 4.5, 0.4 + 1.1 * k) for k in range(missing)]
    later = [*WALLS[: 6 - missing], *features(segments=others).segments]
    now = features(segments=later).transform(*inverse(motion)).segments
    narrow = ((0.2, 0.2, 0.1), np.full(3, 0.2))
    found = relocated(WALLS, now, [WIDE, narrow])
    assert (found is not None) == is_known
    if is_known:
        np.testing.assert_allclose(found, motion, atol=0.02)
