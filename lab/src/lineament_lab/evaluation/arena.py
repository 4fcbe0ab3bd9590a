"""Scans of a real arena whose walls and corners are known: recall, errors, and false corners."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lineament.features import Features
from lineament.scan import Array, LaserScan, Pose
from lineament.simulation import Sensor, World, truth
from lineament.simulation.placing import clearance

from .counts import quantile, ratio
from .kinds import FeatureScores, corner_scores

#: Recordings from known poses, with walls that were fitted to all scans, and corners.
ARENAS = {
    "arena, static": "truth/jackal_static_data.npz",
    "arena, moving": "truth/jackal_mocap_02171554.npz",
}
#: A found corner is a real one within this distance [m].
GATE = 0.10
#: The fitted walls of a room leave gaps; an end so near to a corner belongs to it [m].
_JOINED = 0.15
#: A corner is demanded where both its walls show at least so many measurements within so much of
#: the fitted wall [m], between so far and so far from the corner [m].
FACE_BEAMS, FACE_WIDTH, FACE_FROM, FACE_TO = 4, 0.04, 0.1, 0.6


class Arena(NamedTuple):
    """Scans with their poses in a known world, and the features to find, in each scan's frame.

    Walls are the fitted ones, extended to their corners. Corners, shape (K, 2) [m], include the
    places where one wall ends on another, which are neither demanded nor false.
    """

    scans: list[LaserScan]
    truths: list[Features]
    walls: World
    corners: Array


def archived_scans(path: str | Path) -> list[LaserScan]:
    """Read all scans of an archive of the recordings with a truth, with their best poses."""
    with np.load(path) as archive:
        poses = archive["poses_refined" if "poses_refined" in archive else "poses"].tolist()
        beams = float(archive["angle_min"]), float(archive["angle_increment"])
        far, ranges = float(archive["range_max"]), archive["ranges"]
        stamps = archive["stamps"].tolist() if "stamps" in archive else [0.0] * len(ranges)
    return [
        LaserScan(row, *beams, range_max=far, pose=tuple(pose), stamp=stamp)
        for row, pose, stamp in zip(ranges, poses, stamps, strict=True)
    ]


def load_arena(path: Path, count: int) -> Arena:
    """Load so many scans of the arena, at equal steps of the recording."""
    recorded = archived_scans(path)
    chosen = np.unique(np.linspace(0, len(recorded) - 1, min(count, len(recorded))).astype(int))
    scans = [recorded[i] for i in chosen]
    with np.load(path) as archive:
        ends, corners = archive["gt_segments"].reshape(-1, 2), archive["gt_corners"]
        beams = float(archive["angle_min"]), float(archive["angle_increment"])
        sensor = Sensor("arena", len(scans[0]), *beams, 0.0, float(archive["range_max"]))
    nearest, distance = _nearest(ends, corners)
    ends = np.where(distance[:, np.newaxis] <= _JOINED, nearest, ends)
    walls = World(ends.reshape(-1, 4))
    truths = []
    for scan in scans:
        assert scan.pose is not None
        visible = truth(walls, scan.pose, sensor)
        shown = faces_shown(scan, scan.pose, visible, walls)
        truths.append(replace(visible, corners=visible.corners[shown]))
    return Arena(scans, truths, walls, np.vstack((corners, _ends_on_walls(ends, corners))))


def faces_shown(scan: LaserScan, pose: Pose, visible: Features, walls: World) -> NDArray[np.bool_]:
    """Return whether a scan shows both walls of each corner, by the measurements on them.

    Something that was not fitted may hide one wall: then the corner is a mere silhouette.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    points = scan.points[scan.valid] @ np.array([[c, s], [-s, c]]) + pose[:2]
    ends = walls.segments.reshape(-1, 2, 2)
    shown = []
    for corner in visible.transform(*pose).corners["position"]:
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


def _nearest(points: Array, others: Array) -> tuple[Array, Array]:
    """Return the nearest of the others to each point, and its distance [m]."""
    away = np.hypot(*np.moveaxis(points[:, np.newaxis] - others, 2, 0))
    return others[away.argmin(axis=1)], away.min(axis=1, initial=np.inf)


def _ends_on_walls(ends: Array, corners: Array) -> Array:
    """Return the ends of walls that are at no corner but on another wall."""
    walls = ends.reshape(-1, 4)
    lonely = np.flatnonzero(_nearest(ends, corners)[1] > 0)
    others = (World(np.delete(walls, k // 2, axis=0)) for k in lonely)
    met = [clearance(w, ends[k : k + 1])[0] <= GATE for k, w in zip(lonely, others, strict=True)]
    return ends[lonely[np.array(met, dtype=np.bool_)]]


def arena_scores(
    arena: Arena, extract: Callable[[LaserScan], Features]
) -> tuple[dict[str, float], Array]:
    """Score a method on the scans of the arena.

    Returns the numbers, among them `false`, the share of the found corners that are at no real
    one, and the positions of all found corners in the world frame [m], shape (m, 2).
    """
    found = [extract(scan) for scan in arena.scans]
    positions = np.concatenate(
        [
            features.transform(*scan.pose).corners["position"]
            for features, scan in zip(found, arena.scans, strict=True)
            if scan.pose is not None
        ]
    )
    false = _nearest(positions, arena.corners)[1] > GATE
    corners = FeatureScores.total(map(corner_scores, found, arena.truths))
    return {
        "recall": corners.counts.recall,
        "false": ratio(float(false.sum()), len(positions)),
        "median_error": quantile(corners.errors["position"], 0.5),
        "corners_per_scan": len(positions) / len(found),
    }, positions
