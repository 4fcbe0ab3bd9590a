"""Shapes that a robot docks to: where they are, how sure that is, and that nothing else is one."""

import math

import ezdxf
import numpy as np
import pytest

import lineament as ln
from lineament.docking import Shape, ShapeDock, find_shape
from lineament.errors import LineamentError
from lineament.live import LiveConfig, Pipeline
from lineament.scan.poses import compose, inverse, relative
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
    assert compose(here, inverse(here)) == (0.0, 0.0, 0.0)
