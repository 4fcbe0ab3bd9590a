"""Each constant of method optimal matters: what holds at its value does not at × 1.5 and ÷ 1.5.

The kernels run as plain Python, in which a number can be replaced.
"""

import importlib
import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from conftest import packages
from worlds import fan, vertex, wall

ONE = math.radians(1.0)


@contextmanager
def replaced(name: str, value: float) -> Iterator[None]:
    """Replace a constant wherever a kernel of the method has it."""
    modules = [m for m in packages("lineament.kernels.optimal").values() if hasattr(m, name)]
    assert len(modules) > 1
    with pytest.MonkeyPatch.context() as patch:
        for module in modules:
            patch.setattr(module, name, value)
        yield


def flat(half=30, step=ONE):
    """A wall 2 m ahead, and its bearings."""
    angles = fan(half, step)
    return wall(angles, 2.0, 0), angles


def nearer(beams, by):
    """A wall on which some measurements are nearer by so much [m]."""
    ranges, angles = flat()
    ranges[beams] -= by
    return ranges, angles


def panels(step):
    ranges, angles = flat(15, ONE / 2)
    return ranges + step * (angles > 0), angles


def panel(count):
    ranges, angles = flat(20)
    ranges[20 : 20 + count] -= 0.8 / np.cos(angles[20 : 20 + count])
    return ranges, angles


def turn(opening, arm):
    angles = 0.6 * ONE * np.arange(-arm, arm + 1)
    return vertex(angles, 2.0, opening, convex=False), angles


def hole(missing):
    angles = fan(30, ONE)
    ranges = vertex(angles, 3.0, 90, convex=False)
    ranges[30 : 31 + missing] = np.nan
    return ranges, angles


def end(far):
    angles = fan(20, 2 * ONE)
    return wall(angles, far, 0) * np.where(angles > 0, 2.0, 1.0), angles


def begun(count):
    """A wall whose first measurements are on something nearer."""
    return nearer(slice(count), 0.8)


def stepped(bearing, depth):
    """A wall from a bearing [deg] on, and another so far behind it [m] before."""
    angles = fan(30, ONE)
    return wall(angles, np.where(angles > (bearing + 0.5) * ONE, 2.0, 2.0 + depth), 0), angles


def column(radius, shown=1.5, far=4.0):
    """Measurements at equal turns along a column that is seen from the side."""
    around = np.linspace(-shown / 2, shown / 2, 60)
    x, y = far - radius * np.cos(around), radius * np.sin(around)
    return np.hypot(x, y), np.arctan2(y, x)


def count(table):
    return lambda found: len(getattr(found, table))


def clusters(found):
    return int(found.clusters.max()) + 1


#: By constant: what it decides, two scenes on either side of it, and what is found in them.
CASES = {
    # Walls 7.5 cm apart are one that bends, 10.5 cm apart two.
    "TAU": (count("segments"), (panels(0.075), 1), (panels(0.105), 2)),
    # A last measurement is on its wall where it is off by 7 cm, on none where by 8 cm.
    "CLUTTER": (
        lambda found: found.segments["last_beam"][0],
        (nearer(-1, 0.07), 60),
        (nearer(-1, 0.08), 59),
    ),
    # Four measurements before a wall are a panel, three are none.
    "LEAST": (count("segments"), (panel(3), 2), (panel(4), 3)),
    # A measurement that is off by 7.5 cm counts for its wall, by 10.5 cm not.
    "SIGMAS": (
        lambda found: found.segments["n_points"][0],
        (nearer(30, 0.075), 61),
        (nearer(30, 0.105), 60),
    ),
    # A measurement 17 spacings behind a wall is a spike, at 12 it may be on a surface.
    "STEEPEST": (
        lambda found: found.clusters[30] >= 0,
        (nearer(30, -24.0 * math.sin(ONE)), True),
        (nearer(30, -34.0 * math.sin(ONE)), False),
    ),
    # A wall may bend by 17°, a turn of 23° is a corner.
    "BEND": (count("corners"), (turn(163, 21), 0), (turn(157, 19), 1)),
    # A wall of arms of 0.75 m may bend by 15°, one of arms of 0.85 m has a corner there.
    "RARE": (count("corners"), (turn(165, 37), 0), (turn(165, 42), 1)),
    # A corner is 29 cm from the measurements beside it, not 36 cm from them.
    "REACH": (count("corners"), (hole(3), 1), (hole(4), 0)),
    # The end of a wall is known to 8 cm, by its spacing, or it is no edge.
    "MOST_DEVIATION": (lambda found: len(found.edges), (end(8), 1), (end(12), 0)),
    # A column of 1.3 m is round, one of 1.7 m not.
    "ARC_RADIUS": (count("arcs"), (column(1.3), 1), (column(1.7), 0)),
    # A round surface shows 45°, or it is none.
    "ARC_TURN": (count("arcs"), (column(1.0, 0.6), 0), (column(1.0, 0.85), 1)),
    # At a noise of 0.1 mm a column of 0.5 mm is round, one of 0.35 mm may be straight.
    "ARC_PRICE": (count("arcs"), (column(0.00035), 0), (column(0.0005), 1)),
    # Three measurements are a cluster, two are none.
    "LEAST_CLUSTER": (lambda found: found.clusters[0] >= 0, (begun(2), False), (begun(3), True)),
    # A face that 0.4 of a beam would see does not join walls, one that 0.6 would see does.
    "FACE_LEAST": (clusters, (stepped(7, 0.12), 2), (stepped(10, 0.12), 1)),
    # A face that 2.5 beams would see joins walls with no measurement between, one of 4 not.
    "FACE_MORE": (clusters, (stepped(20, 0.3), 1), (stepped(25, 0.4), 2)),
    # A corner that costs 15 to leave out is one, a corner that costs 10 is none.
    "evidence": (count("corners"), (turn(154, 13), 0), (turn(154, 15), 1)),
    # A wall goes on over six missing beams, not over seven.
    "max_missing": (
        count("segments"),
        (nearer(slice(20, 26), math.nan), 1),
        (nearer(slice(20, 27), math.nan), 2),
    ),
}
PARAMETERS = ("evidence", "max_missing")
#: How sure lines are, of which `naive_optimal` has twins; what takes time; rounding.
ELSEWHERE = {
    *("STEP_SIGMAS", "TOGETHER", "OVERLAP", "LEAST_ODDS", "FARTHER", "ODDS_A", "ODDS_B"),
    *("LEAST_CHORD", "MOST_LINES", "SEED_STEPS", "ARC_STEPS", "GROUP", "RUNNERS"),
    *("SINGULAR", "STRAIGHT", "UNIFORM", "LARGEST", "BITS_OF_INFINITY"),
}


def holds(plain, name, **parameters):
    """Whether what is expected of a constant is found in both of its scenes."""
    parameters = {"max_missing": 20} | parameters if name == "REACH" else parameters
    extractor = plain.Extractor("optimal", noise=plain.RangeNoise(sigma=1e-4), **parameters)
    seen, *scenes = CASES[name]
    with np.errstate(all="ignore"):
        return all(
            seen(extractor(plain.LaserScan(ranges, angles=angles))) == expected
            for (ranges, angles), expected in scenes
        )


def scaled(name, value, factor):
    if name == "BEND":
        return math.cos(factor * math.acos(value))
    return round(value * factor) if isinstance(value, int) else value * factor


@pytest.mark.usefixtures("plain")
def test_every_constant_is_here():
    constants = vars(importlib.import_module("lineament.kernels.optimal.constants"))
    assert {name for name in constants if name.isupper()} == (
        CASES.keys() - {*PARAMETERS}
    ) | ELSEWHERE


@pytest.mark.parametrize("name", sorted(CASES.keys() - {*PARAMETERS}))
def test_constant(plain, name):
    constants = importlib.import_module("lineament.kernels.optimal.constants")
    value = getattr(constants, name)
    assert holds(plain, name)
    for factor in (1.5, 1 / 1.5):
        with replaced(name, scaled(name, value, factor)):
            assert not holds(plain, name), factor
    assert holds(plain, name)


@pytest.mark.parametrize("name", PARAMETERS)
def test_default(plain, name):
    assert holds(plain, name)
    value = getattr(plain.Extractor("optimal").method, name)
    for factor in (1.5, 1 / 1.5):
        assert not holds(plain, name, **{name: scaled(name, value, factor)}), factor
