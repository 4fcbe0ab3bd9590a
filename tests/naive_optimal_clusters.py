"""Slow twin of how method optimal parts a scan: spikes left out, then classes of neighbours."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from naive import Clusters, polar, valid
from naive_fit import range_variance

from lineament import LaserScan
from lineament.kernels import optimal, spikes


def within_reach(scan):
    """Leave out what no scanner reports."""
    nearest, farthest = (
        max(scan.range_min, optimal._NEAREST),
        min(scan.range_max, optimal._FARTHEST),
    )
    limits = {"range_min": nearest, "range_max": farthest}
    if scan.is_regular:
        return LaserScan(scan.ranges, scan.angle_min, scan.angle_increment, **limits)
    return LaserScan(scan.ranges, angles=scan.angles, **limits)


def without_spikes(scan, noise, reach):
    """Ranges, NaN where they are not valid or stand alone on a surface that goes on."""
    ok, r = valid(scan), scan.ranges
    kept = np.where(ok, r, np.nan)
    for i in range(1, len(scan) - 1):
        # A beam without a reading beside it is passed over.
        a = i - 1 if ok[i - 1] or i == 1 else i - 2
        b = i + 1 if ok[i + 1] or i == len(scan) - 2 else i + 2
        if not (ok[a] and ok[i] and ok[b]):
            continue
        apart, deviation = abs(r[a] - r[b]), math.sqrt(range_variance(r[i], noise))
        off = abs(r[i] - (r[a] + r[b]) / 2)
        agree = apart <= reach * (b - a) / 2 * min(r[a], r[b]) + 4 * deviation
        if agree and off > spikes._OFF * deviation + apart / 2:
            kept[i] = np.nan
    return kept


def clusters(scan, ranges, noise, max_missing):
    """Classes of neighbours; that of a closed ring ends with its first beam."""
    points, n, out = polar(ranges, scan.angles), len(scan), Clusters()
    beams = [i for i in range(n) if not math.isnan(ranges[i])]

    step = {}  # From the point before, by beam: of the inverse range.
    for before, b in zip([*beams[-1:], *beams[:-1]], beams, strict=True):
        step[b] = abs(1 / ranges[b] - 1 / ranges[before]) / max((b - before) % n, 1)

    def joins(before, b):
        missed = (b - before) % n
        if missed > max_missing + 1:
            return False
        near, far = sorted((ranges[before], ranges[b]))
        sine = abs(math.sin(scan.angles[b] - scan.angles[before]))
        floor = optimal._FLOOR * math.sqrt(2 * range_variance(far, noise))
        after = beams[(beams.index(b) + 1) % len(beams)]
        even = optimal._UNEVEN * max(step[before], step[after])
        is_step = (step[b] - even) * missed * near * far > floor + optimal._LEDGE
        steepest = optimal._STEEP if is_step else optimal._STEEPEST
        return np.linalg.norm(points[b] - points[before]) <= steepest * near * sine + floor

    classes = [beams[:1]]
    for before, b in pairwise(beams):
        if joins(before, b):
            classes[-1].append(b)
        else:
            classes.append([b])
    if scan.is_full_circle and len(beams) >= 3 and joins(beams[-1], beams[0]):
        out.closed = len(classes) == 1
        if not out.closed:
            classes = [classes[-1] + classes[0], *classes[1:-1]]
    out.classes = [members for members in classes if len(members) >= 3]
    if out.closed:
        turn = int(np.argmax(ranges[beams]))
        out.classes = [beams[turn:] + beams[:turn]]
    return out
