"""Every method but optimal equals its slow twin: on random, degenerate and recorded scans."""

import math
from itertools import islice

import pytest
from equality import assert_same_run
from hypothesis import given, settings
from hypothesis import strategies as st
from lineament_lab.methods.pdbs import RULES
from naive_partition import assert_same_lines, assert_same_partition, assert_same_split, untied
from naive_regions import assert_same_pieces, grow, sample, vote
from worlds import NOISE, degenerate_scans, random_scan

from lineament import Extractor, RangeNoise, open_log
from lineament.kernels.corner_operator import RESPONSES
from lineament.kernels.line_fit import FITS

SENSOR, SMALL_NOISE = RangeNoise(0.01, 0.01, 0.002, 0.01), RangeNoise(0.01, 0.002, 0.001, 0.01)
CHANGED = {"threshold": 0.02, "min_piece": 2, "noise": SENSOR}
#: By twin, by method: parameters, by name. The methods are run without merging where the twin does
#: not merge.
LIU = {
    "default": Extractor("liu"),
    "paper": Extractor("liu:paper", threshold=0.3),
    "scale free": Extractor("liu:scale_free", noise=RangeNoise(0.0, 0.01, 0.002, 0.01)),
    "weighted": Extractor(
        "liu:scale_free", fit="weighted", noise=RangeNoise(0.01, 0.001, 0.001), min_points=5
    ),
    "at beams": Extractor(
        "liu", response="tangent", threshold=0.3, corner="beam", min_points=2, noise=NOISE
    ),
}
PARTITIONS = {
    # Not 0.05, that measurements in whole centimetres have exactly.
    **{rule: Extractor("pdbs", rule=rule, ratio=math.pi / 60) for rule in RULES},
    "pdbs:paper": Extractor("pdbs:paper"),
    "pdbs, changed": Extractor(
        "pdbs", max_missing=0, min_points=1, noise_factor=0.0, grazing_angle=0.4, noise=SENSOR
    ),
    "santos, wide": Extractor("pdbs", rule="santos", beta=1.2, c0=0.0, max_missing=200),
}
SPLITTERS = {
    "iepf": Extractor("iepf", settling=False),
    "iepf:paper": Extractor("iepf:paper"),
    "iepf, changed": Extractor("iepf", settling=False, **CHANGED),
    "split_and_merge": Extractor("split_and_merge"),
    "split_and_merge:paper": Extractor("split_and_merge:paper"),
    "split_and_merge, changed": Extractor("split_and_merge", **CHANGED),
}
TRACKERS = {
    "line_tracking": Extractor("line_tracking"),
    "line_tracking:paper": Extractor("line_tracking:paper"),
    "line_tracking, changed": Extractor(
        "line_tracking", **CHANGED | {"min_piece": 6}, noise_factor=2.0, max_misses=0
    ),
}
FINDERS = {
    "hough": (vote, Extractor("hough")),
    "hough, coarse": (
        vote,
        Extractor("hough", angles=30, distances=16, min_length=0.3, max_misses=0),
    ),
    "hough, bearings": (vote, Extractor("hough", angles=60, min_points=8, noise=SMALL_NOISE)),
    "ransac": (sample, Extractor("ransac")),
    "ransac, narrow": (
        sample,
        Extractor("ransac", trials=7, window=6, min_length=0.3, max_misses=0, seed=12345),
    ),
    "ransac, bearings": (sample, Extractor("ransac", trials=5, min_points=8, noise=SMALL_NOISE)),
    "region_growing": (grow, Extractor("region_growing")),
    "region_growing, metres": (
        grow,
        Extractor("region_growing", sigmas=0.0, epsilon=0.03, p_min=10, l_min=0.3),
    ),
    "hough:paper": (vote, Extractor("hough:paper")),
    "ransac:paper": (sample, Extractor("ransac:paper")),
    "region_growing:paper": (grow, Extractor("region_growing:paper")),
    "region_growing, bearings": (grow, Extractor("region_growing", s_num=4, p_min=5, noise=SENSOR)),
}
DEGENERATE = degenerate_scans()
FAST = [*LIU, *PARTITIONS, *SPLITTERS, *TRACKERS]


def assert_same(name, scan):
    """Hold a method equal to its twin on a scan. Returns how much was compared."""
    if name in LIU:
        return len(assert_same_run(scan, LIU[name])["segments"])
    if name in PARTITIONS:
        return assert_same_partition(scan, PARTITIONS[name])
    if name in SPLITTERS:
        return assert_same_split(scan, SPLITTERS[name])
    if name in TRACKERS:
        return assert_same_lines(scan, TRACKERS[name])
    find, extractor = FINDERS[name]
    return assert_same_pieces(extractor.method, scan, find, extractor.noise)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:all ranges are")
@pytest.mark.parametrize("scan", DEGENERATE.values(), ids=DEGENERATE)
@pytest.mark.parametrize("name", [*FAST, "ransac, bearings", "hough, coarse", "region_growing"])
def test_degenerate_scans(name, scan):
    assert_same(name, untied(scan) if name in SPLITTERS else scan)


@settings(max_examples=60)
@given(
    st.integers(0, 2**32 - 1),
    st.fixed_dictionaries(
        {
            "sigma_d": st.floats(0.3, 20),
            "sigma_r": st.floats(0.01, 2),
            "half_width": st.integers(0, 20),
            "spacing_scale": st.floats(1, 10),
            "noise_floor": st.floats(0, 5),
            "density_k": st.floats(0, 6),
            "min_points": st.integers(2, 9),
            "support_radius": st.integers(1, 9),
            "threshold": st.floats(0.02, 0.5),
            "response": st.sampled_from(sorted(RESPONSES)),
            "recursion": st.sampled_from(["both", "after"]),
            "ends": st.sampled_from(["truncated", "excluded"]),
            "fit": st.sampled_from(sorted(FITS)),
        }
    ),
)
def test_liu_of_any_parameters(seed, parameters):
    assert_same_run(random_scan(seed, 120), Extractor("liu", **parameters))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FAST, *FINDERS])
def test_many_random_scans(name):
    seeds = range(10) if name in FINDERS else range(100, 160)
    assert sum(assert_same(name, random_scan(seed)) for seed in seeds) > 20


@pytest.mark.slow
@pytest.mark.parametrize("name", FAST)
def test_recorded_scans(recorded_scans, data_dir, name):
    scans = recorded_scans
    if name in LIU:
        scans = [*scans[::6], *others(data_dir)]
    assert sum(assert_same(name, scan) for scan in scans) > 50


def others(data_dir):
    """Scans of other sensors."""
    yield from islice(open_log(data_dir / "carmen" / "aces-corrected.log.gz"), 0, 500, 40)
    for name in ("fr079_graph", "jackal_static_data", "jackal_mocap_02171554"):
        yield from islice(open_log(data_dir / "truth" / f"{name}.npz"), 0, None, 120)
