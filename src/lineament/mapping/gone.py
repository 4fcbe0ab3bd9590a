"""What was seen once and looked through since: people, furniture that moved, doors that opened."""

import numpy as np
from numpy.typing import NDArray

from ..scan import Array
from ..walls import Numbers, Records, lengths_of, moved, turned_back, unit
from ..walls.sights import GAP, extents, on_lines, stretches
from .drive_map import passed
from .local_map import beams_of, some
from .loops import Survey

#: Walls are looked through by pieces so long [m]; by so many beams of a key frame.
_PIECE, _BEAMS = 0.5, 360
#: A piece is gone if at least so many key frames look through it, and more than see it.
_THROUGH = 2

Flags = NDArray[np.bool_]


def standing(survey: Survey, views: int, is_sure: Flags) -> tuple[Numbers, Array, Array, Numbers]:
    """Return stretches of the lines of a survey that were seen so often, and still stand.

    As `stretches` does, without what was looked through.
    """
    w, spans = survey.sights["wall"], extents(survey.sights, survey.poses, survey.lines)
    w, begin, end, counts = stretches(w, *spans, GAP, views)
    pieces, of = pieces_of(on_lines(survey.lines, w, begin, end, counts))
    left = ~looked_through(survey, pieces, w[of], is_sure)
    along = along_lines(survey.lines[w[of]], pieces)[left]
    at, begin, end, _ = stretches(of[left], along[:, 0], along[:, 1], gap=1e-6)
    return w[at], begin, end, counts[at]


def looked_through(survey: Survey, pieces: Records, lines: Numbers, is_sure: Flags) -> Flags:
    """Return which pieces, each on a line, more sure key frames look through than see."""
    through = _count_through(survey, pieces, is_sure)
    middles = along_lines(survey.lines[lines], pieces).mean(axis=1)
    spans = (survey.sights["wall"], *extents(survey.sights, survey.poses, survey.lines))
    sees = _covering(spans, lines, middles)
    return np.asarray((through >= _THROUGH) & (through > sees))


def along_lines(lines: Records, pieces: Records) -> Array:
    """Return where pieces begin and end along lines, one for each, from their centroids on [m]."""
    arms = np.stack((pieces["start"], pieces["end"]), axis=1) - lines["centroid"][:, None]
    return np.asarray((arms * unit(lines["angle"])[:, None]).sum(axis=2))


def pieces_of(walls: Records) -> tuple[Records, Numbers]:
    """Return pieces of walls, along each, and the number of the wall of each."""
    counts = np.maximum(np.ceil(lengths_of(walls) / _PIECE), 1).astype(np.int64)
    of = np.repeat(np.arange(len(walls)), counts)
    k = np.arange(len(of)) - (np.cumsum(counts) - counts)[of]
    pieces, along = walls[of], walls["end"][of] - walls["start"][of]
    for name, at in (("start", k), ("end", k + 1)):
        pieces[name] = walls["start"][of] + (at / counts[of])[:, None] * along
    return pieces, of


def _count_through(survey: Survey, pieces: Records, is_sure: Flags) -> Numbers:
    """Return how many key frames whose poses are sure look through each piece."""
    counts, middles = np.zeros(len(pieces), np.int64), (pieces["start"] + pieces["end"]) / 2
    for k in np.flatnonzero(is_sure).tolist():
        frame, (x, y, _) = survey.frames[k], survey.pose(k)
        beams = some(beams_of(frame.features, frame.scan), _BEAMS)
        reach = beams[:, 4].max(initial=0.0) + _PIECE
        near = np.flatnonzero(np.hypot(*(middles - (x, y)).T) < reach)
        here = moved(pieces[near], survey.pose(k))
        (x, y), (to_x, to_y) = here["start"].T, here["end"].T
        # Of those seen from their right, only walls with two sides may be seen by this frame.
        is_back, is_both = x * to_y <= y * to_x, here["side"] == 0
        here[is_back] = turned_back(here[is_back])
        counts[near] += passed(here, beams) & (~is_back | is_both)
    return counts


def _covering(spans: tuple[Numbers, Array, Array], walls: Numbers, along: Array) -> Numbers:
    """Return how many sights of walls w, from low to high, cover places along walls."""
    w, *tips = spans
    before = [np.searchsorted(np.sort(keys_of(w, of)), keys_of(walls, along)) for of in tips]
    return before[0] - before[1]


def keys_of(w: Numbers, along: Array) -> Array:
    """Return numbers in the order of walls, and of places along each [m]."""
    return np.asarray(1e5 * w + along)
