"""What became of a beam: cases made by hand, and no beam of any scan without an answer."""

import numpy as np
import pytest
from worlds import degenerate_scans, random_scan

from lineament import Extractor, LaserScan, RangeNoise
from lineament.explain import explain
from lineament.methods import method_names
from lineament.simulation import SENSORS, scene

NOISE = RangeNoise(sigma=0.01)
OUTCOMES = {"invalid", "spike", "noise", "unexplained", "clustered", "segment", "arc"}
NAN, INF = float("nan"), float("inf")


def wall(n=61, distance=2.0):
    """Ranges of a wall straight ahead, and their bearings."""
    bearings = np.linspace(-0.5, 0.5, n)
    return distance / np.cos(bearings), bearings


def explained(scan, beam, method="optimal", **parameters):
    trace = Extractor(method, noise=NOISE, **parameters).trace(scan)
    explanation = explain(trace, beam)
    return explanation, " | ".join(f"{stage}: {text}" for stage, text in explanation.steps)


def wall_with(beams, ranges, n=61):
    """Scan of a wall straight ahead, but for the ranges of some beams [m]."""
    found, bearings = wall(n)
    found[beams] = ranges
    return LaserScan(found, angles=bearings, range_min=0.1, range_max=30.0)


def column():
    """Scan of a round column."""
    bearings = np.linspace(-0.14, 0.14, 41)
    ranges = 2 * np.cos(bearings) - np.sqrt(0.3**2 - (2 * np.sin(bearings)) ** 2)
    return LaserScan(ranges, angles=bearings)


def two_walls():
    """Scan of a wall before another one, and two measurements before both."""
    ranges, bearings = wall()
    ranges[32:] *= 2.0
    ranges[30:32] = 0.7
    return LaserScan(ranges, angles=bearings)


CLUTTER = wall(121)[0][50:58] - [0.4, 0.6, 0.2, 0.5, 0.7, 0.3, 0.6, 0.25]
TOO_FEW = "Noise: 2 measurements hold together here, too few for a cluster."
IN_A_WALL = ["beams 0 to 60, 61 measurements, 2.19 m", "0.0 mm along its beam (0.0 σ)"]
IN_A_WALL += ["no neighbour that it could be one line with", "cut in two here, χ² would fall by"]
AT_AN_END = ["the scan ends before", "to beam 10 after, over too many missing beams"]


@pytest.mark.parametrize(
    ("scan", "beam", "outcome", "summary", "steps"),
    [
        (wall_with(7, NAN), 7, "invalid", "the range is NaN, no measurement", []),
        (wall_with(7, INF), 7, "invalid", "the range is inf, nothing came back", []),
        (wall_with(7, 0.0), 7, "invalid", "the range is 0 m, no measurement", []),
        (wall_with(7, -1.0), 7, "invalid", "the range is -1 m, no measurement", []),
        (wall_with(7, 0.05), 7, "invalid", "0.05 m is below range_min = 0.1 m", []),
        (wall_with(7, 30.0), 7, "invalid", "30 m is at or beyond range_max = 30 m", []),
        (wall_with([], []), 30, "segment", "Part of segment 0.", IN_A_WALL),
        (wall_with(30, 3.0), 30, "spike", "", ["off the mean of its neighbours by +999.7 mm"]),
        (two_walls(), 30, "noise", TOO_FEW, ["to beam 29 before, more than the"]),
        (wall_with(slice(1, 10), NAN), 0, "noise", "", AT_AN_END),
        (wall_with(slice(50, 58), CLUTTER, 121), 53, "unexplained", "too crooked", ["is off by"]),
        (
            column(),
            20,
            "arc",
            "Part of arc 0.",
            ["radius 300.0 mm", "lines in its place would cost"],
        ),
    ],
)
def test_what_became_of_a_beam(scan, beam, outcome, summary, steps):
    explanation, text = explained(scan, beam)
    assert explanation.outcome == outcome
    assert summary in explanation.summary
    assert [words for words in steps if words not in text] == []


def test_the_verdict_on_a_corner():
    bearings = np.radians(np.arange(-40, 41))
    ranges = 2.0 / (np.cos(bearings) + abs(np.sin(bearings)))
    _, text = explained(LaserScan(ranges, angles=bearings), 41, "iepf")
    assert "was examined as a corner" in text
    assert "asked; a corner" in text
    # Metres against metres: near walls have no corner by the paper's numbers.
    _, text = explained(LaserScan(0.5 * ranges, angles=bearings), 40, "liu", response="tangent")
    assert "0.66 asked; rejected" in text
    # All partitions are compared: no corner was examined for itself.
    _, text = explained(LaserScan(ranges, angles=bearings), 41)
    assert "examined" not in text
    assert "if it were one line with a neighbour (12 asked)" in text


@pytest.mark.parametrize(("beam", "is_cut"), [(3, False), (4, True), (57, True), (58, False)])
def test_a_cut_is_weighed_where_both_sides_have_four_measurements(beam, is_cut):
    _, text = explained(wall_with([], []), beam)
    assert ("cut in two here" in text) == is_cut


@pytest.mark.parametrize(("distance", "words"), [(1.05, "1.05 m"), (0.9, "899.7 mm")])
def test_lengths_below_a_metre_are_in_millimetres(distance, words):
    ranges, bearings = wall()
    ranges[30] += distance
    _, text = explained(LaserScan(ranges, angles=bearings), 30)
    assert f"by +{words}" in text


@pytest.mark.parametrize(
    ("seed", "beam", "method", "words"),
    [
        (6, 70, "optimal", "yet it was not cut, and the two lines turn by"),
        (6, 90, "optimal", "°: one wall that bends"),
        (2, 70, "iepf", "asked; cut there first, then merged again"),
        (2, 65, "iepf", "asked; a border, but the lines on its sides do not meet there"),
    ],
)
def test_what_was_not_cut(seed, beam, method, words):
    assert words in explained(random_scan(seed), beam, method)[1]


def test_pdbs_finds_clusters_alone():
    assert explained(wall_with([], []), 5, "pdbs")[0].outcome == "clustered"


def test_a_ring_ends_nowhere():
    scan = LaserScan(np.full(720, 1.0), 0.0, np.radians(0.5))
    for beam in (0, 360, 719):
        explanation, text = explained(scan, beam, "liu")
        assert explanation.outcome == "unexplained"
        assert "720 measurements here in no line" in explanation.summary
        assert "the scan ends" not in text


@pytest.mark.parametrize("beam", [-1, 61, 1.0, True, None])
def test_a_beam_that_is_not_there_is_refused(beam):
    trace = Extractor(noise=NOISE).trace(wall_with([], []))
    with pytest.raises(ValueError, match=r"beam is .*, expected a whole number from 0 to 60"):
        explain(trace, beam)


def test_a_beam_of_a_table_is_a_beam():
    trace = Extractor(noise=NOISE).trace(wall_with([], []))
    for beam in (np.int32(30), np.int64(30), np.uint8(30)):
        assert explain(trace, beam) == explain(trace, 30)


def test_what_is_no_trace_is_refused():
    with pytest.raises(TypeError, match=r"type LaserScan, expected a Trace: lineament\.trace"):
        explain(wall_with([], []), 3)


def hall(sensor, seed):
    """Scan of a hall with round columns."""
    world, pose = scene("hall", seed)
    return SENSORS[sensor].scan(world, pose, np.random.default_rng(seed))


def agrees(trace, beam, explanation):
    """Whether an outcome is what the features say."""
    found, outcome = (trace.features.segments, trace.features.arcs), explanation.outcome
    spans = [(int(f["first_beam"]), int(f["last_beam"])) for table in found for f in table]
    inside = any(a <= beam <= b if a <= b else beam >= a or beam <= b for a, b in spans)
    if outcome in ("segment", "arc"):
        return inside
    if outcome == "invalid":
        return not np.isfinite(trace.filtered[beam])
    if outcome in ("unexplained", "clustered"):
        return not inside and trace.clusters[beam] >= 0
    return trace.clusters[beam] < 0


QUICK = ("optimal", "liu", "iepf")
METHODS = method_names(presets=False)
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in METHODS if name not in QUICK]


@pytest.mark.parametrize("method", [*QUICK, *SLOW])
def test_every_beam_has_an_answer_that_agrees_with_the_features(method):
    scans = [hall("rplidar", 5)]
    if method in QUICK:
        scans += [*degenerate_scans().values(), random_scan(5)]
    extractor = Extractor(method)
    for scan in scans:
        trace = extractor.trace(scan)
        for beam in range(0, len(scan), max(len(scan) // 60, 1)):
            explanation = explain(trace, beam)
            assert explanation.outcome in OUTCOMES
            assert explanation.steps
            assert agrees(trace, beam, explanation), (method, scan, beam, explanation)


@pytest.mark.slow
def test_the_evidence_is_of_the_same_run_where_the_noise_is_estimated():
    extractor = Extractor("optimal")
    for seed in range(5, 25):
        for sensor in ("rplidar", "lms361"):
            trace = extractor.trace(hall(sensor, seed))
            for kind, values in trace.evidence.items():
                assert len(values) == len(getattr(trace.features, kind)), (sensor, seed, kind)


@pytest.mark.parametrize("method", METHODS)
def test_without_noise_nothing_is_in_deviations(method):
    scan = wall_with([29, 30], [1.9, 2.3])
    trace = Extractor(method, noise=RangeNoise(sigma=0.0)).trace(scan)
    for beam in range(len(scan)):
        steps = explain(trace, beam).steps
        assert steps[0][1].endswith("without noise")
        assert not any("σ" in text for _, text in steps)
