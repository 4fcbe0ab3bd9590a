"""The judge of another localiser's poses: robots that are carried, drift, or meet moved things."""

import math

import numpy as np
import pytest

import lineament as ln
from lineament.mapping import LineMap
from lineament.mapping.evidence import Evidence
from lineament.mapping.following import Whereabouts
from lineament.mapping.index import MAPPED
from lineament.mapping.judging import DENIED, LASTING, LEAST, Judge
from lineament.mapping.locate import LOCATED, LOST, UNKNOWN
from lineament.simulation import SENSORS, World
from lineament.simulation.worlds import closed, rectangle

ROOM = closed(rectangle((4.0, 3.0), 8.0, 6.0))
#: Where we are not located, and what a scan says that is plainly of a place.
NOWHERE = Whereabouts(LOST, (0.0, 0.0, 0.0), UNKNOWN, Evidence(-9.0, 0.0, 0.0, 1.0, 99))
PLAIN = Evidence(30.0, 0.95, 0.05, 0.0, 99)


def furnished(seed: int) -> World:
    """Return a room of 8 m x 6 m with things in it, but for the middle, where a robot drives."""
    rng, things = np.random.default_rng(seed), []
    while len(things) < 14:
        x, y = rng.uniform((0.6, 0.6), (7.4, 5.4))
        if abs(y - 3.0) > 0.9:
            things.append(closed(rectangle((x, y), 0.6, 0.6, rng.uniform(0, 1.5))))
    return World.of_polygons([ROOM, *things])


def seen(world: World, pose: tuple[float, float, float], stamp: float) -> ln.Features:
    rng = np.random.default_rng(round(stamp * 1000))
    return ln.extract(SENSORS["utm30lx"].scan(world, pose, rng, stamp))


def at(stamp: float) -> tuple[float, float, float]:
    """Where the robot is, which drives along the middle."""
    return 2.0 + 0.5 * stamp, 3.0, 0.1


def begun(plan: LineMap, world: World) -> Judge:
    """Return a judge to whom the pose was right at 0 s, and whom nobody tells where we are."""
    judge = Judge(plan)
    where = Whereabouts(LOCATED, at(0.0), np.eye(3) * 1e-4, PLAIN)
    assert judge(seen(world, at(0.0), 0.0), at(0.0), where).verdict == "right"
    return judge


def carried(stamp: float) -> ln.Features:
    """What a robot sees that was put down in another room."""
    return seen(furnished(99), (5.0 + 0.5 * stamp, 3.1, 2.0), stamp)


@pytest.mark.parametrize("sigma", [0.0, MAPPED])
@pytest.mark.parametrize("seed", [0, 3, 5, 8])
def test_a_pose_is_not_wrong_among_things_that_have_moved(seed, sigma):
    """The plan denies each scan, but each shows what those before showed. So on a robot's map."""
    plan, world = LineMap.from_lines(furnished(seed).segments, sigma=sigma), furnished(seed + 50)
    judge, denied = begun(plan, world), 0
    for stamp in np.arange(0.2, 2.0, 0.2).tolist():
        judgement = judge(seen(world, at(stamp), stamp), at(stamp), NOWHERE)
        assert judgement.verdict == "not sure"
        denied += judgement.evidence.log_odds < DENIED and judgement.evidence.explained < LEAST
    assert denied > 5
    # It is the place that says so: carried to another one, the same robot is noticed.
    verdicts = [judge(carried(t), at(t), NOWHERE).verdict for t in (2.0, 2.2)]
    assert verdicts == ["not sure", "wrong"]


def test_what_was_never_right_goes_on_from_nothing():
    plan, world = LineMap.from_lines(furnished(3).segments), furnished(53)
    judge = Judge(plan)
    verdicts = [judge(seen(world, at(t), t), at(t), NOWHERE).verdict for t in (0.0, 0.2, 0.4)]
    assert verdicts == ["not sure", "wrong", "wrong"]


def test_the_plan_alone_may_show_that_the_pose_is_right():
    """Though we are not located ourselves: then it drives on to where things have moved."""
    world = furnished(53)
    judge = Judge(LineMap.from_lines(world.segments))
    assert judge(seen(world, at(0.0), 0.0), at(0.0), NOWHERE).verdict == "not sure"
    judge.plan = LineMap.from_lines(furnished(3).segments)
    verdicts = [judge(seen(world, at(t), t), at(t), NOWHERE).verdict for t in (0.2, 0.4, 0.6)]
    assert verdicts == ["not sure"] * 3


def test_a_pose_that_drifts_away_among_things_that_have_moved():
    """The scans show where the robot really goes, step by step."""
    plan, world = LineMap.from_lines(furnished(3).segments), furnished(53)
    judge, verdicts = begun(plan, world), []
    for stamp in np.arange(0.2, 3.0, 0.2).tolist():
        drifted = np.add(at(stamp), (0.0, 0.5 * stamp, 0.0))
        verdicts.append(judge(seen(world, at(stamp), stamp), tuple(drifted), NOWHERE).verdict)
    first = verdicts.index("wrong")
    assert 0.3 < 0.5 * 0.2 * (first + 1) < 1.0  # [m]


@pytest.mark.parametrize("step", [0.025, 0.2, 0.5])
def test_a_denial_lasts_some_time_at_any_rate(step):
    """Two scans of a fast scanner are one look; two of a slow one are enough."""
    world = furnished(3)
    judge = begun(LineMap.from_lines(world.segments), world)
    stamps = [k * step for k in range(1, 30)]
    verdicts = [judge(carried(t), at(t), NOWHERE).verdict for t in stamps]
    first = verdicts.index("wrong")
    assert first == max(1, math.ceil(LASTING / step - 1e-9))
    assert set(verdicts[:first]) == {"not sure"}
    assert stamps[first] - stamps[0] <= max(LASTING + step, step)


def test_scans_without_a_clock_deny_by_their_number():
    world = furnished(3)
    judge = begun(LineMap.from_lines(world.segments), world)
    still = carried(0.5)
    assert [judge(still, at(0.5), NOWHERE).verdict for _ in range(2)] == ["not sure", "wrong"]


def test_one_scan_is_enough_where_we_are_somewhere_else():
    world = furnished(3)
    judge = begun(LineMap.from_lines(world.segments), world)
    elsewhere = Whereabouts(LOCATED, (6.0, 5.0, 0.0), np.eye(3) * 1e-4, PLAIN)
    assert judge(carried(0.2), at(0.2), elsewhere).verdict == "wrong"
