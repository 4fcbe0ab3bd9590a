"""Plans from files: what all have in common, and tables of features in the frame of the world."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..drawings import check_file, plan_error
from ..errors import LineamentError
from ..features import ARC, SEGMENT, TABLES, Features, make_records
from ..limits import Limits
from ..scan import Array

if TYPE_CHECKING:
    import pyarrow as pa

#: Fields of segments and arcs, and their columns in a table.
_FIELDS = {
    "start": ("start_x", "start_y"), "end": ("end_x", "end_y"), "centroid": ("x", "y"),
    "center": ("x", "y"), "angle": ("angle",), "length": ("length",), "misfit": ("misfit",),
    "radius": ("radius",),
}  # fmt: skip
_ENTRIES = ("00", "01", "11", "02", "12", "22")
#: No deviation of a wall is larger [m]; a covariance that is singular is widened by this share.
_VAGUE, _RIDGE = 1e3, 1e-9
#: Buildings are so large, along the longer side [m].
_BUILDINGS = 3.0, 500.0


def unknown_plan(ending: str) -> LineamentError:
    """Return the error of a file that is no plan by its ending, with what to do about it."""
    if ending in (".pgm", ".png"):
        return LineamentError("is an image, expected the .yaml of the grid that it is of")
    return LineamentError(
        f"a plan is a .dxf, .parquet, .svg or the .yaml of a grid, not {ending or 'this'}: "
        "`lineament map LOG -o plan.dxf` makes one of a drive"
    )


def is_drawn_by_cad(ending: str, **asked: object) -> bool:
    """Whether a plan is a DXF; LineamentError if another one is asked for what only that has."""
    is_dxf = ending == ".dxf"
    for name, value in asked.items():
        if value is not None and not is_dxf:
            raise LineamentError(f"{name} are of a DXF, expected none")
    return is_dxf


def is_a_building(size: float) -> bool:
    """Whether a plan so long [m] can be that of a building."""
    return _BUILDINGS[0] <= size <= _BUILDINGS[1]


def doubts(extent: tuple[float, float], left_out: int, is_grid: bool = False) -> str:
    """Return what may be wrong with a plan: it is of no building, or parts are left out; or ""."""
    (wide, deep), said = extent, []
    if left_out:
        said.append(f"{left_out} walls or columns have impossible numbers, left out")
    if not is_a_building(max(extent)):
        size = f"{wide:.4g} m x {deep:.4g} m"
        why = (
            "is its resolution right?"
            if is_grid
            else "is it drawn in other units? (units=, --units)"
        )
        said.append(f"is {size}: {why}")
    return "; ".join(said)


def read_table(path: str | os.PathLike[str], limits: Limits) -> tuple[Features, int]:
    """Return the segments and arcs of all scans of a table, and how many rows have no numbers.

    Rows with empty or impossible numbers are left out.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    check_file(path, limits)
    error = plan_error(path)
    try:
        # Texts stay numbers of a dictionary: one of a megabyte may be in each row. A path that is
        # no text in UTF-8 is refused by Arrow, an open file is not.
        with Path(path).open("rb") as data, pq.ParquetFile(data, read_dictionary=["kind"]) as file:
            _check_columns(file.schema_arrow, error)
            about = file.metadata
            limits.check("entities", about.num_rows, error)
            groups = [about.row_group(k) for k in range(about.num_row_groups)]
            size = sum(group.total_byte_size for group in groups)
            limits.check_growth(size, Path(path).stat().st_size, error)
            table = file.read(columns=["kind", *_columns()])
    except OSError as problem:
        raise error(problem.strerror or "is no Parquet") from None
    except (pa.ArrowException, ValueError, UnicodeDecodeError) as problem:
        raise error(f"is no table of features: {problem}") from None
    values = {name: _numbers(table[name]) for name in _columns()}
    found: dict[str, Any] = {name: make_records(name, []) for name in TABLES}
    left_out = 0
    for name, kind, dtype in (("segments", "segment", SEGMENT), ("arcs", "arc", ARC)):
        records = _records(dtype, values, _equal(table["kind"], kind))
        good = _are_possible(records)
        found[name], left_out = records[good], left_out + int((~good).sum())
    if left_out and not len(found["segments"]):
        raise error(f"has no walls: {left_out} rows have empty or impossible numbers")
    return Features(**found, clusters=np.empty(0, np.int32)), left_out


def _columns() -> list[str]:
    names = dict.fromkeys(name for columns in _FIELDS.values() for name in columns)
    return [*names, *(f"cov_{entry}" for entry in _ENTRIES)]


def _check_columns(schema: "pa.Schema", error: Callable[[str], LineamentError]) -> None:
    import pyarrow as pa

    missing = [name for name in ("kind", *_columns()) if name not in schema.names]
    if missing:
        raise error(f"is no table of features: it has no column {', '.join(missing)}")
    for name in _columns():
        form = schema.field(name).type
        if not (pa.types.is_floating(form) or pa.types.is_integer(form)):
            raise error(f"is no table of features: column {name} holds {form}, expected numbers")
    form = schema.field("kind").type
    of = form.value_type if pa.types.is_dictionary(form) else form
    if not (pa.types.is_string(of) or pa.types.is_large_string(of)):
        raise error(f"is no table of features: column kind holds {form}, expected text")


def _numbers(column: "pa.ChunkedArray") -> Array:
    """Values of a column, NaN where it is empty."""
    import pyarrow as pa

    chunks = [chunk.cast(pa.float64()).to_numpy(zero_copy_only=False) for chunk in column.chunks]
    return np.concatenate([np.empty(0), *chunks])


def _equal(column: "pa.ChunkedArray", text: str) -> NDArray[np.bool_]:
    import pyarrow.compute as pc

    return np.asarray(pc.fill_null(pc.equal(column, text), False).to_numpy(), bool)


def _records(
    dtype: np.dtype[np.void], values: dict[str, Array], rows: NDArray[np.bool_]
) -> NDArray[np.void]:
    """Make records of rows of a table."""
    records = np.zeros(int(rows.sum()), dtype)
    for name in _FIELDS.keys() & set(dtype.names or ()):
        columns = np.stack([values[column][rows] for column in _FIELDS[name]], axis=-1)
        records[name] = columns.reshape(records[name].shape)
    for i, j in np.ndindex(records["covariance"].shape[1:]):
        records["covariance"][:, i, j] = values[f"cov_{min(i, j)}{max(i, j)}"][rows]
    return records


def _are_possible(records: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which records have numbers, and covariances that are some; these get an inverse."""
    names, covariance = set(records.dtype.names or ()), records["covariance"]
    good: NDArray[np.bool_] = np.asarray((abs(covariance) <= _VAGUE**2).all(axis=(1, 2)))
    for name in _FIELDS.keys() & names:
        finite = np.isfinite(records[name])
        good &= finite.all(axis=1) if finite.ndim > 1 else finite
    if "radius" in names:
        good &= records["radius"] > 0
    diagonal = np.einsum("nii->ni", covariance)
    diagonal[good] *= 1 + _RIDGE
    # Correlations between -1 and 1, in all directions.
    sigma = np.sqrt(np.maximum(diagonal[good], 1e-300))
    correlation = covariance[good] / (sigma[:, :, None] * sigma[:, None])
    good[good] = np.linalg.eigvalsh(correlation).min(axis=1, initial=1.0) > -_RIDGE
    return good
