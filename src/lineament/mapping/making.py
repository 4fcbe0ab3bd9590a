"""`make_map`: a drive to a map, with its loops closed and its walls adjusted."""

import math
import os
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np

from ..errors import NothingFoundError
from ..progress import Track, untracked
from ..scan import Array, Pose
from ..scan.poses import compose
from ..walls import SHORTEST, Numbers, Records, cut, lengths_of, unit
from ..walls.sights import count_of, errors, lines_of, on_lines, sights_of
from .adjust import Adjusted, edges_of, optimise
from .again import tied
from .believed import believed
from .chain import TWICE, found_back, loosened, slid, spread_of, unseen
from .drive_map import KeyFrame, steps_between
from .gone import standing
from .grids import GRID_ENDINGS
from .index import MAPPED
from .joining import closed
from .line_map import LineMap
from .loops import Survey
from .parts import Parts, apart, parts_of

#: Surfaces are thought to be off straight lines by so much at first [m].
_ROUGH = 0.01
#: Walls that were seen so often show how rough surfaces are, between these [m]; median of χ².
_OFTEN, _SMOOTHEST, _ROUGHEST, _MEDIAN = 8, 1e-5, 0.05, 0.4549
#: A wall was seen by so many key frames.
VIEWS = 3
#: Surfaces that lie so close, and along each other (10°), hide each other [m].
_HIDDEN, _ALONG = 0.15, math.cos(math.radians(10))


@dataclass(slots=True, eq=False)
class DriveMap:
    """A map of a drive and the poses of its scans, in the frame of the first scan.

    Attributes
    ----------
    map : LineMap
        Its covariances hold those of the poses, beside the first of their part.
    walls_of : ndarray, shape (w,)
        The part of each wall.
    poses : list of (x, y, theta)
        Of each scan [m, m, rad].
    frame_of : ndarray, shape (s,)
        The key frame of each scan.
    survey : Survey
        The key frames, their poses, and what they saw.
    parts : Parts
        What hangs together, and where the poses are not sure. Parts lie beside each other: nobody
        knows where they are to each other.
    loops, refused : structured arrays of `EDGE`
        Loops between key frames that were closed, and those that contradict the others.
    chain : structured array of `EDGE`
        The motions between key frames.
    adjusted : Adjusted
        The last adjustment; `parts.between` has covariances of it.
    located : tuple of int
        The parts whose place on a plan is known, where there is one.
    """

    map: LineMap
    walls_of: Numbers
    poses: list[Pose]
    frame_of: Numbers
    survey: Survey
    parts: Parts
    loops: Records
    refused: Records
    chain: Records
    adjusted: Adjusted
    located: tuple[int, ...] = ()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the walls, or for ``.yaml`` a grid, in which free is what sure beams pass."""
        if Path(path).suffix.lower() not in GRID_ENDINGS:
            self.map.write(path)
            return
        sure = compress(self.survey.frames, self.parts.is_sure)
        self.map.to_grid(seen=[(of.scan, self.poses[of.index]) for of in sure]).write(path)

    @property
    def ways(self) -> list[float]:
        """Way of each part [m]."""
        return [float(self._steps[self.parts.frames(k)].sum()) for k in range(self.parts.count)]

    @property
    def unsure(self) -> list[tuple[int, int, float]]:
        """First and last scan of each stretch on which the poses are not sure, and its way [m]."""
        index = [frame.index for frame in self.survey.frames]
        return [
            (index[a], index[b], float(self._steps[a + 1 : b + 1].sum()))
            for a, b in self.parts.unsure.tolist()
        ]

    @property
    def way(self) -> tuple[Array, Array]:
        """Steps of the way (n, 2, 2) [m] that are sure, and those that are not."""
        places = np.array([self.poses[frame.index][:2] for frame in self.survey.frames])
        steps, is_sure = np.stack((places[:-1], places[1:]), axis=1), np.ones(len(places), bool)
        for before, after in self.parts.unsure.tolist():
            is_sure[before + 1 : after + 1] = False
        is_one, is_sure = np.diff(self.parts.numbers) == 0, is_sure[1:]
        return steps[is_one & is_sure], steps[is_one & ~is_sure]

    @property
    def _steps(self) -> Array:
        """Way to each key frame from the one before, if both are of one part [m]."""
        is_one = np.diff(self.parts.numbers, prepend=0) == 0
        return np.where(is_one, steps_between(self.survey.poses), 0.0)


def make_map(
    frames: list[KeyFrame], scans: list[tuple[int, Pose]], track: Track = untracked
) -> DriveMap:
    """Close the loops of a drive, and adjust poses and walls together.

    Key frames and scans are those of `Drive`. ``track(items, name, whole)`` yields what is looked
    at and shows the progress. NothingFoundError if there are no walls.
    """
    frames = found_back(frames)
    seen = [(frame.features.segments, frame.walls) for frame in frames]
    sights, poses = sights_of(seen, _ROUGH), np.array([frame.pose for frame in frames])
    if not len(sights):
        raise NothingFoundError(f"no walls are seen in {len(frames)} key frames, expected some")
    lines = lines_of(sights, poses, count_of(sights))
    frames = believed(Survey(frames, poses, sights, lines))
    pairs = [(k, k + 1) for k in range(len(frames) - 1)]
    spreads = [spread_of(frame) for frame in frames[1:]]
    chain = edges_of(pairs, [frame.motion.pose for frame in frames[1:]], spreads)
    found = optimise(poses, chain, sights)
    rough = roughness(sights, found.poses, _ROUGH)
    sights = sights_of(seen, rough)
    found, loops, refused = closed(frames, chain, found, sights, track)
    weak, unknown = loops.copy(), unseen(frames)
    weak["information"] /= TWICE
    weak["loop"] = False
    edges = np.append(chain, weak)
    if len(loops):
        found = optimise(found.poses, edges, sights, rounds=2)
    loose = loosened(edges, unknown)
    found = as_known(found, loose, sights)
    is_doubted = np.array([frame.is_lost or frame.is_contradicted for frame in frames])
    parts = parts_of(found, loose[: len(chain)], is_doubted | slid(frames))
    found, chain, sights = apart(found, chain, sights, parts)
    survey = Survey(frames, found.poses, sights, found.lines)
    if len(loops):
        tight = loosened(np.append(chain, parts.within(loops)), unknown)
        tight["loop"] = False
        survey = tied(survey, tight, chain, parts.roots)
    # Misfits widen the covariances only here: from the start, they have right loops refused.
    bent = [(widened(segments), walls) for segments, walls in seen]
    again = sights_of(bent, rough)
    again["wall"] = survey.sights["wall"]
    sights = sights_of(bent, roughness(again, survey.poses, rough))
    sights["wall"] = again["wall"]
    found = optimise(survey.poses, chain, sights, held=parts.roots, rounds=2)
    found = as_known(found, loosened(chain, unknown), sights, parts.roots)
    survey = Survey(frames, found.poses, sights, found.with_poses(sights, track))
    walls = walls_by_part(survey, parts)
    frame_of = np.array([k for k, _ in scans], np.int64)
    every = [compose(survey.pose(k), pose) for k, pose in scans]
    of_walls = np.repeat(np.arange(parts.count), [len(of) for of in walls])
    plan = LineMap(np.concatenate(walls), sigma=MAPPED)
    return DriveMap(plan, of_walls, every, frame_of, survey, parts, loops, refused, chain, found)


def as_known(found: Adjusted, edges: Records, sights: Records, held: int | Numbers = 0) -> Adjusted:
    """Return poses that were adjusted as is likely, and how they are known by looser edges."""
    known = optimise(found.poses, edges, sights, held=held, rounds=0)
    return replace(found, matrix=known.matrix)


def walls_by_part(survey: Survey, parts: Parts) -> list[Records]:
    """Return the walls of each part; NothingFoundError if there are none."""
    sights, least = survey.sights, min(VIEWS, len(survey.frames))
    of, walls = parts.numbers[sights["frame"]], []
    for k in range(parts.count):
        own = replace(survey, sights=sights[of == k])
        runs = standing(own, least, parts.is_sure & (parts.numbers == k))
        walls.append(single(on_lines(own.lines, *runs)))
    if not any(map(len, walls)):
        raise NothingFoundError(f"no wall is seen by {least} of {len(survey.frames)} key frames")
    return walls


def widened(segments: Records) -> Records:
    """Return segments whose covariances, of noise alone, are larger by their misfits (Birge).

    What noise alone explains of a misfit, on average, does not count.
    """
    result, misfit = segments.copy(), segments["misfit"] ** 2
    noise = np.maximum(segments["rms"] ** 2 - misfit, 1e-18)
    excess = misfit / noise - 1 / np.sqrt(math.pi * np.maximum(segments["n_points"], 1))
    result["covariance"] *= 1 + np.maximum(excess, 0.0)[:, None, None]
    return result


def single(walls: Records) -> Records:
    """Return the walls without the stretches beside a wall that was seen more often.

    Of two surfaces so close that face the same way, the one behind could not be seen: they are one
    surface, drawn twice, like the chords of a wall that bends.
    """
    lengths = lengths_of(walls)
    kept = walls[:0]
    for k in np.lexsort((-lengths, -walls["views"])).tolist():
        u, before = unit(walls["angle"][[k]])[0], unit(kept["angle"])
        from_start = [(kept[name] - walls["start"][k]) @ u for name in ("start", "end")]
        low = np.maximum(np.minimum(*from_start), 0.0)
        high = np.minimum(np.maximum(*from_start), lengths[k])
        arm = walls["start"][k] + ((low + high) / 2)[:, None] * u - kept["start"]
        off = abs(before[:, 0] * arm[:, 1] - before[:, 1] * arm[:, 0])
        hides = (before @ u > _ALONG) & (off < _HIDDEN) & (high > low)
        ends = np.sort(np.concatenate(([0.0, lengths[k]], low[hides], high[hides])))
        middles = (ends[1:] + ends[:-1]) / 2
        free = ((middles < low[hides, None]) | (middles > high[hides, None])).all(axis=0)
        edges = np.flatnonzero(np.diff(np.concatenate(([False], free, [False]))))
        first, last = ends[edges.reshape(-1, 2)].T
        long = last - first >= np.minimum(SHORTEST, lengths[k])
        kept = np.append(kept, cut(walls[k], first[long], last[long]))
    return kept


def roughness(sights: Records, poses: Array, before: float) -> float:
    """Return how far surfaces are from straight [m], by how far sights are off their walls.

    With it, the median of the squared offsets over their variances is that of χ², of the sights of
    walls that were seen often; the wall itself takes its part of them. The covariances of the
    sights hold what was thought `before` [m].
    """
    views = np.bincount(sights["wall"])[sights["wall"]]
    often = views >= _OFTEN
    if not often.any():
        return before
    off = errors(sights, poses, lines_of(sights, poses, count_of(sights)))[0][often, 0]
    squares = off**2 / (1 - 1 / views[often])
    own = sights["covariance"][often, 0, 0] - before**2
    tried: list[float] = np.geomspace(_SMOOTHEST, _ROUGHEST, 60).tolist()
    right = (r for r in tried if np.median(squares / (own + r**2)) <= _MEDIAN)
    return next(right, _ROUGHEST)
