"""Parts of a drive that hang together, and where along it the poses are not sure."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..scan import Array
from ..walls import Numbers, Records, unit
from ..walls.sights import placed
from .adjust import Adjusted, edges_of, errors_of_motions
from .drive_map import UNKNOWN, steps_between
from .following import UNSURE, WORST, WORST_TURN

#: A part is of so much way; less is not sure of itself [m].
_LEAST = 5.0
#: Parts are drawn so far from each other [m].
_BESIDE = 6.0
#: Pairs of poses whose covariances are found at a time.
_BATCH = 100


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Parts of a drive.

    Attributes
    ----------
    numbers : ndarray, shape (n,)
        The part of each key frame; part 0 is that of the first.
    roots : ndarray, shape (p,)
        The key frame of each part beside which its others are known.
    deviations : ndarray, shape (p,)
        How badly places of the part are known beside that, at most: one standard deviation [m].
    unsure : ndarray, shape (m, 2)
        The key frames before and after each stretch on which the poses are not sure.
    """

    numbers: Numbers
    roots: Numbers
    deviations: Array
    unsure: Numbers

    @property
    def count(self) -> int:
        """How many parts there are."""
        return len(self.roots)

    def frames(self, part: int) -> Numbers:
        """Return the key frames of a part."""
        return np.flatnonzero(self.numbers == part)

    def within(self, edges: Records) -> Records:
        """Return the edges between key frames of one part."""
        first, last = self.numbers[edges["ends"]].T
        return np.asarray(edges[first == last])

    @property
    def is_sure(self) -> NDArray[np.bool_]:
        """Whether the pose of each key frame is sure, beside others of its part."""
        sure, last = np.ones(len(self.numbers), bool), len(self.numbers) - 1
        for before, after in self.unsure.tolist():
            sure[before + (before > 0) : after + (after == last)] = False
        return sure


def parts_of(found: Adjusted, chain: Records, is_doubted: NDArray[np.bool_]) -> Parts:
    """Find what hangs together, by the covariances of the adjusted poses.

    A stretch of the way is sure if each motion is known to `UNSURE`, and no key frame `is_doubted`;
    it counts if it is long. Stretches whose ends are known to each other to `WORST` are of one
    part. What lies between goes with what came before, and is not sure unless all of it is known.
    """
    n, solve = len(found.poses), found.solver()
    # What walls and loops add makes no motion less sure: most are sure by themselves.
    is_weak = ~_known(np.linalg.inv(chain["information"]), UNSURE)
    is_weak[is_weak] = ~_known(between(found.poses, chain["ends"][is_weak], solve), UNSURE)
    cuts = np.flatnonzero(is_weak | is_doubted[1:]) + 1
    runs = np.column_stack((np.append(0, cuts), np.append(cuts, n) - 1))
    way = np.cumsum(steps_between(found.poses))
    ways = way[runs[:, 1]] - way[runs[:, 0]]
    runs = runs[ways >= _LEAST] if ways.max() >= _LEAST else runs[[ways.argmax()]]
    labels, numbers = _joined(found.poses, runs, solve), np.zeros(n, np.int64)
    for (first, _), label in zip(runs[1:].tolist(), labels[1:].tolist(), strict=True):
        numbers[first:] = label
    gaps = np.column_stack((np.append(0, runs[:, 1]), np.append(runs[:, 0], n - 1)))
    weak = np.append(0, np.cumsum(is_weak))
    is_unsure = (weak[gaps[:, 1]] > weak[gaps[:, 0]]) | ~_known(
        between(found.poses, gaps, solve), UNSURE
    )
    roots = runs[np.unique(labels, return_index=True)[1], 0]
    ends = np.column_stack((roots[labels].repeat(2), runs.ravel()))
    deviations = np.zeros(len(roots))
    np.maximum.at(deviations, labels.repeat(2), _deviations(between(found.poses, ends, solve)))
    return Parts(numbers, roots, deviations, gaps[is_unsure])


def between(poses: Array, pairs: Numbers, solve: Callable[[Array], Array]) -> Array:
    """Covariances (m, 3, 3) of the motions between pairs of poses, the first of each its frame."""
    some = np.array_split(pairs, math.ceil(len(pairs) / _BATCH) or 1)
    return np.concatenate([_between(poses, of, solve) for of in some])


def _between(poses: Array, pairs: Numbers, solve: Callable[[Array], Array]) -> Array:
    frames, at = np.unique(pairs, return_inverse=True)
    rows, k = 3 * frames[:, None] + np.arange(3), len(frames)
    units = np.zeros((3 * len(poses), 3 * k))
    units[rows.ravel(), np.arange(3 * k)] = 1.0
    joint = (solve(units) if k else units)[rows.ravel()].reshape(k, 3, k, 3)
    a, b = at.reshape(-1, 2).T
    still = edges_of(pairs, np.zeros((len(pairs), 3)), np.tile(np.eye(3), (len(pairs), 1, 1)))
    both = np.concatenate(errors_of_motions(still, poses)[1:], axis=2)
    spreads = np.block([[joint[i, :, j] for j in (a, b)] for i in (a, b)])
    found = both @ spreads @ both.transpose(0, 2, 1)
    return np.asarray((found + found.transpose(0, 2, 1)) / 2)


def _known(covariances: Array, most: float) -> NDArray[np.bool_]:
    """Whether poses are known so well [m], and their turns not much worse."""
    return (_deviations(covariances) <= most) & (covariances[:, 2, 2] <= WORST_TURN**2)


def _deviations(covariances: Array) -> Array:
    """Largest deviations of the places (m,) [m]."""
    largest = np.linalg.eigvalsh(covariances[:, :2, :2])[:, 1]
    return np.asarray(np.sqrt(np.maximum(largest, 0.0)))


def _joined(poses: Array, runs: Numbers, solve: Callable[[Array], Array]) -> Numbers:
    """Return the number of the part of each run of key frames, by how their ends are known."""
    from scipy.sparse.csgraph import connected_components

    (one, other), ends = np.triu_indices(2 * len(runs), 1), runs.ravel()
    known = _known(between(poses, np.column_stack((ends[one], ends[other])), solve), WORST)
    near = np.zeros((len(runs), len(runs)), bool)
    near[one[known] // 2, other[known] // 2] = True
    return np.asarray(connected_components(near, directed=False)[1], np.int64)


def apart(
    found: Adjusted, chain: Records, sights: Records, parts: Parts
) -> tuple[Adjusted, Records, Records]:
    """Return poses and lines of which each part lies beside the others, motions, and sights.

    A wall is of one part, and no motion leads to another: the key frame after such a motion is
    known to 10 m beside the root of the part that it is in, so that all are determined.
    """
    if parts.count == 1:
        return found, chain, sights
    poses, sights = found.poses.copy(), sights.copy()
    of, (places, angles) = parts.numbers[sights["frame"]], placed(sights, poses)
    tips = [places + along[:, None] * unit(angles) for along in sights["ends"].T]
    boxes = boxes_of(np.concatenate((poses[:, :2], *tips)), np.append(parts.numbers, [of, of]))
    moves = beside(boxes, np.zeros(1, int))
    poses[:, :2] += moves[parts.numbers]
    walls, sights["wall"] = np.unique(sights["wall"] * parts.count + of, return_inverse=True)
    lines = found.lines[walls // parts.count]
    lines["centroid"] += moves[walls % parts.count]
    first, last = parts.numbers[chain["ends"]].T
    is_cut = first != last
    ends = np.column_stack((parts.roots[last], chain["ends"][:, 1]))[is_cut]
    ends = ends[ends[:, 0] != ends[:, 1]]
    free = edges_of(ends, np.zeros((len(ends), 3)), np.tile(UNKNOWN, (len(ends), 1, 1)))
    free["motion"] = errors_of_motions(free, poses)[0]
    return replace(found, poses=poses, lines=lines), np.append(chain[~is_cut], free), sights


def boxes_of(points: Array, parts: Numbers) -> Array:
    """Least and largest coordinates of the points of each part [m], shape (p, 2, 2)."""
    of_parts = [points[parts == k] for k in range(int(parts.max()) + 1)]
    return np.array([(of.min(axis=0), of.max(axis=0)) for of in of_parts])


def beside(boxes: Array, stay: Numbers) -> Array:
    """Return motions (p, 2) after which boxes lie in a row, to the right of those that stay [m]."""
    moves, low, high = np.zeros((len(boxes), 2)), boxes[stay, 0], boxes[stay, 1]
    right, bottom = high[:, 0].max(), low[:, 1].min()
    for k in np.setdiff1d(np.arange(len(boxes)), stay).tolist():
        moves[k] = right + _BESIDE - boxes[k, 0, 0], bottom - boxes[k, 0, 1]
        right = boxes[k, 1, 0] + moves[k, 0]
    return moves
