"""Plans from files: DXF of any program, and tables of features in the frame of the world."""

import os
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError, needed_by
from ..features import ARC, SEGMENT, Features, make_records
from .walls import COLUMN, Merger, walls_of

#: Metres of the units that $INSUNITS of a DXF names.
UNITS = {
    1: 0.0254, 2: 0.3048, 3: 1609.344, 4: 0.001, 5: 0.01, 6: 1.0, 7: 1000.0, 8: 2.54e-8,
    9: 2.54e-5, 10: 0.9144, 13: 1e-6, 14: 0.1, 15: 10.0, 16: 100.0,
}  # fmt: skip
#: Numbers of the units that a person names.
NAMES = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6, "dm": 14}
#: A bend becomes chords that are off it by no more [m].
SAG = 0.01

Plan = tuple[NDArray[np.void], NDArray[np.void]]


def read_plan(
    path: str | os.PathLike[str],
    layers: Sequence[str] | None = None,
    units: str | None = None,
) -> Plan:
    """Return walls and columns of a plan by the ending of its path; see `LineMap.read`."""
    ending = Path(path).suffix.lower()
    if ending == ".dxf":
        return _read_dxf(path, layers, units)
    if ending == ".parquet":
        return _read_table(path)
    raise LineamentError(f"{path}: a plan is a .dxf or a .parquet, not {ending or 'this'}")


def _read_dxf(
    path: str | os.PathLike[str], layers: Sequence[str] | None, units: str | None
) -> Plan:
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
    names = dict.fromkeys(entity.dxf.layer for entity in entities)
    if layers is None:
        chosen = {name for name in names if "wall" in name.lower()} or set(names)
    else:
        chosen = {n for n in names for p in layers if fnmatch(n.lower(), p.lower())}
        if not chosen:
            there = ", ".join(names) or "none"
            raise LineamentError(f"{path}: no layer is {' or '.join(layers)}; there are: {there}")
    lines: list[list[float]] = []
    columns: list[tuple[float, float, float]] = []
    for entity in entities:
        if entity.dxf.layer in chosen:
            _draw(entity, unit, lines, columns)
    ends = unit * np.array(lines, np.float64).reshape(-1, 2, 2)
    ends = ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 1e-6]
    if not len(ends):
        raise LineamentError(
            f"{path}: has no walls: {len(entities)} entities on {len(names)} layers, no line"
        )
    found = np.zeros(len(columns), COLUMN)
    for record, (x, y, radius) in zip(found, columns, strict=True):
        record["center"], record["radius"], record["views"] = (unit * x, unit * y), unit * radius, 1
    return walls_of(ends), found


def _exploded(entities: Any) -> Iterator[Any]:
    """Yield what lines are made of; blocks and polylines are taken apart."""
    for entity in entities:
        kind = entity.dxftype()
        if kind == "INSERT":
            for part in _exploded(entity.virtual_entities()):
                if part.dxf.layer == "0":  # what is drawn on layer 0 lies on that of its block
                    part.dxf.layer = entity.dxf.layer
                yield part
        elif kind in ("LWPOLYLINE", "POLYLINE", "MLINE"):
            yield from entity.virtual_entities()
        elif kind in ("LINE", "ARC", "CIRCLE"):
            yield entity


def _draw(
    entity: Any,
    unit: float,
    lines: list[list[float]],
    columns: list[tuple[float, float, float]],
) -> None:
    """Add the lines of an entity, or its circle."""
    kind = entity.dxftype()
    if kind == "LINE":
        lines.append([*entity.dxf.start.vec2, *entity.dxf.end.vec2])
    elif kind == "CIRCLE":
        x, y, _ = entity.ocs().to_wcs(entity.dxf.center)
        columns.append((x, y, entity.dxf.radius))
    elif kind == "ARC":
        vertices = [(v.x, v.y) for v in entity.flattening(SAG / unit)]
        lines.extend([*a, *b] for a, b in pairwise(vertices))


def _read_table(path: str | os.PathLike[str]) -> Plan:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = [
        *["kind", "scan", "x", "y", "angle", "start_x", "start_y", "end_x", "end_y"],
        "radius",
        "misfit",
    ]
    columns += [f"cov_{entry}" for entry in ("00", "01", "11", "02", "12", "22")]
    try:
        table = pq.read_table(path, columns=columns)
    except OSError as error:
        raise LineamentError(f"{path}: {error.strerror or 'is no Parquet'}") from None
    except (pa.ArrowInvalid, KeyError) as error:
        raise LineamentError(f"{path}: is no table of features: {error}") from None
    values = {name: table[name].to_numpy() for name in columns[1:]}
    kinds = np.asarray(table["kind"].to_pylist())
    none = make_records("breakpoints", []), make_records("corners", [])
    merger = Merger()
    for scan in np.unique(values["scan"]):
        of_scan = {
            kind: {n: v[(kinds == kind) & (values["scan"] == scan)] for n, v in values.items()}
            for kind in ("segment", "arc")
        }
        segments, arcs = _segments(of_scan["segment"]), _arcs(of_scan["arc"])
        clusters = np.empty(0, np.int32)
        merger.add(Features(segments, none[1], arcs, clusters, none[0]))
    return merger.result()


def _segments(of: dict[str, Any]) -> NDArray[np.void]:
    records = np.zeros(len(of["x"]), SEGMENT)
    for name, x, y in (("start", "start_x", "start_y"), ("end", "end_x", "end_y"),
                       ("centroid", "x", "y")):  # fmt: skip
        records[name] = np.stack((of[x], of[y]), axis=1)
    records["angle"], records["misfit"] = of["angle"], np.nan_to_num(of["misfit"])
    rows = [[of["cov_00"], of["cov_01"]], [of["cov_01"], of["cov_11"]]]
    records["covariance"] = np.array(rows).transpose(2, 0, 1)
    records["length"] = np.linalg.norm(records["end"] - records["start"], axis=1)
    return records


def _arcs(of: dict[str, Any]) -> NDArray[np.void]:
    records = np.zeros(len(of["x"]), ARC)
    records["center"] = np.stack((of["x"], of["y"]), axis=1)
    records["radius"] = of["radius"]
    for i in range(3):
        for j in range(3):
            records["covariance"][:, i, j] = of[f"cov_{min(i, j)}{max(i, j)}"]
    return records
