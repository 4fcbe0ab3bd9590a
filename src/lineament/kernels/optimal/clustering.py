"""Step 1: which measurements are usable, and between which a surface breaks."""

import math

import numpy as np

from .. import helper, sums, usable
from .constants import SIGMAS, STEEPEST
from .layout import BEAM, BROKEN, CLUSTER_FIRST, CLUSTER_LAST, RHO, SPIKE, X, Y

#: No scanner sees nearer or farther [m], and the fourth powers of much less or more are no numbers.
_NEAREST, _FARTHEST = 1e-6, 1e3
#: Fewer measurements are no cluster.
_LEAST_CLUSTER = 3


@helper
def list_points(ranges, start, range_min, range_max, bearings, points, beams):
    """Place the usable measurements from beam `start` around. Returns how many there are."""
    x, y, rho, beam = points[X], points[Y], points[RHO], beams[BEAM]
    cosines, sines = bearings[0], bearings[1]
    range_min, range_max = max(range_min, _NEAREST), min(range_max, _FARTHEST)
    count = 0
    for first, end in ((start, len(ranges)), (0, start)):
        for i in range(first, end):
            beam[count] = i
            count += usable(ranges[i], range_min, range_max)
    for i in range(count):
        b = beam[i]
        r = ranges[b]
        rho[i], x[i], y[i] = r, r * cosines[b], r * sines[b]
    return count


@helper
def _steps_out(x0, y0, rho0, x1, y1, rho1, noise):
    """Whether the range steps by more than that of a surface met at the steepest incidence."""
    near, far = min(rho0, rho1), max(rho0, rho1)
    slope = STEEPEST * abs(x0 * y1 - y0 * x1) / far
    return far - near > slope + 2.0 * SIGMAS * math.sqrt(noise[0] + noise[1] * far * far)


@helper
def is_broken(points, beams, i, j, n, noise, most_missing):
    """Whether no surface goes on from measurement i to j, the next one of a scan of n beams."""
    x, y, rho = points[X], points[Y], points[RHO]
    missing = (beams[BEAM, j] - beams[BEAM, i]) % n - 1 > most_missing
    return missing or _steps_out(x[i], y[i], rho[i], x[j], y[j], rho[j], noise)


@sums
def _mark_breaks(x, y, rho, beam, broken, noise, n, most_missing):
    """Mark where a surface breaks between a measurement and the one before."""
    x1, y1, rho1, beam1, broken1 = x[1:], y[1:], rho[1:], beam[1:], broken[1:]
    for i in range(len(x1)):
        apart = beam1[i] - beam[i]
        missing = apart + (n if apart < 0 else 0) - 1 > most_missing
        broken1[i] = missing | _steps_out(x[i], y[i], rho[i], x1[i], y1[i], rho1[i], noise)


@helper
def cluster(points, beams, count, n, circular, noise, most_missing):
    """Mark where a surface breaks, and drop the spikes. Returns how many measurements are left.

    A spike is broken from both its neighbours, while these hold together. Of two in a row neither
    is one: where beams see two surfaces in turn, both are there.
    """
    x, y, rho, beam, broken = points[X], points[Y], points[RHO], beams[BEAM], beams[BROKEN]
    _mark_breaks(
        x[:count], y[:count], rho[:count], beam[:count], broken[:count], noise, n, most_missing
    )
    first, last, kept, spikes = np.int64(0), count - 1, 0, beams[SPIKE]
    if count > 0:
        broken[0] = not circular or is_broken(points, beams, last, first, n, noise, most_missing)
    for i in range(count):
        before, after = i - 1 if i > 0 else last, i + 1 if i < last else 0
        spikes[i] = broken[i] and broken[after] and (circular or 0 < i < last)
        if spikes[i] and is_broken(points, beams, before, after, n, noise, most_missing):
            spikes[i] = 0
    for i in range(count):
        before, after = i - 1 if i > 0 else last, i + 1 if i < last else 0
        if spikes[i] and not spikes[before] and not spikes[after]:
            broken[after] = 0
            continue
        if kept < i:
            x[kept], y[kept], rho[kept] = x[i], y[i], rho[i]
            beam[kept], broken[kept] = beam[i], broken[i]
        kept += 1
    return kept


@helper
def opening(points, beams, count):
    """Where to open a full circle: behind its largest step, or at the farthest measurement.

    Where nothing breaks, a polygon always has a vertex there. Also returns whether nothing does.
    """
    rho, broken, at, largest, closed = points[RHO], beams[BROKEN], 0, -1.0, True
    for i in range(count):
        step = abs(rho[i] - rho[i - 1 if i > 0 else count - 1])
        if broken[i] and step > largest:
            at, largest, closed = i, step, False
        if closed and rho[i] > rho[at]:
            at = i
    return beams[BEAM, at], closed


@helper
def list_clusters(beams, count, clusters):
    """List the clusters, from break to break, and their number by beam. Returns how many.

    Fewer than three measurements are none, -1. Where no break is before the first, the last cluster
    goes on there.
    """
    broken, first, last = beams[BROKEN], beams[CLUSTER_FIRST], beams[CLUSTER_LAST]
    for i in range(len(clusters)):
        clusters[i] = -1
    begin, found, size = 0, 0, 0
    while begin < count and not broken[begin]:
        begin += 1
    begin = begin if begin < count else 0
    for t in range(begin, begin + count):
        size += 1
        after = t + 1 - (count if t + 1 >= count else 0)
        if t + 1 < begin + count and not broken[after]:
            continue
        if size >= _LEAST_CLUSTER:
            for back in range(t + 1 - size, t + 1):
                clusters[beams[BEAM, back - (count if back >= count else 0)]] = found
            begins = t + 1 - size
            first[found] = begins - (count if begins >= count else 0)
            last[found] = t - (count if t >= count else 0)
            found += 1
        size = 0
    return found
