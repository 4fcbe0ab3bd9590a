"""Method optimal against its slow twins: the partition is the least of all, the fits are right."""

import math
from contextlib import suppress
from itertools import product

import naive_optimal as naive
import numpy as np
import pytest
from naive_fit import intersection, second_order
from scipy.optimize import least_squares
from worlds import (
    NOISE,
    degenerate_scans,
    fan,
    full_circle,
    random_scan,
    room,
    scan_of,
    vertex,
    wall,
)

from lineament import Extractor, LaserScan, LineamentError, RangeNoise
from lineament.features import noise_row
from lineament.kernels.optimal import layout
from lineament.logs import find_logs, open_log
from lineament.methods.optimal import Optimal
from lineament.methods.workspace import Block
from lineament.simulation import SENSORS, scene

EVIDENCE, MISSING = 12.0, 6


def ran(scan, noise=None, **parameters):
    """Run the method, and give its workspace and the number of measurements that it parted."""
    method = Optimal(**parameters)
    block = Block(scan, noise_row(noise), 1, method.own_arrays(len(scan)))
    block.load(scan.ranges)
    method.run(block)
    return layout.Work(*block.own[0]), int(block.counts[0])


def lines_of(own, count):
    """Lines (first, last) of the partition, by the beginnings that it noted."""
    origin, lines, i = own.beams[layout.ORIGIN], [], count
    while i > 0:
        if origin[i] >= 0:
            lines.append((int(origin[i]), i - 1))
        i = int(origin[i]) if origin[i] >= 0 else i - 1
    return lines[::-1]


def assert_without_spikes(scan, beams, noise):
    """Hold that those are left out that are alone; of neighbours that both seem so, maybe one."""
    usable, spikes = naive.spikes(scan, noise, MISSING)
    near = [set(pair) for pair in naive.neighbours(scan, usable) if spikes.issuperset(pair)]
    left_out = set(usable) - set(beams)
    assert left_out <= spikes
    assert spikes - left_out <= set().union(*near)
    turn = beams.index(min(beams)) if beams else 0
    assert beams[turn:] + beams[:turn] == sorted(set(usable) - left_out)


def assert_least(scan, noise=None, evidence=EVIDENCE):
    """Hold that no partition costs less, and that the lines cost what the kernel says."""
    own, count = ran(scan, noise, evidence=evidence)
    beams = own.beams[layout.BEAM, :count].tolist()
    assert_without_spikes(scan, beams, own.noise)
    points = naive.measured(scan, beams, own.noise, MISSING)
    energies = naive.least_energies(points, own.noise, evidence)
    found = own.points[layout.ENERGY, : count + 1]
    # The differences of its running sums have lost some digits.
    np.testing.assert_allclose(found, energies, rtol=1e-6, atol=1e-5)
    lines = lines_of(own, count)
    for a, b in lines:
        assert b - a + 1 >= naive.FEWEST
        assert not points.broken[a + 1 : b + 1].any()
    cost = naive.energy_of(points, lines, own.noise, evidence)
    assert cost == pytest.approx(energies[-1], rel=1e-6, abs=1e-5)
    return lines


def wall_with_bumps(seed):
    """Make a scan on which beginnings that were given up become the best again, and a price."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(80, 400))
    ranges = 2.0 / np.cos(2.0 * (np.arange(n) / n - 0.5))
    for _ in range(int(rng.integers(1, 9))):
        first, length = int(rng.integers(0, n)), int(rng.integers(3, 40))
        height, bump = rng.normal(0, (0.04, 0.1, 0.2)[seed % 3]), ranges[first : first + length]
        bump += height * (np.sin(np.linspace(0, math.pi, len(bump))) if rng.random() < 0.5 else 1)
    ranges += rng.choice([0.001, 0.01, 0.03]) * rng.normal(size=n)
    return LaserScan(ranges, -1.0, 2.0 / n), float(rng.choice([3.0, 6.0, 12.0, 25.0, 60.0]))


@pytest.mark.slow
def test_partition_of_a_thousand_recorded_scans_is_the_least(data_dir):
    checked = 0
    for log in find_logs(data_dir):
        with suppress(LineamentError):  # It holds no scans.
            scans = list(open_log(log, keep_going=True))
            for scan in scans[3 :: max(len(scans) // 45, 1)][:45]:
                assert_least(scan)
                checked += 1
    assert checked >= 1000


def hard_scans():
    """Scans on which a bound could be wrong, by name."""
    rng, n, ring = np.random.default_rng(4), 150, full_circle(150)
    some = rng.uniform(2.0, 2.2, n)
    for count in range(11):
        yield f"{count} beams", LaserScan(rng.uniform(2, 2.05, count), 0.0, 0.02)
    yield "white", LaserScan(some, 0.0, 0.01)
    yield "near the last digits", LaserScan(some, 0.0, 1e-7)
    yield "along one beam", LaserScan(np.linspace(1.0, 3.0, n), 0.0, 1e-6)
    yield "all broken", LaserScan(np.where(np.arange(n) % 2, 1.0, 9.0), 0.0, 0.01)
    yield "farther than scanners see", LaserScan(1e5 * some, 0.0, 0.01)
    yield "hardly so far", LaserScan(450.0 * some, 0.0, 0.01)
    yield "near", LaserScan(1e-4 * some, 0.0, 0.01)
    yield "of all sizes", LaserScan(10.0 ** rng.uniform(-1, 1.5, n), 0.0, 0.01)
    yield "walk", LaserScan(np.abs(2 + np.cumsum(rng.normal(0, 0.05, n))), 0.0, 0.01)
    yield "bowed", LaserScan(2 + 0.3 * np.sin(np.arange(n) / 20.0), 0.0, 0.01)
    yield "around", LaserScan(2 + 0.3 * np.sin(3 * ring), -math.pi, 2 * math.pi / n)
    some[rng.random(n) < 0.3] = np.nan
    yield "holes", LaserScan(some, 0.0, 0.01)
    yield from degenerate_scans().items()


def three_thousand_beams():
    angles = full_circle(3000)
    ranges = room(angles, [(5.0, 10.0), (3.0, 100.0), (6.0, 190.0), (4.0, 280.0)])
    ranges += 0.05 * np.sin(9 * angles) + 0.01 * np.random.default_rng(1).normal(size=3000)
    return scan_of(ranges, angles)


def cases():
    """Name, scan, the noise that is given, the price of a line, and lines, at least."""
    for seed in range(40):
        noise, evidence = (None, NOISE)[seed % 2], (12.0, 4.0, 40.0)[seed % 3]
        yield f"random {seed}", random_scan(seed), noise, evidence, 0
    for seed in (*range(30), 392, 566, 698, 1186, 1474, 2003):
        scan, evidence = wall_with_bumps(seed)
        yield f"bumps {seed}", scan, NOISE, evidence, 1
    for sensor, (seed, kind) in product(SENSORS, enumerate(("room", "corridor", "hall"))):
        scan = SENSORS[sensor].scan(*scene(kind, seed), np.random.default_rng(seed))
        yield f"{sensor} {kind}", scan, None, EVIDENCE, 3
    for name, scan in hard_scans():
        for noise in (None, RangeNoise(sigma=1e-4), RangeNoise(sigma=0.05, proportional=0.02)):
            yield f"{name} {noise and noise.sigma}", scan, noise, EVIDENCE, 0


@pytest.mark.parametrize(
    ("scan", "noise", "evidence", "least"),
    [
        *(pytest.param(*case, id=name) for name, *case in cases()),
        pytest.param(
            three_thousand_beams(), None, EVIDENCE, 5, id="3000 beams", marks=pytest.mark.slow
        ),
    ],
)
def test_partition_is_the_least(scan, noise, evidence, least):
    assert len(assert_least(scan, noise, evidence)) >= least


def test_a_trace_has_where_surfaces_break():
    cuts = 0
    for seed in range(30):
        scan = random_scan(seed)
        trace = Extractor("optimal", noise=NOISE).trace(scan)
        used = np.flatnonzero(~np.isnan(trace.filtered)).tolist()
        for a, b in naive.neighbours(scan, used):
            is_apart = not trace.spacing[b] <= trace.distance_threshold[b]
            assert is_apart == naive.parts(scan, a, b, (NOISE.sigma**2, 0.0), MISSING)
        corners = trace.features.corners
        meet = np.isin(corners["kind"], ("corner", "slit"))
        assert trace.cuts.tolist() == sorted(corners["beam"][meet])
        cuts += len(trace.cuts)
    assert cuts > 20


# Noise


def test_noise_is_that_of_the_twin():
    random = list(map(random_scan, range(60)))
    scans = [*degenerate_scans().values(), *random]
    scans += [
        SENSORS["rplidar"].scan(*scene("room", k), np.random.default_rng(k)) for k in range(9)
    ]
    grows = 0
    for scan in scans:
        own, _ = ran(scan)
        expected = naive.estimated_noise(scan)
        np.testing.assert_allclose(own.noise[:2], expected[:2], rtol=1e-6, atol=1e-12)
        # Without noise, it depends on rounding which measurements are within three deviations.
        if scan in random:
            uncertainty = Extractor("optimal")(scan).noise.uncertainty
            np.testing.assert_allclose(uncertainty, expected[2], rtol=1e-6)
        grows += own.noise[1] > 0
    assert 9 <= grows < len(scans)


# Fits


@pytest.mark.parametrize("normal", [0, 45, 90, 200])
@pytest.mark.parametrize("noise", [NOISE, RangeNoise(sigma=0.005, proportional=0.01)])
def test_line_is_the_weighted_least_squares(normal, noise):
    angles = math.radians(normal) + fan(30)
    rng = np.random.default_rng(normal)
    ranges = wall(angles, 2.0, normal + 15) + 0.01 * rng.normal(size=len(angles))
    ranges[20] = wall(angles, 2.0, normal + 15)[20] + 0.125
    scan = scan_of(ranges, angles)
    (line,) = Extractor("optimal", noise=noise)(scan).segments
    row = noise.sigma**2, noise.proportional**2
    centroid, direction, variances, rms, misfit, used = naive.fitted_line(
        scan.points, scan.ranges, row
    )
    np.testing.assert_allclose(line["centroid"], centroid, atol=1e-9)
    assert line["angle"] == pytest.approx(math.atan2(direction[1], direction[0]), abs=1e-9)
    expected = second_order(np.diag(variances), centroid, line["angle"])
    np.testing.assert_allclose(line["covariance"], expected, rtol=1e-9)
    np.testing.assert_allclose((line["rms"], line["misfit"]), (rms, misfit), atol=1e-9)
    assert line["n_points"] == used == len(angles) - 1


@pytest.mark.parametrize("radius", [0.15, 0.3, 1.0])
def test_arc_is_the_least_squares_circle(radius):
    angles = fan(math.degrees(0.95 * math.asin(radius / 3.0)), 0.003)
    ranges = 3 * np.cos(angles) - np.sqrt(radius**2 - (3 * np.sin(angles)) ** 2)
    scan = scan_of(ranges + 0.002 * np.random.default_rng(5).normal(size=len(angles)), angles)
    (arc,) = Extractor("optimal", noise=RangeNoise(sigma=0.002))(scan).arcs
    own = slice(arc["first_beam"], arc["last_beam"] + 1)
    given = np.array([*arc["center"], arc["radius"]])
    data = scan.points[own], scan.ranges[own], (0.002**2, 0.0), given
    best = least_squares(naive.arc_residuals, (3.0, 0.0, radius), args=data, x_scale=0.1)
    deviations = np.sqrt(np.diag(arc["covariance"]))
    # Three steps come as near as a thousandth of the deviation.
    assert (abs(best.x - given) < 0.02 * deviations).all()
    np.testing.assert_allclose(arc["covariance"], np.linalg.inv(best.jac.T @ best.jac), rtol=0.01)


def test_corners_are_where_their_lines_cross_and_know_it():
    checked = 0
    for seed in range(60):
        features = Extractor("optimal", noise=NOISE)(random_scan(seed))
        for corner in features.corners:
            place, covariance = intersection(*features.segments[corner["segments"]], 0.0, math.inf)
            np.testing.assert_allclose(corner["position"], place, atol=1e-9)
            np.testing.assert_allclose(corner["covariance"], covariance, rtol=1e-6, atol=1e-15)
            checked += 1
    assert checked > 50


@pytest.mark.parametrize("opening", [60, 120, 155])
def test_response_is_the_rise_of_chi_square(opening):
    angles, noise = fan(20), (NOISE.sigma**2, 0.0)
    ranges = vertex(angles, 3.0, opening, convex=True)
    scan = scan_of(ranges + 0.01 * np.random.default_rng(1).normal(size=len(angles)), angles)
    features = Extractor("optimal", noise=NOISE)(scan)
    (corner,), (first, second) = features.corners, features.segments
    spans = [slice(s["first_beam"], s["last_beam"] + 1) for s in (first, second)]
    cost = [naive.chi_square(scan.points[s], scan.ranges[s], noise) for s in spans]
    both = np.r_[spans[0], spans[1]]
    joint = naive.chi_square(scan.points[both], scan.ranges[both], noise)
    assert corner["response"] == pytest.approx(joint - sum(cost), rel=1e-8)
    assert corner["response"] > EVIDENCE


@pytest.mark.parametrize(("opening", "far"), [(120, 3.0), (150, 3.0), (170, 3.0), (175, 6.0)])
def test_a_border_makes_both_of_its_lines_less_certain(opening, far):
    angles, noise = fan(20), (NOISE.sigma**2, 0.0)
    ranges = vertex(angles, far, opening, convex=True)
    scan = scan_of(ranges + 0.01 * np.random.default_rng(1).normal(size=len(angles)), angles)
    first, second = Extractor("optimal", noise=NOISE)(scan).segments
    border, n = second["first_beam"], len(angles)
    xy, rho = scan.points, scan.ranges
    of_border = naive.border_covariances(xy, rho, noise, border, (first, second), EVIDENCE)
    for line, own, softened in zip(
        (first, second), (slice(0, border), slice(border, n)), of_border, strict=True
    ):
        fit = np.diag(naive.fitted_line(xy[own], rho[own], noise)[2])
        expected = second_order(fit + softened, line["centroid"], line["angle"])
        np.testing.assert_allclose(line["covariance"], expected, rtol=1e-6, atol=1e-12)
        assert abs(line["covariance"][0, 1]) > 1e-10
