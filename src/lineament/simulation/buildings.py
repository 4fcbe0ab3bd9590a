"""Storeys of offices: identical rooms, long corridors, loops; furniture and people that move.

>>> storey = office(3)
>>> storey
Building(60 m x 40 m, 70 rooms, 655 walls, a way of 417 m)
>>> storey.refurnished(4).plan.segments.tolist() == storey.plan.segments.tolist()
True
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np

from ..scan import Array, LaserScan, Pose
from .drive import course, twists_of
from .layouts import (
    DOOR,
    RECESS,
    THICK,
    THIN,
    Box,
    Room,
    box_of,
    corridors_of,
    narrowed,
    pilasters_of,
    rows_of,
    walls_of,
    way_along,
)
from .placing import clearance, is_free
from .sensor import Sensor
from .wheels import Wheels
from .worlds import World, closed, rectangle

#: Half the width of the lane behind a door that stays clear of furniture [m].
_LANE = 0.6
#: Width and depth of a storey, at most [m]: rooms and rays grow with its area.
_WIDEST = 300.0
#: A sensor is put no nearer to a surface than this [m].
_CLEAR = 0.3
#: Speed of people [m/s], the radius of a leg, and how far a leg is from the middle [m].
_WALK, _LEG, _STRIDE = 1.1, 0.06, 0.12


@dataclass(frozen=True, eq=False, repr=False)
class Building:
    """A storey with its furniture, and a way through it.

    Attributes
    ----------
    plan : World
        The walls alone, the free space to the left of each from its first end to its second. Each
        corner is the end of exactly two walls.
    world : World
        The walls, then the furniture.
    rooms : tuple of Room
        Those that can be entered.
    corridors : ndarray, shape (C, 4)
        Free rectangles ``x_min y_min x_max y_max`` [m].
    waypoints : ndarray, shape (W, 2)
        Of a way along every corridor and into some rooms, back to where it began [m].
    size : (width, depth)
        Outer size [m].
    solids : ndarray, shape (P, 4)
        Pilasters and recesses that are taken from the corridors, and doors that are closed.
    """

    plan: World
    world: World
    rooms: tuple[Room, ...]
    corridors: Array
    waypoints: Array
    size: tuple[float, float]
    solids: Array

    def __repr__(self) -> str:
        wide, deep = self.size
        way = np.hypot(*np.diff(self.waypoints, axis=0).T).sum()
        return (
            f"Building({wide:g} m x {deep:g} m, {len(self.rooms)} rooms, "
            f"{len(self.plan.segments)} walls, a way of {way:.0f} m)"
        )

    def refurnished(self, seed: int, amount: float = 1.0) -> Self:
        """Return the same plan with other furniture; 0 for `amount` leaves the rooms empty."""
        rng = np.random.default_rng([seed, 7])
        boxes, columns = [], []
        for room in self.rooms:
            found = _furniture(room, rng, amount)
            boxes += found[0]
            columns += found[1]
        furniture = World.of_polygons(map(closed, boxes), columns)
        walls = np.vstack((self.plan.segments, furniture.segments))
        return replace(self, world=World(walls, furniture.circles))

    def moved(self, seed: int, share: float = 0.3, by: float = 0.3) -> Self:
        """Return another plan, in which this share of the rooms has one wall moved inwards [m].

        There is no furniture in it: `refurnished` puts it there.
        """
        rng = np.random.default_rng([seed, 8])
        rooms = []
        for room in self.rooms:
            chance, side = rng.random(), int(rng.integers(3))
            rooms.append(narrowed(room, side, by) if chance < share else room)
        plan = World(walls_of(rooms, self.corridors, self.solids))
        return replace(self, plan=plan, world=plan, rooms=tuple(rooms))

    def mirrored(self) -> World:
        """Return the plan mirrored in x: no motion makes it the plan again."""
        x1, y1, x2, y2 = self.plan.segments.T
        return World(np.column_stack((self.size[0] - x2, y2, self.size[0] - x1, y1)))

    def drive(
        self,
        sensor: Sensor,
        *,
        seed: int = 0,
        speed: float = 1.0,
        rate: float | None = None,
        wheels: Wheels | None = None,
        people: int = 0,
        moving: bool = False,
    ) -> tuple[Iterator[LaserScan], list[Pose]]:
        """Simulate the scans of a drive along the way, among people who walk about.

        `moving` is whether the sensor moves while it sweeps, as for `drive`.

        Returns the scans, whose poses are the odometry of the wheels, from the origin on (None
        without wheels), and the true poses in the world, kept apart.
        """
        stamps, poses, twists = course(
            self.waypoints, speed, 1.0, sensor.rate if rate is None else rate
        )
        truth: list[Pose] = [(x, y, theta) for x, y, theta in poses.tolist()]
        believed = [None] * len(truth) if wheels is None else wheels.odometry(truth, seed)

        def scans() -> Iterator[LaserScan]:
            along = zip(stamps.tolist(), truth, believed, twists_of(twists, moving), strict=True)
            for i, (stamp, pose, odometry, twist) in enumerate(along):
                world = self.with_people(seed, stamp, pose, people) if people else self.world
                rng = np.random.default_rng([seed, i])
                scan = sensor.scan(world, pose, rng, stamp, twist)
                yield scan.with_pose(odometry)

        return scans(), truth

    def free_pose(self, rng: np.random.Generator, in_room: bool | None = None) -> Pose:
        """Draw a pose in free space: anywhere, in a room, or in a corridor (False)."""
        in_rooms = np.array([(*room.low, *room.high) for room in self.rooms]).reshape(-1, 4)
        places = np.vstack((in_rooms, self.corridors))
        size = (places[:, 2] - places[:, 0]) * (places[:, 3] - places[:, 1])
        if in_room is not None:
            size[slice(len(in_rooms), None) if in_room else slice(len(in_rooms))] = 0.0
        while True:
            low_x, low_y, high_x, high_y = places[rng.choice(len(places), p=size / size.sum())]
            at = np.array([[rng.uniform(low_x, high_x), rng.uniform(low_y, high_y)]])
            theta = rng.uniform(-math.pi, math.pi)
            if clearance(self.world, at)[0] >= _CLEAR and is_free(self.world, at)[0]:
                return float(at[0, 0]), float(at[0, 1]), theta

    def with_people(self, seed: int, stamp: float, pose: Pose, number: int = 8) -> World:
        """Return the world at a time [s], with people who walk up and down the corridors.

        Each is two legs. Nobody comes nearer than 0.5 m to the sensor.
        """
        rng = np.random.default_rng([seed, 9])
        legs = []
        for _ in range(number):
            low_x, low_y, high_x, high_y = self.corridors[rng.integers(len(self.corridors))]
            start, speed, beside = (
                rng.random(),
                _WALK * rng.uniform(0.6, 1.3),
                rng.uniform(0.3, 0.7),
            )
            along = max(high_x - low_x, high_y - low_y) - 1.0
            gone = abs((start * 2 * along + speed * stamp) % (2 * along) - along) + 0.5
            swing = _STRIDE * math.sin(2 * math.pi * gone)
            level = high_x - low_x > high_y - low_y
            for side in (-1, 1):
                forth, across = gone + side * swing, beside + side * _STRIDE / 2
                x = low_x + (forth if level else beside * (high_x - low_x) + side * _STRIDE)
                y = low_y + (across * (high_y - low_y) if level else forth)
                if math.hypot(x - pose[0], y - pose[1]) > 0.5:
                    legs.append((x, y, _LEG))
        circles = np.vstack((self.world.circles, np.array(legs).reshape(-1, 3)))
        return World(self.world.segments, circles)


def office(
    seed: int,
    size: tuple[float, float] = (60.0, 40.0),
    *,
    identical: float = 0.5,
    furniture: float = 1.0,
    visits: float = 0.25,
) -> Building:
    """Make a storey of offices along corridors that form loops.

    Corridors run from end to end of the storey in x, others join them; rooms stand in rows along
    them. In an identical row, all rooms have the same size, their doors at the same place, and
    no corner cut off; in the others widths, doors and corners are drawn. Pilasters stand in some
    corridors, some doors are closed.

    Parameters
    ----------
    seed : int
        Of everything that is drawn.
    size : (width, depth)
        Outer size [m], 20 m x 16 m to 300 m x 300 m.
    identical : float
        Share of rows of identical rooms.
    furniture : float
        How much stands in the rooms: 1 is about four pieces a room.
    visits : float
        Share of the rooms that the way goes into.

    Raises
    ------
    ValueError
        If the storey is too small or too large.

    Examples
    --------
    >>> from lineament.simulation import SENSORS, drive
    >>> storey = office(1, (30, 20))
    >>> scan = next(drive(storey.world, storey.waypoints, SENSORS["utm30lx"]))
    >>> storey.plan.n_surfaces < storey.world.n_surfaces
    True
    """
    if not (20 <= size[0] <= _WIDEST and 16 <= size[1] <= _WIDEST):
        most = f"{_WIDEST:g} m x {_WIDEST:g} m"
        raise ValueError(f"size is {size}, expected 20 m x 16 m to {most}")
    rng = np.random.default_rng([seed, 6])
    level, upright = corridors_of(size, rng)
    rooms: list[Room] = []
    solids: list[Box] = []
    for low, high, up, spans in rows_of(size, level, upright):
        same = rng.random() < identical
        width, at, beside = rng.uniform(3.0, 6.0), rng.uniform(0.25, 0.75), rng.uniform(0.5, 0.9)
        for start, end in spans:
            count = max(1, round((end - start) / width))
            widths = np.full(count, 1.0) if same else rng.uniform(0.6, 1.6, count)
            edges = start + np.concatenate(([0.0], np.cumsum(widths / widths.sum()))) * (
                end - start
            )
            for left, right in pairwise(edges.tolist()):
                left, right = left + THIN / 2, right - THIN / 2
                share = at if same else rng.uniform(0.2, 0.8)
                door = left + 0.75 + share * max(right - left - 1.5, 0.0)
                cut = 0.0 if same or rng.random() > 0.3 else rng.uniform(0.5, 1.2)
                if right - left > 1.8 and (same or rng.random() < beside):
                    rooms.append(Room((left, low), (right, high), door, up, cut))
                elif right - left > 1.8:
                    front = high + THICK if up else low - THICK
                    back = front - RECESS if up else front + RECESS
                    solids.append(box_of((door - DOOR / 2, front), (door + DOOR / 2, back)))
    corridors = np.vstack((level, upright))
    taken = np.array([*solids, *pilasters_of(level, rooms, solids, upright, rng)]).reshape(-1, 4)
    plan = World(walls_of(rooms, corridors, taken))
    way = way_along(level, upright, rooms, visits, rng)
    bare = Building(plan, plan, tuple(rooms), corridors, way, size, taken)
    return bare.refurnished(seed, furniture)


def _furniture(
    room: Room, rng: np.random.Generator, amount: float
) -> tuple[list[Array], list[tuple[float, float, float]]]:
    """Boxes (4, 2) and columns that leave the lane behind the door, and gaps, free."""
    boxes: list[Array] = []
    columns: list[tuple[float, float, float]] = []
    taken: list[tuple[float, float, float]] = []
    low, high = np.array(room.low), np.array(room.high)
    for _ in range(rng.poisson(16.0 * amount)):
        wide, deep, radius = rng.uniform(0.4, 1.8), rng.uniform(0.35, 0.9), rng.uniform(0.1, 0.3)
        at, askew = rng.uniform(low, high), rng.normal(0, 0.3)
        is_round, is_upright, kind = rng.random() < 0.2, rng.random() < 0.5, rng.random()
        half = np.array((deep, wide) if is_upright else (wide, deep)) / 2
        half = np.array((radius, radius)) if is_round else half
        if kind < 0.5 and not is_round:  # against a wall at the side
            at[0] = low[0] + half[0] + 0.05 if kind < 0.25 else high[0] - half[0] - 0.05
        turn = askew if kind > 0.7 else 0.0
        half = half + abs(math.sin(turn)) * half[::-1]
        reach, clear = float(np.hypot(*half)), half + 0.04 + room.cut
        if (at - clear < low).any() or (at + clear > high).any():
            continue
        if abs(at[0] - room.door) < _LANE + half[0]:
            continue
        if any(math.hypot(at[0] - x, at[1] - y) < reach + r + 0.1 for x, y, r in taken):
            continue
        taken.append((float(at[0]), float(at[1]), reach))
        if is_round:
            columns.append((float(at[0]), float(at[1]), radius))
        else:
            boxes.append(rectangle(at, wide, deep, turn + (math.pi / 2 if is_upright else 0.0)))
    return boxes, columns
