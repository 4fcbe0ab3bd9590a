"""Method optimal from another side: turned, mirrored, cut at another beam, in other units."""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import numpy as np
import pytest
from worlds import BOX, NOISE, full_circle, random_scan, room, scan_of

from lineament import Extractor, LaserScan, RangeNoise
from lineament.simulation import SCENES, SENSORS, scene

UNAWARE, AWARE = Extractor("optimal"), Extractor("optimal", noise=NOISE)
TABLES = ("segments", "corners", "arcs")


def rotated(points, turn):
    c, s = math.cos(turn), math.sin(turn)
    return points @ [[c, s], [-s, c]]


def seen(scan, ranges, angles):
    """Make a scan of other ranges and bearings with the limits of one."""
    limits = {"range_min": scan.range_min, "range_max": scan.range_max}
    if scan.is_regular:
        return LaserScan(ranges, float(angles[0]), scan.angle_increment, **limits)
    return LaserScan(ranges, angles=angles, **limits)


def rows_of(features, place=np.asarray, flip=False):
    """What there is to know of segments, corners and arcs, one row each, by places elsewhere."""
    lines, corners, arcs = features.segments, features.corners, features.arcs
    ends = ("end", "start") if flip else ("start", "end")
    variances = lines["covariance"][:, [0, 1], [0, 1]] ** 0.5
    numbers = [lines[name] for name in ("n_points", "rms", "misfit")]
    yield np.column_stack([place(lines[e]) for e in (*ends, "centroid")] + [variances, *numbers])
    kinds = corners["kind"] == "edge"
    numbers = [corners[name] for name in ("opening", "quality", "convex", "response")]
    spread = np.sqrt(np.trace(corners["covariance"], axis1=1, axis2=2))
    yield np.column_stack([place(corners["position"]), spread, kinds, *numbers])
    yield np.column_stack([place(arcs["center"]), arcs["radius"], arcs["n_points"]])


def assert_same(one, other, beams, place=np.asarray, flip=False):
    """Hold that features are those of another scan in any order.

    `beams` and `place` lead from the beams and the places of one to those of the other.
    """
    tables = zip(rows_of(one, place, flip), rows_of(other), strict=True)
    for name, (before, after) in zip(TABLES, tables, strict=False):
        assert len(before) == len(after), name
        near = np.isclose(before[:, None], after, rtol=1e-5, atol=1e-6).all(axis=2)
        assert (near.sum(axis=0) == 1).all(), name
        assert (near.sum(axis=1) == 1).all(), name
    pairs = set(zip(one.clusters.tolist(), other.clusters[beams].tolist(), strict=True))
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})
    assert all((a < 0) == (b < 0) for a, b in pairs)


@cache
def simulated(sensor):
    """Make four scans of each kind of scene."""
    device, scans = SENSORS[sensor], []
    for kind, seed in product(SCENES, range(4)):
        world, pose = scene(kind, seed)
        scans.append(device.scan(world, pose, np.random.default_rng(seed)))
    return scans


@pytest.fixture(params=[*SENSORS, "random"])
def scans(request):
    """Scans of a sensor, or of nothing in particular."""
    if request.param == "random":
        return [random_scan(seed) for seed in range(60)]
    return simulated(request.param)


def test_features_turn_with_the_bearings(scans):
    """All directions are alike: no axis is special."""
    extractor = UNAWARE
    for scan, turn in zip(scans, np.linspace(0.3, 6.0, len(scans)), strict=True):
        other = extractor(seen(scan, scan.ranges, scan.angles + turn))
        assert_same(extractor(scan), other, np.arange(len(scan)), lambda p, t=turn: rotated(p, t))


def test_features_of_a_mirrored_scan_are_mirrored(scans):
    extractor = UNAWARE
    for scan in scans:
        other = extractor(seen(scan, scan.ranges[::-1], -scan.angles[::-1]))
        beams = np.arange(len(scan))[::-1]
        assert_same(extractor(scan), other, beams, lambda p: p * (1, -1), flip=True)


def test_interlaced_edges_are_the_same_from_both_sides():
    """A spike among measurements of another surface: which of them is one is not told by order."""
    angles = math.radians(0.5) * np.arange(-30, 31)
    for mixed in ((4.0, 2.0), (4.0, 2.0, 4.0, 2.0)):
        ranges = np.r_[np.full(30, 2.0), mixed, np.full(31 - len(mixed), 4.0)] / np.cos(angles)
        one = AWARE(scan_of(ranges, angles))
        other = AWARE(scan_of(ranges[::-1], angles))
        assert_same(one, other, np.arange(61)[::-1], lambda p: p * (1, -1), flip=True)


def test_features_do_not_depend_on_the_seam(scans):
    """A full circle may begin at any beam."""
    extractor, rng = AWARE, np.random.default_rng(3)
    for scan in scans:
        n, shift = len(scan), int(rng.integers(1, max(len(scan), 2)))
        if scan.is_full_circle:
            angles = scan.angles - shift * scan.angle_increment
            other = extractor(seen(scan, np.roll(scan.ranges, shift), angles))
            assert_same(extractor(scan), other, (np.arange(n) + shift) % n)


def test_wherever_the_seam_lies_the_room_is_the_same():
    n = 720
    ring, step = full_circle(n), 2 * math.pi / n
    ranges = room(ring, BOX) + 0.01 * np.random.default_rng(2).normal(size=n)
    one = AWARE(scan_of(ranges, ring))
    assert len(one.corners) == len(one.segments) == 4
    for shift in range(0, n, 45):
        turned = LaserScan(np.roll(ranges, shift), -math.pi - shift * step, step)
        other = AWARE(turned)
        assert len(other.breakpoints) == 0
        assert_same(one, other, (np.arange(n) + shift) % n)


@pytest.mark.parametrize("scale", [2.0, 4.0])
def test_lengths_and_noise_scale_together(scale):
    """But for the scale of a surface and the reach of a corner, which do not matter here."""
    ring, angles = full_circle(720), math.radians(0.25) * np.arange(-40, 41)
    column = 1.5 * np.cos(angles) - np.sqrt(0.3**2 - (1.5 * np.sin(angles)) ** 2)
    for ranges, bearings in ((room(ring, BOX), ring), (column, angles)):
        one, two = (
            Extractor("optimal", noise=RangeNoise(sigma=0.004 * k))(scan_of(k * ranges, bearings))
            for k in (1.0, scale)
        )
        assert len(one.arcs) == len(two.arcs) == (bearings is angles)
        assert len(one.segments) == len(two.segments) == 4 * (bearings is ring)
        for table, names in (
            ("segments", ("start", "end", "centroid")),
            ("corners", ("position",)),
        ):
            for name in names:
                before, after = getattr(one, table)[name], getattr(two, table)[name]
                np.testing.assert_allclose(after, scale * before, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(two.arcs["radius"], scale * one.arcs["radius"], rtol=1e-6)
        np.testing.assert_allclose(
            two.corners["covariance"], scale**2 * one.corners["covariance"], rtol=1e-5, atol=1e-12
        )
        assert two.clusters.tolist() == one.clusters.tolist()
