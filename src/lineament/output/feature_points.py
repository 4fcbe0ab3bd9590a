"""The features of a scan as points with named fields: what a PointCloud2 of them holds."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..features.records import FIELDS, POINTS, numbers, text_codes

if TYPE_CHECKING:
    from ..motion import Tracks

#: Tables that have points, in the order of the values of the field `kind`.
_TABLES = ("segments", "corners", "arcs", "edges")
#: Types of the fields of a point.
_FORMS = {"z": "<f4", "kind": "<u4", "track": "<i4"} | {
    point: "<f4" if np.dtype(field.form).base.kind in "fb" else "<i4"
    for field in FIELDS
    for point in field.points.split()
}

#: One feature, in fields of four bytes: position (centroid of a segment, position of a corner or an
#: edge, centre of an arc; z = 0) [m], kind (0 segment, 1 corner, 2 arc, 3 edge), track (-1 without
#: tracking), and what `lineament.features.records.FIELDS` leads to a point: `convex` is 0 or 1,
#: `corner` 0 corner, 1 slit; `side` 0 start, 1 end; a corner and an edge have their beam in both
#: beams. A field that a kind does not fill is NaN, or -1 where it is an integer.
FEATURE_POINT = np.dtype(
    [(name, _FORMS[name]) for name in dict.fromkeys((*POINTS.split(), *_FORMS))]
)


#: A point of each kind of which only the kind is known.
_EMPTY = np.zeros(len(_TABLES), FEATURE_POINT)
for _name, _form in _FORMS.items():
    _EMPTY[_name] = {"<f4": np.nan, "<i4": -1, "<u4": 0}[_form]
_EMPTY["z"], _EMPTY["kind"] = 0.0, range(len(_TABLES))


def _moves(table: str) -> list[tuple[str, str, int]]:
    """List field of a record, field of a point, and which of the numbers of the one it takes."""
    moves = []
    for field in FIELDS:
        if field.table == table and field.form[0] != "U":
            points, places = field.points.split(), numbers(np.dtype(field.form).shape)
            moves += [(field.name, *move) for move in zip(points, cycle(places), strict=False)]
    return moves


_MOVES = {table: _moves(table) for table in _TABLES}


def feature_points(features: Features, tracks: Tracks | None = None) -> NDArray[np.void]:
    """Make one record a feature, in its frame: segments, corners, arcs, then edges; shape (n,).

    The segments of a corner are thus also the indices of their records. Those that are not finite
    are there too. `tracks` are the numbers that the features have from scan to scan; a ValueError
    if they are those of other features.
    """
    tables = [getattr(features, name) for name in _TABLES]
    counts = [len(table) for table in tables]
    points, begin = np.repeat(_EMPTY, counts), 0
    with np.errstate(over="ignore"):  # What no float32 holds is infinite.
        for name, table in zip(_TABLES, tables, strict=True):
            if len(table):
                rows, begin = points[begin : begin + len(table)], begin + len(table)
                for field, point, place in _MOVES[name]:
                    rows[point] = table[field].reshape(len(table), -1)[:, place]
    corners, edges = points[counts[0] :][: counts[1]], points[len(points) - counts[3] :]
    corners["corner"] = text_codes("corners", features.corners["kind"])
    edges["side"] = text_codes("edges", features.edges["side"])
    if tracks is not None:
        numbers_of = tracks.segments, tracks.corners, tracks.arcs
        if [*map(len, numbers_of)] != counts[:3]:
            raise ValueError(
                f"tracks have {', '.join(str(len(n)) for n in numbers_of)} segments, corners and "
                f"arcs, expected {', '.join(map(str, counts[:3]))}, as the features"
            )
        points["track"][: len(points) - counts[3]] = np.concatenate(numbers_of)
    return points
