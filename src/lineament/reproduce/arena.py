"""Scans of a real arena whose walls and corners are known: recall, errors, and false corners."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..evaluation.counts import quantile, ratio
from ..evaluation.kinds import FeatureScores, corner_scores, vertices
from ..extractor import Extractor
from ..features import Features
from ..output import canvas
from ..scan import Array, LaserScan, Pose
from ..simulation import Sensor, World, truth
from ..simulation.placing import clearance
from .findings import Figure, Table
from .frames import batch_of

__all__ = [
    "ARENA",
    "FLAT",
    "Arena",
    "ArenaScores",
    "arena_figure",
    "arena_scores",
    "arena_table",
    "load_arena",
]

#: The recording: scans from known poses, walls that were fitted to all of them, and corners.
ARENA = "truth/jackal_static_data.npz"
#: A found corner is a real one within this distance [m].
GATE = 0.10
#: Ends of fitted walls so near to a corner end there; the walls of a room leave gaps [m].
_JOINED = 0.15
#: Within so much of an open end of a fitted wall nothing is known [m].
_UNKNOWN = 0.3
#: A corner is demanded where both its walls show at least so many measurements within so much of
#: the fitted wall [m], between so far and so far from the corner [m].
FACE_BEAMS, FACE_WIDTH, FACE_FROM, FACE_TO = 4, 0.04, 0.1, 0.6
#: Flatter corners may be bends of panels, which the fitted walls do not have [rad].
FLAT = math.radians(150)


@dataclass(frozen=True, slots=True, eq=False)
class Arena:
    """Scans from known poses in a known world.

    Attributes
    ----------
    scans : list of LaserScan
        With their poses in the world frame.
    truths : list of Features
        What there is to find in each, in its own frame; corners are those that are visible, and
        of which the scan shows both walls: see `faces_shown`.
    walls : World
        The fitted walls, made to end at the corners that they are near to.
    corners : ndarray, shape (K, 2)
        All real corners, whether visible or not [m], and those places where one wall ends on
        another, which may be found but are not demanded.
    open_ends : ndarray, shape (m, 2)
        All other ends of the fitted walls [m]: beyond them there are walls that were not fitted,
        and corners that are not listed.
    """

    scans: list[LaserScan]
    truths: list[Features]
    walls: World
    corners: Array
    open_ends: Array


def load_arena(path: Path, count: int) -> Arena:
    """Load so many scans of the arena, at equal steps of the recording."""
    with np.load(path) as archive:
        ranges, poses = archive["ranges"], archive["poses_refined"]
        first, step = float(archive["angle_min"]), float(archive["angle_increment"])
        range_max = float(archive["range_max"])
        walls, corners = archive["gt_segments"], archive["gt_corners"]
    ends = walls.reshape(-1, 2)
    nearest, distance = _nearest(ends, corners)
    ends = np.where(distance[:, np.newaxis] <= _JOINED, nearest, ends)
    world = World(ends.reshape(-1, 4))
    sensor = Sensor("arena", ranges.shape[1], first, step, 0.0, range_max)
    chosen = np.unique(np.linspace(0, len(ranges) - 1, min(count, len(ranges))).astype(int))
    scans = [
        LaserScan(ranges[i], first, step, range_max=range_max, pose=_pose(poses[i])) for i in chosen
    ]
    truths = [
        _demanded(scan, truth(world, _pose(poses[i]), sensor), world)
        for i, scan in zip(chosen, scans, strict=True)
    ]
    on_walls, open_ends = _lonely_ends(ends, corners)
    return Arena(scans, truths, world, np.vstack((corners, on_walls)), open_ends)


def _demanded(scan: LaserScan, visible: Features, walls: World) -> Features:
    """Keep the corners of which the scan shows both walls."""
    return replace(visible, corners=visible.corners[faces_shown(scan, visible, walls)])


def faces_shown(scan: LaserScan, visible: Features, walls: World) -> NDArray[np.bool_]:
    """Whether a scan shows both walls of each corner.

    What stands there need not be what was fitted, and a thing that nobody fitted may hide one of
    the walls, so that the corner is a mere silhouette. A wall shows by at least 4 measurements
    within 4 cm of it, between 0.1 and 0.6 m from the corner.
    """
    if scan.pose is None:
        raise ValueError("scan has no pose, expected (x, y, theta)")
    c, s = math.cos(scan.pose[2]), math.sin(scan.pose[2])
    points = scan.points[scan.valid] @ np.array([[c, s], [-s, c]]) + scan.pose[:2]
    ends = walls.segments.reshape(-1, 2, 2)
    shown = []
    for corner in visible.transform(*scan.pose).corners["position"]:
        faces = 0
        for wall in (*ends, *ends[:, ::-1]):
            arm = wall[1] - wall[0]
            if np.hypot(*(wall[0] - corner)) > FACE_WIDTH:
                continue
            arm /= np.hypot(*arm)
            along = (points - corner) @ arm
            off = abs((points - corner) @ np.array([-arm[1], arm[0]]))
            near = (off <= FACE_WIDTH) & (along >= FACE_FROM) & (along <= FACE_TO)
            faces += near.sum() >= FACE_BEAMS
        shown.append(faces >= 2)
    return np.array(shown, dtype=np.bool_)


def _pose(row: Array) -> Pose:
    x, y, theta = row.tolist()
    return x, y, theta


def _apart(points: Array, others: Array) -> Array:
    """Distance of each point from each of the others [m]."""
    return np.asarray(np.hypot(*np.moveaxis(points[:, np.newaxis] - others, 2, 0)))


def _nearest(points: Array, others: Array) -> tuple[Array, Array]:
    """Of each point the nearest of the others, and its distance [m]."""
    away = _apart(points, others)
    return others[away.argmin(axis=1)], away.min(axis=1, initial=np.inf)


def _lonely_ends(ends: Array, corners: Array) -> tuple[Array, Array]:
    """Pick the ends of walls that are at no corner: those on another wall, and all others."""
    walls = ends.reshape(-1, 4)
    lonely = np.flatnonzero(_nearest(ends, corners)[1] > 0)
    others = (World(np.delete(walls, k // 2, axis=0)) for k in lonely)
    met = np.array(
        [clearance(w, ends[k : k + 1])[0] <= GATE for k, w in zip(lonely, others, strict=True)],
        dtype=np.bool_,
    )
    return ends[lonely[met]], ends[lonely[~met]]


@dataclass(frozen=True, slots=True, eq=False)
class ArenaScores:
    """What a method finds in the arena.

    Attributes
    ----------
    corners : FeatureScores
        Against the visible corners of the single scans.
    positions : ndarray, shape (m, 2)
        All found corners but edges, in the world frame [m].
    false : int
        How many of them lie on no real corner.
    judged, sharp_false : int
        The same of those alone that can be judged without doubt: on a real corner, or with an
        opening of less than 150° and not near an open end of a fitted wall.
    scans : int
        How many scans.
    """

    corners: FeatureScores
    positions: Array
    false: int
    judged: int
    sharp_false: int
    scans: int

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        return {
            "recall": self.corners.counts.recall,
            "false": ratio(self.false, len(self.positions)),
            "sharp_false": ratio(self.sharp_false, self.judged),
            "median_error": quantile(self.corners.errors["position"], 0.5),
            "corners_per_scan": len(self.positions) / self.scans,
        }


def arena_scores(arena: Arena, extractor: Extractor) -> ArenaScores:
    """Score a method on the scans of the arena."""
    found = batch_of(extractor, arena.scans)
    positions = [
        vertices(features.transform(*scan.pose))["position"]
        for features, scan in zip(found, arena.scans, strict=True)
        if scan.pose is not None
    ]
    together = np.concatenate(positions)
    false = _nearest(together, arena.corners)[1] > GATE
    sharp = np.concatenate([vertices(features)["opening"] for features in found]) < FLAT
    known = (_apart(together, arena.open_ends) > _UNKNOWN).all(axis=1)
    sharp_false = false & sharp & known
    return ArenaScores(
        FeatureScores.total(map(corner_scores, found, arena.truths)),
        together,
        int(false.sum()),
        int((~false | sharp_false).sum()),
        int(sharp_false.sum()),
        len(found),
    )


def arena_table(arena: Arena, scores: Mapping[str, ArenaScores]) -> Table:
    """Recall of the visible corners, errors, and share of false corners, by method."""
    visible = next(iter(scores.values())).corners.counts.true
    rows = []
    for name, score in scores.items():
        figures = score.summary()
        rows.append(
            {
                "method": name,
                "recall": figures["recall"],
                "on no real corner, of those found": figures["false"],
                "median error [mm]": 1e3 * figures["median_error"],
                "corners a scan": figures["corners_per_scan"],
            }
        )
    return Table.of_records(
        "Corners of a real arena with fitted walls",
        rows,
        f"{len(arena.scans)} scans with {visible} visible corners of six beams or more on both "
        "sides, within 0.1 m. Walls and poses are known to about 1 cm, and the walls bow by 13 to "
        "23 mm rms: smaller errors tell nothing, and where a wall bends there may be a corner that "
        "is not listed.",
    )


def arena_figure(arena: Arena, scores: Mapping[str, ArenaScores]) -> Figure:
    """Draw the corners that the methods found in all scans, on the map of the arena."""
    columns = 4
    rows = -(-len(scores) // columns)
    figure = canvas.new_figure(3.4 * columns, 4.3 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(scores) :]:
        axes.remove()
    ends = arena.walls.segments.reshape(-1, 2)
    for axes, (name, score) in zip(panels, scores.items(), strict=False):
        figures = score.summary()
        about = f"recall {figures['recall']:.2f}, on no corner {100 * figures['false']:.0f} %"
        canvas.style_plane(axes, name, about, ends)
        axes.plot(*ends.reshape(-1, 2, 2).T, color=canvas.INK, linewidth=1.0)
        axes.plot(*arena.corners.T, "o", markersize=9, mfc="none", mec=canvas.FAINT)
        axes.plot(*score.positions.T, ".", markersize=3, alpha=0.4, color=canvas.CORNER_COLOR)
    return Figure(
        "table3-arena",
        "Corners that each method found in all scans of the arena (red), the fitted walls and the "
        "real corners (circles).",
        canvas.figure_bytes(figure),
    )
