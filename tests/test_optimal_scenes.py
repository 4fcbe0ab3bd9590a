"""Method optimal on scenes by hand: what a person would draw, and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import NOISE, STEP, fan, full_circle, room, scan_of, vertex, wall

from lineament import Extractor
from lineament.evaluation.segments import segment_scores
from lineament.simulation import SENSORS, Sensor, World, scene, truth

UNAWARE, AWARE = Extractor("optimal"), Extractor("optimal", noise=NOISE)
SENSOR = Sensor("fan", 481, math.radians(-80), STEP, noise=NOISE)
#: Noise estimated, and given.
extractors = pytest.mark.parametrize("extractor", [UNAWARE, AWARE], ids=["estimated", "given"])


def noisy(ranges, seed=0, sigma=NOISE.sigma):
    return ranges + sigma * np.random.default_rng(seed).normal(size=len(ranges))


def sweep(world, seed=0, pose=(0.0, 0.0, 0.0)):
    return SENSOR.scan(world, pose, np.random.default_rng(seed))


def within(error, covariance, deviations=4.0):
    """Whether an error is within so many standard deviations."""
    return error @ np.linalg.solve(covariance, error) < deviations**2


# Corners


@extractors
@pytest.mark.parametrize("convex", [True, False])
@pytest.mark.parametrize("opening", [60, 90, 120, 150, 165])
def test_vertex_has_its_two_walls(extractor, opening, convex):
    """Down to a turn of 15°."""
    angles = fan(25)
    for seed in range(5):
        ranges = noisy(vertex(angles, 3.0, opening, convex=convex), seed)
        features = extractor(scan_of(ranges, angles))
        (corner,), (first, second) = features.corners, features.segments
        assert within(corner["position"] - (3.0, 0.0), corner["covariance"], 5.0)
        assert corner["opening"] == pytest.approx(math.radians(opening), abs=0.05)
        assert corner["convex"] == convex
        assert corner["segments"].tolist() == [0, 1]
        assert corner["response"] > extractor.method.evidence
        assert first["end"].tolist() == second["start"].tolist() == corner["position"].tolist()
        assert (first["first_beam"], second["last_beam"]) == (0, len(angles) - 1)
        assert 1 <= second["first_beam"] - first["last_beam"] <= 4
        assert (features.clusters >= 0).all()


@extractors
@pytest.mark.parametrize("arm", [5, 6, 8, 12])
def test_corner_next_to_the_end_of_a_cluster(extractor, arm):
    angles = fan(25)
    ranges = vertex(angles, 2.0, 90, convex=True)[: len(angles) // 2 + 1 + arm]
    for seed in range(5):
        features = extractor(scan_of(noisy(ranges, seed), angles[: len(ranges)]))
        (corner,) = features.corners
        assert within(corner["position"] - (2.0, 0.0), corner["covariance"], 5.0)
        assert features.segments["last_beam"][1] >= len(ranges) - 3


@extractors
def test_wall_of_four_beams_is_a_wall(extractor):
    angles = fan(25)
    ranges, middle = wall(angles, 3.0, 0.0), len(angles) // 2
    ranges[middle - 2 : middle + 2] = wall(angles[middle - 2 : middle + 2], 1.5, 0.0)
    features = extractor(scan_of(noisy(ranges), angles))
    assert features.segments["n_points"][1] == 4
    assert len(features.segments) == 3
    assert len(features.corners) == 0
    assert features.breakpoints["occluder"].tolist()[:2] == [middle - 2, middle + 1]


# Columns and polygons


@extractors
@pytest.mark.parametrize("radius", [0.15, 0.25, 0.5])
def test_column_in_front_of_a_wall_is_one_arc(extractor, radius):
    world = World([[4.5, -6, 4.5, 6]], [[2.5, 0.3, radius]])
    for seed in range(5):
        features = extractor(sweep(world, seed))
        (arc,) = features.arcs
        assert within(
            np.array([*arc["center"], arc["radius"]]) - (2.5, 0.3, radius), arc["covariance"]
        )
        assert len(features.segments) == 2
        assert len(features.corners) == 0
        assert features.clusters.max() == 2


def polygon(vertices, x, radius, turn):
    bearing = turn + 2 * math.pi / vertices * np.arange(vertices + 1)
    return World.of_polygons(
        [np.column_stack((x + radius * np.cos(bearing), radius * np.sin(bearing)))]
    )


@extractors
@pytest.mark.parametrize(("sides", "radius", "corners"), [(4, 0.8, 1), (6, 1.0, 1), (8, 1.0, 2)])
def test_polygon_is_no_arc(extractor, sides, radius, corners):
    features = extractor(sweep(polygon(sides, 3.0, radius, 0.3)))
    assert len(features.arcs) == 0
    assert len(features.corners) == corners
    assert len(features.segments) == corners + 1


# Walls as they are


@extractors
@pytest.mark.parametrize(("waves", "amplitude"), [(0.5, 0.068), (1, 0.028), (2, 0.028)])
@pytest.mark.parametrize("sigma", [0.003, 0.01])
def test_bowed_wall_is_one(extractor, waves, amplitude, sigma):
    """A wall of 4 m is off a line by 20 mm, root mean square."""
    angles = fan(45)
    bow = amplitude * np.cos(math.pi * waves * np.tan(angles))
    scan = scan_of(noisy((2.0 + bow) / np.cos(angles), sigma=sigma), angles)
    features = extractor(scan)
    (line,) = features.segments
    assert len(features.corners) == len(features.arcs) == 0
    assert line["n_points"] >= len(angles) - 4
    # The covariance is that of the wall, not of the readings alone.
    assert line["covariance"][0, 0] > (0.2 * 0.02) ** 2


@extractors
@pytest.mark.parametrize("step", [0.01, 0.02])
def test_panels_with_small_steps_are_one_wall(extractor, step):
    angles = fan(45)
    depth = 2.0 + step * (np.floor(2.0 * np.tan(angles) / 0.8) % 2)
    for sigma in (0.003, 0.01):
        features = extractor(scan_of(noisy(depth / np.cos(angles), sigma=sigma), angles))
        assert len(features.segments) == 1
        assert len(features.corners) == 0


@extractors
@pytest.mark.parametrize("behind", [np.nan, np.inf, 5.0])
def test_doorway_is_not_bridged(extractor, behind):
    angles = fan(40)
    door = abs(angles) < math.radians(12)
    beyond = wall(angles, 5.0, 0.0) if behind == 5.0 else behind
    ranges = noisy(np.where(door, beyond, wall(angles, 2.0, 0.0)))
    features = extractor(scan_of(ranges, angles))
    assert len(features.segments) == (3 if behind == 5.0 else 2)
    assert len(features.corners) == 0
    for line in features.segments:
        assert len(set(door[line["first_beam"] : line["last_beam"] + 1])) == 1
    kinds = ["jump", "jump"] if behind == 5.0 else ["gap"]
    assert features.breakpoints["kind"].tolist() == [*kinds, "scan_end", "scan_end"]


@pytest.mark.parametrize("beams", [(6, 6), (6, 12), (8, 8), (8, 10), (10, 8), (10, 10)])
def test_step_of_short_walls_parts_them_wherever_it_is(beams):
    """As pieces begin with stretches of four readings: the step may be within one."""
    first, n = beams[0], sum(beams)
    angles = math.radians(1.0) * (np.arange(n) - n // 2)
    ranges = np.where(np.arange(n) < first, wall(angles, 3.0, 0), wall(angles, 3.08, 0))
    for seed in range(5):
        features = AWARE(scan_of(noisy(ranges, seed), angles))
        assert len(features.segments) == 2
        assert abs(features.segments["first_beam"][1] - first) <= 1


def test_wall_behind_a_doorway_is_not_lost():
    """On one line with the wall before, and two readings of the frame on it by chance."""
    (world, pose), sensor = scene("corridor", 20010), SENSORS["lms181"]
    features = UNAWARE(sensor.scan(world, pose, np.random.default_rng(20010)))
    scores = segment_scores(features, truth(world, pose, sensor)).counts
    assert scores.correct == scores.true


@extractors
def test_grazing_wall_is_not_cut(extractor):
    """Along the sensor, up to an incidence of 86°."""
    for seed in range(5):
        features = extractor(sweep(World([[0.3, 0.5, 12, 0.5]]), seed))
        (line,) = features.segments
        assert line["end"][0] == pytest.approx(0.3, abs=0.02)
        assert line["start"][0] > 0.5 * math.tan(math.radians(86))
        assert features.clusters.max() == 0


@extractors
@pytest.mark.parametrize("at", ["wall", "corner"])
def test_room_all_around_is_closed_over_the_seam(extractor, at):
    n = 720
    ring = full_circle(n)
    box = [(2.0, 0.0), (1.3, 90.0), (2.4, 180.0), (1.7, 270.0)]
    turn = 0.0 if at == "wall" else math.atan2(1.7, 2.4)
    for seed in range(5):
        ranges = noisy(room(ring + turn, box), seed)
        features = extractor(scan_of(ranges, ring))
        corners, segments = features.corners, features.segments
        assert len(corners) == len(segments) == 4
        assert len(features.breakpoints) == 0
        assert (features.clusters == 0).all()
        assert sorted(corners["segments"].ravel().tolist()) == [0, 0, 1, 1, 2, 2, 3, 3]
        c, s = math.cos(turn), math.sin(turn)
        for corner in corners:
            x, y = corner["position"] @ [[c, s], [-s, c]]
            true = (2.0 if x > 0 else -2.4, 1.3 if y > 0 else -1.7)
            error = np.array(true) @ [[c, -s], [s, c]] - corner["position"]
            assert within(error, corner["covariance"], 5.0)


# Readings that are on no surface


@extractors
@pytest.mark.parametrize("between", [(2.7,), (2.5, 3.2), (3.6,)])
def test_mixed_pixels_between_two_depths_are_noise(extractor, between):
    angles = fan(30)
    ranges, edge = np.where(angles < 0, wall(angles, 2.0, 0.0), wall(angles, 4.0, 0.0)), 90
    ranges[edge : edge + len(between)] = between
    features = extractor(scan_of(noisy(ranges), angles))
    assert len(features.segments) == 2
    assert len(features.corners) == 0
    assert (features.clusters[edge : edge + len(between)] == -1).all()
    assert features.segments["last_beam"][0] == edge - 1
    assert features.segments["first_beam"][1] == edge + len(between)


@extractors
@pytest.mark.parametrize("off", [-1.0, -0.3, 0.1, 0.3, 2.0])
def test_spike_on_a_wall(extractor, off):
    angles = fan(30)
    ranges = noisy(wall(angles, 2.0, 10.0))
    ranges[60] += off
    features = extractor(scan_of(ranges, angles))
    (line,) = features.segments
    assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
    assert line["n_points"] == len(angles) - 1
    assert features.clusters[60] == -1
    assert (np.delete(features.clusters, 60) == 0).all()
    assert features.breakpoints["kind"].tolist() == ["scan_end", "scan_end"]


@extractors
def test_drop_outs_do_not_cut_a_wall(extractor):
    angles = fan(30)
    ranges = noisy(wall(angles, 2.0, 10.0))
    lost = np.random.default_rng(1).random(len(angles)) < 0.2
    ranges[lost] = np.inf
    (line,) = extractor(scan_of(ranges, angles)).segments
    assert line["n_points"] == (~lost).sum()
    assert line["rms"] == pytest.approx(NOISE.sigma, rel=0.2)


@pytest.mark.parametrize("max_missing", [0, 3, 6])
def test_wall_goes_on_over_as_many_missing_beams_as_are_allowed(max_missing):
    angles, extractor = fan(30), Extractor("optimal", max_missing=max_missing)
    for missing, pieces in ((max_missing, 1), (max_missing + 1, 2)):
        ranges = noisy(wall(angles, 2.0, 0.0))
        ranges[50 : 50 + missing] = np.nan
        assert len(extractor(scan_of(ranges, angles)).segments) == pieces


@extractors
@pytest.mark.parametrize("normal", [0, 90, 180, 270, 30])
def test_wall_ends_at_its_last_readings(extractor, normal):
    angles = math.radians(normal) + fan(30)
    scan = scan_of(noisy(wall(angles, 2.0, normal)), angles)
    (line,) = extractor(scan).segments
    direction = [math.cos(line["angle"]), math.sin(line["angle"])]
    for end, point in ((line["start"], scan.points[0]), (line["end"], scan.points[-1])):
        assert (end - point) @ direction == pytest.approx(0.0, abs=1e-9)
        assert np.hypot(*(end - point)) < 4 * NOISE.sigma


def test_evidence_is_what_a_corner_must_have():
    """A faint corner is two walls for who asks for little, one wall for who asks for much."""
    angles = fan(10)
    scan = scan_of(noisy(vertex(angles, 3.0, 168, convex=False), 2), angles)
    (corner,) = Extractor("optimal", evidence=10.0, noise=NOISE)(scan).corners
    for evidence, corners in ((0.9 * corner["response"], 1), (1.1 * corner["response"], 0)):
        found = Extractor("optimal", evidence=evidence, noise=NOISE)(scan)
        assert len(found.corners) == corners
