"""Plans that are small on disk and huge, endless, deep or no numbers to whoever believes them."""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from lineament.mapping import LineMap

ROOM = np.array([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]], float)
NAN, INF = math.nan, math.inf


def drawn(path: Path, draw: Callable[[Any, Any], Any]) -> None:
    """Write a DXF: a room, and what is drawn in its model space beside its blocks."""
    drawing = ezdxf.new("R2010", units=6)
    space = drawing.modelspace()
    for x, y, to_x, to_y in ROOM.tolist():
        space.add_line((x, y), (to_x, to_y))
    draw(space, drawing.blocks)
    drawing.saveas(path)


def _laughs(space: Any, blocks: Any) -> None:
    blocks.new("0").add_line((0, 0), (4, 0))
    for level in range(1, 12):
        block = blocks.new(f"{level}")
        for i in range(10):
            block.add_blockref(f"{level - 1}", (i, 0))
    space.add_blockref("11", (0, 0))


def _deep(space: Any, blocks: Any) -> None:
    for level in range(60):
        blocks.new(f"{level}").add_blockref(f"{level + 1}", (1, 0))
    blocks.new("60").add_line((0, 0), (1, 0))
    space.add_blockref("0", (0, 0))


def _holds_itself(space: Any, blocks: Any) -> None:
    blocks.new("a").add_blockref("b", (1, 1))
    blocks.new("b").add_blockref("A", (1, 1))
    space.add_blockref("a", (0, 0))


def _grid(inside: Callable[[Any], Any], count: int, step: float = 1.0) -> Callable[[Path], None]:
    """Write a block that stands so many times along and across."""

    def draw(space: Any, blocks: Any) -> None:
        inside(blocks.new("a"))
        grid = {"row_count": count, "column_count": count, "row_spacing": step}
        space.add_blockref("a", (0, 0), dxfattribs={**grid, "column_spacing": step})

    return lambda path: drawn(path, draw)


def _corner(block: Any) -> None:
    block.add_line((0, 0), (5, 0))
    block.add_line((0, 0), (0, 5))


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 27)


def table(path: Path, rows: int = 0, change: Any = None, **options: Any) -> None:
    """Write a table of a room, so many times or changed."""
    LineMap.from_lines(ROOM, side=1).write(path)  # a row a wall
    written = pq.read_table(path)
    if rows:
        written = written.filter(pa.compute.equal(written["kind"], "segment"))
        written = written.take(np.zeros(rows, np.int64))
    pq.write_table(change(written) if change else written, path, **options)


def put(name: str, values: Any) -> Callable[[pa.Table], pa.Table]:
    """Return what puts values into the first rows of a column."""

    def change(of: pa.Table) -> pa.Table:
        rest = of[name].to_pylist()[len(values) :]
        form = of.schema.field(name).type
        column = pa.array([*values, *rest], None if isinstance(values[0], str) else form)
        return of.set_column(of.schema.get_field_index(name), name, column)

    return change


def _each(*entities: Callable[[Any], Any]) -> Callable[[Path], None]:
    return lambda path: drawn(path, lambda space, _: [add(space) for add in entities])


def _gridded(size: int, pixels: bytes) -> Callable[[Path], None]:
    """Write a grid whose image has so many rows and columns, and these bytes again and again."""

    def write(path: Path) -> None:
        rows = pixels * (size * size // len(pixels)) if size < 10_000 else pixels
        path.with_suffix(".pgm").write_bytes(b"P5\n%d %d\n255\n" % (size, size) + rows)
        path.write_text(f"image: {path.stem}.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")

    return write


def _spline(to: Any, weight: float, knot: float) -> None:
    spline = to.add_spline()
    points = [(0, 1, 0), (1, 2, 0), (2, 1, 0), (3, 2, 0)]
    spline.set_open_rational(points, [1, 1, 1, weight])
    spline.knots = [*list(spline.knots)[:-1], knot]


#: What each is beyond (or ""), how it is written, limits, and what is said of it or of the plan.
PLANS: dict[str, tuple[str, Callable[[Path], Any], dict[str, int], str]] = {
    "laughs.dxf": ("entities", lambda path: drawn(path, _laughs), {}, ""),
    "grid.dxf": ("entities", _grid(lambda to: to.add_line((0, 0), (1, 0)), 30_000), {}, ""),
    "rows.parquet": ("entities", lambda path: table(path, 300_000), {}, ""),
    "deep.dxf": ("depth", lambda path: drawn(path, _deep), {}, ""),
    "bigarc.dxf": ("chords", _each(lambda to: to.add_arc((0, 0), 1e12, 0, 180)), {}, ""),
    "bigring.dxf": ("chords", _each(lambda to: to.add_circle((0, 0), 1e9)), {}, ""),
    "bulge.dxf": (
        "chords", _each(lambda to: to.add_lwpolyline([(0, 0, 1), (1e9, 0, 0)], "xyb")), {}, "",
    ),
    "spline.dxf": (
        "chords", _each(lambda to: to.add_spline([(0, 0), (1e9, 1e9), (2e9, -1e9), (9, 0)])), {},
        "",
    ),
    "ellipse.dxf": ("chords", _each(lambda to: to.add_ellipse((0, 0), (1e9, 0), 0.5)), {}, ""),
    "huge.yaml": ("cells", _gridded(10_000, b"\0"), {}, ""),
    "stripes.yaml": ("entities", _gridded(502, b"\0\376"), {}, ""),
    "arcs.dxf": ("walls", _grid(lambda to: to.add_arc((0, 0), 500.0, 0, 359), 30), {}, ""),
    "sparse.dxf": ("drawing", sparse, {}, ""),
    "sparse.parquet": ("drawing", sparse, {}, ""),
    "packed.parquet": (
        "ratio",
        lambda path: table(path, 249_000, use_dictionary=False, compression="zstd"),
        {},
        "",
    ),
    "hatch.dxf": ("", _grid(_corner, 200, 0.02), {}, "pairs of .* walls lie beside each"),
    "holds.dxf": ("", lambda path: drawn(path, _holds_itself), {}, "block 'a' holds itself"),
    "fifo.dxf": ("", os.mkfifo, {}, "is no regular file, expected a plan"),
    "fifo.parquet": ("", os.mkfifo, {}, "is no regular file, expected a plan"),
    "zero.dxf": ("", lambda path: path.symlink_to("/dev/zero"), {}, "is no regular file"),
    "bulgenan.dxf": ("", _each(lambda to: to.add_lwpolyline([(0, 0, NAN), (1, 0)], "xyb")), {},
                     "read, 4 walls, 1 left out"),
    "circlenan.dxf": ("", _each(lambda to: to.add_circle((NAN, 0), 1)), {},
                      "read, 4 walls, 1 left out"),
    "radius.dxf": ("", _each(lambda to: to.add_circle((1, 0), 0), lambda to: to.add_arc(
        (0, 0), 0, 0, 90), lambda to: to.add_circle((0, 0), INF)), {}, "read, 4 walls, 3 left out"),
    "circlefar.dxf": ("", _each(lambda to: to.add_circle((1e300, 0), 1)), {},
                      r"plan is 1e\+300 m from its origin"),
    "circleaway.dxf": ("", _each(lambda to: to.add_circle((1e7, 0), 1)), {},
                       r"is 1e\+07 m wide"),
    "line.dxf": ("", _each(lambda to: to.add_line((0, NAN), (1, 1)), lambda to: to.add_line(
        (0, 0), (INF, 1))), {}, "read, 4 walls, 2 left out"),
    "far.dxf": ("", _each(lambda to: to.add_line((-1e308, 0), (1e308, 1))), {},
                r"plan is 1e\+308 m from"),
    "scale.dxf": ("", lambda path: drawn(path, lambda space, blocks: (
        blocks.new("a").add_line((0, 0), (1, 1)),
        space.add_blockref("a", (0, 0), dxfattribs={"xscale": INF, "yscale": 1e308}))), {},
        "read, 4 walls, 1 left out"),
    "splinenan.dxf": ("", _each(lambda to: to.add_open_spline([(0, 0), (NAN, 1), (2, 0), (3, 1)])),
                      {}, "read, 4 walls, 1 left out"),
    "weights.dxf": ("", _each(lambda to: _spline(to, NAN, 1.0)), {}, "read, 4 walls, 1 left out"),
    "knots.dxf": ("", _each(lambda to: _spline(to, 1.0, NAN)), {}, "read, 4 walls, 1 left out"),
    "rational.dxf": ("", _each(lambda to: _spline(to, 1.0, 1.0)), {}, "walls, 0 left out"),
    "nowhere.dxf": ("", lambda path: drawn(path, lambda space, blocks: (
        blocks.new("a").add_line((0, 0), (1, 1)), space.add_blockref("a", (NAN, 1)))), {},
        "read, 4 walls, 1 left out"),
    "text.parquet": ("", lambda path: table(path, change=put("x", ["a"] * 8)), {},
                     "column x holds string, expected numbers"),
    "column.parquet": ("", lambda path: table(path, change=lambda of: of.drop_columns(["x"])), {},
                       "has no column x$"),
    "null.parquet": ("", lambda path: table(path, change=put("start_x", [None, NAN])), {},
                     "read, 2 walls, 2 left out"),
    "inf.parquet": ("", lambda path: table(path, change=put("cov_00", [INF, -1.0, 1e300])), {},
                    "read, 1 walls, 3 left out"),
    "singular.parquet": ("", lambda path: table(path, change=lambda of: put("cov_00", [1.0])(
        put("cov_01", [0.1])(put("cov_11", [0.01])(of)))), {}, "read, 4 walls, 0 left out"),
    "all.parquet": ("", lambda path: table(path, change=put("end_y", [NAN] * 4)), {},
                    "has no walls: 4 rows have empty or impossible numbers"),
}  # fmt: skip
