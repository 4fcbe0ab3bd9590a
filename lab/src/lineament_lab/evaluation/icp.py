"""Scan-to-scan point-to-line ICP, written plainly: what motion from features is compared with.

Censi, *An ICP variant using a point-to-line metric*, ICRA 2008, without its tricks for speed.
"""

import math

import numpy as np

from lineament.scan import Array, LaserScan, Pose

#: Farthest pair of points in the first round, and in the last ones [m]; halved from round to round.
_FARTHEST, _NEAREST = 0.5, 0.1
#: Neighbouring points that are farther apart than this are not on one line [m].
_GAP = 0.3
_ROUNDS, _SMALL = 40, 1e-7


def icp(before: LaserScan, now: LaserScan, start: Pose = (0.0, 0.0, 0.0)) -> Pose:
    """Motion between two scans by point-to-line ICP.

    Each point of the later scan, moved by what is known of the motion, is paired with the nearest
    line between neighbouring points of the earlier one, and the motion with the least sum of
    squared distances is taken; pairs farther apart than a limit are left out.

    Returns the pose (x, y, theta) of the later sensor in the frame of the earlier one [m, m, rad],
    by a search from `start`; the start if too few points can be paired.
    """
    from scipy.spatial import cKDTree

    anchors, normals = _lines(before)
    points = now.points[now.valid]
    if len(anchors) < 3 or len(points) < 3:
        return start
    tree = cKDTree(anchors)
    motion, limit = np.array(start, dtype=np.float64), _FARTHEST
    for _ in range(_ROUNDS):
        c, s = math.cos(motion[2]), math.sin(motion[2])
        moved = points @ np.array([[c, s], [-s, c]])
        distance, nearest = tree.query(moved + motion[:2])
        kept = distance <= limit
        if kept.sum() < 3:
            return start
        arm, normal = moved[kept], normals[nearest[kept]]
        error = ((arm + motion[:2] - anchors[nearest[kept]]) * normal).sum(axis=1)
        by_turn = normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]
        step, *_ = np.linalg.lstsq(np.column_stack((normal, by_turn)), -error, rcond=None)
        motion = motion + step
        if limit == _NEAREST and np.abs(step).max() < _SMALL:
            break
        limit = max(limit / 2, _NEAREST)
    x, y, theta = motion.tolist()
    return x, y, math.remainder(theta, 2 * math.pi)


def _lines(scan: LaserScan) -> tuple[Array, Array]:
    """Middles (m, 2) of neighbouring points, and the unit normals of the lines through them."""
    points = scan.points[scan.valid]
    arms = np.diff(points, axis=0)
    lengths = np.hypot(arms[:, 0], arms[:, 1])
    kept = (lengths > 0) & (lengths < _GAP)
    normals = arms[kept][:, ::-1] * (-1.0, 1.0) / lengths[kept, np.newaxis]
    return (points[:-1] + points[1:])[kept] / 2, normals
