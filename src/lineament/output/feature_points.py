"""The features of a scan as points with named fields: what a PointCloud2 of them holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES, Features
from ..features.records import FIELDS, POINTS, kind_codes, numbers

if TYPE_CHECKING:
    from ..motion import Tracks

#: Values of the field `kind`.
SEGMENT_POINT, CORNER_POINT, ARC_POINT = range(3)
_TABLES = ("segments", "corners", "arcs")
#: Types of the fields of a point.
_FORMS = {"z": "<f4", "kind": "<u4", "track": "<i4"} | {
    point: "<f4" if np.dtype(field.form).base.kind in "fb" else "<i4"
    for field in FIELDS
    for point in field.points.split()
}

#: One feature, in fields of four bytes: position (centroid of a segment, position of a corner,
#: centre of an arc; z = 0) [m], kind (0 segment, 1 corner, 2 arc), track (-1 without tracking), and
#: what `lineament.features.records.FIELDS` leads to a point: `convex` is 0 or 1, `corner` 0 corner,
#: 1 slit, 2 edge, a corner has its beam in both beams. A field that a kind does not fill is NaN, or
#: -1 where it is an integer.
FEATURE_POINT = np.dtype(
    [(name, _FORMS[name]) for name in dict.fromkeys((*POINTS.split(), *_FORMS))]
)


def _moves(table: str, kind: str) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return which words of a record, all floats or all integers, go to which words of a point."""
    taken: list[int] = []
    put: list[int] = []
    dtype, names = TABLES[table], FEATURE_POINT.names or ()
    for field in FIELDS:
        form = np.dtype(field.form)
        if field.table == table and form.base.kind == kind:
            first = dtype.fields[field.name][1] // form.base.itemsize  # type: ignore[index]
            words = [first + i for i in numbers(form.shape)]
            points = [names.index(name) for name in field.points.split()]
            taken += words * (len(points) // len(words))
            put += points
    return np.array(taken), np.array(put)


_MOVES = {table: (_moves(table, "f"), _moves(table, "i")) for table in _TABLES}
#: Points of which only the kind is known, as words.
_EMPTY = np.zeros(3, FEATURE_POINT)
for _name, _form in _FORMS.items():
    _EMPTY[_name] = {"<f4": np.nan, "<i4": -1, "<u4": 0}[_form]
_EMPTY["z"], _EMPTY["kind"] = 0.0, range(3)
_EMPTY_WORDS = _EMPTY.view("<i4").reshape(3, -1)


def feature_points(features: Features, tracks: Tracks | None = None) -> NDArray[np.void]:
    """Make one record a feature, in its frame: segments, then corners, then arcs; shape (n,).

    The segments of a corner are thus also the indices of their records. Those that are not finite
    are there too. `tracks` are the numbers that the features have from scan to scan; a ValueError
    if they are those of other features.
    """
    tables = [getattr(features, name) for name in _TABLES]
    counts = [len(table) for table in tables]
    ints = np.repeat(_EMPTY_WORDS, counts, axis=0)
    floats, points, begin = ints.view("<f4"), ints.view(FEATURE_POINT).reshape(len(ints)), 0
    with np.errstate(over="ignore"):  # What no float32 holds is infinite.
        for name, table in zip(_TABLES, tables, strict=True):
            if len(table) == 0:
                continue
            # A copy has no gaps.
            data, end = table.tobytes(), begin + len(table)
            (taken, put), (ints_taken, ints_put) = _MOVES[name]
            words = np.frombuffer(data, "f8").reshape(len(table), -1)
            floats[begin:end, put] = words[:, taken]
            words = np.frombuffer(data, "i4").reshape(len(table), -1)
            ints[begin:end, ints_put] = words[:, ints_taken]
            begin = end
    corners = slice(counts[0], counts[0] + counts[1])
    points["convex"][corners] = features.corners["convex"]
    points["corner"][corners] = kind_codes("corners", features.corners["kind"])
    if tracks is not None:
        numbers_of = tracks.segments, tracks.corners, tracks.arcs
        if [*map(len, numbers_of)] != counts:
            raise ValueError(
                f"tracks have {', '.join(str(len(n)) for n in numbers_of)} segments, corners and "
                f"arcs, expected {', '.join(map(str, counts))}, as the features"
            )
        points["track"] = np.concatenate(numbers_of)
    return points
