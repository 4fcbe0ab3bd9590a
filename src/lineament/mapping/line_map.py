"""`LineMap`: walls, corners and columns in one frame, each with its covariance."""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._copies import ReadOnly, locked
from ..drawings import plan_error, read_drawing
from ..errors import LineamentError, one_line, warn
from ..features import ARC, CORNER, Features, make_records
from ..limits import Limits
from ..output import open_writer
from ..scan import Array, LaserScan, Pose
from ..walls import COLUMN, lengths_of, rows_shaped, segments_of, shared, turned_back, walls_of
from ..walls.sights import columns_shown, walls_shown
from .grids import GRID_ENDINGS, Grid
from .hypotheses import Listed, anchors, listed, meetings, spectrum
from .index import LONGEST, MAPPED, Index, checked_records, make_index, rings
from .outlines import walls_of_grid
from .plans import doubts, is_drawn_by_cad, read_table, unknown_plan
from .svg_plans import read_svg


class LineMap(ReadOnly):
    """A plan: walls, corners and columns in one frame [m, rad].

    Parameters
    ----------
    walls : structured array of `WALL`
        Walls without length or with numbers that are not finite are left out.
    columns : structured array of `COLUMN`, optional
        Those with numbers that are not finite are left out.
    sigma : float
        How far walls are from where they stand [m], beside their covariances. 4.5 cm is that of
        buildings beside their drawings, and of maps beside buildings; 0 that of simulated ones.

    Attributes
    ----------
    left_out : int
        Walls and columns of the file, or given, whose numbers are not finite.
    is_mapped : bool
        Whether it is some centimetres off: walls have covariances, or `sigma` is 4.5 cm or more.
        Beams may then pass through some of its walls, and poses have to be more plainly there.

    Raises
    ------
    TypeError
        If walls or columns are not such records.
    LineamentError
        If no wall is left, or the plan is larger than a building can be.

    Examples
    --------
    >>> plan = LineMap.from_lines([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]])
    >>> plan
    LineMap(4 walls, 4 corners, 0 columns, 4.0 m x 3.0 m)
    """

    def __init__(
        self,
        walls: NDArray[np.void],
        columns: NDArray[np.void] | None = None,
        *,
        sigma: float = 0.0,
    ) -> None:
        if not 0 <= sigma < 1:
            raise ValueError(f"sigma is {sigma}, expected less than 1 in metres, and ≥ 0")
        columns = np.zeros(0, COLUMN) if columns is None else columns
        rest, self.columns = checked_records(walls, columns)
        self.left_out = len(walls) - len(rest) + len(columns) - len(self.columns)
        self.walls = rest[lengths_of(rest) > 1e-6]
        if not len(self.walls):
            raise LineamentError(f"the plan has no walls: {len(walls)} lines, none has a length")
        self.walls, self.columns = locked(self.walls), locked(self.columns)
        if (extent := max(self.size)) > LONGEST:
            raise LineamentError(
                f"the plan is {extent:.5g} m wide, expected a building: "
                "is it drawn in other units? (units=, --units)"
            )
        self.sigma = sigma
        self.is_mapped = sigma >= MAPPED or bool(self.walls["covariance"].any())

    def __repr__(self) -> str:
        wide, deep = self.size
        return (
            f"LineMap({len(self.walls)} walls, {len(self.corners)} corners, "
            f"{len(self.columns)} columns, {wide:.1f} m x {deep:.1f} m)"
        )

    def __len__(self) -> int:
        return len(self.walls) + len(self.corners) + len(self.columns)

    @property
    def ends(self) -> Array:
        """Both ends of each wall, shape (n, 2, 2) [m]."""
        return np.stack((self.walls["start"], self.walls["end"]), axis=1)

    @property
    def size(self) -> tuple[float, float]:
        """Width and depth of the rectangle around all walls and columns [m]."""
        center, radius = self.columns["center"], self.columns["radius"][:, None]
        places = self.ends.reshape(-1, 2), center - radius, center + radius
        width, depth = np.ptp(np.concatenate(places), axis=0).tolist()
        return width, depth

    @property
    def area(self) -> float:
        """Area of that rectangle [m²]."""
        return math.prod(self.size)

    @cached_property
    def corners(self) -> NDArray[np.void]:
        """Where two walls end together: records of `hypotheses.MEETING`."""
        return locked(meetings(self.walls))

    @cached_property
    def anchors(self) -> Listed:
        """What votes for poses: corners and ends of walls, see `hypotheses.anchors`."""
        return listed(anchors(self.walls, self.corners))

    @cached_property
    def spectrum(self) -> NDArray[np.complex128]:
        """The directions of the walls, see `hypotheses.spectrum`."""
        return spectrum(self.walls)

    @cached_property
    def as_drawn(self) -> "LineMap":
        """The same walls as on a drawing: where they are said to be, and none is missing."""
        plan = LineMap(self.walls, self.columns)
        plan.is_mapped = False
        return plan

    @cached_property
    def index(self) -> Index:
        """What the kernels need."""
        return make_index(self.walls, self.columns, self.sigma)

    @classmethod
    def from_lines(
        cls, ends: ArrayLike, columns: ArrayLike = (), *, sigma: float = 0.0, side: int = 0
    ) -> Self:
        """Make a plan of lines ``x1 y1 x2 y2`` (n, 4) and columns ``x y r`` (m, 3), known exactly.

        Lines may also be pairs of ends (n, 2, 2). `side` is 1 for lines that are seen from their
        left alone. Raises ValueError for anything else.
        """
        circles = rows_shaped("columns", columns, (3,))
        lines = rows_shaped("lines", ends, (4,), (2, 2)).reshape(-1, 2, 2)
        found = np.zeros(len(circles), COLUMN)
        found["center"], found["radius"], found["views"] = circles[:, :2], circles[:, 2], 1
        with np.errstate(over="ignore", invalid="ignore"):  # refused, or left out
            walls = walls_of(lines, side=side)
        return cls(walls, found, sigma=sigma)

    @classmethod
    def from_features(
        cls,
        features: Iterable[Features],
        poses: Iterable[Pose] | None = None,
        pose_covariances: Iterable[ArrayLike] | None = None,
        *,
        min_views: int = 1,
        sigma: float = 0.0,
    ) -> Self:
        """Merge the features of scans, each seen from its pose.

        Segments join a wall if they lie along it, or no more than a door apart, and the χ² of their
        common line is within its 99 % quantile; misfits of the surfaces count as errors.

        Parameters
        ----------
        features : iterable of Features
            Of each scan, in the frame of its sensor, or of the map where `poses` is None.
        poses : iterable of (x, y, theta), optional
            Of the sensor in the frame of the map.
        pose_covariances : iterable of array_like, shape (3, 3), optional
            Of the poses [m, m, rad].
        min_views : int
            Walls and columns that were seen less often are left out.
        sigma : float
            As for the map.

        Raises
        ------
        ValueError
            If there are not as many poses, or covariances, as scans.
        LineamentError
            As for the map.
        """
        scans, given = list(features), {"poses": poses, "pose_covariances": pose_covariances}
        at = [[None] * len(scans) if of is None else list(of) for of in given.values()]
        for name, of in zip(given, at, strict=True):
            if len(of) != len(scans):
                raise ValueError(f"{name} are {len(of)}, expected {len(scans)}, one for each scan")
        placed = [
            seen if pose is None else seen.transform(*pose, spread)
            for seen, pose, spread in zip(scans, *at, strict=True)
        ]
        shown = walls_shown([of.segments for of in placed]), columns_shown(of.arcs for of in placed)
        return cls(*(records[records["views"] >= min_views] for records in shown), sigma=sigma)

    @classmethod
    def from_grid(cls, grid: Grid, *, sigma: float = MAPPED, limits: Limits | None = None) -> Self:
        """Take the walls of an occupancy grid: the faces of what is occupied, seen from free cells.

        A wall lies in the middle of its cells, where a robot has hits. Its covariance is that of a
        place somewhere in a cell, all of its cells off alike. A LineamentError without a wall, or
        with more borders of cells than the limit of ``entities``.

        Examples
        --------
        >>> cells = np.zeros((20, 20), np.int8)
        >>> cells[4:16, 8:] = 100
        >>> LineMap.from_grid(Grid(cells, 0.05)).walls["start"].round(3).tolist()
        [[1.0, 0.225], [0.425, 0.225], [0.425, 0.775]]
        """
        return cls(walls_of_grid(grid, limits or Limits()), sigma=sigma)

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        layers: Sequence[str] | None = None,
        *,
        units: str | None = None,
        sigma: float = MAPPED,
        limits: Mapping[str, int] | None = None,
    ) -> Self:
        """Read a plan: DXF, an occupancy grid, or a table of features in the world's frame.

        A plan as large as no building, or of which parts are left out, is a `LineamentWarning`.

        Parameters
        ----------
        path : path-like
            A ``.dxf`` of any program, the ``.yaml`` of a map of map_server (ROS, nav2) with its
            image, a ``.parquet`` of ``lineament extract --world``, or an ``.svg`` of lineament.
        layers : sequence of str, optional
            The layers of a DXF that hold walls, ``*`` stands for anything; by default those with
            "wall" in their name, or all if there are none.
        units : str, optional
            Those of a DXF: m, dm, cm, mm, ft or in; by default those that it names, or metres.
        sigma : float
            How far the walls are from where they stand [m]. Buildings are some centimetres off
            their drawings, and maps off the buildings.
        limits : mapping, optional
            Limits that differ from those of ``lineament.limits.Limits``: of the plan's bytes
            (``drawing``), ``entities``, ``depth`` of blocks, ``chords``, ``walls``, ``cells``.

        Raises
        ------
        LineamentError
            If the file cannot be read, is beyond a limit, or has no walls.
        """
        ending, most = Path(path).suffix.lower(), Limits.of(limits)
        try:
            is_dxf = is_drawn_by_cad(ending, layers=layers, units=units)
            if ending in (".dxf", ".svg"):
                drawn = read_drawing(path, layers, units, most) if is_dxf else read_svg(path, most)
                lines, circles, left_out = drawn
                plan = cls.from_lines(lines, circles, sigma=sigma)
            elif ending == ".parquet":
                features, left_out = read_table(path, most)
                plan = cls.from_features([features], sigma=sigma)
            elif ending in GRID_ENDINGS:
                plan, left_out = cls.from_grid(Grid.read(path, most), sigma=sigma, limits=most), 0
            else:
                raise unknown_plan(ending)
            plan.left_out += left_out
            len(plan.corners)  # refuses more walls beside each other than a building has
        except LineamentError as error:
            problem = str(error).removeprefix(one_line(f"{path}: "))
            raise plan_error(path)(problem) from None
        if doubt := doubts(plan.size, plan.left_out, ending in GRID_ENDINGS):
            warn(one_line(f"{path}: {doubt}"))
        return plan

    def to_features(self) -> Features:
        """Return walls, corners and columns as the features of one scan in the map's frame."""
        points, arcs = shared(self.corners, CORNER), shared(self.columns, ARC)
        arcs["n_points"] = self.columns["views"]
        points["convex"], points["kind"] = self.corners["solid"] == 1, "corner"
        points["segments"] = self.corners["walls"]
        return Features(
            segments=segments_of(self.walls),
            corners=points,
            edges=make_records("edges", []),
            arcs=arcs,
            breakpoints=make_records("breakpoints", []),
            clusters=np.empty(0, np.int32),
            frame_id="map",
        )

    def to_grid(
        self, resolution: float = 0.05, seen: Iterable[tuple[LaserScan, Pose]] = ()
    ) -> Grid:
        """Draw walls and columns into an occupancy grid of cells of this size [m].

        `seen` are scans with their poses in the map's frame: what their beams passed through is
        free. All else is unknown: of a plan alone, nothing says where a robot may be.

        Examples
        --------
        >>> int(LineMap.from_lines([[0.0, 0.0, 1.0, 0.0]]).to_grid().occupied.sum())
        20
        """
        return Grid.drawn(np.concatenate((self.ends, rings(self.columns))), seen, resolution)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the map, in the format of the ending of the path.

        Those are the formats of ``lineament extract``, and ``.yaml``: an occupancy grid without
        free cells, see `to_grid`, with its image beside it. In a table a wall is seen from its
        left: one that may be seen from either side has two rows.
        """
        ending, plan = Path(path).suffix.lower(), self
        if ending in GRID_ENDINGS:
            self.to_grid().write(path)
            return
        both = self.walls[self.walls["side"] == 0]
        if len(both) and ending not in (".dxf", ".svg", ".geojson"):
            plan = LineMap(np.append(self.walls, turned_back(both)), self.columns)
        with open_writer(path) as writer:
            writer.write(plan.to_features(), LaserScan([], 0.0, 1.0, pose=(0.0, 0.0, 0.0)))
