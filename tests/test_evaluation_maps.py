"""Maps against the truth, by hand."""

import math

import numpy as np
import pytest
from lineament_lab.evaluation.maps import (
    absolute_errors,
    alignment,
    contradicted,
    doubled_walls,
)

from lineament.scan.poses import compose
from lineament.simulation import SENSORS, room


def test_ways_are_aligned_before_they_are_compared():
    rng = np.random.default_rng(3)
    truth = [tuple(p) for p in rng.uniform(-3, 3, (20, 3)).tolist()]
    frame = (4.0, -2.0, 2.5)
    seen = [compose(frame, pose) for pose in truth]
    np.testing.assert_allclose(compose(alignment(seen, truth), frame), (0, 0, 0), atol=1e-12)
    errors = absolute_errors(seen, truth)
    assert errors.ways.max() < 1e-12
    assert errors.turns.max() < 1e-12
    # A square of 2 m, stretched in x by 0.2 m: all corners are off by 0.1 m, headings by 0.3.
    square = [(x, y, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    wide = [(1.1 * x + 7, y, 0.3) for x, y, _ in square]
    errors = absolute_errors(wide, square)
    np.testing.assert_allclose(errors.ways, 0.1)
    np.testing.assert_allclose(errors.turns, 0.3)
    for wrong in ([], square[1:]):
        with pytest.raises(ValueError, match="poses and 4 true ones"):
            absolute_errors(wrong, square)


WALL = [0, 0, 10, 0]


@pytest.mark.parametrize(
    ("walls", "length"),
    [
        ([], 0),
        ([WALL], 0),
        # Beside it, within 15 cm and beyond, to either side.
        ([WALL, [2, 0.14, 5, 0.14]], 3),
        ([WALL, [2, -0.14, 5, -0.14]], 3),
        ([WALL, [2, 0.16, 5, 0.16]], 0),
        # The other face; in line with it, behind its end; half of it beside.
        ([WALL, [5, 0.14, 2, 0.14]], 0),
        ([WALL, [10.5, 0.05, 13, 0.05]], 0),
        ([WALL, [8, 0.1, 12, 0.1]], 2),
        # The same stretch beside two walls counts once, three walls on each other twice.
        ([WALL, [0, 0.1, 9, 0.1], [1, 0.05, 4, 0.05]], 12),
        ([WALL, [6, 0.1, 8, 0.1], [1, 0.1, 4, 0.1]], 5),
        # Turned by less and by more than 10°.
        ([WALL, [4, -0.05, 5, 0.05]], math.hypot(1, 0.1)),
        ([WALL, [4, -0.1, 5, 0.1]], 0),
    ],
)
def test_doubled_walls_by_hand(walls, length):
    rng = np.random.default_rng(0)
    for x, y, theta in [(0, 0, 0), *rng.uniform(-5, 5, (3, 3))]:
        moved = [
            compose((x, y, theta), (px, py, 0.0))[:2]
            for wall in walls
            for px, py in (wall[:2], wall[2:])
        ]
        assert doubled_walls(np.array(moved).reshape(-1, 4)) == pytest.approx(length, abs=1e-9)


def test_scans_that_look_at_a_place_again_contradict_each_other_at_wrong_poses():
    """There and back: by the true poses none of five pairs does, by others all that turned."""
    rng, places = np.random.default_rng(4), np.linspace(-1.5, 1.5, 5)
    out = [(x, -0.3, 0.2) for x in places.tolist()]
    away = [(1.5, 9.0, 0.0), (-1.5, 9.0, 0.0)]
    truth = [*out, *away, *[(x, 0.3, 0.2) for x in places.tolist()]]
    scans = [SENSORS["utm30lx"].scan(room(), pose, rng) for pose in truth]
    turned = [(x, y, theta + (0.5 if k > 8 else 0.0)) for k, (x, y, theta) in enumerate(truth)]
    count, shares = contradicted(scans, truth, turned)
    # Places are 0.75 m apart, ways 0.6 m: each is near the one on the way back, and its neighbours.
    assert count == 5 + 8
    assert shares[0] == 0
    assert shares[1] == pytest.approx(
        sum(abs(i - j) < 2 and j > 1 for i in range(5) for j in range(5)) / 13
    )
    assert contradicted(scans[:5], truth[:5])[0] == 0  # never again
