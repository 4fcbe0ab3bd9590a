"""Loops: places that were seen before, found by `locate` alone."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..progress import Track, untracked
from ..scan import Array, Pose
from ..scan.poses import relative
from ..walls import Numbers, Records, moved
from ..walls.sights import walls_along
from .adjust import edges_of
from .drive_map import KeyFrame, steps_between
from .line_map import LineMap
from .local_map import Query, beams_of, moved_beams, thinned
from .locate import located_near

#: What is looked for is of this way before a key frame; where, of this way around another [m].
_QUERY, _PLAN = 5.0, 5.0
#: Key frames are looked for after so much way; others are at least so much way before them [m].
_EVERY, _BEFORE = 2.0, 12.0
#: Stretches of the way that are looked at for each, which may have passed so near, beside what is
#: not known, and at most [m]; key frames whose beams a query has.
_STRETCHES, _NEAR, _FARTHEST, _SCANS = 3, 2.0, 25.0, 6
#: Errors of a loop beside those that `locate` knows [m, rad].
FLOOR = np.diag((0.02, 0.02, 0.005)) ** 2


@dataclass(eq=False)
class Survey:
    """Key frames, their poses (n, 3), what they saw, and the lines of its walls."""

    frames: list[KeyFrame]
    poses: Array
    sights: Records
    lines: Records

    @cached_property
    def way(self) -> Array:
        """Way to each key frame [m]; where it was lost, what was seen before is far."""
        steps = steps_between(self.poses)
        steps[[frame.is_torn for frame in self.frames]] = _BEFORE
        return np.cumsum(steps)

    def pose(self, k: int) -> Pose:
        """Pose of a key frame."""
        x, y, theta = self.poses[k].tolist()
        return x, y, theta

    def walls(self, pose: Pose, frames: NDArray[np.intp]) -> Records:
        """Return the walls that some key frames see, in the frame of a pose."""
        chosen = self.sights[np.isin(self.sights["frame"], frames)]
        return moved(walls_along(chosen, self.poses, self.lines), pose)

    def query(self, q: int) -> Query | None:
        """Return what was seen on the last metres before a key frame, in its frame."""
        before, here = self.way[q] - self.way[: q + 1], self.pose(q)
        last = np.flatnonzero(before <= _QUERY)
        walls, beams = self.walls(here, last), []
        n = len(walls)
        if n < 4:
            return None
        for k in last[np.unique(np.linspace(0, len(last) - 1, _SCANS).astype(int))[::-1]].tolist():
            own = beams_of(self.frames[k].features, self.frames[k].scan)
            beams.append(moved_beams(own, relative(here, self.pose(k)), np.zeros((3, 3))))
        blocks = np.zeros((n, 2, n, 2))
        blocks[np.arange(n), :, np.arange(n)] = walls["covariance"]
        return Query(walls, blocks.reshape(2 * n, 2 * n), thinned(np.concatenate(beams)))

    def each(self, every: float, frames: Numbers) -> list[int]:
        """Return those of some key frames that are the first of each so many metres of the way."""
        first = np.flatnonzero(np.diff(np.floor(self.way / every), prepend=-1))
        found: list[int] = np.intersect1d(first, frames).tolist()
        return found

    def queries(
        self, every: float, frames: Numbers, track: Track = untracked
    ) -> Iterator[tuple[int, Query]]:
        """Return what was seen before each of these key frames, behind its number."""
        first = self.each(every, frames)
        for q in track(first, "places", first):
            query = self.query(q)
            if query is not None:
                yield q, query

    def loops(
        self,
        least: tuple[float, float],
        known: Callable[[Numbers], Array] | None = None,
        track: Track = untracked,
    ) -> Records:
        """Look for what was seen before, where the poses say that it is: records of `EDGE`.

        Poses are off by deviations of `least` [m, rad], and by what is `known` of the way: this
        returns the covariances (m, 3, 3) of motions between pairs of key frames. It says nothing
        across a lost one: what came before that is looked for by `least` alone.
        """
        pairs, covariances, reach = self._candidates(least, known)
        ends, motions, spreads = [], [], []
        plans: dict[tuple[int, float], LineMap | None] = {}
        query, of_query = None, -1
        for k in track(range(len(pairs)), "loops", pairs):
            # Numbers are rounded, so that queries that follow each other look at the same plans.
            j, q = 4 * (int(pairs[k, 0]) // 4), int(pairs[k, 1])
            of_plan = j, _PLAN * (1 + round(float(reach[k]) / _PLAN))
            if of_plan not in plans:
                plans[of_plan] = self._plan(*of_plan)
            if q != of_query:
                query, of_query = self.query(q), q
            if (plan := plans[of_plan]) is not None and query is not None:
                guess = relative(self.pose(j), self.pose(q))
                where = located_near(query, plan, guess, covariances[k], is_prior=True)
                if where:
                    ends.append((j, q))
                    motions.append(where.pose)
                    spreads.append(where.covariance + FLOOR)
        return edges_of(ends, motions, spreads, loop=True)

    def _candidates(
        self, least: tuple[float, float], known: Callable[[Numbers], Array] | None
    ) -> tuple[Numbers, Array, Array]:
        """Return pairs of key frames that may have passed the same place.

        With them come the covariances of the motions between them, and two deviations [m].
        """
        asked = self.each(_EVERY, np.arange(len(self.poses)))
        every = [(j, q) for q in asked for j in self._passed(q)]
        pairs = np.array(every, np.int64).reshape(-1, 2)
        spans = np.cumsum([frame.is_torn for frame in self.frames])[pairs]
        is_followed = spans[:, 0] == spans[:, 1]
        covariances = np.tile(np.diag((least[0], *least)) ** 2, (len(pairs), 1, 1))
        if known is not None:
            covariances[is_followed] += known(pairs[is_followed])
        reach = 2.0 * np.sqrt(np.linalg.eigvalsh(covariances[:, :2, :2])[:, 1])
        away = np.hypot(*(self.poses[pairs[:, 0], :2] - self.poses[pairs[:, 1], :2]).T)
        near = away < _NEAR + reach
        return pairs[near], covariances[near], reach[near]

    def _plan(self, j: int, reach: float) -> LineMap | None:
        """Return the walls along so much of the way around a key frame, in its frame."""
        way = self.way
        walls = self.walls(self.pose(j), np.flatnonzero(abs(way - way[j]) <= reach))
        return LineMap(walls) if len(walls) > 3 else None

    def _passed(self, q: int) -> list[int]:
        """Return the nearest key frames of stretches of the way that passed before."""
        way, away = self.way, np.hypot(*(self.poses[:, :2] - self.poses[q, :2]).T)
        chosen: list[int] = []
        near = np.flatnonzero((away < _FARTHEST) & (way < way[q] - _BEFORE))
        for j in near[np.argsort(away[near], kind="stable")].tolist():
            if (abs(way[chosen] - way[j]) >= _PLAN).all():
                chosen.append(j)
            if len(chosen) == _STRETCHES:
                break
        return chosen
