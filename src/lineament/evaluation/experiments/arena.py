"""Scans of a real arena whose walls and corners are known: recall, errors, and false corners."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...extractor import Extractor
from ...features import Features
from ...output import canvas
from ...scan import Array, LaserScan, Pose
from ...simulation import Sensor, World, truth
from ...simulation.placing import clearance
from ..corners import CornerScores, corner_scores
from ..counts import quantile, ratio
from .findings import Figure, Table
from .frames import batch_of

__all__ = [
    "ARENA",
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
_JOINED = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class Arena:
    """Scans from known poses in a known world.

    Attributes
    ----------
    scans : list of LaserScan
        With their poses in the world frame.
    truths : list of Features
        What there is to find in each, in its own frame; corners are those that are visible.
    walls : World
        The fitted walls, made to end at the corners that they are near to.
    corners : ndarray, shape (K, 2)
        All real corners, whether visible or not [m], and those places where one wall ends on
        another, which may be found but are not demanded.
    """

    scans: list[LaserScan]
    truths: list[Features]
    walls: World
    corners: Array


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
    truths = [truth(world, _pose(poses[i]), sensor) for i in chosen]
    return Arena(scans, truths, world, np.vstack((corners, _on_other_walls(ends, corners))))


def _pose(row: Array) -> Pose:
    x, y, theta = row.tolist()
    return x, y, theta


def _nearest(points: Array, others: Array) -> tuple[Array, Array]:
    """Of each point the nearest of the others, and its distance [m]."""
    away = np.hypot(*np.moveaxis(points[:, np.newaxis] - others, 2, 0))
    return others[away.argmin(axis=1)], away.min(axis=1, initial=np.inf)


def _on_other_walls(ends: Array, corners: Array) -> Array:
    """Pick the ends of walls that lie on another wall, and at no corner."""
    walls = ends.reshape(-1, 4)
    lonely = np.flatnonzero(_nearest(ends, corners)[1] > 0)
    others = (World(np.delete(walls, k // 2, axis=0)) for k in lonely)
    met = [clearance(w, ends[k : k + 1])[0] <= GATE for k, w in zip(lonely, others, strict=True)]
    on_walls: Array = ends[lonely[met]]
    return on_walls


@dataclass(frozen=True, slots=True, eq=False)
class ArenaScores:
    """What a method finds in the arena.

    Attributes
    ----------
    corners : CornerScores
        Against the visible corners of the single scans.
    positions : ndarray, shape (m, 2)
        All found corners, in the world frame [m].
    false : int
        How many of them lie on no real corner.
    scans : int
        How many scans.
    """

    corners: CornerScores
    positions: Array
    false: int
    scans: int

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        return {
            "recall": self.corners.counts[GATE].recall,
            "false": ratio(self.false, len(self.positions)),
            "median_error": quantile(self.corners.distances, 0.5),
            "corners_per_scan": len(self.positions) / self.scans,
        }


def arena_scores(arena: Arena, extractor: Extractor) -> ArenaScores:
    """Score a method on the scans of the arena."""
    found = batch_of(extractor, arena.scans)
    positions = [
        features.transform(*scan.pose).corners["position"]
        for features, scan in zip(found, arena.scans, strict=True)
        if scan.pose is not None
    ]
    together = np.concatenate(positions)
    return ArenaScores(
        CornerScores.total(map(corner_scores, found, arena.truths)),
        together,
        int((_nearest(together, arena.corners)[1] > GATE).sum()),
        len(found),
    )


def arena_table(arena: Arena, scores: Mapping[str, ArenaScores]) -> Table:
    """Recall of the visible corners, errors, and share of false corners, by method."""
    visible = next(iter(scores.values())).corners.counts[GATE].true
    columns = (
        *("method", "recall", "on no real corner, of those found"),
        *("median error [mm]", "corners a scan"),
    )
    rows = []
    for name, score in scores.items():
        recall, false, error, per_scan = score.summary().values()
        rows.append((name, recall, false, 1e3 * error, per_scan))
    return Table(
        "Corners of a real arena with fitted walls",
        columns,
        tuple(rows),
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
