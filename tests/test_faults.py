"""Faults that were found, each with the smallest case that showed it."""

from __future__ import annotations

import numpy as np
import pytest

import lineament as ln
from lineament import LaserScan
from lineament.methods.stages import estimate_noise


def test_batches_are_equal_to_the_byte():
    rows = 3.0 + np.random.default_rng(4).normal(0, 0.02, (12, 301))
    batches = [
        ln.Extractor("liu").batch(rows, angle_min=-1.0, angle_increment=0.005, workers=workers)
        for workers in (1, 2, 3)
    ]
    for name in ("segments", "corners", "arcs", "breakpoints", "clusters", "offsets"):
        assert len({getattr(batch, name).tobytes() for batch in batches}) == 1


def test_huge_ranges_do_not_drown_their_neighbours():
    ranges = np.full(41, 2.0)
    ranges[[5, 20, 21]] = 3.4e38, 1e100, 1e7
    filtered = ln.trace(LaserScan(ranges, -0.2, 0.01), method="liu").filtered
    np.testing.assert_allclose(filtered, ranges, rtol=1e-6)


def test_a_jump_without_noise_is_no_lattice():
    scan = LaserScan([2.0] * 20 + [4.0] * 20, 0.0, 0.01)
    assert estimate_noise(scan).sigma == pytest.approx(1e-4)
    assert len(set(ln.extract(scan).clusters)) == 2
