"""`make_map`: a drive to a map, with its loops closed and its walls adjusted."""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import LineamentError
from ..scan import Array, Pose
from ..scan.poses import compose, inverse, relative
from .drive_map import KeyFrame
from .graph import Edges, optimise, wrapped
from .joint import Lines, Sights, adjust, roughened, roughness
from .line_map import LineMap
from .locate import locate
from .loops import find_loops, merged, queries, whole_walls

#: Surfaces are thought to be off straight lines by so much at first [m].
_ROUGH = 0.01
#: What walls say of a motion is known by the walls already: of motions, a 25th counts, and
#: nothing below these deviations [m, m, rad].
_TWICE, _LEAST = 25.0, np.diag((0.02, 0.02, 0.01)) ** 2
#: Deviations by which adjusted key frames are off their neighbours, beside their covariances.
_NEXT = np.diag((0.003, 0.003, 0.001)) ** 2
#: Where loops are looked for at first, and once they are closed [m, rad].
_SPREADS = (0.8, 0.12), (0.3, 0.06)
_MERGED = 2
#: Edges with less weight are wrong.
_RIGHT = 0.5
#: A drive is looked for on a plan from places so far apart [m]; places that agree [m, rad].
_PLACES, _AGREE = 3.0, (0.5, 0.05)
#: A wall was seen so often, or in no map.
VIEWS = 3


@dataclass(slots=True, eq=False)
class DriveMap:
    """A map of a drive.

    Attributes
    ----------
    map : LineMap
        Its walls, with covariances that hold those of the poses.
    poses : list of (x, y, theta)
        Of all scans.
    frames : ndarray, shape (n, 3)
        Poses of the key frames.
    loops : Edges
        Those that were closed, between key frames.
    refused : int
        Loops that were left out, since they contradict the others.
    sights, lines
        What the key frames saw of each wall, and its line in the frame of the first one.
    """

    map: LineMap
    poses: list[Pose]
    frames: Array
    loops: Edges
    refused: int
    sights: Sights
    lines: Lines


def make_map(frames: list[KeyFrame], scans: list[tuple[int, Pose]], views: int = VIEWS) -> DriveMap:
    """Close the loops of a drive, and adjust poses and walls together.

    Parameters
    ----------
    frames, scans
        As `Drive` has them.
    views : int
        How often a part of a wall was seen, by key frames, to be in the map.

    Raises
    ------
    LineamentError
        If there are no walls.
    """
    chain, sights, count = (
        _chain(frames),
        _sights(frames),
        1 + max(int(f.walls.max(initial=0)) for f in frames),
    )
    if not len(sights.walls):
        raise LineamentError(f"no walls are seen in {len(frames)} key frames, expected some")
    poses = np.array([frame.pose for frame in frames])
    poses, lines, _ = adjust(poses, chain, sights, count)
    sights = roughened(sights, roughness(sights, lines, poses))
    own, loops, refused = sights, None, 0
    for spread in _SPREADS:
        found = find_loops(frames, poses, own, lines, spread)
        if not len(found.ends):
            break
        followed = np.array(
            [relative(_pose(poses[k]), _pose(poses[k + 1])) for k in range(len(poses) - 1)]
        )
        near = np.linalg.inv(np.array([frame.motion.covariance for frame in frames[1:]]) + _NEXT)
        near_chain = replace(chain, motions=followed.reshape(-1, 3), information=near)
        poses, weights = optimise(poses, near_chain.together(found))
        right = weights[len(chain.ends) :] > _RIGHT
        refused = int((~right).sum())
        loops = Edges(
            found.ends[right],
            found.motions[right],
            found.information[right] / _TWICE,
            found.robust[right],
        )
        sights, number = own, count
        for _ in range(_MERGED):
            poses, lines, _ = adjust(poses, chain.together(loops), sights, number)
            labels = merged(sights, lines, poses)
            sights, number = replace(sights, walls=labels[sights.walls]), int(labels.max()) + 1
        own, count = sights, number
        poses, lines, _ = adjust(poses, chain, sights, number)
    poses, lines, _ = adjust(poses, chain, sights, count, covariances=True)
    walls = whole_walls(sights, lines, poses, min(views, len(frames)))
    none = Edges(
        np.zeros((0, 2), np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0, bool)
    )
    every = [compose(_pose(poses[k]), pose) for k, pose in scans]
    return DriveMap(LineMap(walls), every, poses, loops or none, refused, sights, lines)


def onto_plan(made: DriveMap, frames: list[KeyFrame], plan: LineMap) -> DriveMap:
    """Move a map into the frame of a plan, on which it is located without a first guess.

    Places along the way are looked for on the plan; the motion on which most of those that are
    located agree is taken. LineamentError if none is located.
    """
    found = []
    for q, query in queries(frames, made.frames, made.sights, made.lines, _PLACES):
        where = locate(query, plan)
        if where:
            found.append(compose(where.pose, inverse(_pose(made.frames[q]))))
    if not found:
        raise LineamentError("the drive is not on the plan, or the plan does not say where")
    moves = np.array(found)
    # Compared where the map is, not at its origin.
    turned = np.abs(wrapped(moves[:, None, 2] - moves[None, :, 2])) < _AGREE[1]
    middle = np.append(made.frames[:, :2].mean(axis=0), 0.0)
    places = np.array([compose(move, _pose(middle))[:2] for move in found])
    near = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) < _AGREE[0]
    best = found[int((turned & near).sum(axis=1).argmax())]
    moved = LineMap.from_features([made.map.to_features()], [best])
    poses = [compose(best, pose) for pose in made.poses]
    placed = np.array([compose(best, _pose(row)) for row in made.frames])
    return replace(made, map=moved, poses=poses, frames=placed)


def _chain(frames: list[KeyFrame]) -> Edges:
    """Motions from key frame to key frame, of which the walls know most already."""
    n = len(frames) - 1
    ends = np.column_stack((np.arange(n), np.arange(1, n + 1)))
    motions = np.array([frame.motion.pose for frame in frames[1:]]).reshape(-1, 3)
    spread = np.array([frame.motion.covariance for frame in frames[1:]]).reshape(-1, 3, 3)
    return Edges(ends, motions, np.linalg.inv(_TWICE * spread + _LEAST), np.zeros(n, dtype=bool))


def _sights(frames: list[KeyFrame]) -> Sights:
    """Walls as the key frames see them."""
    segments = np.concatenate([frame.features.segments for frame in frames])
    numbers = np.concatenate([np.full(len(f.walls), k) for k, f in enumerate(frames)])
    u = np.column_stack((np.cos(segments["angle"]), np.sin(segments["angle"])))
    ends = [((segments[e] - segments["centroid"]) * u).sum(axis=1) for e in ("start", "end")]
    kept = segments["length"] > 0.1
    sights = Sights(
        numbers[kept],
        np.concatenate([frame.walls for frame in frames])[kept],
        segments["centroid"][kept],
        segments["angle"][kept],
        segments["covariance"][kept],
        np.column_stack(ends)[kept],
    )
    return roughened(sights, _ROUGH)


def _pose(row: Array) -> Pose:
    x, y, theta = row.tolist()
    return x, y, theta
