"""What became of a beam: cases made by hand, and no beam of any scan without an answer."""

import numpy as np
import pytest
from worlds import degenerate_scans, random_scan

from lineament import Extractor, LaserScan, RangeNoise
from lineament.explain import explain
from lineament.methods import METHODS
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


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (NAN, "the range is NaN, no measurement"),
        (INF, "the range is inf, nothing came back"),
        (0.0, "the range is 0 m, no measurement"),
        (-1.0, "the range is -1 m, no measurement"),
        (0.05, "0.05 m is below range_min = 0.1 m"),
        (30.0, "30 m is at or beyond range_max = 30 m"),
    ],
)
def test_each_kind_of_invalid_beam_is_named(value, words):
    ranges, bearings = wall()
    ranges[7] = value
    scan = LaserScan(ranges, angles=bearings, range_min=0.1, range_max=30.0)
    explanation, _ = explained(scan, 7)
    assert explanation.outcome == "invalid"
    assert words in explanation.summary


def test_a_reading_on_a_wall_names_its_segment_and_the_evidence():
    ranges, bearings = wall()
    explanation, text = explained(LaserScan(ranges, angles=bearings), 30)
    assert (explanation.outcome, explanation.summary) == ("segment", "Part of segment 0.")
    assert "beams 0 to 60, 61 measurements, 2.19 m" in text
    assert "+0.0 mm along its beam (0.0 σ)" in text or "−0.0 mm along its beam (0.0 σ)" in text
    assert "no neighbour that it could be one line with" in text
    assert "cut in two here, χ² would fall by" in text


def test_a_spike_is_told_with_how_far_it_is_off():
    ranges, bearings = wall()
    ranges[30] += 1.0
    explanation, text = explained(LaserScan(ranges, angles=bearings), 30)
    assert explanation.outcome == "spike"
    assert "off the mean of its neighbours by +1.00 m" in text or "by +999" in text


def test_two_readings_before_two_walls_are_too_few_for_a_cluster():
    ranges, bearings = wall()
    ranges[32:] *= 2.0
    ranges[30:32] = 0.7
    explanation, text = explained(LaserScan(ranges, angles=bearings), 30)
    assert explanation.outcome == "noise"
    assert explanation.summary == "Noise: 2 measurements hold together here, too few for a cluster."
    assert "to beam 29 before, more than the" in text


def test_missing_beams_part_and_the_end_of_the_scan_is_explained():
    ranges, bearings = wall()
    ranges[1:10] = NAN
    explanation, text = explained(LaserScan(ranges, angles=bearings), 0)
    assert explanation.outcome == "noise"
    assert "the scan ends before" in text
    assert "to beam 10 after, over too many missing beams" in text


def test_clutter_between_walls_is_too_crooked():
    ranges, bearings = wall(121)
    ranges[50:58] -= [0.4, 0.6, 0.2, 0.5, 0.7, 0.3, 0.6, 0.25]
    explanation, text = explained(LaserScan(ranges, angles=bearings), 53)
    assert explanation.outcome == "unexplained"
    assert "too crooked" in explanation.summary
    assert "a line through them is off by" in text


def test_the_verdict_on_a_corner():
    bearings = np.radians(np.arange(-40, 41))
    ranges = 2.0 / (np.cos(bearings) + abs(np.sin(bearings)))
    _, text = explained(LaserScan(ranges, angles=bearings), 41, "iepf")
    assert "was examined as a corner" in text
    assert "asked; a corner" in text
    # Metres against metres: near walls have no corner by the paper's numbers.
    _, text = explained(LaserScan(0.5 * ranges, angles=bearings), 40, "liu")
    assert "0.66 asked; rejected" in text
    # All partitions are compared: no corner was examined for itself.
    _, text = explained(LaserScan(ranges, angles=bearings), 41)
    assert "examined" not in text
    assert "if it were one line with a neighbour (12 asked)" in text


def test_a_reading_on_a_column_is_part_of_an_arc():
    bearings = np.linspace(-0.14, 0.14, 41)
    ranges = 2 * np.cos(bearings) - np.sqrt(0.3**2 - (2 * np.sin(bearings)) ** 2)
    explanation, text = explained(LaserScan(ranges, angles=bearings), 20)
    assert (explanation.outcome, explanation.summary) == ("arc", "Part of arc 0.")
    assert "radius 300.0 mm" in text
    assert "lines in its place would cost" in text


def test_pdbs_finds_clusters_alone():
    ranges, bearings = wall()
    assert explained(LaserScan(ranges, angles=bearings), 5, "pdbs")[0].outcome == "clustered"


def test_a_ring_ends_nowhere():
    scan = LaserScan(np.full(720, 1.0), 0.0, np.radians(0.5))
    for beam in (0, 360, 719):
        explanation, text = explained(scan, beam, "liu")
        assert explanation.outcome == "unexplained"
        assert "720 measurements here in no line" in explanation.summary
        assert "the scan ends" not in text


@pytest.mark.parametrize("beam", [-1, 61, 1.0, True, None])
def test_a_beam_that_is_not_there_is_refused(beam):
    ranges, bearings = wall()
    trace = Extractor(noise=NOISE).trace(LaserScan(ranges, angles=bearings))
    with pytest.raises(ValueError, match=r"beam is .*, expected a whole number from 0 to 60"):
        explain(trace, beam)


def hall(sensor, seed):
    """Scan of a hall with round columns."""
    world, pose = scene("hall", seed)
    return SENSORS[sensor].scan(world, pose, np.random.default_rng(seed))


def agrees(trace, beam, explanation):
    """Whether an outcome is what the features say."""
    features = trace.features
    spans = [
        (int(f["first_beam"]), int(f["last_beam"])) for f in (*features.segments, *features.arcs)
    ]
    inside = any(a <= beam <= b if a <= b else beam >= a or beam <= b for a, b in spans)
    if explanation.outcome in ("segment", "arc"):
        return inside
    if explanation.outcome == "invalid":
        return not np.isfinite(trace.filtered[beam])
    if explanation.outcome in ("unexplained", "clustered"):
        return not inside and trace.clusters[beam] >= 0
    return trace.clusters[beam] < 0


@pytest.mark.parametrize("method", ["optimal", "liu", "iepf"])
def test_every_beam_has_an_answer_that_agrees_with_the_features(method):
    scans = [*degenerate_scans().values(), random_scan(5), hall("rplidar", 5)]
    extractor = Extractor(method)
    for scan in scans:
        trace = extractor.trace(scan)
        for beam in range(0, len(scan), max(len(scan) // 60, 1)):
            explanation = explain(trace, beam)
            assert explanation.outcome in OUTCOMES
            assert explanation.steps
            assert agrees(trace, beam, explanation), (method, scan, beam, explanation)


@pytest.mark.slow
@pytest.mark.parametrize("method", list(METHODS))
def test_no_method_is_without_answers(method):
    scan = hall("utm30lx", 6)
    trace = Extractor(method).trace(scan)
    for beam in range(0, len(scan), 25):
        assert agrees(trace, beam, explain(trace, beam))


@pytest.mark.slow
def test_the_evidence_is_of_the_same_run_where_the_noise_is_estimated():
    extractor = Extractor("optimal")
    for seed in range(5, 25):
        for sensor in ("rplidar", "lms361"):
            trace = extractor.trace(hall(sensor, seed))
            for kind, values in trace.evidence.items():
                assert len(values) == len(getattr(trace.features, kind)), (sensor, seed, kind)
