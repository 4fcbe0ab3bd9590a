"""Method pdbs: its kernel equals its slow twin; every rule by hand; what it does not do."""

import math

import numpy as np
import pytest
from lineament_lab.methods.pdbs import RULES
from worlds import NOISE, fan, full_circle, scan_of, wall

from lineament import Extractor, LaserScan

# The rules by hand


def breaks(rule, ranges, step=0.01, **parameters):
    """Whether the second of two measurements begins a new cluster."""
    scan = LaserScan(ranges, 0.0, step)
    features = Extractor("pdbs", rule=rule, min_points=1, noise=NOISE, **parameters)(scan)
    return features.clusters[-1] == 1


def both_sides_of(rule, before, rho, **parameters):
    """Hold that the threshold lies between two ranges a hair apart, the second of which breaks."""
    assert not breaks(rule, [before, rho - 1e-6], **parameters)
    assert breaks(rule, [before, rho + 1e-6], **parameters)


def range_at(before, distance, step=0.01):
    """Range of the farther measurement that is `distance` from one at `before`."""
    across = before * math.sin(step)
    return before * math.cos(step) + math.sqrt(distance**2 - across**2)


def test_fixed():
    both_sides_of("fixed", 2.0, range_at(2.0, 0.25), distance=0.25)


def test_dietmayer():
    # 0.1 m and the spacing of two equal ranges of 2 m: 2 · 2 sin 0.005.
    both_sides_of("dietmayer", 2.0, range_at(2.0, 0.1 + 4 * math.sin(0.005)), c0=0.1)


def test_santos():
    # At β = 45° the cotangent is 1, and what is left is cos 0.005 - sin 0.005 = 0.99499.
    spacing = 4 * math.sin(0.005)
    both_sides_of("santos", 2.0, range_at(2.0, 0.1 + spacing / 0.99499), c0=0.1, beta=math.pi / 4)
    # A steeper surface holds together at more.
    wider = range_at(2.0, 0.1 + spacing / 0.99499)
    assert not breaks("santos", [2.0, wider], c0=0.1, beta=math.radians(60))


def test_lee_compares_ratios_and_not_metres():
    # (ρ - 2)/(ρ + 2) = 0.02 at ρ = 2 · 1.02/0.98, and at ten times that the same.
    for scale in (0.1, 1.0, 10.0):
        both_sides_of("lee", 2.0 * scale, 2.0 * scale * 1.02 / 0.98 * (1 + 1e-9), ratio=0.02)
    ranges = np.array([2.0, 2.05, 2.4, 2.41, 1.9, 1.93])
    labels = [
        Extractor("pdbs", rule="lee", min_points=1)(LaserScan(k * ranges, 0.0, 0.01)).clusters
        for k in (0.5, 1.0, 7.0)
    ]
    assert labels[0].tolist() == labels[1].tolist() == labels[2].tolist() == [0, 0, 1, 1, 2, 2]


def test_borges_aldon():
    # σ = 1 cm: 2 sin 0.01 / sin(0.1745 - 0.01) + 0.03.
    angle = math.radians(10)
    spacing = 2 * math.sin(0.01) / math.sin(angle - 0.01) + 0.03
    both_sides_of("borges_aldon", 2.0, range_at(2.0, spacing), grazing_angle=angle)
    # A wall at just over 10° to its beams holds together without noise, one at less does not.
    steps = 0.01 * np.arange(3)
    for grazing, joined in ((10.3, True), (9.7, False)):
        ranges = 2.0 * math.sin(math.radians(grazing)) / np.sin(math.radians(grazing) - steps)
        assert breaks("borges_aldon", ranges[:2], noise_factor=0.0, grazing_angle=angle) != joined


@pytest.mark.parametrize("rule", ["dietmayer", "santos", "borges_aldon", "lee"])
def test_the_angle_over_missing_beams_counts(rule):
    """A wall holds together over four missing beams as it does where none is missing."""
    angles = fan(20)
    ranges = wall(angles, 2.0, 30.0)
    ranges[40:44] = np.nan
    clusters = Extractor("pdbs", rule=rule, noise=NOISE)(scan_of(ranges, angles)).clusters
    assert set(clusters) == {0, -1}
    at = Extractor("pdbs", rule=rule, noise=NOISE).trace(scan_of(ranges, angles))
    assert at.distance_threshold[44] > at.distance_threshold[45]


def test_no_rule_bridges_a_doorway():
    angles = fan(40)
    ranges = wall(angles, 2.0, 0.0)
    for missing in (5, 6, 40):
        ranges[100 : 100 + missing] = np.inf
        for rule in RULES:
            features = Extractor("pdbs", rule=rule, distance=0.5)(scan_of(ranges, angles))
            assert features.clusters.max() == (1 if missing > 5 else 0)
            kinds = features.breakpoints["kind"].tolist()
            assert kinds == ["gap"] * (missing > 5) + ["scan_end"] * 2


def test_cluster_over_the_seam_is_one():
    angles = full_circle(720)
    ranges = np.where(abs(angles) > 2.6, wall(angles, 2.0, 180.0), 6.0)
    features = Extractor("pdbs", noise=NOISE)(scan_of(ranges, angles))
    assert features.clusters[0] == features.clusters[-1]
    assert features.clusters.max() == 1
    assert len(features.breakpoints) == 2
