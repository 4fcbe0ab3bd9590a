"""The walls of a plan as the kernels take them, listed by the cells that they lie in."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from ..kernels.mapping.layout import list_walls
from ..scan import Array
from ..walls import COLUMN, WALL, Records, rows_of, walls_of

#: Longer walls are in no building: the plan is in other units [m].
LONGEST = 2000.0
#: Farther from the origin, coordinates are too coarse to be believed [m].
FARTHEST = 1e8
#: How far the walls of a map are from where they are seen later [m]: real ones bow, and move.
MAPPED = 0.045
#: Size of the cells by which walls are found [m], how far around a wall they reach; most cells, and
#: most in the boxes around all walls.
_CELL, _AROUND, _MOST_CELLS, _MOST_LISTED = 0.75, 0.3, 4_000_000, 20_000_000
#: Walls of which a round column is made to meet beams.
_SIDES = 12


class Index(NamedTuple):
    """The walls as the kernels take them, and which of them lie near a place."""

    walls: Array
    grid: Array
    begins: NDArray[np.int64]
    members: NDArray[np.int64]


def checked_records(walls: Records, columns: Records) -> tuple[Records, Records]:
    """Return those walls and columns whose numbers are finite; an error if they are far away."""
    for name, given, dtype in (("walls", walls, WALL), ("columns", columns, COLUMN)):
        if getattr(given, "dtype", None) != dtype:
            raise TypeError(f"{name} are no records of {name}: LineMap.from_lines takes numbers")
    ends = np.concatenate((walls["start"], walls["end"]), axis=1)
    finite = np.isfinite(ends).all(axis=1)
    finite &= np.isfinite(walls["covariance"]).all(axis=(1, 2))
    whole = np.isfinite(columns["center"]).all(axis=1) & np.isfinite(columns["radius"])
    whole &= np.isfinite(columns["covariance"]).all(axis=(1, 2)) & (columns["radius"] > 0)
    places = np.concatenate((ends[finite].ravel(), columns["center"][whole].ravel()))
    if (farthest := abs(places).max(initial=0.0)) > FARTHEST:
        raise LineamentError(
            f"the plan is {farthest:.4g} m from its origin, expected a building: "
            "is it drawn in metres?"
        )
    return walls[finite], columns[whole]


def make_index(walls: Records, columns: Records, sigma: float) -> Index:
    """List the walls by cells, with round columns as short walls behind them."""
    every = np.concatenate((walls, walls_of(rings(columns), side=1)))
    table, ends = rows_of(every), np.stack((every["start"], every["end"]), axis=1)
    if sigma >= MAPPED:  # a pose is one beside the walls around it: what all are off counts not
        table[:, 6:9] *= np.minimum(1.0, sigma**2 / np.maximum(table[:, 6], 1e-18))[:, None]
    table[:, 6] += sigma**2
    along = ends[:, 1] - ends[:, 0]
    low, high = ends.min(axis=(0, 1)) - 1.0, ends.max(axis=(0, 1)) + 1.0
    boxes = float(np.prod(abs(along) + 2 * (_AROUND + _CELL), axis=1).sum())
    area = float(np.prod(high - low))
    cell = max(_CELL, math.sqrt(area / _MOST_CELLS), math.sqrt(boxes / _MOST_LISTED))
    counts = np.ceil((high - low) / cell)
    grid, begins = np.array([*low, cell, *counts]), np.zeros(2 * int(np.prod(counts)) + 1, np.int64)
    list_walls(table, grid, _AROUND, begins[1:], np.empty(0, np.int64))
    begins = np.cumsum(begins)
    members = np.empty(begins[-1], np.int64)
    list_walls(table, grid, _AROUND, begins[:-1].copy(), members)
    return Index(table, grid, begins, members)


def rings(columns: NDArray[np.void]) -> Array:
    """Return sides of round columns, which are seen from outside: from their left, (n, 2, 2)."""
    turns = np.linspace(0, 2 * math.pi, _SIDES + 1)
    ring = np.stack((np.cos(turns), np.sin(turns)), axis=1)[::-1]
    ring = columns["center"][:, None] + columns["radius"][:, None, None] * ring
    return np.stack((ring[:, :-1], ring[:, 1:]), axis=2).reshape(-1, 2, 2)
