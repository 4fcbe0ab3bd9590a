"""Features as sets of beams: how they overlap, and which beams lie on what is too small."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array

__all__ = [
    "MIN_BEAMS",
    "beam_masks",
    "beam_spans",
    "beams_of",
    "common_beams",
    "marked_beams",
    "on_small_surfaces",
    "overlap_ratios",
    "shared_beams",
]

#: First beam and the one behind the last, (K, 2); at or beyond n where it lies over the seam.
Spans = NDArray[np.int64]

#: A true feature with fewer beams is too small to be demanded.
MIN_BEAMS = 6


def common_beams(found: Features, truth: Features) -> int:
    """Return the number of beams of the scan that both are of."""
    n, expected = len(found.clusters), len(truth.clusters)
    if n != expected:
        raise ValueError(f"found is of a scan of {n} beams, expected {expected} as in the truth")
    return n


def beam_spans(first: NDArray[np.int32], last: NDArray[np.int32], n: int) -> Spans:
    """Span from the first to the last of n beams, over the seam where first > last.

    Examples
    --------
    >>> beam_spans(np.array([1, 3]), np.array([2, 0]), 4).tolist()
    [[1, 3], [3, 5]]
    """
    begin = first.astype(np.int64)
    return np.column_stack((begin, begin + (last - begin) % n + 1))


def beams_of(table: NDArray[np.void], n: int) -> Spans:
    """Spans of segments or arcs."""
    return beam_spans(table["first_beam"], table["last_beam"], n)


def beam_masks(spans: Spans, n: int) -> NDArray[np.bool_]:
    """Which of n beams lie in each span, shape (K, n).

    Examples
    --------
    >>> beam_masks(np.array([[1, 3], [3, 5]]), 4).astype(int)
    array([[0, 1, 1, 0],
           [1, 0, 0, 1]])
    """
    beam, begin, end = np.arange(n), spans[:, :1], spans[:, 1:]
    return np.asarray(((begin <= beam) & (beam < end)) | (beam + n < end))


def shared_beams(spans: Spans, others: Spans, n: int) -> NDArray[np.int64]:
    """Return how many beams each two spans have in common, shape (F, T).

    Examples
    --------
    >>> shared_beams(np.array([[1, 3]]), np.array([[0, 2], [3, 6]]), 4)
    array([[1, 1]])
    """
    # One of them may be a turn ahead of the other.
    others = others[:, np.newaxis] + n * np.array([[-1], [0], [1]])
    mine = spans[:, np.newaxis, np.newaxis]
    begin = np.maximum(mine[..., 0], others[..., 0])
    end = np.minimum(mine[..., 1], others[..., 1])
    return np.asarray(np.maximum(end - begin, 0).sum(axis=2))


def overlap_ratios(spans: Spans, others: Spans, n: int) -> Array:
    """Beams in both over beams in either (intersection over union), shape (F, T).

    Examples
    --------
    >>> overlap_ratios(np.array([[0, 3]]), np.array([[1, 4]]), 4)
    array([[0.5]])
    """
    shared = shared_beams(spans, others, n)
    sizes, other_sizes = spans[:, 1] - spans[:, 0], others[:, 1] - others[:, 0]
    return np.asarray(shared / (sizes[:, np.newaxis] + other_sizes - shared))


def marked_beams(spans: Spans, marks: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return how many beams of each span are marked, shape (K,).

    Examples
    --------
    >>> marked_beams(np.array([[0, 2], [2, 5]]), np.array([True, True, False, False]))
    array([2, 1])
    """
    # Twice around: a span may go on over the seam.
    before = np.concatenate(([0], np.cumsum(np.tile(marks, 2))))
    return np.asarray(before[spans[:, 1]] - before[spans[:, 0]])


def on_small_surfaces(spans: Spans, truth: Features) -> NDArray[np.bool_]:
    """Whether at least half of each span's beams meet a surface too small to be demanded."""
    small = np.zeros(len(truth.clusters), dtype=np.bool_)
    for table in (truth.segments, truth.arcs):
        few = table[table["n_points"] < MIN_BEAMS]
        small |= beam_masks(beams_of(few, len(small)), len(small)).any(axis=0)
    return np.asarray(2 * marked_beams(spans, small) >= spans[:, 1] - spans[:, 0])
