"""The truth of simulated scans: cases worked by hand, and what must hold in every scene."""

import math

import numpy as np
import pytest
from handmade import assert_alike

from lineament.bounds import arc_bound, corner_bound, line_bound
from lineament.features import TABLES
from lineament.scan import RangeNoise
from lineament.simulation import SCENES, SENSORS, Sensor, World, scene, truth

NOISE = RangeNoise(sigma=0.01, bearing=0.001)
ORIGIN, TURNED = (0.0, 0.0, 0.0), (0.0, 0.0, math.pi / 4)
STEP, RIGHT = math.radians(1), math.pi / 2


def fan(half_width, step=STEP, **settings):
    """Make a scanner whose beams lie at ±step/2, ±3/2 step ...: none straight ahead."""
    n = 2 * round(math.radians(half_width) / step)
    return Sensor("fan", n, -(n - 1) * step / 2, step, noise=NOISE, **settings)


def ring(n=360, first=-math.pi, **settings):
    return Sensor("ring", n, first, 2 * math.pi / n, noise=NOISE, **settings)


def tan(degrees):
    return math.tan(math.radians(degrees))


def box(x1, y1, x2, y2):
    return [(x1, y1), (x2, y1), (x2, y2), (x1, y2), (x1, y1)]


def lines(*polygons, circles=()):
    return World.of_polygons(polygons, circles)


def counts(features):
    return tuple(len(getattr(features, name)) for name in TABLES)


def walls(features):
    """Ends of each segment, and its first and last beam."""
    table = features.segments
    beams = (table["first_beam"], table["last_beam"])
    return np.column_stack((table["start"], table["end"], *beams))


def corners(features):
    """Position, opening, whether it is convex, and both segments of each corner."""
    table = features.corners
    parts = (table[name] for name in ("position", "opening", "convex", "segments"))
    return np.column_stack(list(parts))


def breaks(features):
    return [(*b["beam"].tolist(), str(b["kind"]), int(b["occluder"])) for b in features.breakpoints]


def scan_ends(first, last):
    return [(-1, first, "scan_end", -1), (last, -1, "scan_end", -1)]


#: A pilaster 1.2 cm wide and 5 cm deep, whose front is met by the beam at 0.5°.
LOW, HIGH = (2 * math.tan(STEP / 2) + out for out in (-0.006, 0.006))
PILASTER = [(2, -1), (2, LOW), (1.95, LOW), (1.95, HIGH), (2, HIGH), (2, 1)]

#: Where the beam at 29.5° meets the line x + y = √8.
X = math.sqrt(8) / (1 + tan(29.5))
#: Where the beam at 24.5° meets the line x - y = √2.
Z = math.sqrt(2) / (1 - tan(24.5))

#: World, pose, sensor; walls, corners and breakpoints that are true.
CASES = {
    "nothing": (World([]), ORIGIN, fan(45), [], [], []),
    # atan(1/2) = 26.6°: 27 beams at 0.5°, 1.5°, ... on each side.
    "a wall that ends before the next beams": (
        lines([(2, 1), (2, -1)]), ORIGIN, fan(45), [(2, -1, 2, 1, 18, 71)], [], scan_ends(18, 71),
    ),
    "a wall beyond both ends of the scan": (
        lines([(2, 9), (2, -9)]), ORIGIN, fan(10),
        [(2, -2 * tan(9.5), 2, 2 * tan(9.5), 0, 19)], [], scan_ends(0, 19),
    ),
    "a concave corner between beams": (
        lines([(2, -2), (2, 2), (-2, 2)]), TURNED, fan(30),
        [(X, -X * tan(29.5), math.sqrt(8), 0, 0, 29), (math.sqrt(8), 0, X, X * tan(29.5), 30, 59)],
        [(math.sqrt(8), 0, RIGHT, False, 0, 1)], scan_ends(0, 59),
    ),
    "a convex corner": (
        lines(box(1, 1, 3, 3)), TURNED, fan(25),
        [(Z, -Z * tan(24.5), math.sqrt(2), 0, 0, 24), (math.sqrt(2), 0, Z, Z * tan(24.5), 25, 49)],
        [(math.sqrt(2), 0, RIGHT, True, 0, 1)], scan_ends(0, 49),
    ),
    # The side from (2, 0) towards the scanner is met at 0.5° and ends at 0.9°.
    "a corner with a side of one beam": (
        lines([(2, -1), (2, 0), (1.9, 0.03)]), ORIGIN, fan(10), [(2, -2 * tan(9.5), 2, 0, 0, 9)],
        [(2, 0, math.pi - math.atan2(0.1, 0.03), False, 0, -1)], scan_ends(0, 10),
    ),
    # Its corners are at 18.4°, 153.4°, 206.6° and 341.6°; the wall x = 3 is over the seam.
    "a wall over the seam is in one piece": (
        lines(box(-2, -1, 3, 1)), ORIGIN, ring(first=0.0),
        [(3, -1, 3, 1, 342, 18), (3, 1, -2, 1, 19, 153), (-2, 1, -2, -1, 154, 206),
         (-2, -1, 3, -1, 207, 341)],
        [(3, 1, RIGHT, False, 0, 1), (-2, 1, RIGHT, False, 1, 2), (-2, -1, RIGHT, False, 2, 3),
         (3, -1, RIGHT, False, 3, 0)], [],
    ),
    "a box whose other sides are hidden": (
        lines(box(2, -0.5, 3, 0.5)), ORIGIN, fan(40),
        [(2, -0.5, 2, 0.5, 26, 53)], [], scan_ends(26, 53),
    ),
    # Straight through (2, 0), where the front and the hidden side of the block are met; of a front
    # of two beams, they are the only neighbours.
    **{
        f"a beam through the end of a hidden wall, {width}, {order}": (
            lines([(2, 0), (2, width), (3, width), (3, 0.4 * width), (2, 0)][::order]), ORIGIN,
            Sensor("through", 81, -40 * STEP, STEP, noise=NOISE),
            [(2, min(width, 0), 2, max(width, 0), *beams)], [], ends,
        )
        for width, *beams, ends in (
            (1, 40, 66, scan_ends(40, 66)), (0.05, 40, 41, []), (-0.05, 39, 40, [])
        )
        for order in (1, -1)
    },
    # Beams lie between atan(0.01/3) = 0.19° and 0.57°: at 0.25°, 0.35°, 0.45° and 0.55°.
    "the end of a thin wall": (
        World([[5, -9, 5, 9], [1, 0.01, 3, 0.01]]), ORIGIN, fan(30, step=math.radians(0.1)),
        [(5, -5 * tan(29.95), 5, 5 * tan(0.2), 0, 301), (3, 0.01, 1, 0.01, 302, 305),
         (5, 5 * tan(0.6), 5, 5 * tan(29.95), 306, 599)],
        [], [(301, 302, "jump", 302), (305, 306, "jump", 305), *scan_ends(0, 599)],
    ),
    "a wall of one beam is not listed": (
        lines(PILASTER), ORIGIN, fan(15),
        [(2, -2 * tan(14.5), 2, LOW, 0, 14), (2, HIGH, 2, 2 * tan(14.5), 16, 29)],
        [], [(14, 16, "jump", 14), *scan_ends(0, 29)],
    ),
    "walls end to end are one": (
        World([[2, -3, 2, -1], [2, 1, 2, -1.0005], [2, 3, 2, 1]]), ORIGIN, fan(40),
        [(2, -2 * tan(39.5), 2, 2 * tan(39.5), 0, 79)], [], scan_ends(0, 79),
    ),
    # The doorway is 1 m wide, the wall behind it met from 26.5° to the right to the middle.
    "a doorway parts them": (
        World([[2, -3, 2, -1], [2, 0, 2, 3], [4, -9, 4, 9]]), ORIGIN, fan(40),
        [(2, -2 * tan(39.5), 2, -1, 0, 12), (4, -4 * tan(27.0), 4, 0, 13, 39),
         (2, 0, 2, 2 * tan(39.5), 40, 79)],
        [], [(12, 13, "jump", 12), (39, 40, "jump", 40), *scan_ends(0, 79)],
    ),
    # Two walls in line, and one that stands on the vertex between them.
    "a wall against the middle of another": (
        World([[3, -2, 3, 0], [3, 0, 3, 2], [3, 0, 2, 0.2]]), ORIGIN, fan(30, math.radians(0.25)),
        [(3, -3 * tan(29.875), 3, 0, 0, 119), (3, 0, 2, 0.2, 120, 142),
         (3, 3 * tan(5.75), 3, 3 * tan(29.875), 143, 239)],
        [(3, 0, RIGHT + math.atan(0.2), False, 0, 1)],
        [(142, 143, "jump", 142), *scan_ends(0, 239)],
    ),
    # acos(2/2.2) = 24.6°: the last beam is at 24.5°, the next one at 25.5°.
    "range limits end a wall half-way to the next beam": (
        lines([(2, -9), (2, 9)]), ORIGIN, fan(60, range_max=2.2),
        [(2, -2 * tan(25), 2, 2 * tan(25), 35, 84)], [], scan_ends(35, 84),
    ),
    # Six beams at most from one side to the other are a jump; so many are missing on either side.
    **{
        f"a hole of {right + left} beams": (
            World([[2, -1, 2, -2 * tan(right - 0.25)], [2, 2 * tan(left - 0.25), 2, 1]]), ORIGIN,
            fan(30),
            [(2, -1, 2, -2 * tan(right - 0.25), 3, 29 - right),
             (2, 2 * tan(left - 0.25), 2, 1, 30 + left, 56)],
            [], [(29 - right, 30 + left, kind, near),
                 *scan_ends(3, 56)],
        )
        for right, left, kind, near in ((2, 2, "jump", 27), (3, 2, "jump", 32), (3, 3, "gap", -1))
    },
    # One cluster of a full turn that does not close, as the methods have it.
    "an open ring has a break between its ends": (
        lines([(2, -1), (2, 1)]), ORIGIN, ring(first=0.0),
        [(2, -1, 2, 1, 334, 26)], [], [(26, 334, "gap", -1)],
    ),
    # A corner at -180° ± half a step: the seam is at it.
    "a seam at a corner": (
        lines([(-2, 0), (0, -2), (2, 0), (0, 2), (-2, 0)]), ORIGIN, ring(first=-math.pi + STEP / 2),
        [(-2, 0, 0, -2, 0, 89), (0, -2, 2, 0, 90, 179), (2, 0, 0, 2, 180, 269),
         (0, 2, -2, 0, 270, 359)],
        [(0, -2, RIGHT, False, 0, 1), (2, 0, RIGHT, False, 1, 2), (0, 2, RIGHT, False, 2, 3),
         (-2, 0, RIGHT, False, 3, 0)], [],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_by_hand(name):
    world, pose, sensor, true_walls, true_corners, true_breaks = CASES[name]
    features = truth(world, pose, sensor)
    np.testing.assert_allclose(walls(features), np.reshape(true_walls, (-1, 6)), atol=1e-8)
    np.testing.assert_allclose(corners(features), np.reshape(true_corners, (-1, 6)), atol=1e-8)
    assert breaks(features) == true_breaks
    assert features.noise == sensor.noise
    assert not any(getattr(features, name).flags.writeable for name in TABLES)
    assert (features.corners["kind"] == "corner").all()
    assert (features.corners["quality"] == 1).all()
    assert len(features.arcs) == 0
    bounds = []
    for segment in features.segments:
        bearings = sensor.angles[beams_of(segment, sensor.n_beams)]
        bounds.append(line_bound(bearings, segment["start"], segment["angle"], sensor.noise))
        np.testing.assert_allclose(segment["covariance"], bounds[-1].covariance, rtol=1e-6)
        np.testing.assert_allclose(segment["centroid"], bounds[-1].centroid, atol=1e-9)
        assert (segment["rms"], segment["misfit"]) == (0, 0)
    for corner in features.corners:
        sides = [bounds[k] for k in corner["segments"] if k >= 0]
        expected = corner_bound(*sides) if len(sides) == 2 else np.full((2, 2), np.nan)
        np.testing.assert_allclose(corner["covariance"], expected, rtol=1e-6, atol=1e-12)


def test_beams_through_the_vertices_of_a_room():
    features = truth(lines(box(-2, -2, 2, 2)), ORIGIN, ring(16))  # at -180°, -157.5°, -135°
    assert counts(features) == (4, 4, 0, 0, 0)
    assert features.segments["n_points"].sum() == 16
    np.testing.assert_allclose(features.corners["opening"], RIGHT)


@pytest.mark.parametrize(("short", "n_corners"), [(0.0, 1), (0.0008, 1), (0.002, 0)])
def test_a_wall_that_ends_within_a_millimetre_of_another_meets_it(short, n_corners):
    features = truth(World([[3, -2, 3, 2], [3 - short, 0, 2, 0.2]]), ORIGIN, fan(30, STEP / 16))
    assert len(features.corners) == n_corners
    assert (np.hypot(*(features.corners["position"] - (3, 0)).T) < 0.001).all()


def test_a_column_in_front_of_a_wall():
    sensor = fan(30)
    features = truth(World([[4, -9, 4, 9]], [[2, 0, 0.3]]), ORIGIN, sensor)
    # The column covers asin(0.15) = 8.63°: 9 beams on each side; the next are at 8.5° and 9.5°.
    (arc,) = features.arcs
    assert (arc["first_beam"], arc["last_beam"], arc["n_points"]) == (21, 38, 18)
    np.testing.assert_allclose((*arc["center"], arc["radius"]), (2, 0, 0.3), atol=1e-12)
    expected = arc_bound(sensor.angles[21:39], (2, 0), 0.3, NOISE)
    np.testing.assert_allclose(arc["covariance"], expected)
    # The wall is seen half-way to the beams that the column took.
    edges = [features.segments["end"][0, 1], features.segments["start"][1, 1]]
    np.testing.assert_allclose(edges, (-4 * tan(9), 4 * tan(9)))
    assert features.segments["cluster"].tolist() == [0, 2]
    assert breaks(features) == [(20, 21, "jump", 21), (38, 39, "jump", 38), *scan_ends(0, 59)]
    assert math.dist(features.breakpoints["position"][0], (2, 0)) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("circle", "sensor", "n_points", "in_cluster"),
    [
        ((3, 0, 0.04), fan(10), 2, 0),
        ((3, 3 * tan(0.5), 0.07), fan(10), 3, 3),
        ((0.3, 0.2, 2), ring(90), 90, 90),
    ],
)
def test_a_column_of_two_beams_has_no_bound_and_no_cluster(circle, sensor, n_points, in_cluster):
    features = truth(World([], [circle]), ORIGIN, sensor)
    assert counts(features)[:4] == (0, 0, 0, 1)
    assert features.arcs["n_points"].tolist() == [n_points]
    assert np.isfinite(features.arcs["covariance"]).all() == (n_points > 2)
    assert (features.clusters == 0).sum() == in_cluster


# In every scene


EVERY_SCENE = [
    pytest.param(kind, seed, SENSORS[name], id=f"{kind}-{name}")
    for kind in SCENES
    for seed, name in enumerate(("paper", "utm30lx", "ld19", "lms181", "rplidar"))
]


def beams_of(record, n):
    return (record["first_beam"] + np.arange(record["n_points"])) % n


@pytest.mark.parametrize(("kind", "seed", "sensor"), EVERY_SCENE)
def test_what_holds_in_every_scene(kind, seed, sensor):
    world, pose = scene(kind, seed)
    features = truth(world, pose, sensor)
    ranges, _ = sensor.ideal(world, pose)
    n, bearings = sensor.n_beams, sensor.angles
    valid = (ranges >= sensor.range_min) & (ranges < sensor.range_max)
    points = np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings)))
    used = np.zeros(n, dtype=int)
    for segment in features.segments:
        beams = beams_of(segment, n)
        assert beams[-1] == segment["last_beam"]
        used[beams] += 1
        length = math.dist(segment["start"], segment["end"])
        u = (segment["end"] - segment["start"]) / length
        assert segment["angle"] == pytest.approx(math.atan2(u[1], u[0]), abs=1e-9)
        along = (points[beams] - segment["start"]) @ u
        across = (points[beams] - segment["start"]) @ (-u[1], u[0])
        np.testing.assert_allclose(across, 0, atol=1e-9)
        assert (np.diff(along, prepend=-1e-9, append=length + 1e-9) >= 0).all()
        assert (features.clusters[beams] == segment["cluster"]).all()
        assert (np.linalg.eigvalsh(segment["covariance"]) > 0).all()
    for arc in features.arcs:
        beams = beams_of(arc, n)
        used[beams] += 1
        off = np.hypot(*(points[beams] - arc["center"]).T) - arc["radius"]
        np.testing.assert_allclose(off, 0, atol=1e-9)
    assert used.max() == 1
    assert not used[~valid].any()
    assert used[valid].mean() > 0.95
    vertices = world.segments.reshape(-1, 2)
    for corner, in_world in zip(features.corners, features.transform(*pose).corners, strict=True):
        assert np.hypot(*(vertices - in_world["position"]).T).min() < 1e-9
        if -1 not in corner["segments"]:
            assert (np.linalg.eigvalsh(corner["covariance"]) > 0).all()
        x, y = corner["position"]
        turn = math.remainder(math.atan2(y, x) - bearings[corner["beam"]], 2 * math.pi)
        assert abs(turn) <= sensor.angle_increment / 2 + 1e-9
    check_breakpoints(features, ranges)


def check_breakpoints(features, ranges):
    label = features.clusters
    assert sorted(set(label.tolist()) - {-1}) == list(range(label.max(initial=-1) + 1))
    for b in features.breakpoints:
        before, after = b["beam"]
        if b["kind"] == "scan_end":
            assert min(before, after) == -1
            continue
        between = np.arange(before + 1, after if after > before else after + len(label))
        assert (label[between % len(label)] == -1).all()
        near = before if ranges[before] <= ranges[after] else after
        assert b["occluder"] == (near if b["kind"] == "jump" else -1)
        assert math.hypot(*b["position"]) == pytest.approx(ranges[near])


@pytest.mark.parametrize("kind", SCENES)
def test_the_order_direction_and_number_of_walls_and_the_frame_do_not_matter(kind):
    world, (x, y, theta) = scene(kind, 1)
    rng, sensor, ends = np.random.default_rng(0), SENSORS["ld19"], world.segments
    features = truth(world, (x, y, theta), sensor)
    share = rng.uniform(0.2, 0.8, (len(ends), 1))
    middle = (1 - share) * ends[:, :2] + share * ends[:, 2:]
    halves = np.vstack((np.hstack((middle, ends[:, :2])), np.hstack((middle, ends[:, 2:]))))
    for changed in (ends[::-1], ends[:, [2, 3, 0, 1]], rng.permutation(halves)):
        assert_alike(features, truth(World(changed, world.circles), (x, y, theta), sensor))
    turn, shift = 1.1, np.array([3.0, -7.0])
    c, s = math.cos(turn), math.sin(turn)
    rotation, circles = np.array([[c, -s], [s, c]]), world.circles.copy()
    moved = (ends.reshape(-1, 2) @ rotation.T + shift).reshape(-1, 4)
    circles[:, :2] = circles[:, :2] @ rotation.T + shift
    pose = (*(rotation @ (x, y) + shift).tolist(), theta + turn)
    assert_alike(features, truth(World(moved, circles), pose, sensor))
