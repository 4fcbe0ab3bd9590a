"""What beams say that end where nobody has looked, against cases by hand and a slow twin."""

import math

import numpy as np
import pytest

from lineament import LaserScan
from lineament.mapping import LineMap
from lineament.mapping.evidence import evidence_of
from lineament.mapping.views import BEARINGS, looked, views_of
from lineament.scan.poses import compose, inverse

EXPLAINED, SHORT = math.log(7 / 3) + 0.5, math.log(0.7)


def beams_to(places):
    """Return one beam from the origin to each place, all of the same weight."""
    found, places = np.zeros((len(places), 10)), np.asarray(places, float)
    found[:, 4] = np.hypot(*places.T)
    found[:, 2:4], found[:, 6] = places / found[:, 4:5], 1.0
    return found


def test_where_nobody_has_looked_walls_go_on_and_all_else_says_nothing():
    """A wall at x = 2 that ends at y = 0.1: from the origin, nobody has looked to y > 0.2."""
    plan = LineMap.from_lines([[2, -10, 2, 0.1]])
    far = looked(LaserScan(np.full(120, 2.0), -math.pi / 3 * 2, math.radians(1)))
    views = views_of(np.zeros((1, 3)), [far])
    on_wall, goes_on, too_far, nowhere, before = (2, -0.1), (2, 4.0), (2, 4.3), (4, 4), (1, -0.5)

    def says(*places):
        return evidence_of(np.zeros((1, 3)), beams_to(places), plan.index, 0.02, views=views)[0]

    for place, expected in (
        (on_wall, EXPLAINED),
        (goes_on, EXPLAINED),
        (too_far, 0.0),
        (nowhere, 0.0),
        (before, SHORT),
    ):
        assert says(place)[0] == pytest.approx(expected / 3)
    found = says(on_wall, on_wall, goes_on, nowhere, before, before)
    np.testing.assert_allclose(found[1:], (0.5, 0.5, 0.0))
    # Few that say something are not all there is to say.
    found = says(on_wall, *[nowhere] * 9)
    np.testing.assert_allclose(found[1:], (0.5, 0.0, 0.0))
    # Without views all of the plan is known.
    whole = evidence_of(np.zeros((1, 3)), beams_to([on_wall, goes_on]), plan.index, 0.02)[0]
    np.testing.assert_allclose(whole[1:], (0.5, 0.5, 0.0))


@pytest.mark.parametrize("seed", range(5))
def test_what_was_seen_is_as_a_slow_twin_finds_it(seed):
    rng = np.random.default_rng(seed)
    plan = LineMap.from_lines([[90, 90, 91, 90]])  # where no beam ends
    poses = rng.uniform((-3, -3, -4), (3, 3, 4), (4, 3))
    scans = [
        LaserScan(
            np.where(rng.random(n) < 0.2, np.nan, rng.uniform(1, 6, n)),
            rng.uniform(-3, 3),
            math.radians(rng.choice((0.25, 1.0, -1.0))),
        )
        for n in (40, 90, 200, 360)
    ]
    views = views_of(poses, [looked(scan) for scan in scans])
    # Some beside the axes and diagonals of a view, where the octants of the kernel meet.
    ways = (np.arange(8)[:, None] * math.pi / 4 + poses[0, 2] + (-1e-6, 1e-6)).ravel()
    on = [poses[0, :2] + r * np.column_stack((np.cos(ways), np.sin(ways))) for r in (1, 2.2, 4.4)]
    places = np.concatenate((rng.uniform(-6, 6, (300, 2)), *on))
    found = [
        evidence_of(np.zeros((1, 3)), beams_to([place]), plan.index, 0.02, views=views)[0, 0] < 0
        for place in places
    ]
    assert found == [was_seen(place, poses, scans) for place in places.tolist()]
    assert 0.1 < np.mean(found) < 0.9


def was_seen(place, poses, scans):
    """Whether the nearest beam in the degree of a place, or in those beside it, goes so far."""
    for pose, scan in zip(poses.tolist(), scans, strict=True):
        x, y, _ = compose(inverse(tuple(pose)), (*place, 0.0))
        here, near = math.floor(math.degrees(math.atan2(y, x)) % 360), []
        for r, angle in zip(scan.ranges.tolist(), scan.angles.tolist(), strict=True):
            apart = (math.floor(math.degrees(angle) % 360) - here) % BEARINGS
            if apart in (0, 1, BEARINGS - 1) and r > 0:  # not NaN
                near.append(r)
        if near and math.hypot(x, y) < min(near) + 0.05 + 0.02:
            return True
    return False
