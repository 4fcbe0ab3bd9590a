"""Each constant of method optimal matters: what holds at its value does not at × 1.5 and ÷ 1.5.

The kernels run as plain Python, in which a number can be replaced.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numba
import numpy as np
import pytest
from worlds import fan, vertex, wall

ONE = math.radians(1.0)


def packages(name: str = "lineament") -> dict[str, ModuleType]:
    """Modules of a package that are loaded."""
    inside = name + "."
    return {key: m for key, m in sys.modules.items() if key == name or key.startswith(inside)}


@pytest.fixture(scope="module")
def plain() -> Iterator[ModuleType]:
    """The package a second time, its kernels not compiled."""
    compiled, before = packages(), numba.config.DISABLE_JIT
    for name in compiled:
        del sys.modules[name]
    numba.config.DISABLE_JIT = 1
    yield importlib.import_module("lineament")
    numba.config.DISABLE_JIT = before
    for name in packages():
        del sys.modules[name]
    sys.modules.update(compiled)


@contextmanager
def replaced(name: str, value: float) -> Iterator[None]:
    """Replace a constant wherever a kernel of the method has it."""
    modules = [m for m in packages("lineament.kernels.optimal").values() if hasattr(m, name)]
    assert len(modules) > 1
    before = getattr(modules[0], name)
    for module in modules:
        setattr(module, name, value)
    yield
    for module in modules:
        setattr(module, name, before)


class Scenes:
    """What the method finds in scenes of exact ranges; parameters replace its own."""

    def __init__(self, plain: ModuleType, **parameters: Any) -> None:
        self.plain, self.parameters = plain, parameters

    def found(self, ranges, angles, sigma=1e-4, **parameters):
        noise = None if sigma is None else self.plain.RangeNoise(sigma=sigma)
        extractor = self.plain.Extractor("optimal", noise=noise, **parameters | self.parameters)
        with np.errstate(all="ignore"):
            return extractor(self.plain.LaserScan(ranges, angles=angles))

    # Each returns whether what is expected holds, from either side.

    def tau(self):
        """Walls 7.5 cm apart are one that bends, 10.5 cm apart two."""
        return len(self.panels(0.075).segments) == 1 and len(self.panels(0.105).segments) == 2

    def panels(self, step):
        angles = fan(15, ONE / 2)
        return self.found(wall(angles, 2.0, 0) + step * (angles > 0), angles)

    def clutter(self):
        """A last measurement is on its wall where it is off by 7 cm, on none where by 8 cm."""
        return [self.last(off).segments["last_beam"][0] for off in (0.07, 0.08)] == [60, 59]

    def last(self, off):
        angles = fan(30, ONE)
        ranges = wall(angles, 2.0, 0)
        ranges[-1] -= off
        return self.found(ranges, angles)

    def least(self):
        """Four measurements before a wall are a panel, three are none."""
        return [len(self.panel(count).segments) for count in (3, 4)] == [2, 3]

    def panel(self, count):
        angles = fan(20, ONE)
        ranges = wall(angles, 2.0, 0)
        ranges[20 : 20 + count] -= 0.8 / np.cos(angles[20 : 20 + count])
        return self.found(ranges, angles)

    def sigmas(self):
        """A measurement that is off by 7.5 cm counts for its wall, by 10.5 cm not."""
        return [self.off(off).segments["n_points"][0] for off in (0.075, 0.105)] == [61, 60]

    def off(self, off):
        angles = fan(30, ONE)
        ranges = wall(angles, 2.0, 0)
        ranges[30] -= off
        return self.found(ranges, angles)

    def steepest(self):
        """A measurement 17 spacings behind a wall is a spike, at 12 it may be on a surface."""
        return [self.behind(spacings).clusters[30] >= 0 for spacings in (12, 17)] == [True, False]

    def behind(self, spacings):
        angles = fan(30, ONE)
        ranges = wall(angles, 2.0, 0)
        ranges[30] += spacings * 2.0 * math.sin(ONE)
        return self.found(ranges, angles)

    def bend(self):
        """A wall may bend by 17°, a turn of 23° is a corner."""
        return [len(self.turn(163, 21).corners), len(self.turn(157, 19).corners)] == [0, 1]

    def turn(self, opening, arm):
        angles = 0.6 * ONE * np.arange(-arm, arm + 1)
        return self.found(vertex(angles, 2.0, opening, convex=False), angles)

    def rare(self):
        """A wall of arms of 0.75 m may bend by 15°, one of arms of 0.85 m has a corner there."""
        return [len(self.turn(165, arm).corners) for arm in (37, 42)] == [0, 1]

    def reach(self):
        """A corner is 29 cm from the measurements beside it, not 36 cm from them."""
        return [len(self.hole(missing).corners) for missing in (3, 4)] == [1, 0]

    def hole(self, missing):
        angles = fan(30, ONE)
        ranges = vertex(angles, 3.0, 90, convex=False)
        ranges[30 : 31 + missing] = np.nan
        return self.found(ranges, angles, max_missing=20)

    def most_deviation(self):
        """The end of a wall is known to 8 cm, by its spacing, or it is no edge."""
        return [(self.end(far).corners["kind"] == "edge").sum() for far in (8, 12)] == [1, 0]

    def end(self, far):
        angles = fan(20, 2 * ONE)
        return self.found(wall(angles, far, 0) * np.where(angles > 0, 2.0, 1.0), angles)

    def arc_radius(self):
        """A column of 1.3 m is round, one of 1.7 m not."""
        return [len(self.column(radius).arcs) for radius in (1.3, 1.7)] == [1, 0]

    def column(self, radius, turn=1.5, far=4.0):
        """Measurements at equal turns along a column that is seen from the side."""
        around = np.linspace(-turn / 2, turn / 2, 60)
        x, y = far - radius * np.cos(around), radius * np.sin(around)
        return self.found(np.hypot(x, y), np.arctan2(y, x))

    def arc_turn(self):
        """A round surface shows 45°, or it is none."""
        return [len(self.column(1.0, turn).arcs) for turn in (0.6, 0.85)] == [0, 1]

    def evidence(self):
        """A corner that costs 15 to leave out is one, a corner that costs 10 is none."""
        return [len(self.turn(154, arm).corners) for arm in (13, 15)] == [0, 1]

    def max_missing(self):
        """A wall goes on over six missing beams, not over seven."""
        return [len(self.missing(beams).segments) for beams in (6, 7)] == [1, 2]

    def missing(self, beams):
        angles = fan(30, ONE)
        ranges = wall(angles, 2.0, 0)
        ranges[20 : 20 + beams] = np.nan
        return self.found(ranges, angles)


#: Constants, and what they become times a factor.
SCALED = ("TAU", "CLUTTER", "SIGMAS", "STEEPEST", "RARE", "REACH", "MOST_DEVIATION")
SCALED += ("ARC_RADIUS", "ARC_TURN")
CONSTANTS = {name: lambda value, factor: value * factor for name in SCALED}
CONSTANTS["LEAST"] = lambda value, factor: round(value * factor)
CONSTANTS["BEND"] = lambda value, factor: math.cos(factor * math.acos(value))


@pytest.mark.usefixtures("plain")
def test_every_constant_is_here():
    constants = vars(importlib.import_module("lineament.kernels.optimal.constants"))
    assert {name for name in constants if name.isupper()} == CONSTANTS.keys()


@pytest.mark.parametrize("name", CONSTANTS)
def test_constant(plain, name):
    holds = getattr(Scenes(plain), name.lower())
    constants = importlib.import_module("lineament.kernels.optimal.constants")
    value, of = getattr(constants, name), CONSTANTS[name]
    assert holds()
    for factor in (1.5, 1 / 1.5):
        with replaced(name, of(value, factor)):
            assert not holds(), factor
    assert holds()


@pytest.mark.parametrize("name", ["evidence", "max_missing"])
def test_default(plain, name):
    assert getattr(Scenes(plain), name)()
    value = getattr(plain.Extractor("optimal").method, name)
    for factor in (1.5, 1 / 1.5):
        other = type(value)(round(value * factor, 6))
        assert not getattr(Scenes(plain, **{name: other}), name)(), factor
