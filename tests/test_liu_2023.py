"""`liu:paper` and `liu:figure9` reproduce the script written from the paper, stage by stage."""

from itertools import islice, pairwise

import numpy as np
import pytest
from liu_2023 import Paper, bilateral_filter, distances, liu_2023, polar
from worlds import degenerate_scans, random_scan

from lineament import Extractor, LaserScan, open_log
from lineament.simulation import SCENES, SENSORS, scene

#: The filter of the kernels sums in float32 [m].
FILTER = 5e-5
#: The kernels take σ_K from running sums: where it is nearly 0, half its digits are left [m].
ROOT = 1e-7
OTHERS = degenerate_scans()
OTHERS |= {
    f"ring of {n}": LaserScan(2 + 0.2 * np.sin(np.arange(n)), -np.pi, 2 * np.pi / n)
    for n in range(3, 20)
}
OTHERS |= {f"random {seed}": random_scan(seed) for seed in range(12)}
LOGS = (
    "carmen/intel-corrected.log.gz",
    "carmen/csail-corrected.log.gz",
    "rosbag1/scans_demo.bag",
    "rosbag2/ld19",
    "rosbag2/jackal_mocap",
    "text/tinyslam_exp1.dat.gz",
)
RESPONSES = ("tangent", "product", "relative", "product_scaled", "chord_scaled")
THRESHOLDS = (0.0, 0.02, 0.05, 0.1, 0.2)
PRESETS = {"liu:paper": {}, "liu:figure9": {"response": "product_scaled"}}
VARIANTS = {
    "the paper's numbers": {},
    "the reading of Figure 9": {"method": "liu:figure9"},
    "more corners": {"threshold": 0.05},
    "a wide filter": {"half_width": 8},
    "a wide filter, more corners": {"half_width": 8, "threshold": 0.1},
    "product": {"response": "product", "threshold": 0.05},
    "relative": {"response": "relative", "threshold": 0.15, "support_radius": 10},
    "scaled by the chord": {"response": "chord_scaled", "threshold": 0.2},
    "to the letter": {"recursion": "after", "fit": "slope_intercept", "threshold": 0.1},
    "whole supports": {"ends": "excluded", "threshold": 0.1},
    "narrow": {"half_width": 3, "sigma_d": 1.5, "sigma_r": 0.1, "threshold": 0.2},
    "unfiltered": {"half_width": 0, "support_radius": 1, "threshold": 0.02},
    "clusters": {"spacing_scale": 2.0, "density_k": 1.0, "min_points": 5, "threshold": 0.1},
    "pairs": {"spacing_scale": 9.0, "density_k": 0.0, "min_points": 2, "threshold": 0.05},
}


def equal(actual, expected, off=1e-9):
    """Compare to 1 nm; of ranges of 10⁹ m, 12 digits are asked."""
    np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=off)


def simulated(sensor):
    """One scan of each kind of scene."""
    worlds = (scene(kind, 3) for kind in SCENES)
    return [SENSORS[sensor].scan(*world, np.random.default_rng(5)) for world in worlds]


def by_the_paper(scan, filtered, paper):
    return liu_2023(filtered, scan.angles, scan.angle_increment, scan.is_full_circle, paper)


def has_length(points, piece, _, direction):
    first, last = points[piece[0]], points[piece[-1]]
    return abs((last - first) @ direction) > 1e-12 * np.hypot(*direction) * np.abs(first).sum()


def assert_reproduced(scan, may_tie=False, method="liu:paper", **changes):
    """Compare each stage on the ranges that the kernels filtered, and the corners end to end.

    Where two points are equally far from a chord, the last digits of the filter decide. Returns
    the number of lines, and whether there was such a tie.
    """
    paper = Paper(**PRESETS[method], **changes)
    trace = Extractor(method, **changes).trace(scan)
    features = trace.features
    ranges = np.where(scan.valid, scan.ranges, np.nan)
    filtered = bilateral_filter(ranges, scan.is_full_circle, paper)
    equal(trace.filtered, filtered, FILTER)

    found = by_the_paper(scan, trace.filtered, paper)
    clusters = found.clusters
    np.testing.assert_array_equal(trace.clusters, clusters.labels())
    equal(trace.spacing, clusters.spacing)
    equal(trace.distance_threshold, clusters.distance_threshold)
    equal(trace.density_threshold, clusters.density_threshold, ROOT)

    beams, to_chord, responses = np.reshape(found.candidates, (-1, 3)).T
    np.testing.assert_array_equal(trace.candidates["beam"], beams)
    equal(trace.candidates["chord_distance"], to_chord)
    equal(trace.candidates["response"], responses)
    points = polar(trace.filtered, scan.angles)
    np.testing.assert_array_equal(trace.cuts, np.sort(found.corners))
    # A corner is between two lines; a ring with one corner has none. What begins and ends at the
    # same place of its line is a line of the paper, but no segment.
    lines = [line for line in found.lines if has_length(points, *line)]
    if lines and len(lines) == len(found.lines):
        np.testing.assert_array_equal(np.sort(features.corners["beam"]), trace.cuts)
    else:
        assert set(features.corners["beam"]) <= set(trace.cuts)
    corners = points[features.corners["beam"]]
    equal(features.corners["position"], corners)

    assert len(features.segments) == len(lines)
    for segment, (piece, centroid, direction) in zip(features.segments, lines, strict=True):
        assert (segment["first_beam"], segment["last_beam"]) == (piece[0], piece[-1])
        assert segment["n_points"] == len(piece)
        equal(segment["centroid"], centroid)
        across = np.array([-np.sin(segment["angle"]), np.cos(segment["angle"])])
        equal(across @ direction / np.hypot(*direction), 0)
        off = distances(points[piece], centroid, direction)
        equal(segment["rms"], np.sqrt(np.mean(off**2)))

    alone = by_the_paper(scan, filtered, paper)
    np.testing.assert_array_equal(alone.clusters.labels(), trace.clusters)
    tie = alone.corners != found.corners
    if tie and may_tie:
        pairs = zip(alone.candidates, found.candidates, strict=False)
        own, other = next(pair for pair in pairs if pair[0][0] != pair[1][0])
        equal(own[1], other[1], FILTER)
    else:
        assert alone.corners == found.corners
    return len(found.lines), tie


@pytest.mark.slow
@pytest.mark.parametrize("changes", VARIANTS.values(), ids=VARIANTS)
@pytest.mark.parametrize("sensor", ["paper", "utm30lx", "lms361", "rplidar", "ld19"])
def test_simulated_scans_are_reproduced(sensor, changes):
    lines = [assert_reproduced(scan, **changes)[0] for scan in simulated(sensor)]
    assert sum(lines) > len(lines)


@pytest.mark.slow
@pytest.mark.parametrize("changes", VARIANTS.values(), ids=VARIANTS)
@pytest.mark.parametrize("log", LOGS)
def test_recorded_scans_are_reproduced(data_dir, log, changes):
    scans = list(islice(open_log(data_dir / log), 0, 100, 20))
    whole_millimetres = log == "rosbag2/ld19"
    found = [assert_reproduced(scan, whole_millimetres, **changes) for scan in scans]
    lines, ties = np.sum(found, axis=0)
    assert lines > len(scans)
    assert ties <= 2


@pytest.mark.slow
@pytest.mark.parametrize(("name", "scan"), OTHERS.items(), ids=OTHERS)
def test_other_scans_are_reproduced(name, scan):
    for changes in VARIANTS.values():
        assert_reproduced(scan, may_tie=name == "open box", **changes)


@pytest.mark.parametrize("recursion", ["both", "after"])
@pytest.mark.parametrize("response", RESPONSES)
def test_corners_are_nested_in_the_threshold(response, recursion):
    """What a higher threshold finds, a lower one finds as well, and more."""
    form = {"response": response, "recursion": recursion}
    found = np.zeros(len(THRESHOLDS), int)
    for seed in range(20):
        scan = random_scan(seed)
        traces = [Extractor("liu:paper", threshold=t, **form).trace(scan) for t in THRESHOLDS]
        cuts = [set(trace.cuts.tolist()) for trace in traces]
        assert all(higher <= lower for lower, higher in pairwise(cuts))
        found += [len(beams) for beams in cuts]
    assert (np.diff(found) < 0).all()
