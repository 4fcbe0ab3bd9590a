"""Shapes that a robot docks to: where they are, how sure that is, and that nothing else is one."""

import importlib.util
import math
from pathlib import Path

import ezdxf
import numpy as np
import pytest

import lineament as ln
from lineament.bounds import line_bound
from lineament.docking import Shape, ShapeDock, find_shape
from lineament.docking.fitting import _bracket, beams_of, fit
from lineament.errors import LineamentError
from lineament.live import LiveConfig, Pipeline
from lineament.scan.poses import compose, relative
from lineament.simulation import SENSORS, World, drive

V = [[(-0.3, 0.5), (0.0, 0.0), (-0.3, -0.5)]]
RECESS = [[(0, -0.8), (0, -0.4), (0.3, -0.4), (0.3, 0.4), (0, 0.4), (0, 0.8)]]
PALLET = [[(0.1, y), (0, y), (0, y + 0.1), (0.1, y + 0.1)] for y in (-0.6, -0.05, 0.5)]
FRONTS = [[(0, y), (0, y + 0.1)] for y in (-0.6, -0.05, 0.5)]
SHAPES = {"V": V, "recess": RECESS, "pallet": PALLET, "fronts of feet": FRONTS}
WALLS = [(5.0, -4.0, 5.0, 4.0), (-3.0, -4.0, 5.0, -4.0), (-3.0, 4.0, 5.0, 4.0)]


def seen(shape: Shape, pose, rng, *others, sensor: str = "utm30lx") -> ln.Features:
    world = World([*shape.placed(pose).reshape(-1, 4), *WALLS, *others])
    return ln.extract(SENSORS[sensor].scan(world, (0.0, 0.0, 0.0), rng))


def drawn(rng) -> tuple[float, float, float]:
    """Return a pose 2 m away, that faces the scanner to 20°."""
    bearing = rng.uniform(-0.3, 0.3)
    return 2 * math.cos(bearing), 2 * math.sin(bearing), bearing + rng.uniform(-0.35, 0.35)


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_at_two_metres_and_their_covariance(name):
    shape, rng = Shape(SHAPES[name]), np.random.default_rng(3)
    errors, squares, missed = [], [], 0
    for _ in range(15):
        true = drawn(rng)
        guess = compose(true, tuple(rng.uniform(-1, 1, 3) * (0.3, 0.3, 0.4)))
        found = find_shape(seen(shape, true, rng), shape, guess)
        if found is None:
            missed += 1
            continue
        error = np.subtract(found.pose, true)
        error[2] = math.remainder(error[2], 2 * math.pi)
        errors.append(error)
        squares.append(error @ np.linalg.solve(found.covariance, error) / 3)
        assert found.seen > 0.8
    assert missed <= 4
    assert np.sqrt(np.square(np.array(errors)[:, :2]).sum(axis=1).mean()) < 0.005
    assert np.degrees(np.sqrt(np.square(np.array(errors)[:, 2]).mean())) < 0.4
    assert 0.3 < np.mean(squares) < 2.5


# A wall at x = 2 m, up to y = 0.5 m, at a bearing of 0.245; beams each 0.01, and 5 m behind it.
BEFORE = [2 / math.cos(0.01 * k) for k in range(25)]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("last", "behind", "expected"),
    [
        (25, [5.0, 5.0], (0.24, 0.25)),  # the end is between two beams
        (25, [3.5, 5.0], (0.245, 0.255)),  # the first behind is split
        (24, [2.5, 5.0], (0.235, 0.245)),  # the last on the wall is split
        (25, [4.8, 5.0], (0.24, 0.25)),  # what is behind is not square to the beams
        (25, [3.5, math.inf], (0.24, 0.25)),  # nobody knows what is behind
        (25, [math.inf, 5.0], (0.24, 0.25)),
        (25, [2.11, 2.11], None),  # too near for an end
    ],
)
def test_an_end_is_between_two_beams_or_at_the_one_that_it_splits(side, last, behind, expected):
    ranges = np.array([*BEFORE[:last], *behind, *[5.0] * 3])
    scan = ln.LaserScan(ranges, angles=0.01 * np.arange(len(ranges)))
    if side < 0:
        scan = ln.LaserScan(ranges[::-1], angles=-scan.angles[::-1])
    end, other, normal = np.array([(2.0, side * 0.5), (2.0, 0.0), (-1.0, 0.0)])
    found = _bracket(beams_of(scan, ln.RangeNoise(0.01)), end, other, normal)
    if expected is None:
        assert found is None
    else:
        # The side of the wall comes first.
        assert found == pytest.approx((side * expected[0], side * expected[1]), abs=1e-12)


@pytest.mark.parametrize(("ranges", "through"), [((3.5, 5.0), 0), ((4.8, 5.0), 1), ((5.0, 5.0), 1)])
def test_a_beam_that_an_outline_splits_does_not_pass_through_it(ranges, through):
    bearings = np.radians(np.arange(-30, 31))
    shape = Shape([[(0.3, -0.4), (0.0, -0.4), (0.0, 0.4), (0.3, 0.4)]])  # its corners show
    expected = np.where(np.abs(np.tan(bearings)) <= 0.2, 2 / np.cos(bearings), 5.0)
    edge = np.flatnonzero(expected < 4)[-1]
    expected[edge : edge + 2] = ranges
    scan = ln.LaserScan(expected, angles=bearings)
    found = fit(beams_of(scan, ln.RangeNoise(0.01)), shape, (2.0, 0.0, 0.0))
    assert (found.reached, found.through, found.short) == (22, through, 0)


@pytest.mark.parametrize(("size", "growth"), [(0.5, 1.0), (1.05, 1.0), (1.5, 2.25), (1.8, 3.24)])
def test_a_covariance_grows_by_what_is_beyond_chance(size, growth):
    shape, pose = Shape(RECESS), (2.0, 0.0, 0.0)
    ideal, _ = SENSORS["utm30lx"].ideal(World(shape.placed(pose).reshape(-1, 4)), (0.0, 0.0, 0.0))
    signs = np.resize((1.0, -1.0, -1.0, 1.0), len(ideal))
    scan = ln.LaserScan(ideal + size * 0.01 * signs, angles=SENSORS["utm30lx"].angles)
    features = ln.extract(scan, noise=0.01)
    found = find_shape(features, shape, pose, (0.05, 0.05, 0.1))
    of_noise = fit(beams_of(scan, ln.RangeNoise(0.01)), shape, found.pose).information
    assert np.linalg.det(found.covariance @ of_noise) ** (1 / 3) == pytest.approx(growth, rel=0.05)


def test_the_best_pose_is_not_one_beside_it():
    """Few beams meet a pallet: with this draw all first fits stop 7 of their deviations off."""
    shape, rng = Shape(PALLET), np.random.default_rng(199)
    true = drawn(rng)
    features = seen(shape, true, rng, sensor="lms361")
    found = find_shape(
        features, shape, compose(true, tuple(rng.uniform(-1, 1, 3) * (0.3, 0.3, 0.4)))
    )
    off = np.subtract(found.pose, true)
    assert off @ np.linalg.solve(found.covariance, off) / 3 < 2.0


@pytest.mark.parametrize("guess", [(2.075, 0.175, 0.1), (2.0, 0.175, 0.1), (2.05, 0.03, 0.1)])
def test_narrow_feet_are_found_from_between_two_starts(guess):
    shape, pose = Shape(FRONTS), (2.0, 0.1, 0.1)
    for seed in range(4):
        features = seen(shape, pose, np.random.default_rng(seed), sensor="lms361")
        assert find_shape(features, shape, guess).pose == pytest.approx(pose, abs=0.02)


def test_what_is_not_there_is_not_found():
    shape, rng = Shape(RECESS), np.random.default_rng(0)
    assert find_shape(seen(Shape(V), (2.0, 0.0, 0.0), rng), shape, (2.0, 0.0, 0.0)) is None
    # A bare wall, nothing at all, and half of it hidden behind a box.
    bare = ln.extract(SENSORS["utm30lx"].scan(World(WALLS), (0.0, 0.0, 0.0), rng))
    assert find_shape(bare, shape, (4.8, 0.0, 0.0)) is None
    nothing = ln.extract(ln.LaserScan(np.full(181, np.inf), -1.57, 0.01745))
    assert find_shape(nothing, shape, (2.0, 0.0, 0.0)) is None
    box = (1.0, -0.5, 1.0, 0.1)
    assert find_shape(seen(shape, (2.0, 0.0, 0.0), rng, box), shape, (2.0, 0.0, 0.0)) is None
    post = (1.0, -0.02, 1.0, 0.02)
    assert find_shape(seen(shape, (2.0, 0.0, 0.0), rng, post), shape, (2.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ([(math.nan, 0, 0)], r"guess is \(nan, 0, 0\), expected three finite numbers"),
        ([(2.0, 0.0)], r"guess is \(2.0, 0.0\), expected three finite numbers"),
        ([(2.0, 0, 0), (500, 500, 3)], r"reach is \(500, 500, 3\), expected 0 to 10 \[m, m, rad\]"),
        ([(2.0, 0, 0), (-1, 1, 1)], r"reach is \(-1, 1, 1\), expected 0 to 10"),
        ([(2.0, 0, 0), (1, 1)], r"reach is \(1, 1\), expected three finite numbers"),
    ],
)
def test_a_place_that_makes_no_sense_is_refused(given, problem):
    features = seen(Shape(V), (2.0, 0.0, 0.0), np.random.default_rng(0))
    with pytest.raises(ValueError, match=problem):
        find_shape(features, Shape(V), *given)
    with pytest.raises(ValueError, match=r"point is \(nan, 0, 0.0\), expected three finite"):
        ShapeDock(Shape(V), (math.nan, 0))


def test_two_of_a_kind_are_ambiguous():
    shape, rng = Shape(V), np.random.default_rng(1)
    other = shape.placed((2.0, 0.8, 0.0)).reshape(-1, 4)
    features = seen(shape, (2.0, -0.8, 0.0), rng, *other)
    assert find_shape(features, shape, (2.0, 0.0, 0.0), (0.5, 1.0, 0.5)) is None
    found = find_shape(features, shape, (2.0, -0.6, 0.0), (0.3, 0.3, 0.5))
    assert found.pose == pytest.approx((2.0, -0.8, 0.0), abs=0.02)


@pytest.mark.parametrize(
    ("polylines", "problem"),
    [
        ([], "has 0 pieces, expected 1 to 200"),
        ([[(0, 0), (0, 0)]], "has 0 pieces"),
        ([[(0, 0), (math.nan, 1)]], "finite vertices"),
        ([[(0, 0), (0, 0.05)]], r"is 0.05 m large, expected 0.1 to 10 m"),
        ([[(0, 0), (0, 900)]], r"is 900 m large"),
        ([[(0, k % 2) for k in range(300)]], "has 299 pieces"),
    ],
)
def test_what_is_no_shape(polylines, problem):
    with pytest.raises(ValueError, match=problem):
        Shape(polylines)


@pytest.fixture
def drawing(tmp_path):
    document = ezdxf.new()
    document.header["$INSUNITS"] = 4
    for line in RECESS:
        document.modelspace().add_lwpolyline([(1000 * x, 1000 * y) for x, y in line])
    document.saveas(tmp_path / "recess.dxf")
    return str(tmp_path / "recess.dxf")


def test_a_shape_that_is_drawn(drawing):
    shape = Shape.read(drawing)
    np.testing.assert_allclose(shape.ends, Shape(RECESS).ends, atol=1e-9)
    assert repr(shape) == "Shape(5 pieces, 0.30 m x 1.60 m, 2 ends)"
    with pytest.raises(LineamentError, match=r"recess.dxf: a shape is 1600 m large"):
        Shape.read(drawing, units="m")


def test_the_node_follows_a_shape(drawing):
    shape = Shape(RECESS)
    world = World([*shape.placed((3.0, 0.2, 0.1)).reshape(-1, 4), *WALLS])
    walk = [(-1.0, 0.0), (1.0, 0.1)]
    pipeline = Pipeline(LiveConfig(dock=(3.8, 0.0), dock_shape=drawing))
    docks = []
    for scan in drive(world, walk, SENSORS["lms361"], speed=0.8, rate=5):
        frame = pipeline("one", scan)
        docks.append(frame.dock)
    true = relative(scan.pose, (3.0, 0.2, 0.1))
    assert frame.dock.pose == pytest.approx(true, abs=0.02)
    assert sum(dock is not None for dock in docks) >= len(docks) - 2


def test_a_shape_is_looked_for_anew_where_it_was_said_to_be():
    shape, rng = Shape(RECESS), np.random.default_rng(2)
    dock, here = ShapeDock(shape, (2.2, 0.1)), (0.0, 0.0, 0.0)
    first, second = (2.0, 0.0, 0.0), (2.2, 0.3, 0.2)
    assert dock(seen(shape, first, rng), None, here)
    results = [dock(seen(shape, second, rng), None, here) for _ in range(12)]
    assert results[0] is None or results[0].pose == pytest.approx(second, abs=0.02)
    assert results[-1].pose == pytest.approx(second, abs=0.02)


def test_the_bounds_of_the_benchmark_are_those_of_a_wall_and_its_ends():
    path = Path(__file__).parents[1] / "benchmarks" / "docking.py"
    spec = importlib.util.spec_from_file_location("benchmark_docking", path)
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    sensor = SENSORS["utm30lx"]
    by_range, with_ends = benchmark.bounds(Shape([[(0, -0.4), (0, 0.4)]]), (2.0, 0.0, 0.0), sensor)
    beams = sensor.angles[np.abs(np.tan(sensor.angles)) < 0.2]
    offset, turn = np.diag(line_bound(beams, (2.0, 0.0), math.pi / 2, sensor.noise).covariance)
    assert by_range == pytest.approx((offset, 1e9, turn), rel=1e-4)
    # The bearing of (2, ±0.4) changes by ∓0.4/ρ² with x, 2/ρ² with y and 0.4²/ρ² with the turn.
    square, weight = 2**2 + 0.4**2, 12 / sensor.angle_increment**2
    x = 1 / (1 / offset + 2 * weight * (0.4 / square) ** 2)
    y = 1 / (2 * weight * (2 / square) ** 2) + (0.4**2 / 2) ** 2 * turn
    assert with_ends == pytest.approx((x, y, turn), rel=1e-4)
