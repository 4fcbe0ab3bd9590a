"""Method optimal on any scan: sound features, the same ones however they are asked for."""

import math
from functools import cache
from itertools import islice, product

import numpy as np
import pytest
from equality import direction_of
from hostile import all_hostile, hostile_scans
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from worlds import BOX, NOISE, degenerate_scans, full_circle, random_scan, room, scan_of, seen

from lineament import Extractor, LaserScan, LogError, RangeNoise
from lineament.checks.sound import first_problem
from lineament.kernels import LARGEST
from lineament.logs import find_logs, open_log
from lineament.simulation import SCENES, SENSORS, scene

EXTRACTORS = {
    "default": Extractor("optimal"),
    "noise given": Extractor("optimal", noise=NOISE),
    "weak evidence": Extractor("optimal", evidence=5.0, max_missing=0),
}
every_extractor = pytest.mark.parametrize("extractor", EXTRACTORS.values(), ids=EXTRACTORS)
#: Scale of a surface [m], distance of a corner from its measurements and its deviation [m].
SURFACE, REACH, MOST = 0.03, 0.3, 0.1


@cache
def simulated(sensor):
    """Make four scans of each kind of scene."""
    device, scans = SENSORS[sensor], []
    for kind, seed in product(SCENES, range(4)):
        world, pose = scene(kind, seed)
        scans.append(device.scan(world, pose, np.random.default_rng(seed)))
    return scans


def deviation(features, rho):
    """Deviation of a measurement about its surface."""
    noise = features.noise
    constant = max(math.hypot(noise.sigma, noise.quantum / 12**0.5), 1e-4)
    return math.hypot(constant, noise.proportional * rho, SURFACE)


def assert_sound(scan, features, extractor):
    """Hold what is true of the features of any scan, and of maps of it.

    The vertices of a map are where the error of the ranges is the least, by so many vertices: they
    may be far from what is measured there, but lie on its ray, and they are there however well
    they are known.
    """
    is_map = extractor.method.max_vertices > 0
    assert first_problem(features, scan) == ""
    segments, corners = features.segments, features.corners
    assert is_map or np.isfinite(corners["response"]).all()
    assert (features.arcs["radius"] > 0).all()
    if features.noise is not None and extractor.noise is None:
        farthest = features.noise.proportional * scan.ranges[scan.valid & (scan.ranges < 1e6)].max(
            initial=0.0
        )
        assert 0 < math.hypot(features.noise.sigma, farthest) <= MOST * (1 + 1e-9)
    for segment in segments:
        centroid = segment["centroid"]
        ahead = [(segment[name] - centroid) @ direction_of(segment) for name in ("start", "end")]
        # To rounding: a mean may lie at an end, and in a map is moved to the part that is drawn.
        assert ahead[0] <= 1e-9 * np.hypot(*centroid)
        assert ahead[1] >= -1e-9 * np.hypot(*centroid)
        if is_map:
            assert_drawn_on_its_rays(scan, segment)
        else:
            assert_drawn_where_it_was_measured(scan, features, segment)
    for corner in corners:
        assert is_map or math.sqrt(np.linalg.eigvalsh(corner["covariance"])[-1]) <= MOST
        assert_joined(corner, segments)
    for edge in features.edges:
        assert math.sqrt(np.linalg.eigvalsh(edge["covariance"])[-1]) <= MOST
        assert_ends(edge, segments)


def beams_of(scan, segment):
    first, last = segment["first_beam"], segment["last_beam"]
    beams = (first + np.arange((last - first) % len(scan) + 1)) % len(scan)
    return beams[scan.valid[beams]]


def assert_drawn_on_its_rays(scan, segment):
    """Its ends are on the rays of its first and its last measurement, or between the next ones."""
    usable = np.flatnonzero(scan.valid & (scan.ranges >= 1 / LARGEST) & (scan.ranges < LARGEST))
    for name, beam in (("start", "first_beam"), ("end", "last_beam")):
        at = int(np.searchsorted(usable, segment[beam]))
        low, ray, high = scan.angles[usable[[at - 1, at, (at + 1) % len(usable)]]]
        turn = math.remainder(math.atan2(*segment[name][::-1]) - ray, 2 * math.pi)
        assert -((ray - low) % (2 * math.pi)) - 1e-9 <= turn <= (high - ray) % (2 * math.pi) + 1e-9


def assert_drawn_where_it_was_measured(scan, features, segment):
    """It passes its first and last measurement, and ends abreast of them, or at a corner near them.

    What was measured of it is longer than the step of its beams, so that it does not run along
    them. Corners may cut it shorter than that.
    """
    beams, along = beams_of(scan, segment), direction_of(segment)
    own, rho = scan.points[beams], scan.ranges[beams]
    spacing = np.hypot(*np.diff(own, axis=0).T)
    step = abs(math.sin(scan.angles[beams[1]] - scan.angles[beams[0]]))
    assert (own[-1] - own[0]) @ along >= step * rho.min()
    kinds = {tuple(corner["position"]): corner["kind"] for corner in features.corners}
    kinds |= {tuple(place): "edge" for place in features.edges["position"]}
    for name, k in (("start", 0), ("end", -1)):
        place, nearest, error = segment[name], own[k], 3 * deviation(features, rho[k])
        kind = kinds.get(tuple(place))
        ahead, aside = (nearest - segment["centroid"]) @ np.c_[along, (-along[1], along[0])]
        assert abs(aside) <= error + 1e-9 * rho[k]
        if kind == "corner":
            assert np.hypot(*(place - nearest)) <= max(REACH, spacing[k] + error)
            continue
        # An edge is half a spacing beyond, which is a uniform error of at most so much.
        beyond = MOST * math.sqrt(12) / 2 if kind == "edge" else 0.0
        assert abs((place - segment["centroid"]) @ along - ahead) <= beyond + 1e-9 * rho.max()


def assert_joined(corner, segments):
    """It is of one of two kinds, between the right segments."""
    assert 0 <= corner["quality"] <= 1
    a, b = corner["segments"]
    assert 0 <= min(a, b) < max(a, b) < len(segments)
    assert corner["beam"] == segments["first_beam"][b]
    assert 0 < corner["opening"] < math.pi
    ends = segments["end"][a].tolist(), segments["start"][b].tolist()
    at = corner["position"].tolist()
    assert corner["kind"] in ("corner", "slit")
    assert ends == (at, at) if corner["kind"] == "corner" else at not in ends


def assert_ends(edge, segments):
    """It is at the end of its segment that it names."""
    assert 0 <= edge["quality"] <= 1
    assert 0 <= edge["segment"] < len(segments)
    segment, beam = segments[edge["segment"]], {"start": "first_beam", "end": "last_beam"}
    assert segment[str(edge["side"])].tolist() == edge["position"].tolist()
    assert segment[beam[edge["side"]]] == edge["beam"]


def odd_scans():
    """Hostile scans of any number of beams, some as near to each other as the last digits."""
    yield from (*all_hostile(), *degenerate_scans().values())
    rng = np.random.default_rng(1)
    for _ in range(30):
        n = int(rng.integers(1, 500))
        step = rng.choice([2 * math.pi / n, 0.01, 1e-9])
        for ranges in hostile_scans(n, rng).values():
            yield LaserScan(ranges, -math.pi, step, range_max=rng.choice([5.0, np.inf]))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:all ranges are")
@every_extractor
@pytest.mark.parametrize("source", ["odd", "random", *SENSORS])
def test_features_are_sound(extractor, source):
    made = {"odd": odd_scans, "random": lambda: map(random_scan, range(440))}
    for scan in made.get(source, lambda: simulated(source))():
        assert_sound(scan, extractor(scan), extractor)


@pytest.mark.slow
def test_features_of_recorded_scans_are_sound(data_dir):
    checked = 0
    for path in find_logs(data_dir):
        try:
            log = open_log(path)
        except LogError:
            continue
        for scan in islice(log, 3, None, max(len(log) // 25, 1)):
            extractor = EXTRACTORS["default"]
            assert_sound(scan, extractor(scan), extractor)
            checked += 1
    assert checked > 400


@pytest.mark.slow
@given(
    arrays(np.float64, st.integers(0, 80), elements=st.floats(width=64)),
    st.sampled_from([1e-6, 0.001, 0.01, 0.0775, 2 * math.pi / 40]),
)
@settings(max_examples=500)
@pytest.mark.filterwarnings("ignore::lineament.LineamentWarning")
def test_features_of_any_floats_are_sound(ranges, step):
    step = min(step, 2 * math.pi / max(len(ranges), 1))
    scan = LaserScan(ranges, -1.0, step)
    assert_sound(scan, EXTRACTORS["default"](scan), EXTRACTORS["default"])


def test_ranges_that_no_scanner_reports_are_no_features():
    for value in (1e-300, 1e-9, 1e7, 1e150, 1e300):
        features = EXTRACTORS["default"](LaserScan(np.full(50, value), 0.0, 0.01))
        assert len(features.segments) == len(features.breakpoints) == 0
        assert (features.clusters == -1).all()


def scan_at(points):
    return LaserScan(np.hypot(*points.T), angles=np.arctan2(points[:, 1], points[:, 0]))


@pytest.mark.parametrize("side", [1, -1])
def test_a_corner_is_within_the_spacing_and_the_deviations_there(side):
    """One deviation is 0.11 m at the nearer wall's first measurement, 0.13 m at the farther's last.

    0.2 m and 3 deviations are 0.535 m; by those of the farther wall, it was 0.57 m.
    """
    far = np.column_stack([np.full(40, 4.0), np.linspace(-1.0, 0.97, 40)])
    extractor, found = Extractor("optimal", noise=RangeNoise(0.0, 0.03)), []
    for distance in (0.5, 0.53, 0.54, 0.56):
        near = np.column_stack([4.0 - distance - 0.2 * np.arange(12), np.ones(12)])
        features = extractor(scan_at(np.concatenate([far, near])[::side] * (1, side)))
        assert features.segments["n_points"].tolist() == [40, 12][::side]
        found.append(features.corners["position"].round(9).tolist())
    assert found == [[[4.0, side]], [[4.0, side]], [], []]


@pytest.mark.parametrize(("turn", "beside"), [(10, 0), (15, 1), (18, 2), (19, 2)])
@pytest.mark.parametrize("side", [1, -1])
def test_a_wall_that_bends_ends_where_its_line_passes_its_measurements(turn, beside, side):
    """Its last half metre turns away: what is 9 cm beside the line is not drawn as of it."""
    heading = math.radians(turn)
    away = 0.1 * np.arange(1, 6)[:, None] * (-math.sin(heading), math.cos(heading))
    straight = np.column_stack([np.full(41, 2.0), np.linspace(-1.0, 1.0, 41)])
    points = np.concatenate([straight, straight[-1:] + away])[::side] * (1, side)
    (wall,) = Extractor("optimal", noise=0.001)(scan_at(points)).segments
    aside = abs((points - wall["centroid"]) @ (-math.sin(wall["angle"]), math.cos(wall["angle"])))
    near = np.flatnonzero(aside <= 3 * math.hypot(SURFACE, 0.001))
    assert len(near) == 46 - beside
    assert [wall["first_beam"], wall["last_beam"]] == [near[0], near[-1]]


@pytest.mark.parametrize(("x", "lines"), [(1.65, 0), (1.8, 1)])
def test_a_line_of_which_three_measurements_are_left_is_none(x, lines):
    """Of so much evidence, one of four may be 0.35 m beside a line, which does not end there."""
    points = np.array([(2.0, 0.0), (2.0, 0.1), (2.0, 0.2), (x, 0.3)])
    assert len(Extractor("optimal", noise=0.001, evidence=40.0)(scan_at(points)).segments) == lines


# Seen in another way


def rows_of(features, place=np.asarray, flip=False):
    """What there is to know of segments, corners and arcs, one row each, by places elsewhere."""
    lines, corners, arcs = features.segments, features.corners, features.arcs
    ends = ("end", "start") if flip else ("start", "end")
    variances = lines["covariance"][:, [0, 1], [0, 1]] ** 0.5
    numbers = [lines[name] for name in ("n_points", "rms", "misfit")]
    yield np.column_stack([place(lines[e]) for e in (*ends, "centroid")] + [variances, *numbers])
    numbers = [corners[name] for name in ("opening", "quality", "convex", "response")]
    spread = np.sqrt(np.trace(corners["covariance"], axis1=1, axis2=2))
    yield np.column_stack([place(corners["position"]), spread, *numbers])
    edges = features.edges
    spread = np.sqrt(np.trace(edges["covariance"], axis1=1, axis2=2))
    sides = edges["side"] == ends[0]
    yield np.column_stack([place(edges["position"]), spread, sides, edges["quality"]])
    yield np.column_stack([place(arcs["center"]), arcs["radius"], arcs["n_points"]])


def assert_same(one, other, beams, place=np.asarray, flip=False):
    """Hold that features are those of another scan in any order.

    `beams` and `place` lead from the beams and the places of one to those of the other.
    """
    tables = zip(rows_of(one, place, flip), rows_of(other), strict=True)
    for before, after in tables:
        assert len(before) == len(after)
        near = np.isclose(before[:, None], after, rtol=1e-5, atol=1e-6).all(axis=2)
        assert (near.sum(axis=0) == 1).all()
        assert (near.sum(axis=1) == 1).all()
    pairs = set(zip(one.clusters.tolist(), other.clusters[beams].tolist(), strict=True))
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})
    assert all((a < 0) == (b < 0) for a, b in pairs)


def turned(scan, k):
    turn = 0.3 + 0.7 * k % 6.0
    other = seen(scan, scan.ranges, scan.angles + turn)
    c, s = math.cos(turn), math.sin(turn)
    return other, np.arange(len(scan)), lambda points: points @ [[c, s], [-s, c]]


def mirrored(scan, _):
    other = seen(scan, scan.ranges[::-1], -scan.angles[::-1])
    return other, np.arange(len(scan))[::-1], lambda points: points * (1, -1)


def rolled(scan, k):
    """A full circle may begin at any beam."""
    n, shift = len(scan), (7 + 37 * k) % max(len(scan), 1) if scan.is_full_circle else 0
    angles = scan.angles - shift * scan.angle_increment
    return seen(scan, np.roll(scan.ranges, shift), angles), (np.arange(n) + shift) % n, np.asarray


@pytest.mark.parametrize("source", [*SENSORS, "random"])
@pytest.mark.parametrize("change", [turned, mirrored, rolled])
def test_features_are_those_of_the_scan_seen_in_another_way(source, change):
    """No direction, no side and no beam is special."""
    scans = list(map(random_scan, range(60))) if source == "random" else simulated(source)
    extractor = EXTRACTORS["noise given" if change is rolled else "default"]
    for k, scan in enumerate(scans):
        other, beams, place = change(scan, k)
        flip = change is mirrored
        assert_same(extractor(scan), extractor(other), beams, place, flip=flip)


def test_interlaced_edges_are_the_same_from_both_sides():
    """A spike among measurements of another surface: which of them is one is not told by order."""
    angles = math.radians(0.5) * np.arange(-30, 31)
    for mixed in ((4.0, 2.0), (4.0, 2.0, 4.0, 2.0)):
        ranges = np.r_[np.full(30, 2.0), mixed, np.full(31 - len(mixed), 4.0)] / np.cos(angles)
        one = EXTRACTORS["noise given"](scan_of(ranges, angles))
        other = EXTRACTORS["noise given"](scan_of(ranges[::-1], angles))
        assert_same(one, other, np.arange(61)[::-1], lambda p: p * (1, -1), flip=True)


@pytest.mark.parametrize("scale", [2.0, 4.0])
def test_lengths_and_noise_scale_together(scale):
    """But for the scale of a surface and the reach of a corner, which do not matter here."""
    ring, angles = full_circle(720), math.radians(0.25) * np.arange(-40, 41)
    column = 1.5 * np.cos(angles) - np.sqrt(0.3**2 - (1.5 * np.sin(angles)) ** 2)
    for ranges, bearings in ((room(ring, BOX), ring), (column, angles)):
        one, two = (
            Extractor("optimal", noise=RangeNoise(sigma=0.004 * k))(scan_of(k * ranges, bearings))
            for k in (1.0, scale)
        )
        assert len(one.arcs) == len(two.arcs) == (bearings is angles)
        assert len(one.segments) == len(two.segments) == 4 * (bearings is ring)
        for table, names in (
            ("segments", ("start", "end", "centroid")),
            ("corners", ("position",)),
        ):
            for name in names:
                before, after = getattr(one, table)[name], getattr(two, table)[name]
                np.testing.assert_allclose(after, scale * before, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(two.arcs["radius"], scale * one.arcs["radius"], rtol=1e-6)
        np.testing.assert_allclose(
            two.corners["covariance"], scale**2 * one.corners["covariance"], rtol=1e-5, atol=1e-12
        )
        assert two.clusters.tolist() == one.clusters.tolist()


def test_a_vertex_of_a_map_is_not_beyond_all_bounds():
    """A line along the ray of its vertex, six measurements of a nanometre: it was at 5000 km."""
    ranges = [9.381522315907185e-10, 9.514869517520805e-10, 9.642356304067797e-10]
    ranges += [9.398491119881507e-10, 9.642236086075349e-10, 9.645831849580405e-10]
    scan = LaserScan(ranges, -math.pi, math.pi / 3)
    features = Extractor("optimal", noise=0.0, max_missing=3, max_vertices=40)(scan)
    assert features.counts()["segments"]
    assert np.abs(features.segments["end"]).max() < 1.0
