"""Method optimal on scenes by hand: what a person would draw, and nothing else."""

import math

import numpy as np
import pytest
from lineament_lab.evaluation import segment_scores
from worlds import BOX, NOISE, STEP, fan, full_circle, room, scan_of, vertex, wall

from lineament import Extractor, LaserScan
from lineament.simulation import SENSORS, Sensor, World, scene, truth

UNAWARE, AWARE = Extractor("optimal"), Extractor("optimal", noise=NOISE)
SENSOR = Sensor("fan", 481, math.radians(-80), STEP, noise=NOISE)
#: Noise estimated, and given.
extractors = pytest.mark.parametrize("extractor", [UNAWARE, AWARE], ids=["estimated", "given"])


def noisy(ranges, seed=0, sigma=NOISE.sigma):
    return ranges + sigma * np.random.default_rng(seed).normal(size=len(ranges))


def found_in(extractor, ranges, angles, **noise):
    return extractor(scan_of(noisy(ranges, **noise), angles))


def sweep(world, seed=0, pose=(0.0, 0.0, 0.0)):
    return SENSOR.scan(world, pose, np.random.default_rng(seed))


def within(error, covariance, deviations=4.0):
    """Whether an error is within so many standard deviations."""
    return error @ np.linalg.solve(covariance, error) < deviations**2


def of_kind(features, kind):
    return features.corners[features.corners["kind"] == kind]


# Corners


@extractors
@pytest.mark.parametrize("convex", [True, False])
@pytest.mark.parametrize("opening", [60, 90, 120, 150, 160])
def test_vertex_has_its_two_walls(extractor, opening, convex):
    angles = fan(25)
    for seed in range(5):
        ranges = noisy(vertex(angles, 3.0, opening, convex=convex), seed)
        features = extractor(scan_of(ranges, angles))
        (corner,), (first, second) = features.corners, features.segments
        assert within(corner["position"] - (3.0, 0.0), corner["covariance"], 4.0)
        assert corner["opening"] == pytest.approx(math.radians(opening), abs=0.05)
        assert (corner["convex"], corner["kind"]) == (convex, "corner")
        assert corner["segments"].tolist() == [0, 1]
        assert corner["response"] > extractor.method.evidence
        assert 0.2 < corner["quality"] < 1
        assert first["end"].tolist() == second["start"].tolist() == corner["position"].tolist()
        assert (first["first_beam"], second["last_beam"]) == (0, len(angles) - 1)
        assert 1 <= second["first_beam"] - first["last_beam"] <= 4
        assert (features.clusters == 0).all()


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
@pytest.mark.parametrize("beams", [2, 3])
def test_faces_beside_a_hole_are_a_slit(extractor, beams):
    """Their lines cross within 0.3 m of both, and they end where they were seen."""
    angles = fan(25)
    ranges, middle = vertex(angles, 2.0, 90, convex=True), len(angles) // 2
    hole = slice(middle - 1, middle - 1 + beams)
    ranges[hole] = wall(angles[hole], 5.0, 0.0)
    features = found_in(extractor, ranges, angles)
    (corner,), (first, second) = of_kind(features, "slit"), features.segments
    assert within(corner["position"] - (2.0, 0.0), corner["covariance"])
    assert corner["segments"].tolist() == [0, 1]
    assert min(np.hypot(*(s - (2.0, 0.0))) for s in (first["end"], second["start"])) > 0.005
    assert (first["last_beam"], second["first_beam"]) == (hole.start - 1, hole.stop)
    assert features.clusters[hole.start - 1] != features.clusters[hole.stop]
    assert len(of_kind(features, "corner")) == 0


@extractors
def test_a_wall_seen_through_a_slit_does_not_part_its_corner(extractor):
    angles = fan(25)
    ranges, middle = vertex(angles, 2.0, 90, convex=True), len(angles) // 2
    hole = slice(middle - 3, middle + 4)
    ranges[hole] = wall(angles[hole], 5.0, 0.0)
    features = found_in(extractor, ranges, angles, sigma=0.003)
    assert len(features.segments) == 3
    (corner,) = of_kind(features, "slit")
    assert corner["segments"].tolist() == [0, 2]
    assert within(corner["position"] - (2.0, 0.0), corner["covariance"])


@pytest.mark.parametrize("behind", [2, 7])
def test_a_slit_is_found_where_a_full_circle_is_opened(behind):
    """Its largest step is beside the slit, so that the two walls are the last and the first."""
    angles = full_circle(720)
    corner = round((math.atan2(1.3, 2.0) + math.pi) / (angles[1] - angles[0]))
    ranges = room(angles, BOX)
    ranges[corner - behind // 2 :][:behind] = wall(
        angles[corner - behind // 2 :][:behind], 9.0, 33.0
    )
    step = angles[1] - angles[0]
    for turn in (0, corner, 300):
        ranges_turned = noisy(np.roll(ranges, -turn), 3)
        features = AWARE(LaserScan(ranges_turned, angles[0] + turn * step, step))
        (slit,) = of_kind(features, "slit")
        assert within(slit["position"] - (2.0, 1.3), slit["covariance"])
        assert len(of_kind(features, "corner")) == 3


def test_the_trace_has_the_spacing_before_each_measurement():
    angles = fan(25)
    scan = scan_of(noisy(vertex(angles, 2.0, 90, convex=True)), angles)
    apart = np.hypot(*np.diff(scan.points, axis=0).T)
    spacing = AWARE.trace(scan).spacing
    assert np.isnan(spacing[0])
    np.testing.assert_allclose(spacing[1:], apart)


@extractors
def test_a_panel_before_a_wall_ends_in_edges(extractor):
    angles = fan(25)
    panel = abs(np.tan(angles)) < 0.2
    ranges = np.where(panel, wall(angles, 2.0, 0.0), wall(angles, 4.0, 0.0))
    features = found_in(extractor, ranges, angles, sigma=1e-4)
    edges, near = features.edges, features.segments[1]
    assert (len(features.corners), edges["segment"].tolist()) == (0, [1, 1])
    assert sorted(edges["side"]) == ["end", "start"]
    for edge in edges:
        sign = 1 if edge["side"] == "end" else -1
        end, beam = ("end", "last_beam") if sign > 0 else ("start", "first_beam")
        assert edge["position"].tolist() == near[end].tolist()
        assert edge["beam"] == near[beam] == np.flatnonzero(panel)[-1 if sign > 0 else 0]
        spacing = 2.0 * (math.tan(angles[edge["beam"]]) - math.tan(angles[edge["beam"] - sign]))
        beyond = 2.0 * math.tan(angles[edge["beam"]]) + spacing / 2
        assert edge["position"][1] == pytest.approx(beyond, abs=1e-3)
        least = spacing**2 / 12
        assert 0.9 * least < edge["covariance"][1, 1] < 1.1 * least + (0.2 * NOISE.sigma) ** 2
        assert 0.0 < edge["quality"] < 1.0
    assert features.breakpoints["occluder"].tolist()[:2] == [near["first_beam"], near["last_beam"]]


# Columns and polygons


@extractors
@pytest.mark.parametrize("radius", [0.15, 0.25, 0.5])
def test_column_in_front_of_a_wall_is_one_arc(extractor, radius):
    world = World([[4.5, -6, 4.5, 6]], [[2.5, 0.3, radius]])
    for seed in range(5):
        features = extractor(sweep(world, seed))
        (arc,) = features.arcs
        error = np.array([*arc["center"], arc["radius"]]) - (2.5, 0.3, radius)
        assert within(error, arc["covariance"])
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
@pytest.mark.parametrize(("waves", "amplitude"), [(0.5, 0.045), (1, 0.02), (2, 0.028)])
@pytest.mark.parametrize("sigma", [0.003, 0.01])
def test_bowed_wall_is_one(extractor, waves, amplitude, sigma):
    """A wall of 4 m is off a line by 14 to 20 mm, root mean square: that is its misfit."""
    angles = fan(45)
    bow = amplitude * np.cos(math.pi * waves * np.tan(angles))
    bow -= bow.mean()
    scan = scan_of(noisy((2.0 + bow) / np.cos(angles), sigma=sigma), angles)
    features = extractor(scan)
    (line,) = features.segments
    assert len(features.corners) == len(features.arcs) == 0
    assert line["n_points"] >= len(angles) - 4
    assert line["misfit"] == pytest.approx(np.std(bow), abs=0.0035)
    # The covariance is that of the noise.
    assert line["covariance"][0, 0] < 0.002**2


@pytest.mark.parametrize("beams", [(6, 6), (6, 12), (8, 8), (8, 10), (10, 8), (10, 10)])
def test_step_of_short_walls_parts_them_wherever_it_is(beams):
    first, n = beams[0], sum(beams)
    angles = math.radians(1.0) * (np.arange(n) - n // 2)
    ranges = np.where(np.arange(n) < first, wall(angles, 3.0, 0), wall(angles, 3.2, 0))
    for seed in range(5):
        features = found_in(AWARE, ranges, angles, seed=seed)
        assert len(features.segments) == 2
        assert features.segments["first_beam"][1] == first
        assert features.breakpoints["beam"][0].tolist() == [first - 1, first]


def test_wall_behind_a_doorway_is_not_lost():
    """On one line with the wall before, and two measurements of the frame on it by chance."""
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
        assert line["start"][0] > 0.49 * math.tan(math.radians(86))
        assert features.clusters.max() == 0


@extractors
@pytest.mark.parametrize("turn", [0.0, 0.3, math.atan2(1.7, 2.4)])
def test_room_all_around_is_closed_over_the_seam(extractor, turn):
    """Wherever the seam is: on a wall, or in a corner."""
    n = 720
    ring = full_circle(n)
    for seed in range(5):
        ranges = noisy(room(ring + turn, BOX), seed)
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


# Clutter


@extractors
@pytest.mark.parametrize("between", [(2.7,), (2.5, 3.2), (3.6,)])
def test_mixed_pixels_between_two_depths_are_noise(extractor, between):
    angles = fan(30)
    ranges, edge = np.where(angles < 0, wall(angles, 2.0, 0.0), wall(angles, 4.0, 0.0)), 90
    ranges[edge : edge + len(between)] = between
    features = found_in(extractor, ranges, angles)
    assert len(features.segments) == 2
    assert (len(features.corners), len(features.edges)) == (0, 1)
    assert (features.clusters[edge : edge + len(between)] == -1).all()
    assert features.segments["last_beam"][0] == edge - 1
    assert features.segments["first_beam"][1] == edge + len(between)


@extractors
@pytest.mark.parametrize("off", [-1.0, -0.3, 0.3, 2.0])
def test_spike_on_a_wall_is_dropped(extractor, off):
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
@pytest.mark.parametrize("far", [30.0, 1e3, 1e5])
def test_what_is_far_away_does_not_disturb_what_is_near(extractor, far):
    angles = fan(80)
    ranges = noisy(room(angles, BOX), 1)
    ranges[20:22] = far, 1.01 * far
    features = extractor(scan_of(ranges, angles))
    assert 3 <= len(features.segments) <= 4
    assert len(of_kind(features, "corner")) == 2
    assert features.segments["rms"].max() < 0.012


@extractors
def test_panels_of_one_wall_beside_a_slit_have_no_corner(extractor):
    """Their lines cross somewhere, as all lines do."""
    angles = fan(30)
    for seed in range(40):
        ranges = noisy(wall(angles, 2.0, 20.0), seed)
        ranges[8:10] = 9.0
        features = extractor(scan_of(ranges, angles))
        assert len(of_kind(features, "slit")) == len(of_kind(features, "corner")) == 0


@extractors
def test_drop_outs_do_not_cut_a_wall(extractor):
    angles = fan(30)
    ranges = noisy(wall(angles, 2.0, 10.0))
    lost = np.random.default_rng(1).random(len(angles)) < 0.2
    ranges[lost] = np.inf
    (line,) = extractor(scan_of(ranges, angles)).segments
    assert line["n_points"] == (~lost).sum()
    assert line["rms"] == pytest.approx(NOISE.sigma, rel=0.2)


# Noise


@pytest.mark.parametrize("sigma", [0.001, 0.01, 0.03])
def test_noise_is_estimated_whatever_else_is_there(sigma):
    """Corners, and clutter among 3 % of the measurements."""
    angles, found = full_circle(), []
    for seed in range(20):
        ranges, rng = noisy(room(angles, BOX), seed, sigma), np.random.default_rng(seed + 99)
        ranges[rng.random(len(ranges)) < 0.03] *= 0.7
        found.append(UNAWARE(scan_of(ranges, angles)).noise.sigma)
    assert np.mean(found) == pytest.approx(sigma, rel=0.03)
    assert np.std(found) < 0.06 * sigma


#: Walls whose ranges differ, and what is off them in proportion to range.
LONG, PROPORTIONAL = [(1.0, 0.0), (3.0, 90.0), (6.0, 180.0), (3.0, 270.0)], 0.01


def test_noise_that_grows_with_range_is_estimated():
    angles, found = full_circle(), []
    for seed in range(20):
        ranges = room(angles, LONG)
        noise = UNAWARE(scan_of(ranges * noisy(1.0 + 0.0 * ranges, seed), angles)).noise
        found.append(math.hypot(noise.sigma, 3.0 * noise.proportional))
        assert 0.008 < noise.proportional < 0.0105
    assert np.mean(found) == pytest.approx(3.0 * PROPORTIONAL, rel=0.1)


def test_a_room_in_noise_that_grows_with_range_is_closed_too():
    """Its seam is no border of a wall."""
    angles = full_circle()
    for seed in range(20):
        ranges = room(angles, LONG)
        features = UNAWARE(scan_of(ranges * noisy(1.0 + 0.0 * ranges, seed), angles))
        assert len(features.segments) == len(features.corners) == 4, seed
