"""Plans from files: DXF of any program, and tables of features in the frame of the world."""

import os
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError, needed_by
from ..features import ARC, SEGMENT, Features, make_records
from ..scan import Array

#: Metres of the units that $INSUNITS of a DXF names.
UNITS = {
    1: 0.0254, 2: 0.3048, 3: 1609.344, 4: 0.001, 5: 0.01, 6: 1.0, 7: 1000.0, 8: 2.54e-8,
    9: 2.54e-5, 10: 0.9144, 13: 1e-6, 14: 0.1, 15: 10.0, 16: 100.0,
}  # fmt: skip
#: Numbers of the units that a person names.
NAMES = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6, "dm": 14}
#: A bend becomes chords that are off it by no more [m].
SAG = 0.01
#: What walls are drawn with, and what is taken apart into that.
_DRAWN = ("LINE", "ARC", "CIRCLE", "SPLINE", "ELLIPSE")
_WHOLE = ("INSERT", "LWPOLYLINE", "POLYLINE", "MLINE")
#: Fields of segments and arcs, and their columns in a table.
_FIELDS = {
    "start": ("start_x", "start_y"), "end": ("end_x", "end_y"), "centroid": ("x", "y"),
    "center": ("x", "y"), "angle": ("angle",), "length": ("length",), "misfit": ("misfit",),
    "radius": ("radius",),
}  # fmt: skip


def read_drawing(
    path: str | os.PathLike[str], layers: Sequence[str] | None, units: str | None
) -> tuple[Array, Array]:
    """Return lines (n, 2, 2) and circles ``x y r`` (m, 3) of a DXF; see `LineMap.read`."""
    with needed_by(f"{path}:"):
        import ezdxf
    try:
        drawing = ezdxf.readfile(path)  # type: ignore[attr-defined]
    except OSError as error:
        raise LineamentError(f"{path}: {error.strerror or 'is no DXF'}") from None
    except ezdxf.DXFError as error:  # type: ignore[attr-defined]
        raise LineamentError(f"{path}: is no DXF: {error}") from None
    drawn = drawing.header.get("$INSUNITS", 0) if units is None else NAMES[units]
    unit = UNITS.get(drawn, 1.0)
    entities = list(_exploded(drawing.modelspace()))
    names = dict.fromkeys(layer for layer, _ in entities)
    if layers is None:
        chosen = {name for name in names if "wall" in name.lower()} or set(names)
    else:
        chosen = {n for n in names for p in layers if fnmatch(n.lower(), p.lower())}
        if not chosen:
            there = ", ".join(names) or "none"
            raise LineamentError(f"{path}: no layer is {' or '.join(layers)}; there are: {there}")
    lines, rings = [np.zeros((0, 2, 2))], []
    for entity in (entity for layer, entity in entities if layer in chosen):
        dxf = entity.dxf
        if entity.dxftype() == "CIRCLE":
            rings.append((*entity.ocs().to_wcs(dxf.center).vec2, dxf.radius))
        else:
            is_line = entity.dxftype() == "LINE"
            along = (dxf.start, dxf.end) if is_line else entity.flattening(SAG / unit)
            vertices = unit * np.array([(vertex.x, vertex.y) for vertex in along])
            lines.append(np.stack((vertices[:-1], vertices[1:]), axis=1))
    ends = np.concatenate(lines)
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 1e-6]
    if not len(ends):
        raise LineamentError(
            f"{path}: has no walls: {len(entities)} entities on {len(names)} layers, no line"
        )
    return ends, unit * np.array(rings).reshape(-1, 3)


def _exploded(entities: Any, block: str = "0") -> Iterator[tuple[str, Any]]:
    """Yield what is drawn and its layer; in a block, layer 0 is the layer of the block."""
    for entity in entities:
        layer = block if entity.dxf.layer == "0" else entity.dxf.layer
        if entity.dxftype() in _WHOLE:
            yield from _exploded(entity.virtual_entities(), layer)
        elif entity.dxftype() in _DRAWN:
            yield layer, entity


def read_table(path: str | os.PathLike[str]) -> Features:
    """Return the segments and arcs of all scans of a table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = {name: None for columns in _FIELDS.values() for name in columns}
    columns = [*names, *(f"cov_{entry}" for entry in ("00", "01", "11", "02", "12", "22"))]
    try:
        table = pq.read_table(path, columns=["kind", *columns])
    except OSError as error:
        raise LineamentError(f"{path}: {error.strerror or 'is no Parquet'}") from None
    except (pa.ArrowInvalid, KeyError) as error:
        raise LineamentError(f"{path}: is no table of features: {error}") from None
    values = {name: table[name].to_numpy() for name in columns}
    kinds = np.asarray(table["kind"].to_pylist())
    return Features(
        segments=_records(SEGMENT, values, kinds == "segment"),
        corners=make_records("corners", []),
        edges=make_records("edges", []),
        arcs=_records(ARC, values, kinds == "arc"),
        breakpoints=make_records("breakpoints", []),
        clusters=np.empty(0, np.int32),
    )


def _records(
    dtype: np.dtype[np.void], values: dict[str, NDArray[Any]], rows: NDArray[np.bool_]
) -> NDArray[np.void]:
    """Make records of rows of a table."""
    records = np.zeros(int(rows.sum()), dtype)
    for name in _FIELDS.keys() & set(dtype.names or ()):
        columns = np.stack([values[column][rows] for column in _FIELDS[name]], axis=-1)
        records[name] = np.nan_to_num(columns).reshape(records[name].shape)
    for i, j in np.ndindex(records["covariance"].shape[1:]):
        records["covariance"][:, i, j] = values[f"cov_{min(i, j)}{max(i, j)}"][rows]
    return records
