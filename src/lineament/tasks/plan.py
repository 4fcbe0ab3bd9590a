"""A plan in one format to another, or described: what `lineament plan` and `info` do."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..files import check_outputs
from ..limits import Limits
from ..mapping import Grid, LineMap
from ..mapping.grids import GRID_ENDINGS, all_files
from ..mapping.outlines import areas
from ..output import open_writer
from ..output.figures import plot_walls
from ..output.geojson import GeoJsonWriter
from ..scan import LaserScan
from ..walls import lengths_of

#: Formats that a plan is written in: pictures, and those that are read again or go on elsewhere.
PICTURES = (".png", ".pdf")
ENDINGS = (".dxf", ".yaml", ".svg", ".parquet", ".csv", ".jsonl", ".geojson", *PICTURES)
#: What is described as a plan, and not as a log; images are refused with a hint at their grid, and
#: GeoJSON, which is only written, with what is read.
PLANS = (".dxf", ".svg", ".parquet", *GRID_ENDINGS, ".pgm", ".png", ".geojson")


def convert_plan(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    layers: Sequence[str] | None = None,
    units: str | None = None,
    resolution: float = 0.05,
    dark: bool = False,
    limits: dict[str, int] | None = None,
) -> str:
    """Read a plan and write it in another format; return a line about it.

    Parameters
    ----------
    path, layers, units, limits
        As for `LineMap.read`.
    output : path-like
        One of `ENDINGS`. Of a grid, another grid has the same cells.
    resolution : float
        Size of the cells of a grid that is drawn [m].
    dark : bool
        Whether a picture is drawn on black.

    Raises
    ------
    LineamentError
        If the plan cannot be read, or the output cannot be written or is the plan.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> LineMap.from_lines([[0, 0, 4, 0], [4, 0, 4, 3]]).write(folder / "a.svg")
    >>> convert_plan(folder / "a.svg", folder / "b.parquet").partition(" -> ")[0][-5:]
    'a.svg'
    """
    ending, is_grid = Path(output).suffix.lower(), Path(path).suffix.lower() in GRID_ENDINGS
    if ending not in (*PICTURES, *GRID_ENDINGS):
        open_writer(output)  # refuses an ending that is not known, before any work
    check_outputs(all_files(output), all_files(path, is_read=True))
    if is_grid and ending in GRID_ENDINGS:
        grid = Grid.read(path, Limits.of(limits))
        grid.write(output)
        return f"{path} -> {output}: {grid.cells.size} cells of {grid.resolution:g} m"
    plan = LineMap.read(path, layers, units=units, limits=limits)
    if ending in PICTURES:
        plot_walls(plan.ends, plan.columns, output, title=Path(path).name, dark=dark)
    elif ending in GRID_ENDINGS:
        plan.to_grid(resolution).write(output)
    elif is_grid and ending == ".geojson":
        _write_areas(Grid.read(path, Limits.of(limits)), plan, output)
    else:
        plan.write(output)
    free = ": no cell is free, as a plan alone does not say" * (ending in GRID_ENDINGS)
    return f"{path} -> {output}: {plan}{free}"


def _write_areas(grid: Grid, plan: LineMap, output: str | os.PathLike[str]) -> None:
    """Write the walls of a grid and its free space as GeoJSON."""
    with GeoJsonWriter(output) as writer:
        writer.areas = [[grid.placed(ring) for ring in area] for area in areas(grid.free)]
        writer.write(plan.to_features(), LaserScan([], 0.0, 1.0, pose=(0.0, 0.0, 0.0)))


def describe_plan(path: str | os.PathLike[str], limits: dict[str, int] | None = None) -> str:
    """Return what a plan holds, as a block of text; a NothingFoundError if it has no walls."""
    rows, grid = [], None
    if Path(path).suffix.lower() in GRID_ENDINGS:
        grid = Grid.read(path, Limits.of(limits))
        (high, wide), (width, depth), (x, y, turn) = grid.cells.shape, grid.size, grid.origin
        shares = [float(cells.mean()) for cells in (grid.occupied, grid.free)]
        names = ("occupied", "free", "neither")
        of = zip((*shares, max(1 - sum(shares), 0.0)), names, strict=True)
        rows += [
            (
                "grid",
                f"{wide} x {high} cells of {grid.resolution:g} m, {width:.2f} m x {depth:.2f} m",
            ),
            ("origin", f"{x:g} m, {y:g} m, turned by {np.degrees(turn):.4g}°"),
            ("cells", ", ".join(f"{100 * share:.1f} % {name}" for share, name in of)),
        ]
    plan = LineMap.read(path, limits=limits)
    wide_walls, deep_walls = plan.size
    sides = int((plan.walls["side"] == 1).sum())
    rows += [
        ("walls", f"{len(plan.walls)}, {lengths_of(plan.walls).sum():.1f} m in all, "
                  f"{sides} of them seen from one side alone"),
        ("size", f"{wide_walls:.2f} m x {deep_walls:.2f} m"),
        ("corners", f"{len(plan.corners)}"),
        ("columns", f"{len(plan.columns)}"),
    ]  # fmt: skip
    return "\n".join([f"{path}: a plan", *(f"  {name:<8} {value}" for name, value in rows)])
