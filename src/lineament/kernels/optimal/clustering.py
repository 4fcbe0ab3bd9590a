"""Step 2: which measurements are usable, and between which a surface breaks."""

import numpy as np

from .. import FARTHEST, NEAREST, helper, inlined, sums, usable
from . import layout as at
from .constants import LEAST_CLUSTER, STEEPEST, STEP_SIGMAS
from .geometry import around, missing


@inlined
def list_points(work, ranges, start, limits, bearings):
    """Place the usable measurements from beam `start` around. Returns how many there are."""
    points, beam = work.points, work.beams[at.BEAM]
    x, y, rho = points[at.X], points[at.Y], points[at.RHO]
    cosines, sines = bearings[0], bearings[1]
    range_min, range_max = max(limits[0], NEAREST), min(limits[1], FARTHEST)
    count = 0
    for first, end in ((start, len(ranges)), (0, start)):
        for i in range(first, end):
            # What is not usable is written over by the next, or behind the last.
            is_usable = usable(ranges[i], range_min, range_max)
            r = ranges[i] if is_usable else 0.0
            beam[count], rho[count], x[count], y[count] = i, r, r * cosines[i], r * sines[i]
            count += is_usable
    return count


@helper
def _steps_out(x0, y0, rho0, x1, y1, rho1, noise):
    """Whether the range steps by more than that of a surface met at the steepest incidence."""
    near, far = min(rho0, rho1), max(rho0, rho1)
    # Times the farther range, so that nothing is divided, and no root is taken.
    square, beyond = far * far, far * (far - near) - STEEPEST * abs(x0 * y1 - y0 * x1)
    allowed = STEP_SIGMAS * STEP_SIGMAS * square * (noise[at.CONSTANT] + noise[at.GROWTH] * square)
    return (beyond > 0.0) & (beyond * beyond > allowed)


@inlined
def _is_broken(work, i, j, n, most_missing):
    """Whether no surface goes on from measurement i to j, the next one of a scan of n beams."""
    x, y, rho = work.points[at.X], work.points[at.Y], work.points[at.RHO]
    is_gap = missing(work.beams[at.BEAM, i], work.beams[at.BEAM, j], n) > most_missing
    return is_gap or _steps_out(x[i], y[i], rho[i], x[j], y[j], rho[j], work.noise)


@sums
def _mark_breaks(points, beams, count, noise, n, most_missing):
    """Mark where a surface breaks between a measurement and the one before."""
    x, y, rho = points[at.X, :count], points[at.Y, :count], points[at.RHO, :count]
    beam, broken = beams[at.BEAM, :count], beams[at.BROKEN, :count]
    x1, y1, rho1, beam1, broken1 = x[1:], y[1:], rho[1:], beam[1:], broken[1:]
    for i in range(len(x1)):
        apart = beam1[i] - beam[i]
        is_gap = apart + (n if apart < 0 else 0) - 1 > most_missing
        broken1[i] = is_gap | _steps_out(x[i], y[i], rho[i], x1[i], y1[i], rho1[i], noise)


@inlined
def _mark_spikes(work, count, n, circular, most_missing):
    """Mark the measurements that are broken from neighbours which hold together, and count them."""
    broken, spikes = work.beams[at.BROKEN], work.beams[at.SPIKE]
    last, pairs = count - 1, np.int64(0)
    # Hardly any measurement is one.
    broken1 = broken[1:count]
    for i in range(len(broken1)):
        spikes[i] = broken[i] & broken1[i]
        pairs += spikes[i]
    if circular and count > 0:
        spikes[last] = broken[last] & broken[0]
        pairs += spikes[last]
    elif count > 1:
        pairs, spikes[0], spikes[last] = pairs - spikes[0], 0, 0
    for i in range(count if pairs > 0 else 0):
        if spikes[i]:
            before, after = around(i - 1, count), around(i + 1, count)
            if _is_broken(work, before, after, n, most_missing):
                spikes[i], pairs = 0, pairs - 1
    return pairs


@inlined
def cluster(work, count, n, circular, most_missing):
    """Mark where a surface breaks, and drop the spikes. Returns how many measurements are left.

    A spike is broken from both its neighbours, while these hold together. Of two in a row neither
    is one: where beams see two surfaces in turn, both are there.
    """
    points, beam, broken = work.points, work.beams[at.BEAM], work.beams[at.BROKEN]
    _mark_breaks(points, work.beams, count, work.noise, n, most_missing)
    first, last, kept, spikes = np.int64(0), count - 1, 0, work.beams[at.SPIKE]
    if count > 0:
        broken[0] = not circular or _is_broken(work, last, first, n, most_missing)
    if _mark_spikes(work, count, n, circular, most_missing) == 0:
        return count
    for i in range(count):
        before, after = around(i - 1, count), around(i + 1, count)
        if spikes[i] and not spikes[before] and not spikes[after]:
            broken[after] = 0
            continue
        for row in (at.X, at.Y, at.RHO):
            points[row, kept] = points[row, i]
        beam[kept], broken[kept] = beam[i], broken[i]
        kept += 1
    return kept


@inlined
def opening(work, count):
    """Where to open a full circle: behind its largest step, or at the farthest measurement.

    Where nothing breaks, a polygon always has a vertex there. Also returns whether nothing does.
    """
    rho, broken, begin = work.points[at.RHO], work.beams[at.BROKEN], 0
    largest, closed = -1.0, True
    for i in range(count):
        step = abs(rho[i] - rho[around(i - 1, count)])
        if broken[i] and step > largest:
            begin, largest, closed = i, step, False
        if closed and rho[i] > rho[begin]:
            begin = i
    return work.beams[at.BEAM, begin], closed


@helper
def list_clusters(beams, count, clusters):
    """List the clusters, from break to break, and their number by beam. Returns how many.

    Beams in none, and in one of fewer than three measurements, have -1. Where no break is before
    the first measurement, the last cluster goes on there.
    """
    beam, broken = beams[at.BEAM], beams[at.BROKEN]
    for i in range(len(clusters)):
        clusters[i] = -1
    begin, found = 0, 0
    while begin < count and not broken[begin]:
        begin += 1
    begin = begin if begin < count else 0
    start, ahead = begin, broken[begin + 1 : count]
    for k in range(len(ahead) + 1):
        if k < len(ahead) and not ahead[k]:
            continue
        # What is before the first break belongs to the last cluster.
        end, seam = begin + 1 + k, begin if k == len(ahead) else 0
        if end - start + seam >= LEAST_CLUSTER:
            _label(clusters, beam[start:end], found)
            _label(clusters, beam[:seam], found)
            beams[at.CLUSTER_FIRST, found] = start
            beams[at.CLUSTER_LAST, found] = (seam if seam > 0 else end) - 1
            found += 1
        start = end
    return found


@helper
def _label(clusters, beams, number):
    for i in range(len(beams)):
        clusters[beams[i]] = number
