"""Method optimal: whole runs equal those of the slow twin."""

from __future__ import annotations

import numpy as np
import pytest
from equality import assert_same_features
from naive_optimal import optimal_features
from naive_partition import untied
from test_liu import real_scans
from worlds import NOISE, degenerate_scans, random_scan

from lineament import Extractor, RangeNoise
from lineament.simulation import SENSORS, scene

EXTRACTORS = {
    "default": Extractor("optimal"),
    "noise given": Extractor("optimal", noise=NOISE),
    "all parts of the noise": Extractor("optimal", noise=RangeNoise(0.01, 0.002, 0.001, 0.01)),
    "weak evidence": Extractor("optimal", evidence=12.0, max_missing=2, without=("growth",)),
    "bare": Extractor("optimal", without=("spikes", "growth", "borders", "dissolving", "arcs")),
}
DEGENERATE = degenerate_scans()
every_extractor = pytest.mark.parametrize("extractor", EXTRACTORS.values(), ids=EXTRACTORS)


def assert_same_run(scan, extractor):
    """Hold the features of the kernels equal to those of the twin; return these."""
    noise, features = extractor.noise, extractor(scan)
    given = noise and (noise.sigma, noise.proportional, noise.bearing, noise.quantum)
    twin = optimal_features(scan, extractor.method, given)
    if features.noise is not None:
        estimated = (features.noise.sigma, features.noise.proportional)
        np.testing.assert_allclose(estimated, twin["noise"][:2], rtol=1e-6, atol=1e-12)
    for own, corner in zip(features.corners, twin["corners"], strict=True):
        # A small difference of large χ².
        assert own["response"] == pytest.approx(corner["response"], rel=1e-3, abs=1e-2)
        corner["response"] = own["response"]
    assert_same_features(features, twin, rtol=1e-5, atol=1e-7)
    assert len(features.arcs) == len(twin["arcs"])
    for own, arc in zip(features.arcs, twin["arcs"], strict=True):
        for name in features.arcs.dtype.names:
            np.testing.assert_allclose(own[name], arc[name], rtol=1e-5, atol=1e-9, err_msg=name)
    return twin


@every_extractor
@pytest.mark.parametrize("scan", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_scans_equal_the_slow_twin(extractor, scan):
    assert_same_run(untied(scan), extractor)


@every_extractor
@pytest.mark.parametrize("seed", range(5))
def test_random_scans_equal_the_slow_twin(extractor, seed):
    assert_same_run(random_scan(seed), extractor)


@pytest.mark.slow
@every_extractor
def test_many_random_scans_equal_the_slow_twin(extractor):
    twins = [assert_same_run(random_scan(seed), extractor) for seed in range(100, 130)]
    found = {name: sum(len(twin[name]) for twin in twins) for name in ("segments", "corners")}
    assert min(found["segments"] / 5, found["corners"]) > 20  # Else nothing was compared.


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "rplidar"])
def test_scenes_with_columns_equal_the_slow_twin(name):
    sensor, twins = SENSORS[name], []
    extractor = Extractor("optimal", noise=sensor.noise)
    for seed in range(12):
        world, pose = scene("hall", seed)
        scan = sensor.scan(world, pose, np.random.default_rng(seed))
        twins.append(assert_same_run(scan, extractor))
    assert sum(len(twin["arcs"]) for twin in twins) >= 10


@pytest.mark.slow
def test_recorded_scans_equal_the_slow_twin(data_dir):
    scans = list(real_scans(data_dir))[1::3]
    twins = [assert_same_run(scan, EXTRACTORS["default"]) for scan in scans]
    assert sum(len(twin["segments"]) for twin in twins) > 100
