"""The tables that kernels of maps take, and the cells by which walls near a place are found.

A wall is a row of `WALL_COLUMNS` numbers, a local wall one of `LOCAL_COLUMNS`, a beam of
`BEAM_COLUMNS`. Cells are squares, `grid` is low x, low y and size [m], columns and rows of cells;
`begins` has where the list of the walls near each cell begins in `members`, and behind that, for
each cell again, that of the walls that cross it.
"""

import math

from .. import helper, kernel
from ..arrays import Floats1, Floats2, Ints1

#: start x, y; direction x, y; length; whether it is seen from its left alone; variance of its
#: offset at the middle, covariance of offset and angle, variance of the angle.
WALL_COLUMNS = 9
#: centroid x, y; direction x, y; length from the centroid back to the start and on to the end;
#: variance of offset, covariance, variance of angle.
LOCAL_COLUMNS = 9
#: origin x, y; direction x, y; range; variance of the range; weight; covariance xx, xy, yy of the
#: end by the pose.
BEAM_COLUMNS = 10
#: A wall crosses a cell that it misses by so much of its size: places are rounded.
_ROUNDED = 0.01


@kernel
def list_walls(
    walls: Floats2,
    grid: Floats1,
    margin: float,
    begins: Ints1,
    members: Ints1,
):
    """Count the walls of each cell in `begins`, or list them if `members` has room.

    Near are those within a margin. Call it with no members, make `begins` the running sum, and call
    it again.
    """
    low_x, low_y, cell = grid[0], grid[1], grid[2]
    columns, rows = int(grid[3]), int(grid[4])
    reach, half = cell * math.sqrt(0.5) + margin, (0.5 + _ROUNDED) * cell
    for k in range(len(walls)):
        px, py, ux, uy, length = walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3], walls[k, 4]
        qx, qy = px + length * ux, py + length * uy
        wide, high = 0.5 * abs(qx - px) + half, 0.5 * abs(qy - py) + half
        first = max(int((min(px, qx) - margin - low_x) / cell), 0)
        last = min(int((max(px, qx) + margin - low_x) / cell), columns - 1)
        lower = max(int((min(py, qy) - margin - low_y) / cell), 0)
        upper = min(int((max(py, qy) + margin - low_y) / cell), rows - 1)
        for i in range(first, last + 1):
            for j in range(lower, upper + 1):
                x = low_x + (i + 0.5) * cell - px
                y = low_y + (j + 0.5) * cell - py
                off = abs(ux * y - uy * x)
                if off > reach:
                    continue
                along = min(max(x * ux + y * uy, 0.0), length)
                if math.hypot(x - along * ux, y - along * uy) > reach:
                    continue
                at = i * rows + j
                if len(members):
                    members[begins[at]] = k
                begins[at] += 1
                if off > half * (abs(ux) + abs(uy)):
                    continue
                if abs(x - 0.5 * (qx - px)) > wide or abs(y - 0.5 * (qy - py)) > high:
                    continue
                at += columns * rows
                if len(members):
                    members[begins[at]] = k
                begins[at] += 1


@helper
def cell_of(grid, x, y):
    """Return the number of the cell at a place, -1 outside."""
    fi, fj = (x - grid[0]) / grid[2], (y - grid[1]) / grid[2]
    if not (fi >= 0.0 and fj >= 0.0 and fi < grid[3] and fj < grid[4]):
        return -1
    return int(fi) * int(grid[4]) + int(fj)
