"""Several scanners on one robot: what they see becomes one set of features."""

import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from handmade import arc, corner, edge, features, segment

import lineament as ln
from lineament.features import TABLES
from lineament.mapping import merge_features
from lineament.scan import LaserScan
from lineament.scan.poses import compose
from lineament.simulation import SENSORS, World, scene, sensor_like

#: Scanners at the front left and the rear right of a robot, and one that looks to its left.
CORNERS = [(0.3, 0.25, math.pi / 4), (-0.3, -0.25, -3 * math.pi / 4)]
THREE = [*CORNERS, (0.0, 0.25, math.pi / 2)]
AT_ROBOT = [(0.0, 0.0, 0.0)] * 2
#: A scanner without what a line does not explain: mixed pixels and false returns.
PLAIN = sensor_like("utm30lx", mixed_pixel=0.0, dropout=0.0, outlier=0.0)


def seen(world, base, mountings, seed, sensor=PLAIN):
    """Return the features of each scanner of a robot in a world."""
    rng, extractor = np.random.default_rng([seed, 7]), ln.Extractor()
    return [extractor(sensor.scan(world, compose(base, pose), rng)) for pose in mountings]


def made(**rows):
    """Make the features of a scan of three beams."""
    return replace(features(3, **rows), scan=LaserScan([5.0, 5.0, 5.0], -0.1, 0.1))


def wall(x, first, last, sigma, **fields):
    """Make a wall at x, from its first to its last y; its offset is known to sigma."""
    row = segment((x, first), (x, last), 0, 2, sigma=(sigma, 0.01))
    for name, value in fields.items():
        row[name] = value
    return row


def merged_walls(*walls):
    """Return the segments of scanners in one place, each of which sees one wall."""
    parts = [made(segments=[one]) for one in walls]
    return merge_features(parts, AT_ROBOT).segments


def test_walls_are_weighted_by_their_information():
    one = wall(2.00, -1.0, 0.5, 0.01, rms=0.01)
    (found,) = merged_walls(one, wall(2.03, -0.5, 1.5, 0.02, n_points=9, rms=0.02))
    # Weights are 1 / 0.01² and 1 / 0.02², at places 0.75 m apart where lines turn by 0.01 rad.
    assert found["n_points"] == 12
    assert found["rms"] == pytest.approx(math.sqrt((3 * 0.01**2 + 9 * 0.02**2) / 12))
    assert 2.0 < found["centroid"][0] < 2.015
    assert found["covariance"][0, 0] == pytest.approx(1 / (1 / 0.01**2 + 1 / 0.02**2), rel=0.1)
    assert found["start"][1] == pytest.approx(-1.0, abs=1e-3)
    assert found["end"][1] == pytest.approx(1.5, abs=1e-3)
    assert found["length"] == pytest.approx(2.5, abs=1e-3)


def test_walls_at_one_place_are_a_weighted_mean():
    (found,) = merged_walls(wall(2.0, -1.0, 1.0, 0.01), wall(2.03, -1.0, 1.0, 0.02))
    assert found["centroid"] == pytest.approx((2.0 + 0.03 / 5, 0.0))
    assert found["covariance"] == pytest.approx(np.diag([1 / 12500, 5e-5]), rel=1e-3, abs=1e-9)


def test_walls_are_one_up_to_the_quantile_of_chi_square():
    limit = math.sqrt(-2 * math.log(0.001) * 2) * 0.01  # of the difference of two
    for share, count in ((0.99, 1), (1.01, 2)):
        beside = wall(2.0 + share * limit, -1.0, 1.0, 0.01)
        assert len(merged_walls(wall(2.0, -1.0, 1.0, 0.01), beside)) == count
        # A misfit of the surface is an error of each that noise does not explain.
        assert len(merged_walls(wall(2.0, -1, 1, 0.01, misfit=0.02), beside)) == 1


@pytest.mark.parametrize(("first", "count"), [(1.15, 1), (1.25, 2), (0.5, 1)])
def test_walls_with_a_doorway_between_them_are_two(first, count):
    assert len(merged_walls(wall(2.0, -1.0, 1.0, 0.01), wall(2, first, 3, 0.01))) == count


def test_the_other_side_of_a_wall_is_another_wall():
    assert len(merged_walls(wall(2.0, -1.0, 1.0, 0.01), wall(2.0, 1.0, -1.0, 0.01))) == 2


def test_nothing_of_one_scanner_becomes_one():
    halves = made(segments=[wall(2.0, -1.0, 0.0, 0.01), wall(2.0, 0.01, 1.0, 0.01)])
    whole = made(segments=[wall(2.001, -1.0, 1.0, 0.01)])
    assert len(merge_features([halves], AT_ROBOT[:1]).segments) == 2
    assert len(merge_features([halves, whole], AT_ROBOT).segments) == 2


def test_corners_and_arcs_are_weighted_by_their_information():
    corners = corner(2.0, 1.0), corner(2.01, 1.01)
    for row, variances in zip(corners, ([1e-4, 4e-4], [4e-4, 1e-4]), strict=True):
        row["covariance"] = np.diag(variances)
    arcs = arc(3, 0, 0.2, 0, 2), arc(3, 0.02, 0.2, 0, 2)
    parts = [made(corners=[of], arcs=[at]) for of, at in zip(corners, arcs, strict=True)]
    found = merge_features(parts, AT_ROBOT)
    assert found.corners["position"] == pytest.approx(np.array([[2.002, 1.008]]))
    assert found.corners["covariance"][0] == pytest.approx(np.eye(2) * 8e-5)
    assert found.arcs["center"] == pytest.approx(np.array([[3.0, 0.01]]))
    assert found.arcs["covariance"][0] == pytest.approx(np.eye(3) * 5e-5)
    assert found.arcs["n_points"] == 6


def test_corners_of_another_convexity_are_two():
    parts = [made(corners=[corner(2, 1)]) for _ in range(2)]
    parts[0].corners["convex"] = True
    assert len(merge_features(parts, AT_ROBOT).corners) == 2
    parts[1].corners["convex"] = True
    assert len(merge_features(parts, AT_ROBOT).corners) == 1


def test_edges_stay_where_walls_end():
    hidden = made(
        segments=[wall(2.0, -1.0, 0.5, 0.01)],
        edges=[edge(2.0, -1.0, side="start"), edge(2.0, 0.5)],
    )
    longer = made(
        segments=[wall(5.0, 0, 1, 0.01), wall(2.0, -0.99, 1.5, 0.01)],
        edges=[edge(2.0, -0.99, side="start", segment=1), edge(2.0, 1.5, segment=1)],
    )
    found = merge_features([hidden, longer], AT_ROBOT)
    which = found.edges["segment"]
    assert (found.segments["centroid"][which, 0] < 2.1).all()
    places = dict(zip(found.edges["side"], found.edges["position"][:, 1].round(3), strict=True))
    assert places == {"end": 1.5, "start": -0.995}


def test_beams_count_in_the_scan_of_all():
    world, base = scene("room", 3)
    parts = seen(world, base, CORNERS, 3)
    merged = merge_features(parts, CORNERS, frame_id="robot")
    assert len(merged.clusters) == len(merged.scan) == sum(len(part.scan) for part in parts)
    assert merged.scan.frame_id == merged.frame_id == "robot"
    assert merged.scan.pose == pytest.approx(base)
    for name, end in (("first_beam", "start"), ("last_beam", "end")):
        beams = merged.segments[name]
        away = np.linalg.norm(merged.scan.points[beams] - merged.segments[end], axis=1)
        assert away.max() < 0.15
        assert np.array_equal(merged.clusters[beams] >= 0, np.ones(len(beams), bool))
    sides = merged.corners["segments"]
    assert sides.max() < len(merged.segments)
    assert sides.min() >= -1
    # What lies beyond a corner is on the lines of its segments, as it is for each scanner.
    for k, corner_of in zip(sides[:, 0], merged.corners["position"], strict=True):
        arm, angle = corner_of - merged.segments["centroid"][k], merged.segments["angle"][k]
        assert abs(arm[1] * math.cos(angle) - arm[0] * math.sin(angle)) < 0.05
    assert not (merged.breakpoints["kind"] == "scan_end").any()
    assert merged.to_arrow().num_rows >= len(merged)


@pytest.mark.parametrize("kind", ["room", "hall", "corridor"])
def test_the_order_of_the_scanners_does_not_matter(kind):
    world, base = scene(kind, 5)
    parts = seen(world, base, THREE, 5)
    expected = merge_features(parts, THREE)
    for order in permutations(range(3)):
        found = merge_features([parts[k] for k in order], [THREE[k] for k in order])
        assert np.allclose(found.scan.ranges, expected.scan.ranges)
        for name in TABLES:
            assert len(found[name]) == len(expected[name])
            for field in set(TABLES[name].names) - {"cluster", "kind", "side"}:
                assert np.allclose(found[name][field], expected[name][field], atol=1e-9), field


def errors_of_walls(found, world):
    """NEES of the offset and angle of the segments that lie on one wall of the world."""
    squares = []
    for one in found.segments:
        for x, y, to_x, to_y in world.segments:
            u = np.array([to_x - x, to_y - y])
            length = np.hypot(*u)
            u /= length
            along = [(one[end] - (x, y)) @ u for end in ("start", "end", "centroid")]
            arm = one["centroid"] - (x, y)
            offset, turn = u[0] * arm[1] - u[1] * arm[0], one["angle"] - math.atan2(u[1], u[0])
            if min(along) > -0.1 and max(along) < length + 0.1 and abs(offset) < 0.1:
                sign = 1 if math.cos(turn) > 0 else -1
                off = np.array([sign * offset, math.remainder(turn, math.pi)])
                if abs(off[1]) < 0.2:
                    squares.append(off @ np.linalg.solve(one["covariance"], off) / 2)
                    break
    return squares


def errors_of_corners(corners, world):
    """NEES of corners that are vertices of the world."""
    vertices = world.segments.reshape(-1, 2)
    off = [one["position"] - vertices for one in corners]
    off = [of[np.linalg.norm(of, axis=1).argmin()] for of in off]
    pairs = zip(off, corners["covariance"], strict=True)
    return [e @ np.linalg.solve(of, e) / 2 for e, of in pairs if np.linalg.norm(e) < 0.15]


def test_covariances_of_what_is_one_are_those_of_its_errors():
    walls, corners = [], []
    for kind in ("room", "hall", "star"):
        for seed in range(40):
            world, base = scene(kind, seed)
            parts = seen(world, base, CORNERS, seed)
            merged = merge_features(parts, CORNERS).transform(*base)
            apart = {n for part in parts for n in part.segments["covariance"][:, 0, 0].tolist()}
            is_one = [n not in apart for n in merged.segments["covariance"][:, 0, 0].tolist()]
            traces = np.concatenate([np.linalg.det(part.corners["covariance"]) for part in parts])
            ratio = np.linalg.det(merged.corners["covariance"])[:, None] / traces - 1
            both = merged.corners[(abs(ratio) > 1e-6).all(axis=1)]
            merged.segments, found = merged.segments[is_one], len(walls)
            walls += errors_of_walls(merged, world)
            assert len(walls) - found == sum(is_one)  # no wall is of two
            corners += errors_of_corners(both, world)
    assert len(walls) > 600
    assert len(corners) > 250
    assert 0.8 < np.mean(walls) < 1.25
    assert 0.8 < np.mean(corners) < 1.25


def test_a_mounting_that_is_not_known_well_joins_what_is_beside():
    world = World([(3, -2, 3, 2)])
    parts = seen(world, (0, 0, 0), [(0.3, 0, 0), (0.28, 0.02, 0)], 1)
    believed = [(0.3, 0.0, 0.0), (0.3, 0.0, 0.0)]
    assert len(merge_features(parts, believed).segments) == 2
    unsure = np.diag([0.01, 0.01, 0.01]) ** 2
    (found,) = merge_features(parts, believed, unsure).segments
    assert found["covariance"][0, 0] > 0.01**2 / 2


@pytest.mark.parametrize("method", ["optimal", "liu", "pdbs", "iepf"])
def test_any_method_and_scanner_will_do(method):
    if method not in ln.methods.method_names():
        pytest.skip(f"{method} is of the laboratory")
    world, base = scene("hall", 2)
    extractor = ln.Extractor(method)
    rng = np.random.default_rng(0)
    scans = [
        SENSORS[name].scan(world, compose(base, pose), rng)
        for name, pose in zip(("ld19", "utm30lx"), CORNERS, strict=True)
    ]
    merged = merge_features([extractor(scan) for scan in scans], CORNERS)
    assert sum(merged.counts().values())


@pytest.mark.parametrize(
    "scan",
    [
        LaserScan([], 0.0, 0.1),
        LaserScan([math.nan] * 5, 0.0, 0.1),
        LaserScan([1e9] * 5, 0.0, 0.1),
        LaserScan([1e-9] * 5, 0.0, 0.1),
        LaserScan([1.0], 0.0, 0.1),
    ],
)
def test_scans_of_nothing(scan):
    found = ln.extract(scan)
    other = ln.extract(LaserScan([2.0] * 9, -0.04, 0.01))
    both = merge_features([found, other], AT_ROBOT)
    assert len(both.segments) == len(found.segments) + 1
    assert merge_features([found, found], AT_ROBOT).counts()["segments"] == len(found.segments)


def test_features_that_cannot_be_merged():
    found = ln.extract(LaserScan([2.0] * 9, -0.04, 0.01))
    two, moved = [found, found], [found, found.transform(0, 0, 1)]
    for problem, *given in (
        ("1 mountings of 2 features, expected one each", two, AT_ROBOT[:1]),
        ("0 mountings of 0 features", [], []),
        ("have no scan", moved, AT_ROBOT),
        ("three finite numbers", two, [(0, 0, 0), (math.nan, 0, 0)]),
        ("theta = 180 rad, more than a turn", two, [(0, 0, 0), (0, 0, 180)]),
        ("300 m from the robot's origin, .* in millimetres", two, [(0, 0, 0), (300, 0, 0)]),
        ("covariance", two, AT_ROBOT, np.eye(2)),
    ):
        with pytest.raises(ValueError, match=problem):
            merge_features(*given)
    with pytest.raises(ValueError, match="between 0 and 1"):
        merge_features(two, AT_ROBOT, gate=1.0)
