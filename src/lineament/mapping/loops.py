"""Loops: places that were seen before, found by `locate` alone."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scan import Array, Pose
from ..scan.poses import relative
from ..walls import Numbers, Records, moved
from ..walls.sights import walls_along
from .adjust import edges_of
from .drive_map import KeyFrame
from .line_map import LineMap
from .local_map import Query, beams_of, moved_beams, thinned
from .locate import located_near

#: What is looked for is of this way before a key frame; where, of this way around another [m].
_QUERY, _PLAN = 5.0, 5.0
#: Key frames are looked for after so much way; others are at least so much way before them [m].
_EVERY, _BEFORE = 2.0, 12.0
#: Stretches of the way that are looked at for each; key frames whose beams a query has.
_STRETCHES, _SCANS = 2, 6
#: Errors of a loop beside those that `locate` knows [m, rad].
FLOOR = np.diag((0.02, 0.02, 0.005)) ** 2


@dataclass(slots=True, eq=False)
class Survey:
    """Key frames, their poses (n, 3), what they saw, and the lines of its walls."""

    frames: list[KeyFrame]
    poses: Array
    sights: Records
    lines: Records

    @property
    def way(self) -> Array:
        """Way to each key frame [m]; where it was lost, what was seen before is far."""
        steps = np.hypot(*np.diff(self.poses[:, :2], axis=0, prepend=self.poses[:1, :2]).T)
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

    def queries(self, every: float, frames: Numbers) -> Iterator[tuple[int, Query]]:
        """Return those of some key frames that are the first of each so many metres of the way.

        With each comes what was seen before it.
        """
        first = np.flatnonzero(np.diff(np.floor(self.way / every), prepend=-1))
        for q in np.intersect1d(first, frames).tolist():
            query = self.query(q)
            if query is not None:
                yield q, query

    def loops(self, spread: tuple[float, float]) -> Records:
        """Look for what was seen before, near where the poses say that it is: records of `EDGE`.

        The deviations [m, rad] are those of the poses from each other.
        """
        ends, motions, spreads, way = [], [], [], self.way
        covariance = np.diag((spread[0], *spread)) ** 2
        plans: dict[int, LineMap | None] = {}
        for q, query in self.queries(_EVERY, np.arange(len(way))):
            for j in self._passed(q, 2.0 + 2.0 * spread[0]):
                if j not in plans:
                    walls = self.walls(self.pose(j), np.flatnonzero(abs(way - way[j]) <= _PLAN))
                    plans[j] = LineMap(walls) if len(walls) > 3 else None
                if (plan := plans[j]) is not None:
                    guess = relative(self.pose(j), self.pose(q))
                    where = located_near(query, plan, guess, covariance, is_prior=True)
                    if where:
                        ends.append((j, q))
                        motions.append(where.pose)
                        spreads.append(where.covariance + FLOOR)
        return edges_of(ends, motions, spreads, loop=True)

    def _passed(self, q: int, reach: float) -> list[int]:
        """Return the nearest key frame of each stretch of the way that passed near.

        Numbers are rounded, so that queries that follow each other look at the same plans.
        """
        way, away = self.way, np.hypot(*(self.poses[:, :2] - self.poses[q, :2]).T)
        near = np.flatnonzero((away < reach) & (way < way[q] - _BEFORE))
        runs = np.split(near, np.flatnonzero(np.diff(near) > 5) + 1) if len(near) else []
        best = sorted((float(away[run].min()), int(run[away[run].argmin()])) for run in runs)
        return [4 * (j // 4) for _, j in best[:_STRETCHES]]
