"""Method ransac: equal to its slow twin; its draws; the same features whatever the batch."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive_regions import assert_same_pieces, sample
from worlds import NOISE, STEP, degenerate_scans, fan, random_scan, scan_of, wall

from lineament import Extractor, LaserScan, RangeNoise
from lineament.kernels.rivals.ransac import PERIOD, draw
from lineament.methods.ransac import Ransac

DEGENERATE = degenerate_scans()
METHODS = {
    "default": (Ransac(), None),
    "narrow": (Ransac(trials=7, window=6, min_length=0.3, max_misses=0, seed=12345), None),
    "bearing noise": (Ransac(trials=5, min_points=8), RangeNoise(0.01, 0.002, 0.001, 0.01)),
}


@pytest.mark.parametrize("scan", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_scans_equal_the_slow_twin(scan):
    assert_same_pieces(Ransac(trials=5), scan, sample)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "noise"), METHODS.values(), ids=METHODS)
def test_random_scans_equal_the_slow_twin(method, noise):
    pieces = sum(assert_same_pieces(method, random_scan(s), sample, noise) for s in range(10))
    assert pieces > 20  # Else nothing was compared.


def naive_draws(seed, n):
    out = [seed]
    while len(out) <= n:
        out.append(out[-1] * 48271 % (2**31 - 1))
    return out


def test_generator_is_the_least_standard_one():
    """Its 10 000th number from 1 on is the one that the C++ standard demands (minstd_rand)."""
    assert naive_draws(1, 10_000)[-1] == 399268537
    draw_once = getattr(draw, "py_func", draw)
    for seed in (1, 2, PERIOD - 1):
        assert draw_once(seed) == naive_draws(seed, 1)[-1]


def rows_of_a_room(n):
    angles = fan(60)
    ranges = np.minimum(wall(angles, 2.0, 0.0), wall(angles, 2.5, 60.0))
    return angles, ranges + 0.03 * np.random.default_rng(1).normal(size=(n, len(angles)))


def test_same_scan_has_the_same_features_whatever_the_batch_or_the_thread():
    angles, rows = rows_of_a_room(12)
    bearings = {"angle_min": float(angles[0]), "angle_increment": STEP}
    extractor = Extractor("ransac", trials=5)
    batches = [extractor.batch(rows, **bearings, workers=workers) for workers in (1, 3)]
    backwards = extractor.batch(rows[::-1], **bearings)
    for i in range(12):
        alone = extractor(LaserScan(rows[i], **bearings)).segments.tobytes()
        assert alone == batches[0][i].segments.tobytes() == batches[1][i].segments.tobytes()
        assert alone == backwards[11 - i].segments.tobytes()


def test_seed_is_all_that_changes_the_draws():
    angles, rows = rows_of_a_room(1)
    scan = scan_of(rows[0], angles)
    cuts = {
        Extractor(Ransac(trials=1, seed=s), noise=NOISE)(scan).segments.tobytes()
        for s in (1, 1, 7, 7, 99)
    }
    assert 1 < len(cuts) <= 3


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("trials", [0, 2.0, None]),
        ("window", [0, 2.5]),
        ("min_points", [2, 4.0]),
        ("min_length", [-0.1, math.nan]),
        ("max_misses", [-1, 1.0]),
        ("epsilon", [-0.1]),
        ("sigmas", [-1, math.inf]),
        ("seed", [0, -1, PERIOD, 1.0]),
        ("reach", [-1.0]),
        ("fit", ["huber"]),
        ("max_vertices", [-1]),
    ],
)
def test_bounds(name, refused):
    for value in refused:
        with pytest.raises(ValueError, match=f"{name} is ") as error:
            Ransac(**{name: value})
        assert str(value) in str(error.value)
