"""Features of several scanners that are one: found by χ², and weighted by their information."""

import numpy as np
from numpy.typing import NDArray

from ..scan import Array
from ..walls import Numbers, Records, bent, covariance_at, lengths_of, shared, summed, unit, wrapped
from ..walls.sights import GAP, SIGHT, lines_of, squared_misfits

#: Lines whose directions differ by more are never one: they are not of one side of a wall [rad].
_TURN = 0.35
#: Added to covariances, which are 0 where there is no noise at all [m², rad²].
_LEAST = 1e-18
#: The fields that are the place of a record, by table.
_PLACES = {"corners": ("position",), "edges": ("position",), "arcs": ("center", "radius")}


def grouped(squares: Array, limit: float) -> Numbers:
    """Return the number of the group of each of n features, by the χ² (n, n) of their pairs.

    All pairs of a group are below the limit; the most alike come first.
    """
    near, labels = squares < limit, np.arange(len(squares))
    one, other = np.nonzero(np.triu(near))
    for k in np.argsort(squares[one, other], kind="stable").tolist():
        these, those = (np.flatnonzero(labels == labels[pair[k]]) for pair in (one, other))
        if near[np.ix_(these, those)].all():
            labels[those] = labels[these[0]]
    return np.asarray(np.unique(labels, return_inverse=True)[1])


def squares_of_segments(segments: Records, owners: Numbers) -> Array:
    """Return the χ² (n, n) of offset and angle of segments; inf of one owner, or too far apart.

    It is that in the middle of what two share, or of the gap between them, with their misfits.
    """
    turn = np.abs(wrapped(segments["angle"][:, None] - segments["angle"]))
    i, j = np.nonzero(_comparable(segments, owners) & (turn < _TURN))
    one, other, u = segments[i], segments[j], unit(segments["angle"])
    spans = [
        np.sort(np.einsum("nki,ni->nk", _ends(part) - one["centroid"][:, None], u[i]))
        for part in (one, other)
    ]
    first = np.maximum(spans[0][:, 0], spans[1][:, 0])
    last = np.minimum(spans[0][:, 1], spans[1][:, 1])
    middle = (first + last) / 2
    arm = one["centroid"] + middle[:, None] * u[i] - other["centroid"]
    offset = u[j, 0] * arm[:, 1] - u[j, 1] * arm[:, 0]
    off = np.column_stack((offset, wrapped(one["angle"] - other["angle"])))
    spread = covariance_at(one["covariance"], middle)
    spread += covariance_at(other["covariance"], (arm * u[j]).sum(axis=1))
    shorter, rough = np.minimum(lengths_of(one), lengths_of(other)), roughness(segments)
    spread += bent(rough[i] + rough[j], shorter)
    squares = _squares(len(segments), (i, j), off, spread)
    apart = first - last > GAP
    squares[i[apart], j[apart]] = np.inf
    return np.maximum(squares, squares.T)  # They differ by how far the other one is turned.


def squares_of_places(
    kind: str, records: Records, owners: Numbers, same: Numbers, rough: Array | float = 0.0
) -> Array:
    """Return the χ² (n, n) of the places of records; inf of one owner, or if not the `same`.

    `rough` (n,) is the variance that its surfaces give to each [m²].
    """
    i, j = np.nonzero(_comparable(records, owners) & (same[:, None] == same))
    places = _places(kind, records)
    spread = records["covariance"] + np.multiply.outer(
        np.broadcast_to(rough, len(records)), np.eye(places.shape[1])
    )
    return _squares(len(records), (i, j), places[i] - places[j], spread[i] + spread[j])


def roughness(segments: Records) -> Array:
    """Return the squared misfits (n,) of segments, less what noise alone explains [m²]."""
    misfit, noise = squared_misfits(segments)
    return np.asarray(np.maximum(misfit - noise, 0.0))


def fused_segments(segments: Records, labels: Numbers) -> tuple[Records, NDArray[np.bool_]]:
    """Return a segment for each group; and which ends (n, 2) of the old ones are ends of these."""
    found = segments[_first(labels, -segments["n_points"])]
    many = np.bincount(labels, minlength=len(found)) > 1
    sights = shared(segments[many[labels]], SIGHT)
    sights["wall"] = (np.cumsum(many) - 1)[labels[many[labels]]]
    sights["covariance"] += _LEAST * np.eye(2)
    lines = lines_of(sights, np.zeros((1, 3)), int(many.sum()))
    for name in ("centroid", "angle", "covariance"):
        found[name][many] = lines[name]
    u, is_end = unit(found["angle"]), np.zeros((len(segments), 2), bool)
    arms = _ends(segments) - found["centroid"][labels][:, None]
    along = np.einsum("nki,ni->nk", arms, u[labels])
    for k, (name, beam) in enumerate((("start", "first_beam"), ("end", "last_beam"))):
        outermost = _first(labels, along[:, k] * (1 - 2 * k))
        is_end[outermost, k] = True
        found[beam] = segments[beam][outermost]
        ends = found["centroid"] + along[outermost, k, None] * u
        found[name][many] = ends[many]
    found["length"][many] = lengths_of(found)[many]
    return _pooled(found, segments, labels), is_end


def fused_places(kind: str, records: Records, labels: Numbers) -> Records:
    """Return a record for each group: its place by information, all else of the surest of it."""
    found = records[_first(labels, np.trace(records["covariance"], axis1=1, axis2=2))]
    count = len(found)
    many = np.bincount(labels, minlength=count) > 1
    parts, at = records[many[labels]], labels[many[labels]]
    size = records["covariance"].shape[1]
    information = np.asarray(np.linalg.inv(parts["covariance"] + _LEAST * np.eye(size)), float)
    weighted = np.einsum("nij,nj->ni", information, _places(kind, parts))
    spread = np.linalg.inv(summed(information, at, count)[many])
    places = np.einsum("nij,nj->ni", spread, summed(weighted, at, count)[many])
    found["covariance"][many] = spread
    found[_PLACES[kind][0]][many] = places[:, :2]
    if kind == "arcs":
        found["radius"][many] = places[:, 2]
        _pooled(found, records, labels)
    return found


def _comparable(records: Records, owners: Numbers) -> NDArray[np.bool_]:
    """Whether pairs (n, n) are of different owners, and have covariances."""
    known = np.isfinite(records["covariance"]).all(axis=(1, 2))
    return np.asarray((owners[:, None] != owners) & known & known[:, None])


def _squares(count: int, at: tuple[Numbers, Numbers], off: Array, spread: Array) -> Array:
    squares = np.full((count, count), np.inf)
    inverse = np.linalg.inv(spread + _LEAST * np.eye(off.shape[1]))
    squares[at] = np.einsum("ni,nij,nj->n", off, inverse, off)
    return squares


def _ends(segments: Records) -> Array:
    return np.stack((segments["start"], segments["end"]), axis=1)


def _places(kind: str, records: Records) -> Array:
    return np.column_stack([records[name] for name in _PLACES[kind]])


def _first(labels: Numbers, rank: Array) -> Numbers:
    """Return the index of what comes first in each group."""
    order = np.lexsort((rank, labels))
    return np.asarray(order[np.unique(labels[order], return_index=True)[1]])


def _pooled(found: Records, records: Records, labels: Numbers) -> Records:
    """Give each group the points of all its records, and their mean squares."""
    points = records["n_points"]
    found["n_points"] = np.bincount(labels, points, len(found))
    weights = np.maximum(found["n_points"], 1)
    for name in {"rms", "misfit"} & {*(found.dtype.names or ())}:
        squares = np.bincount(labels, points * records[name] ** 2, len(found))
        found[name] = np.sqrt(squares / weights)
    return found
