"""Whether a scan goes on where the last one was: neither looks through what the other has seen."""

import math
from collections.abc import Iterable

import numpy as np

from ..scan import Array, LaserScan, Pose
from ..scan.poses import inverse
from ..walls import unit
from .local_map import some

#: Errors of a motion from scan to scan, and their growth with way and turn [m, rad]: beams end so
#: near to those of the other scan, and beside some of them that are turned by so much.
_NEAR, _TURNED, _GROWTH = 0.08, 0.015, 0.1
#: Two scans of one place explain at least this share of the ends that both of them can see: people,
#: doors and glass take up to 8 % of them from scan to scan, a place elsewhere most.
LEAST = 0.85
#: So many ends of each scan are looked at; fewer in all say nothing.
_MOST, _FEWEST = 180, 20


def is_consistent(before: LaserScan, scan: LaserScan, motion: Pose) -> bool:
    """Whether two scans may show the same place, the second one `motion` [m, m, rad] farther."""
    return not agreement(before, scan, [motion])[0] < LEAST


def agreement(before: LaserScan, scan: LaserScan, motions: Iterable[Pose]) -> Array:
    """Return the share of explained ends among those that both scans can see, of each motion.

    The ends of the beams of each are seen from where the other was taken. One that is there where
    beams of that scan end is explained; one that is nearer is contradicted, as those beams went
    through it; one that is farther away is hidden, and says nothing. NaN if they are few.
    """
    old, new = _by_bearing(before), _by_bearing(scan)
    ends_then, ends_now = some(old, _MOST), some(new, _MOST)
    seen_then, seen_now = _going_round(old), _going_round(new)
    shares = []
    for motion in motions:
        way, turn = math.hypot(motion[0], motion[1]), abs(math.remainder(motion[2], 2 * math.pi))
        near, turned = _NEAR + _GROWTH * way, _TURNED + _GROWTH * turn
        then = _count(_ends(ends_now, motion), seen_then, near, turned)
        now = _count(_ends(ends_then, inverse(motion)), seen_now, near, turned)
        explained, contradicted = then[0] + now[0], then[1] + now[1]
        seen = explained + contradicted
        shares.append(explained / seen if seen >= _FEWEST else math.nan)
    return np.array(shares)


def _by_bearing(scan: LaserScan) -> Array:
    """Return range and bearing of each valid beam, by bearings from 0 to 2π, shape (n, 2)."""
    beams = np.stack((scan.ranges, scan.angles), axis=1)[scan.valid]
    beams[:, 1] %= 2 * math.pi
    return np.asarray(beams[np.argsort(beams[:, 1])], np.float64)


def _ends(beams: Array, pose: Pose) -> tuple[Array, Array]:
    """Return range and bearing of the ends of beams of another pose, as they are seen from 0."""
    x, y = beams[:, 0] * unit(beams[:, 1] + pose[2]).T + np.array(pose[:2])[:, None]
    return np.hypot(x, y), np.arctan2(y, x) % (2 * math.pi)


def _going_round(beams: Array) -> tuple[Array, Array]:
    """Return bearings and ranges of beams, each also a turn before and after itself."""
    bearings = np.concatenate([beams[:, 1] + turn for turn in (-2 * math.pi, 0.0, 2 * math.pi)])
    return bearings, np.append(np.tile(beams[:, 0], 3), math.inf)


def _count(
    ends: tuple[Array, Array], seen: tuple[Array, Array], near: float, turned: float
) -> tuple[int, int]:
    """Count the ends that beams explain, and those that they contradict."""
    bearings, ranges = seen
    beside = np.searchsorted(bearings, [ends[1] - turned, ends[1] + turned])
    is_seen = beside[0] < beside[1]
    if not is_seen.any():
        return 0, 0
    far, runs = ends[0][is_seen], beside[:, is_seen].T.ravel()
    least, most = (of.reduceat(ranges, runs)[::2] for of in (np.minimum, np.maximum))
    is_explained = (far > least - near) & (far < most + near)
    return int(is_explained.sum()), int((far <= least - near).sum())
