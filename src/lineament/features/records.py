"""The fields of the features, declared once: one row of `FIELDS` each.

From it come the types of the records, the columns and units of the table of features
(`features.tables`), the points of a cloud (`output.feature_points`), and where kernels write.

Numba can write records, but takes half a minute to compile it. So kernels see a table of records
as a matrix of float64, or of int32, over the same memory, and each field by its column there.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Field(NamedTuple):
    """A field of the records of a table: its NumPy type, unit and meaning.

    `columns` and `points` name what its numbers fill in the table of features and in a point of
    the cloud; those of a symmetric matrix are its upper triangle, row by row.
    """

    table: str
    name: str
    form: str
    unit: str
    about: str
    columns: str
    points: str


#: A segment is a straight piece of a surface. Its covariance is that of (offset at the centroid
#: along the left normal of the direction [m], angle [rad]), of what is random: the noise. `misfit`
#: is what the surface itself is off a straight line, the same in every scan. Beams run from
#: `first_beam` to `last_beam`, over the seam of a full circle where the first is larger.
#:
#: A corner is a vertex between two segments. `kind` is "corner" or "slit" (the segments end beside
#: a hole at their vertex); `response` is the rise of χ² or a length, as the method has it.
#:
#: An edge is where a segment ends before a jump, and few measurements show its face. It may be a
#: silhouette, which moves with the sensor. `side` is the end of its segment: "start" or "end".
#:
#: An arc is a circular piece of a surface; its covariance is that of (x, y, radius).
#:
#: A breakpoint is where a surface ends without a corner. `beam` are the valid beams on either side
#: (-1 past an end of the scan), `kind` is "jump" (depth changes between them, `position` is on the
#: nearer side), "gap" (no valid beam between them where surfaces could go on) or "scan_end".
FIELDS = tuple(
    Field(*row)
    for row in (
        ("segments", "start", "(2,)f8", "m", "start", "start_x start_y", "start_x start_y"),
        ("segments", "end", "(2,)f8", "m", "end", "end_x end_y", "end_x end_y"),
        ("segments", "centroid", "(2,)f8", "m", "centroid", "x y", "x y"),
        ("segments", "angle", "f8", "rad", "direction from start to end", "angle", "angle"),
        ("segments", "covariance", "(2,2)f8", "m², m·rad, rad²", "of offset and angle",
         "cov_00 cov_01 cov_11", "c00 c01 c11"),
        ("segments", "first_beam", "i4", "", "first beam", "first_beam", "first_beam"),
        ("segments", "last_beam", "i4", "", "last beam", "last_beam", "last_beam"),
        ("segments", "n_points", "i4", "", "number of valid beams", "n_points", "n_points"),
        ("segments", "rms", "f8", "m", "rms distance of its points", "rms", "rms"),
        ("segments", "misfit", "f8", "m", "rms distance of its surface from a straight line",
         "misfit", "misfit"),
        ("segments", "cluster", "i4", "", "index of its cluster", "cluster", ""),
        ("segments", "length", "f8", "m", "distance from start to end", "length", "length"),
        ("corners", "position", "(2,)f8", "m", "position", "x y", "x y"),
        ("corners", "covariance", "(2,2)f8", "m²", "of x and y", "cov_00 cov_01 cov_11",
         "c00 c01 c11"),
        ("corners", "opening", "f8", "rad", "interior angle between its arms", "opening",
         "opening"),
        ("corners", "convex", "?", "", "points towards the sensor", "convex", "convex"),
        ("corners", "beam", "i4", "", "its beam", "beam", "first_beam last_beam"),
        ("corners", "response", "f8", "", "strength, in the unit of the method", "response", ""),
        ("corners", "segments", "(2,)i4", "", "indices of its segments, or -1",
         "segment_before segment_after", "segment_a segment_b"),
        ("corners", "quality", "f8", "", "share found again from another place, 0 to 1",
         "quality", "quality"),
        ("corners", "kind", "U6", "", "corner or slit", "corner", "corner"),
        ("edges", "position", "(2,)f8", "m", "position", "x y", "x y"),
        ("edges", "covariance", "(2,2)f8", "m²", "of x and y", "cov_00 cov_01 cov_11",
         "c00 c01 c11"),
        ("edges", "quality", "f8", "", "share found again from another place, 0 to 1",
         "quality", "quality"),
        ("edges", "beam", "i4", "", "its beam", "beam", "first_beam last_beam"),
        ("edges", "segment", "i4", "", "index of its segment", "segment", "segment_a"),
        ("edges", "side", "U5", "", "which end of its segment: start or end", "side", "side"),
        ("arcs", "center", "(2,)f8", "m", "center", "x y", "x y"),
        ("arcs", "radius", "f8", "m", "", "radius", "radius"),
        ("arcs", "covariance", "(3,3)f8", "m²", "of x, y and radius",
         "cov_00 cov_01 cov_02 cov_11 cov_12 cov_22", "c00 c01 c02 c11 c12 c22"),
        ("arcs", "first_beam", "i4", "", "first beam", "first_beam", "first_beam"),
        ("arcs", "last_beam", "i4", "", "last beam", "last_beam", "last_beam"),
        ("arcs", "n_points", "i4", "", "number of valid beams", "n_points", "n_points"),
        ("arcs", "rms", "f8", "m", "rms distance of its points", "rms", "rms"),
        ("breakpoints", "beam", "(2,)i4", "", "beams on either side", "first_beam last_beam", ""),
        ("breakpoints", "position", "(2,)f8", "m", "position", "x y", ""),
        ("breakpoints", "kind", "U8", "", "jump, gap or scan_end", "breakpoint", ""),
        ("breakpoints", "occluder", "i4", "", "beam of the nearer side of a jump, or -1",
         "occluder", ""),
    )
)  # fmt: skip

#: The tables of a scan, in the order in which they are written, and the type of their records.
TABLES = {
    table: np.dtype([(f.name, f.form) for f in FIELDS if f.table == table], align=True)
    for table in dict.fromkeys(field.table for field in FIELDS)
}
SEGMENT, CORNER, EDGE, ARC, BREAKPOINT = TABLES.values()
#: The number of each table in that order.
SEGMENTS, CORNERS, EDGES, ARCS, BREAKPOINTS = range(len(TABLES))

#: The columns of the table of features in their order; those of other fields follow.
COLUMNS = (
    "kind scan stamp index x y angle start_x start_y end_x end_y cov_00 cov_01 cov_11 cov_02 "
    "cov_12 cov_22 radius opening convex response quality corner beam segment_before "
    "segment_after first_beam last_beam n_points rms misfit cluster breakpoint occluder"
)
#: Unit and meaning of the columns that are not those of one field.
SHARED_COLUMNS = {
    "kind": ("", "segment, corner, edge, arc, breakpoint or cluster"),
    "scan": ("", "index of the scan in its log, from 0"),
    "stamp": ("s", "stamp of the scan"),
    "index": ("", "index among the features of its kind in its scan"),
    "x": ("m", "segment: centroid; corner, edge, breakpoint: position; arc: center"),
    "y": ("m", "as x"),
    "cov_00": ("m²", "of segment (offset, angle), corner, edge (x, y), arc (x, y, radius)"),
    "cov_01": ("m² or m·rad", "as cov_00; of a segment m·rad"),
    "cov_11": ("m² or rad²", "as cov_00; of a segment rad²"),
    "cov_02": ("m²", "of arc (x, y, radius)"),
    "cov_12": ("m²", "as cov_02"),
    "cov_22": ("m²", "as cov_02"),
    "quality": ("", "corner, edge: share found again from another place, 0 to 1"),
    "beam": ("", "corner, edge: its beam"),
    "segment_before": ("", "corner: index of the segment before it, or -1"),
    "segment_after": ("", "corner: index of the segment after it, or -1"),
    "first_beam": ("", "segment, arc, cluster: first beam; breakpoint: beam before"),
    "last_beam": ("", "segment, arc, cluster: last beam; breakpoint: beam after"),
    "n_points": ("", "segment, arc, cluster: number of valid beams"),
    "rms": ("m", "segment, arc: rms distance of its points"),
}
#: The fields of a point in their order; those of other fields follow.
POINTS = (
    "x y z kind track start_x start_y end_x end_y angle radius opening convex rms misfit quality "
    "c00 c01 c02 c11 c12 c22 first_beam last_beam n_points segment_a segment_b corner"
)

KIND_NAMES = ("jump", "gap", "scan_end")
JUMP, GAP, SCAN_END = 0, 1, 2
CORNER_KINDS = ("corner", "slit")
SHARP, SLIT = 0, 1
SIDES = ("start", "end")
AT_START, AT_END = 0, 1
#: The values of the field that is text, by table, and as the int32 words of its text.
TEXTS = {"corners": CORNER_KINDS, "edges": SIDES, "breakpoints": KIND_NAMES}
KIND_WORDS = np.array(KIND_NAMES, "U8").view(np.int32).reshape(3, 8)
CORNER_WORDS = np.array(CORNER_KINDS, "U6").view(np.int32).reshape(2, 6)
SIDE_WORDS = np.array(SIDES, "U5").view(np.int32).reshape(2, 5)


def words(records: NDArray[np.void]) -> NDArray[np.float64]:
    """See an array of records as its float64 words, two int32 words each."""
    return records.view(np.float64).reshape(len(records), records.dtype.itemsize // 8)


def make_records(table: str, rows: Sequence[Mapping[str, Any]]) -> NDArray[np.void]:
    """Make records of a table, read-only, from their fields by name; what is left out is 0."""
    records = np.zeros(len(rows), TABLES[table])
    for record, row in zip(records, rows, strict=True):
        for name, value in row.items():
            record[name] = value
    records.flags.writeable = False
    return records


def numbers(shape: tuple[int, ...]) -> list[int]:
    """Return which of a field's numbers there are to know: of a matrix, its upper triangle."""
    places = enumerate(np.ndindex(shape))
    return [i for i, place in places if len(place) < 2 or place[0] <= place[1]]


def text_codes(table: str, texts: NDArray[np.str_]) -> NDArray[np.int32]:
    """Return the index of each text among those of its table, -1 of one that is not there."""
    codes = np.full(len(texts), -1, np.int32)
    for code, name in enumerate(TEXTS[table]):
        codes[texts == name] = code
    return codes


def _at(dtype: np.dtype[np.void], names: str) -> list[int]:
    """Return where fields are among the words of a record: of 8 bytes for floats, else of 4."""
    fields = [dtype.fields[name] for name in names.split()]  # type: ignore[index]
    return [offset // (8 if form.base.kind == "f" else 4) for form, offset, *_ in fields]


S_START, S_END, S_CENTROID, S_ANGLE, S_COVARIANCE, S_RMS, S_MISFIT, S_LENGTH = _at(
    SEGMENT, "start end centroid angle covariance rms misfit length"
)
S_FIRST, S_LAST, S_POINTS, S_CLUSTER = _at(SEGMENT, "first_beam last_beam n_points cluster")
C_POSITION, C_COVARIANCE, C_OPENING, C_RESPONSE, C_QUALITY = _at(
    CORNER, "position covariance opening response quality"
)
C_CONVEX, C_BEAM, C_SEGMENTS, C_KIND = _at(CORNER, "convex beam segments kind")
E_POSITION, E_COVARIANCE, E_QUALITY = _at(EDGE, "position covariance quality")
E_BEAM, E_SEGMENT, E_SIDE = _at(EDGE, "beam segment side")
A_CENTER, A_RADIUS, A_COVARIANCE, A_RMS = _at(ARC, "center radius covariance rms")
A_FIRST, A_LAST, A_POINTS = _at(ARC, "first_beam last_beam n_points")
B_POSITION, B_BEAM, B_KIND, B_OCCLUDER = _at(BREAKPOINT, "position beam kind occluder")
