"""Drawings as lines and circles: DXF of any program, with blocks, polylines and curves."""

import logging
import math
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .errors import LineamentError, needed_by, one_line, shortened
from .limits import Limits
from .scan import Array

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
_WHOLE = ("LWPOLYLINE", "POLYLINE", "MLINE")
#: How an entity begins: in a text, and in a binary file.
_BEGINS = re.compile(rb"^[ \t]*0[ \t]*\r?$", re.MULTILINE), re.compile(rb"\0[A-Z]")
_BINARY = b"AutoCAD Binary DXF"

# Before ezdxf is imported: else what it ignores of a damaged file, and that it has no home for its
# cache, stands on the screen.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())

Numbers = NDArray[np.int64]
_Error = Callable[[str], LineamentError]


class Drawn(NamedTuple):
    """Lines (n, 2, 2) and circles ``x y r`` (m, 3) of a drawing [m]; how many are left out."""

    lines: Array
    circles: Array
    left_out: int


@dataclass(slots=True)
class _Layout:
    """The model space, or a block: where it stands, on which layers, and what it is made of."""

    entities: list[Any]
    #: Entities with all blocks in it, and levels of blocks below.
    size: int = 0
    height: int = 0
    places: list[Array] = field(default_factory=list)
    layers: list[Numbers] = field(default_factory=list)


def plan_error(path: str | os.PathLike[str]) -> Callable[[str], LineamentError]:
    """Return what makes an error of one line of what is wrong with a plan."""

    def make(problem: str) -> LineamentError:
        return LineamentError(one_line(f"{path}: {shortened(problem)}"))

    return make


def check_file(path: str | os.PathLike[str], limits: Limits, name: str = "") -> None:
    """Raise a LineamentError unless a plan is a regular file within the limit."""
    error = plan_error(name or path)
    try:
        status = Path(path).stat()
    except OSError as problem:
        raise error(problem.strerror or "cannot be read") from None
    except ValueError as problem:  # a null byte in a name that a file holds
        raise error(f"is no name of a file: {problem}") from None
    # Pipes and devices may never end.
    if not stat.S_ISREG(status.st_mode):
        raise error("is no regular file, expected a plan")
    limits.check("drawing", status.st_size, error)


def read_drawing(
    path: str | os.PathLike[str],
    layers: Sequence[str] | None,
    units: str | None,
    limits: Limits,
) -> Drawn:
    """Return what is drawn on some layers of a DXF; see `LineMap.read`."""
    if units is not None and units not in NAMES:
        raise ValueError(f"units are {units!r}, expected one of {', '.join(NAMES)}")
    if isinstance(layers, str):  # Its letters are no layers, and a * among them is every layer.
        raise ValueError(f"layers are {layers!r}, expected a list of names")
    with needed_by(f"{path}:"):
        import ezdxf
    error = plan_error(path)
    check_file(path, limits)
    try:
        data = Path(path).read_bytes()
        # What is small in the file becomes large when it is loaded.
        begins = _BEGINS[data.startswith(_BINARY)].finditer(data)
        limits.check("entities", sum(1 for _ in begins), error)
        del data
        with np.errstate(all="ignore"):  # numbers that are none are left out
            drawing = ezdxf.readfile(path)  # type: ignore[attr-defined]
            drawn = drawing.header.get("$INSUNITS", 0) if units is None else NAMES[units]
            return _drawn(drawing, layers, UNITS.get(drawn, 1.0), limits, error)
    except LineamentError:
        raise
    except OSError as problem:
        raise error(problem.strerror or "is no DXF") from None
    # What is damaged is met by errors of a dozen kinds.
    except Exception as problem:
        reason = " ".join(f"{type(problem).__name__}: {problem}".split())
        raise error(f"is no DXF that can be read: {reason}") from None


def _drawn(
    drawing: Any, layers: Sequence[str] | None, unit: float, limits: Limits, error: _Error
) -> Drawn:
    known: dict[str, _Layout] = {}
    space = _Layout(list(drawing.modelspace()))
    _measure(space, drawing.blocks, known, 0, limits, error)
    order = [space, *reversed(known.values())]  # a block comes after all that hold it
    names: dict[str, int] = {"0": 0}
    space.places, space.layers = [np.eye(4)[None]], [np.zeros(1, np.int64)]
    for layout in order:
        _place(layout, known, names)
    parts = list(_parts(order, names))
    there = [name for name, k in names.items() if any((on == k).any() for _, _, on in parts)]
    chosen = np.array([names[name] for name in _chosen(there, layers, error)])
    lines, circles, left_out, many = [np.zeros((0, 2, 2))], [np.zeros((0, 3))], 0, 0
    for entity, places, on in parts:
        stand = places[np.isin(on, chosen)]
        good = np.isfinite(stand).all(axis=(1, 2))
        stand, left_out = stand[good], left_out + int((~good).sum())
        if not _has_numbers(entity):
            left_out += len(stand)
            continue
        if not len(stand):
            continue
        scale = float(np.linalg.norm(stand[:, :3, :3], axis=2).max())
        for part in entity.virtual_entities() if entity.dxftype() in _WHOLE else (entity,):
            if part.dxftype() not in _DRAWN:
                continue
            is_ring, vertices = _vertices(part, SAG / max(unit * scale, 1e-12), limits, error)
            many += len(stand) * max(len(vertices) - 1, 1)
            limits.check("walls", many, error)
            if not (len(vertices) and np.isfinite(vertices).all()):
                left_out += len(stand)
                continue
            placed = unit * _moved(vertices, stand)
            rings = _rings(placed) if is_ring else np.full((len(placed), 3), np.nan)
            bent = np.isnan(rings).any(axis=1)
            circles.append(rings[~bent])
            lines.append(np.stack((placed[bent, :-1], placed[bent, 1:]), axis=2).reshape(-1, 2, 2))
    ends = np.concatenate(lines)
    ends = ends[~(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) <= 1e-6)]
    if not len(ends):
        raise error(f"has no walls: {len(parts)} entities on {len(there)} layers, no line")
    return Drawn(ends, np.concatenate(circles), left_out)


def _measure(
    layout: _Layout, blocks: Any, known: dict[str, _Layout], level: int, limits: Limits,
    error: _Error,
) -> None:  # fmt: skip
    """Count what blocks in blocks expand to, before any is expanded."""
    layout.height = -1  # not known yet
    height = 0
    for entity in layout.entities:
        kind, times = entity.dxftype(), 1
        if kind == "INSERT" and (name := _block_of(entity, blocks)):
            inner = known.get(name)
            if inner is not None and inner.height < 0:
                raise error(f"block {name!r} holds itself")
            if inner is None:
                inner = _Layout(list(blocks.get(name)))
                limits.check("depth", level + 1, error)
                known[name] = inner
                _measure(inner, blocks, known, level + 1, limits, error)
                known[name] = known.pop(name)  # behind all blocks in it
            height = max(height, inner.height + 1)
            limits.check("depth", level + height, error)
            times = max(entity.mcount, 1) * (inner.size + 1)
        elif kind in _WHOLE:
            times = _pieces(entity)
        layout.size += times
        limits.check("entities", layout.size, error)
    layout.height = height


def _block_of(insert: Any, blocks: Any) -> str:
    block = blocks.get(insert.dxf.get("name", ""))
    return "" if block is None else str(block.name)


def _pieces(entity: Any) -> int:
    if entity.dxftype() == "MLINE":
        style = entity.style
        return len(entity.vertices) * (2 + len(style.elements if style else ()))
    return len(entity) + 1


def _place(layout: _Layout, known: dict[str, _Layout], names: dict[str, int]) -> None:
    """Add to each block that is inserted here where it stands, and on which layer."""
    if not layout.places:
        return
    stand, on = np.concatenate(layout.places), np.concatenate(layout.layers)
    layout.places, layout.layers = [stand], [on]
    for insert in (entity for entity in layout.entities if entity.dxftype() == "INSERT"):
        block = _block_of(insert, insert.doc.blocks)
        if not block:
            continue
        for one in insert.multi_insert() if insert.mcount > 1 else (insert,):
            matrix = np.array(list(one.matrix44())).reshape(4, 4)
            known[block].places.append(matrix @ stand)
            known[block].layers.append(_layer(insert, on, names))


def _layer(entity: Any, on: Numbers, names: dict[str, int]) -> Numbers:
    """Return the layers of an entity; in a block, layer 0 is the layer of the block."""
    name = entity.dxf.layer
    return on if name == "0" else np.full(len(on), names.setdefault(name, len(names)))


def _parts(order: Iterable[_Layout], names: dict[str, int]) -> Iterator[tuple[Any, Array, Numbers]]:
    """Yield what is drawn, each with its places (k, 4, 4) and their layers (k,)."""
    for layout in order:
        for entity in layout.entities if layout.places else ():
            on = _layer(entity, layout.layers[0], names)
            if entity.dxftype() in (*_DRAWN, *_WHOLE):
                yield entity, layout.places[0], on


def _chosen(there: list[str], layers: Sequence[str] | None, error: _Error) -> list[str]:
    if layers is None:
        return [name for name in there if "wall" in name.lower()] or there
    chosen = [n for n in there if any(fnmatch(n.lower(), p.lower()) for p in layers)]
    if not chosen:
        found = ", ".join(there) or "none"
        raise error(f"no layer is {' or '.join(layers)}; there are: {found}")
    return chosen


def _has_numbers(entity: Any) -> bool:
    """Whether the vertices of a polyline are numbers: else ezdxf draws nothing."""
    kind = entity.dxftype()
    if kind == "LWPOLYLINE":
        return bool(np.isfinite(entity.lwpoints.values).all())
    if kind == "POLYLINE":
        numbers = [(*one.dxf.location, one.dxf.get("bulge", 0.0)) for one in entity.vertices]
        return bool(np.isfinite(numbers).all())
    if kind == "MLINE":
        return bool(np.isfinite([tuple(one.location) for one in entity.vertices]).all())
    return True


def _vertices(entity: Any, sag: float, limits: Limits, error: _Error) -> tuple[bool, Array]:
    """Return whether an entity is a circle, and its vertices, those of chords of a curve.

    There are none where its numbers are not finite. A circle has 4k + 1.
    """
    dxf, kind = entity.dxf, entity.dxftype()
    if kind == "LINE":
        return False, _points((dxf.start, dxf.end))
    if kind == "SPLINE":
        return False, _points(_spline(entity, sag, limits, error))
    radius = abs(dxf.radius) if kind != "ELLIPSE" else max(1.0, abs(dxf.ratio)) * abs(
        dxf.major_axis.magnitude
    )  # fmt: skip
    if kind == "CIRCLE":
        begin, turn = 0.0, math.tau
    elif kind == "ARC":
        begin, end = math.radians(dxf.start_angle), math.radians(dxf.end_angle)
        turn = (end - begin) % math.tau or math.tau
    else:
        begin = dxf.start_param
        turn = (dxf.end_param - begin) % math.tau or math.tau
    if not (0 < radius < math.inf and math.isfinite(begin + turn)):
        return False, np.zeros((0, 3))
    # An arc of a turn t rises by r (1 - cos(t / 2)) over its chord, at most r t² / 8.
    chords = turn / math.sqrt(8 * min(sag / radius, 0.25))
    limits.check("chords", math.ceil(min(chords, 1e18)), error)
    n = 4 * math.ceil(chords / 4) if kind == "CIRCLE" else math.ceil(chords)
    angles = np.linspace(begin, begin + turn, n + 1)
    along = angles if kind == "ELLIPSE" else np.degrees(angles)
    return kind == "CIRCLE", _points(entity.vertices(along.tolist()))


def _spline(entity: Any, sag: float, limits: Limits, error: _Error) -> Iterable[Any]:
    numbers = [*np.ravel(_points(entity.control_points)), *np.ravel(_points(entity.fit_points))]
    numbers += [*entity.knots, *entity.weights]
    if not np.isfinite(numbers).all():
        return ()
    most = limits.chords
    limits.check("chords", max(len(entity.control_points), len(entity.fit_points)), error)
    vertices = list(islice(entity.flattening(sag), most + 2))
    limits.check("chords", len(vertices) - 1, error)
    return vertices


def _points(vertices: Iterable[Any]) -> Array:
    return np.array([(v[0], v[1], v[2]) for v in vertices], np.float64).reshape(-1, 3)


def _moved(vertices: Array, places: Array) -> Array:
    """Return vertices (v, 3) as seen from above where they stand, shape (k, v, 2)."""
    return np.asarray(vertices @ places[:, :3, :2] + places[:, 3, None, :2])


def _rings(placed: Array) -> Array:
    """Return x, y, r of what was drawn as circles (k, v, 2); NaN for those that are none now."""
    n = (placed.shape[1] - 1) // 4
    center = (placed[:, 0] + placed[:, 2 * n]) / 2
    a, b = placed[:, 0] - center, placed[:, n] - center
    radius = np.linalg.norm(a, axis=1)
    skew = abs((a * b).sum(axis=1)) + abs(radius**2 - (b * b).sum(axis=1))
    round_ = (skew <= 1e-6 * radius**2) & (radius > 0)
    return np.where(round_[:, None], np.column_stack((center, radius)), np.nan)
