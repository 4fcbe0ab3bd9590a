"""Random worlds by seed, with a scanner in them: what methods are compared on.

Shapes are those of buildings: rooms of 3-12 m, doors of 0.8-1 m, boxes with sides of 0.3-1.5 m,
columns with radii of 0.08-0.5 m. Walls meet only at their ends, obstacles keep 0.2 m from all
other surfaces, the scanner keeps 0.3 m.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..scan import Array, Pose
from .placing import Floor, clearance, is_free
from .worlds import World, closed, rectangle

Rng = np.random.Generator

#: Least turn of an outline at a vertex: a flatter one is no corner that could be placed [rad].
_LEAST_TURN = math.radians(20)


def scene(kind: str, seed: int) -> tuple[World, Pose]:
    """Make a random world and a pose of the scanner in it.

    Parameters
    ----------
    kind : str
        A name of `SCENES`: "room" (alcoves, pilasters, cut and skew corners), "star" (a star
        polygon seen from inside), "corridor" (recessed doors, side rooms that stand open), "hall"
        (boxes at any angle and round columns), "grazing" (thin walls and a long one, met at
        grazing incidence), "layers" (several levels of obstacles, one behind the other).
    seed : int
        Seed, not negative. The same kind and seed give the same world and pose.

    Returns
    -------
    world : World
        A closed outline with obstacles in it.
    pose : (x, y, theta)
        Pose of the scanner [m, m, rad], at least 0.3 m from every surface.

    Raises
    ------
    ValueError
        If there is no such kind, or the seed is negative.

    Examples
    --------
    >>> scene("hall", 3)[0]
    World(28 segments, 4 circles)
    """
    if kind not in SCENES:
        raise ValueError(f"kind is {kind!r}, expected one of {', '.join(SCENES)}")
    if seed < 0:
        raise ValueError(f"seed is {seed}, expected a number ≥ 0")
    floor = SCENES[kind](np.random.default_rng(seed))
    return floor.world, floor.pose


def _room(rng: Rng) -> Floor:
    """Make a room: four walls, often skew, with cut corners, alcoves and pilasters."""
    width, depth = rng.uniform(3, 12, 2)
    corners = rectangle((0, 0), width, depth)
    if rng.random() < 0.5:
        corners += 0.1 * min(width, depth) * rng.uniform(-1, 1, (4, 2))
    cuts = np.where(rng.random(4) < 0.3, rng.uniform(0.4, 1.0, 4), 0.0)
    vertices: list[Array] = []
    for i in range(4):
        start, end = corners[i], corners[(i + 1) % 4]
        vertices += _side_of_room(start, end, cuts[i], cuts[(i + 1) % 4], rng)
    return Floor(vertices, _anywhere(vertices, rng))


def _side_of_room(start: Array, end: Array, cut: float, next_cut: float, rng: Rng) -> list[Array]:
    """Vertices from one corner to the next, counter-clockwise."""
    length = math.dist(start, end)
    along = (end - start) / length
    outwards = np.array([along[1], -along[0]])
    vertices = [start + cut * along]
    # Far enough from the corners that pilasters on two sides do not meet.
    first, last = cut + 0.8, length - next_cut - 0.8
    if last - first >= 0.5 and rng.random() < 0.6:
        width = rng.uniform(0.5, min(2.5, last - first))
        left = rng.uniform(first, last - width)
        out = rng.uniform(0.15, 0.8) if rng.random() < 0.6 else -rng.uniform(0.1, 0.4)
        shift = out * outwards
        a, b = start + left * along, start + (left + width) * along
        vertices += [a, a + shift, b + shift, b]
    return [*vertices, end - next_cut * along] if next_cut > 0 else vertices


def _star(rng: Rng) -> Floor:
    """Make a star polygon around the scanner: the range of each vertex is random."""
    while True:
        n = int(rng.integers(5, 13))
        bearings = 2 * math.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
        ranges = rng.uniform(1.5, 6, n)
        vertices = np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings)))
        x, y = rng.uniform(-0.3, 0.3, 2).tolist()
        floor = Floor(vertices, (x, y, rng.uniform(-math.pi, math.pi)))
        sides = np.roll(vertices, -1, axis=0) - vertices
        directions = np.arctan2(sides[:, 1], sides[:, 0])
        turns = abs(np.angle(np.exp(1j * (np.roll(directions, -1) - directions))))
        if turns.min() >= _LEAST_TURN and clearance(floor.world, [(x, y)])[0] >= 0.3:
            return floor


def _corridor(rng: Rng) -> Floor:
    """Make a corridor with doors on both sides, some of them open."""
    length, width = rng.uniform(8, 20), rng.uniform(1.5, 2.5)
    south = [(x, -out) for x, out in _side_of_corridor(length, rng)]
    north = [(x, width + out) for x, out in _side_of_corridor(length, rng)]
    x, y = rng.uniform(0.6, length - 0.6), rng.uniform(0.45, width - 0.45)
    heading = math.pi * rng.integers(2) + rng.uniform(-0.7, 0.7)
    return Floor([*south, *reversed(north)], (float(x), float(y), float(heading)))


def _side_of_corridor(length: float, rng: Rng) -> list[tuple[float, float]]:
    """Vertices along the corridor and out of it: bays with a wall, a closed door or a room."""
    vertices, bay = [(0.0, 0.0)], 0.0
    while (bay_end := bay + rng.uniform(3.2, 4.5)) < length:
        door = rng.uniform(0.8, 1.0)
        left = rng.uniform(bay + 0.4, bay_end - door - 0.4)
        right, what = left + door, rng.integers(3)
        if what == 1:
            recess = rng.uniform(0.08, 0.2)
            vertices += [(left, 0), (left, recess), (right, recess), (right, 0)]
        elif what == 2:
            wall, back = rng.uniform(0.1, 0.2), rng.uniform(3.2, 5.0)
            a, b = bay + 0.1, bay_end - 0.1
            vertices += [(left, 0), (left, wall), (a, wall), (a, back)]
            vertices += [(b, back), (b, wall), (right, wall), (right, 0)]
        bay = bay_end
    return [*vertices, (length, 0.0)]


def _hall(rng: Rng) -> Floor:
    """Make a hall cluttered with boxes and round columns."""
    outline = rectangle((0, 0), *rng.uniform(6, 12, 2))
    floor = Floor(outline, _anywhere(outline, rng))
    reach = floor.world.segments[:, :2].max(axis=0)
    for _ in range(rng.integers(12, 30)):
        floor.put_box(rng.uniform(-reach, reach), *_box(rng), rng.uniform(0, math.pi))
    for _ in range(rng.integers(8, 20)):
        floor.put_column(rng.uniform(-reach, reach), rng.uniform(0.08, 0.5))
    return floor


def _grazing(rng: Rng) -> Floor:
    """Make a long room whose wall the scanner is close to, with thin walls that point at it."""
    length, depth = rng.uniform(9, 12), rng.uniform(4, 7)
    x, y = rng.uniform(0.6, 1.5), rng.uniform(0.35, 0.8)
    outline = rectangle((length / 2, depth / 2), length, depth)
    floor = Floor(outline, (x, y, rng.uniform(-0.1, 0.5)))
    for _ in range(12):
        distance, bearing = rng.uniform(1.2, 8), rng.uniform(0.0, 1.3)
        turn = rng.choice((-1, 1)) * math.radians(rng.uniform(3, 15))
        floor.put_box(
            _seen_from(floor.pose, distance, bearing),
            rng.uniform(0.8, 2.5), rng.uniform(0.03, 0.1), bearing + turn,
        )  # fmt: skip
    return floor


def _layers(rng: Rng) -> Floor:
    """Make several levels of obstacles, one behind the other, before a back wall."""
    width, depth = rng.uniform(8, 12, 2)
    pose = (0.5, depth / 2 + rng.uniform(-1, 1), rng.uniform(-0.2, 0.2))
    floor = Floor(rectangle((width / 2, depth / 2), width, depth), pose)
    for level in range(5):
        for _ in range(rng.integers(6, 11)):
            bearing = rng.uniform(-1.2, 1.2)
            center = _seen_from(pose, 1.2 + 1.5 * level + rng.uniform(-0.2, 0.2), bearing)
            if rng.random() < 0.3:
                floor.put_column(center, rng.uniform(0.08, 0.4))
            else:
                across = bearing + math.pi / 2 + rng.uniform(-0.9, 0.9)
                floor.put_box(center, *_box(rng), across)
    return floor


def _box(rng: Rng) -> tuple[float, float]:
    """Width and depth of a box, the larger first."""
    depth, width = np.sort(rng.uniform(0.3, 1.5, 2)).tolist()
    return width, depth


def _anywhere(outline: ArrayLike, rng: Rng) -> Pose:
    """Draw a pose within an outline, clear of it."""
    world = World.of_polygons([closed(outline)])
    ends = world.segments[:, :2]
    while True:
        x, y = rng.uniform(ends.min(axis=0), ends.max(axis=0)).tolist()
        if is_free(world, [(x, y)])[0] and clearance(world, [(x, y)])[0] >= 0.4:
            return x, y, rng.uniform(-math.pi, math.pi)


def _seen_from(pose: Pose, distance: float, bearing: float) -> tuple[float, float]:
    """Return the point at a distance from a pose, in a direction of the world."""
    return pose[0] + distance * math.cos(bearing), pose[1] + distance * math.sin(bearing)


#: How each kind of scene is made, by name.
SCENES: dict[str, Callable[[Rng], Floor]] = {
    "room": _room,
    "star": _star,
    "corridor": _corridor,
    "hall": _hall,
    "grazing": _grazing,
    "layers": _layers,
}
