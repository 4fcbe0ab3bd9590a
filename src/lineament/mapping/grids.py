"""Occupancy grids: what map_server of ROS and nav2 keeps as a YAML file and an image."""

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from ..files import naming_errors, written_beside
from ..limits import Limits
from ..scan import Array, LaserScan, Pose
from ..scan.fields import checked_place
from .grid_files import (
    FREE,
    OCCUPIED,
    RAW,
    SCALE,
    UNKNOWN,
    check_resolution,
    read_about,
    read_shades,
    values_of,
)

#: Endings of the file that names the image of a grid.
GRID_ENDINGS = (".yaml", ".yml")
#: Shades that map_saver writes, and its thresholds.
_SHADES, _OCCUPIED, _FREE = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}, 0.65, 0.196
#: Free cells around what is drawn; a line is drawn so far on its solid side [cells].
_MARGIN, _INTO = 4, 1e-6
#: Beams are followed in such steps: none of the cells along an axis is left out [cells].
_STEP = 0.7


@dataclass(frozen=True, eq=False)
class Grid:
    """An occupancy grid, with the values of ROS.

    Attributes
    ----------
    cells : ndarray of int8, shape (rows, columns)
        0 is free, 100 occupied, -1 unknown; the first row is the lowest.
    resolution : float
        Size of a cell [m].
    origin : (x, y, theta)
        Pose of the lower left corner of the first cell in the frame of the map [m, m, rad].
    least, most : int
        A cell is occupied from `least` on, and free up to `most`.

    Examples
    --------
    >>> grid = Grid(np.array([[100, 0], [-1, 0]], np.int8), 0.05, (1.0, 2.0, 0.0))
    >>> grid.size, grid.occupied.tolist()
    ((0.1, 0.1), [[True, False], [False, False]])
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: Pose = (0.0, 0.0, 0.0)
    least: int = OCCUPIED
    most: int = FREE

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells)
        if cells.dtype != np.int8 or cells.ndim != 2:
            had = f"{cells.dtype} of shape {cells.shape}"
            raise ValueError(f"cells are {had}, expected int8 in rows and columns")
        check_resolution(self.resolution)
        checked_place(self.origin, "origin")

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """Which cells are occupied, shape (rows, columns)."""
        return np.asarray(self.cells >= self.least)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which cells are free, shape (rows, columns)."""
        return np.asarray((self.cells >= 0) & (self.cells <= self.most))

    @property
    def size(self) -> tuple[float, float]:
        """Width and depth [m]."""
        rows, columns = self.cells.shape
        return columns * self.resolution, rows * self.resolution

    def placed(self, points: Array) -> Array:
        """Return points (..., 2), counted in cells from the origin, in the map's frame [m]."""
        x, y, theta = self.origin
        c, s = math.cos(theta), math.sin(theta)
        return np.asarray(self.resolution * points @ np.array([[c, s], [-s, c]]) + (x, y))

    @classmethod
    def read(cls, path: str | os.PathLike[str], limits: Limits | None = None) -> Self:
        """Read the YAML and the image of a grid as map_server does, in each of its modes.

        Raises
        ------
        LineamentError
            If one of them is missing or makes no sense, or the image is beyond the limit.
        """
        limits = Limits() if limits is None else limits
        about = read_about(path, limits)
        shades, clear = read_shades(path, about, limits)
        cells = values_of(about)[shades]
        if about.mode == SCALE:
            cells[clear] = UNKNOWN
        bounds = OCCUPIED, FREE
        if about.mode == RAW:
            bounds = math.ceil(100 * about.occupied), math.floor(100 * about.free)
        return cls(cells[::-1].copy(), about.resolution, about.origin, *bounds)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the YAML, and a PGM of the same name beside it: both, or none.

        Cells that are more or less occupied are written as `mode: raw`, which keeps them. A
        ValueError for another ending than ``.yaml`` and ``.yml``: the PGM may not have its name.
        """
        yaml, image = files_of(path)
        if yaml.suffix.lower() not in GRID_ENDINGS:
            wanted = " or ".join(GRID_ENDINGS)
            raise ValueError(f"{yaml}: is the name of no grid, expected an ending of {wanted}")
        plain = (self.least, self.most) == (OCCUPIED, FREE)
        if plain and np.isin(self.cells, list(_SHADES)).all():
            mode, occupied, free, pixels = "trinary", _OCCUPIED, _FREE, self.cells.astype(np.uint8)
            for value, shade in _SHADES.items():
                pixels[self.cells == value] = shade
        else:
            mode, occupied, free = RAW, self.least / 100, self.most / 100
            pixels = np.where(self.cells < 0, 255, self.cells).astype(np.uint8)
        rows, columns = self.cells.shape
        head = f"P5\n{columns} {rows}\n255\n".encode()
        origin = ", ".join(f"{value:.9g}" for value in self.origin)
        about = (
            f"image: {image.name}\nmode: {mode}\n"
            f"resolution: {self.resolution:.9g}\norigin: [{origin}]\nnegate: 0\n"
            f"occupied_thresh: {occupied:g}\nfree_thresh: {free:g}\n"
        )
        with written_beside(yaml) as last, written_beside(image) as first:
            with naming_errors(image):
                first.write_bytes(head + pixels[::-1].tobytes())
            with naming_errors(yaml):
                last.write_text(about, encoding="utf-8", newline="\n")

    @classmethod
    def drawn(
        cls,
        lines: Array,
        seen: Iterable[tuple[LaserScan, Pose]] = (),
        resolution: float = 0.05,
        limits: Limits | None = None,
    ) -> Self:
        """Draw lines (n, 2, 2), which hide what is to their right [m]: cells on them are occupied.

        Cells that beams of scans passed through, each from its pose, are free: all but the last on
        the way to where a beam ends. The others are unknown.
        """
        check_resolution(resolution)
        seen = list(seen)
        shown = [lines.reshape(-1, 2), *(_ends(*one) for one in seen)]
        low = np.floor(np.min([part.min(axis=0) for part in shown], axis=0) / resolution) - _MARGIN
        high = np.ceil(np.max([part.max(axis=0) for part in shown], axis=0) / resolution) + _MARGIN
        columns, rows = (high - low).tolist()
        (limits or Limits()).check("cells", int(columns * rows), LineamentError)
        cells = np.full((int(rows), int(columns)), UNKNOWN, np.int8)
        for scan, pose in seen:
            _mark(cells, _passed(scan, pose, resolution) / resolution - low, FREE)
        for start, end in lines / resolution - low:
            _mark(cells, _on_line(start, end), OCCUPIED)
        x, y = (resolution * low).round(9).tolist()
        return cls(cells, resolution, (x, y, 0.0))


def files_of(path: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Return the two files of a grid that is written: its YAML, and its image."""
    return Path(path), Path(path).with_suffix(".pgm")


def all_files(path: str | os.PathLike[str], *, is_read: bool = False) -> list[Path]:
    """Return the files of a plan, to be written or read: two of a grid, else one."""
    if Path(path).suffix.lower() not in GRID_ENDINGS:
        return [Path(path)]
    if not is_read:
        return list(files_of(path))
    try:
        return [Path(path), Path(path).parent / read_about(path, Limits()).image]
    except LineamentError:  # Reading it reports what is wrong.
        return [Path(path)]


def _mark(cells: NDArray[np.int8], places: Array, value: int) -> None:
    """Set the cells that these places (n, 2), in cells from the first, are in."""
    columns, rows = np.floor(places).astype(np.int64).T
    inside = (columns >= 0) & (rows >= 0) & (rows < cells.shape[0]) & (columns < cells.shape[1])
    cells[rows[inside], columns[inside]] = value


def _on_line(start: Array, end: Array) -> Array:
    """Return a place in each cell that a line passes through, a little to its right."""
    along = end - start
    crossed = [np.array([0.0, 1.0])]
    for axis in range(2):
        low, high = sorted((start[axis], end[axis]))
        borders = np.arange(math.ceil(low), math.floor(high) + 1)
        if along[axis]:
            crossed.append((borders - start[axis]) / along[axis])
    at = np.unique(np.clip(np.concatenate(crossed), 0.0, 1.0))
    right = along[::-1] * (1, -1) / max(math.hypot(*along), 1e-12)
    return np.asarray(start + ((at[1:] + at[:-1]) / 2)[:, None] * along + _INTO * right)


def _ends(scan: LaserScan, pose: Pose) -> Array:
    """Return where a sensor is, and where its beams end (n + 1, 2) [m]."""
    ranges, (x, y, theta) = scan.ranges[scan.valid], pose
    angles = scan.angles[scan.valid] + theta
    ends = np.column_stack((x + ranges * np.cos(angles), y + ranges * np.sin(angles)))
    return np.concatenate(([(x, y)], ends))


def _passed(scan: LaserScan, pose: Pose, cell: float) -> Array:
    """Return places along the beams of a scan, up to a cell before they end [m]."""
    ranges, (sensor, *ends) = scan.ranges[scan.valid], _ends(scan, pose)
    step = _STEP * cell
    counts = np.maximum(np.floor((ranges - cell) / step + 0.5), 0).astype(np.int64)
    beam = np.repeat(np.arange(len(ranges)), counts)
    along = np.arange(len(beam)) - (np.cumsum(counts) - counts)[beam] + 0.5
    way = (np.reshape(ends, (-1, 2)) - sensor) / ranges[:, None]
    return np.asarray(sensor + step * along[:, None] * way[beam])
