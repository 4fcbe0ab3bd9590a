"""Features as sets of beams, and points as seen along beams."""

import math

import numpy as np
from numpy.typing import NDArray

from lineament.features import Features
from lineament.scan import Array, LaserScan

#: A true feature with fewer beams is too small to be demanded.
MIN_BEAMS = 6

Masks = NDArray[np.bool_]


def common_beams(found: Features, truth: Features) -> int:
    """Return the number of beams of the scan of both."""
    n, expected = len(found.clusters), len(truth.clusters)
    if n != expected:
        raise ValueError(f"found is of a scan of {n} beams, expected {expected} as in the truth")
    return n


def check_beams(scan: LaserScan, features: Features) -> None:
    """Raise ValueError if the features are of a scan with another number of beams."""
    n = len(features.clusters)
    if n != len(scan):
        raise ValueError(f"features are of {n} beams, expected the scan's {len(scan)}")


def beam_masks(first: NDArray[np.int32], last: NDArray[np.int32], n: int) -> Masks:
    """Which of n beams lie from each first to each last beam, over the seam if first > last."""
    ahead = (np.arange(n) - first[:, np.newaxis]) % n
    return np.asarray(ahead <= ((last - first) % n)[:, np.newaxis])


def beams_of(table: NDArray[np.void], n: int) -> Masks:
    """Which of n beams belong to each segment or arc, shape (K, n)."""
    return beam_masks(table["first_beam"], table["last_beam"], n)


def shared_beams(masks: Masks, others: Masks) -> Array:
    """Return how many beams each two masks share, shape (F, T)."""
    return np.asarray(masks.astype(np.float64) @ others.astype(np.float64).T)


def overlap_ratios(masks: Masks, others: Masks) -> Array:
    """Beams in both over beams in either (intersection over union), shape (F, T)."""
    shared = shared_beams(masks, others)
    either = masks.sum(axis=1)[:, np.newaxis] + others.sum(axis=1) - shared
    return np.asarray(shared / either)


def on_small_surfaces(masks: Masks, truth: Features) -> NDArray[np.bool_]:
    """Whether at least half of the beams of each mask meet a surface too small to be demanded."""
    small = np.zeros(masks.shape[1], dtype=np.bool_)
    for table in (truth.segments, truth.arcs):
        small |= beams_of(table[table["n_points"] < MIN_BEAMS], len(small)).any(axis=0)
    return np.asarray(2 * (masks & small).sum(axis=1) >= masks.sum(axis=1))


def nearest_beams(scan: LaserScan, points: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Beam nearest to the bearing of each point, and whether that is within half a step of it."""
    angles, half_step = scan.angles, 0.5 * scan.angle_increment
    first = angles[0] - half_step
    bearings = first + (np.arctan2(points[:, 1], points[:, 0]) - first) % (2 * math.pi)
    nearest = np.searchsorted(0.5 * (angles[1:] + angles[:-1]), bearings)
    return nearest, bearings <= angles[-1] + half_step


def with_neighbours(scan: LaserScan) -> NDArray[np.intp]:
    """Index of each beam between those of its neighbours, shape (n, 3); ends repeat themselves."""
    n = len(scan)
    beams = np.arange(n)[:, np.newaxis] + np.arange(-1, 2)
    return beams % n if scan.is_full_circle else np.clip(beams, 0, n - 1)
