"""Whether a scan goes on where the last one was: neither looks through what the other has seen."""

import math

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.mapping.agreeing import agree
from ..scan import Array, LaserScan, Pose
from ..walls import unit
from .local_map import some

#: Errors of a motion from scan to scan, and their growth with way and turn [m, rad]: beams end so
#: near to those of the other scan, and beside some of them that are turned by so much.
_NEAR, _TURNED, _GROWTH = 0.08, 0.015, 0.1
#: An end lies between two beams, so the window around it is a little wider than beams are apart.
#: The farther of the two alone seems to look through a wall along a corridor, unless both scans are
#: of one place: a robot that drives would seem to stand.
_SPACED = 1.01
#: Two scans of one place explain at least this share of the ends that both of them can see: people,
#: doors and glass take up to 8 % of them from scan to scan, a place elsewhere most.
LEAST = 0.85
#: So many ends of each scan are looked at; fewer in all say nothing.
_MOST, _FEWEST = 180, 20


def is_consistent(before: LaserScan, scan: LaserScan, motion: Pose) -> bool:
    """Whether two scans may show the same place, the second one `motion` [m, m, rad] farther."""
    return not agreement(before, scan, [motion])[0] < LEAST


def agreement(before: LaserScan, scan: LaserScan, motions: ArrayLike) -> Array:
    """Return the share of explained ends among those that both scans can see, of motions (n, 3).

    The ends of the beams of each are seen from where the other was taken. One that is there where
    beams of that scan end is explained; one that is nearer is contradicted, as those beams went
    through it; one that is farther away is hidden, and says nothing. NaN if they are few.
    """
    old, new, of = _by_bearing(before), _by_bearing(scan), np.array(motions, float).reshape(-1, 3)
    ends = [beams[:, :1] * unit(beams[:, 1]) for beams in (some(old, _MOST), some(new, _MOST))]
    counts = np.empty((len(of), 2))
    turned = max(_TURNED, *(_SPACED * abs(each.angle_increment) for each in (before, scan)))
    agree(*ends, _going_round(old), _going_round(new), of, (_NEAR, turned, _GROWTH), counts)
    seen = counts.sum(axis=1)
    return np.asarray(np.where(seen >= _FEWEST, counts[:, 0] / np.maximum(seen, 1.0), np.nan))


def _by_bearing(scan: LaserScan) -> Array:
    """Return range and bearing of each valid beam, by bearings from 0 to 2π, shape (n, 2)."""
    beams = np.stack((scan.ranges, scan.angles), axis=1)[scan.valid]
    beams[:, 1] %= 2 * math.pi
    return np.asarray(beams[np.argsort(beams[:, 1])], np.float64)


def _going_round(beams: Array) -> Array:
    """Return beams, each also a turn before and after itself."""
    turns = np.repeat((-2 * math.pi, 0.0, 2 * math.pi), len(beams))
    return np.asarray(np.tile(beams, (3, 1)) + np.column_stack((np.zeros_like(turns), turns)))
