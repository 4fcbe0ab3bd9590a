"""The public benchmark: its file, scores by hand, the authors' own figures to the last digit."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from handmade import corner, features, segment
from lineament_lab.evaluation.ple import (
    Benchmark,
    cast_map,
    load_benchmark,
    maps,
    method_map,
    polylines_of,
    run_benchmark,
    score_map,
    sparing_map,
)
from naive_iepf import iepf_map

from lineament import LaserScan
from lineament.errors import LogError

#: Scans and budgets where two points are equally far but for the authors' rounding, which took the
#: later one.
TIED = [(30, 40), (139, 50)]


@pytest.fixture(scope="module")
def real(data_dir):
    return load_benchmark(data_dir / "benchmark" / "ple_real.npz")


@pytest.fixture(scope="module")
def simulated(data_dir):
    return load_benchmark(data_dir / "benchmark" / "ple_sim.npz")


def given_iepf(benchmark, score):
    return benchmark.scores[score][:, benchmark.methods.index("iepf")]


@pytest.mark.slow
def test_the_authors_iepf_comes_out_to_the_last_digit(real, simulated):
    pytest.importorskip("shapely")
    shown = []

    def track(scans, about, whole):
        shown.append((len(scans), about, len(whole)))
        return scans

    result = run_benchmark(real, iepf_map, track=track)
    on_simulated = run_benchmark(simulated, iepf_map)
    assert shown == [(140, "iepf_map", 140)]
    for score in ("rmse", "f", "fnr"):
        given = given_iepf(real, score)
        close = np.isclose(result.scores[score], given, rtol=0, atol=1e-12, equal_nan=True)
        off = {(int(i), real.max_vertices[j]) for i, j in np.argwhere(~close)}
        assert off == (set(TIED) if score == "rmse" else set())
    for score in ("rmse", "f", "area_error"):
        given = given_iepf(simulated, score)
        np.testing.assert_allclose(on_simulated.scores[score], given, rtol=0, atol=1e-12)
    assert np.isnan(on_simulated.scores["fnr"]).all()
    assert (on_simulated.scores["vertices"] == simulated.max_vertices).all()
    # A ∪ B = A + B - A ∩ B, so that the one score bounds the other.
    scores = on_simulated.scores
    assert (scores["iou"] <= 1 - scores["area_error"] / 2 + 1e-12).all()
    for found, given in (
        (result.means()["rmse"], [1.3572, 0.6577, 0.387, 0.2475, 0.153]),
        (real.means()["rmse"]["ple+"], [0.0811, 0.0635, 0.0471, 0.0352, 0.0254]),
        (on_simulated.means()["area_error"], [0.0351, 0.0145, 0.0119, 0.0110, 0.0105]),
    ):
        np.testing.assert_allclose(found, given, atol=5.1e-5)


def odd(benchmark):
    """Give the scans with odd numbers: a constant of `optimal` was chosen on the others."""
    scores = {score: values[1::2] for score, values in benchmark.scores.items()}
    outlines = benchmark.outlines and benchmark.outlines[1::2]
    return replace(benchmark, scans=benchmark.scans[1::2], scores=scores, outlines=outlines)


@pytest.mark.slow
def test_optimal_explains_more_of_real_scans_and_better_than_any_authors(real):
    result = run_benchmark(odd(real), "optimal")
    for score, better in (("rmse", np.less), ("f", np.greater)):
        theirs = result.benchmark.means()[score]["ple+"]
        assert better(result.means()[score], theirs).all()


@pytest.mark.slow
def test_a_map_of_few_vertices_is_nearer_to_the_truth_than_the_authors_best(simulated):
    pytest.importorskip("shapely")
    scans = replace(odd(simulated), max_vertices=(30,))
    area_error = run_benchmark(scans, sparing_map("optimal")).means()["area_error"]
    assert area_error[0] < 0.8 * min(scans.means()["area_error"]["ple+"])


def test_scores_by_hand():
    # A wall at x = 2 that ends at bearing 0.1, and another behind it, over the seam.
    wall = np.array([[2.0, -2.0], [2.0, 2.0 * math.tan(0.1)]])
    back = np.array([[-1.0, 1.0], [-1.0, -1.0]])
    bearings = np.array([-3.0, -1.0, -0.5, 0.0, 0.2, 3.1])
    ranges = np.array([1 / math.cos(math.pi - 3.0) + 0.3, np.nan, np.nan, 2.4, 5.0, np.nan])
    score = score_map([wall, back], LaserScan(ranges, angles=bearings))
    assert score.vertices == 4
    assert score.rmse == pytest.approx(math.sqrt((0.3**2 + 0.4**2) / 2))
    assert score.f == pytest.approx(2 / 3)  # At 0.2 rad a return meets nothing.
    assert score.fnr == pytest.approx(1 / 3)  # At -0.5 and 3.1 rad there is a wall.
    assert math.isnan(score.area_error)


NEAR, FAR = (np.array([[x, -1.0], [x, 1.0]]) for x in (1.0, 3.0))


@pytest.mark.parametrize(
    ("polylines", "bearing", "expected"),
    [
        ([NEAR, FAR], 0.0, 3.0),  # of several the last
        ([FAR, NEAR], 0.0, 1.0),
        ([np.concatenate((FAR, NEAR[::-1]))], 0.0, 1.0),
        ([np.array([[2.0, 0.0], [2.0, 1.0]])], -0.9e-3, 2.0),  # by a milliradian past its end
        ([np.array([[2.0, 0.0], [2.0, 1.0]])], -1.1e-3, math.nan),
        ([np.array([[2.0, 0.0], [2.0, -1.0]])], 0.9e-3, 2.0),
        ([np.array([[2.0, 0.0], [2.0, -1.0]])], 1.1e-3, math.nan),
        ([np.array([[1.0, 0.0], [2.0, 0.0]])], 0.0, math.nan),  # along the ray
    ],
)
def test_where_a_ray_meets_a_map(polylines, bearing, expected):
    found = cast_map(polylines, np.array([bearing]))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_areas_by_hand():
    pytest.importorskip("shapely")
    outline = np.array([[2.0, 2.0], [-2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]])
    scan = LaserScan([2.0, np.nan], angle_min=0.0, angle_increment=0.1)
    right = np.array([[3.0, -2.0], [3.0, 2.0]])
    left = np.array([[-1.0, 2.0], [-1.0, -2.0]])
    score = score_map([left, right], scan, outline)
    assert (score.area_error, score.iou) == pytest.approx(((20 - 12) / 16, 12 / 20))
    for empty in [], [np.empty((0, 2))], [np.ones((1, 2))], [left[:1], right[:1]]:
        score = score_map(empty, scan, outline)
        assert math.isnan(score.rmse)
        assert (score.f, score.fnr, score.area_error, score.iou) == (0.0, 1.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: cast_map([NEAR, np.ones((2, 3))], np.zeros(1)), r"polylines\[1\] has shape"),
        (lambda: run_benchmark(wall_benchmark(), "lui"), "method 'lui' is unknown"),
        (
            lambda: run_benchmark(
                wall_benchmark(), lambda scan, _: [scan.points[:3]], name="chord"
            ),
            "chord made a map of 3 vertices of scan 0, expected at most 2",
        ),
    ],
)
def test_maps_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def features_of(walls, corners, beams=4):
    """Make features of walls (start, end, first beam, last beam) and corners (a, b) at beams."""
    joints = [corner(0, 0, segments=sides) for sides in corners]
    found = features(0, segments=[segment(*wall) for wall in walls], corners=joints)
    found.corners["beam"] = beams
    return found


FAN = LaserScan(np.ones(9), angle_min=-0.4, angle_increment=0.1)


def test_segments_joined_at_a_corner_share_its_vertex():
    walls = [((2.0, -0.5), (2.0, 0.0), 2, 4), ((2.0, 0.0), (3.0, 0.5), 4, 6)]
    (joined,) = polylines_of(features_of(walls, [(0, 1)]), FAN)
    # The ends go on to the rays at ∓0.2 rad.
    end = 2.0 / (1 - 2 * math.tan(0.2))
    expected = [[2.0, -2.0 * math.tan(0.2)], [2.0, 0.0], [end, end * math.tan(0.2)]]
    np.testing.assert_allclose(joined, expected)
    apart = polylines_of(features_of(walls, [(-1, 1)]), FAN)
    assert [len(polyline) for polyline in apart] == [2, 2]
    assert polylines_of(features_of([], []), FAN) == []
    # A wall along the rays keeps its ends.
    (grazing,) = polylines_of(features_of([((2.0, 0.001), (3.0, 0.002), 4, 5)], []), FAN)
    np.testing.assert_allclose(grazing, [[2.0, 0.001], [3.0, 0.002]])


@pytest.mark.parametrize(
    ("ends", "x"),
    [
        (((2.0, 0.0), (2.2, 0.0)), 2.1),  # lines that miss each other meet midway
        # x = 2 goes on to y = 4, at 63° and beyond the fan: midway on the ray of the bend.
        (((2.0, 4.0), (2.0, 4.0)), (2.0 + 22.0 / 7.0) / 2),
    ],
)
def test_where_lines_that_do_not_share_a_vertex_meet(ends, x):
    walls = [((2.0, -0.5), ends[0], 2, 4), (ends[1], (3.0, 0.5), 4, 6)]
    (polyline,) = polylines_of(features_of(walls, [(0, 1)]), FAN)
    np.testing.assert_allclose(polyline[1], [x, 0.0])


def test_a_closed_outline_ends_where_it_begins():
    around = LaserScan(np.ones(8), angle_min=-math.pi / 4, angle_increment=math.pi / 4)
    vertices = [(2.0, -2.0), (2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0)]
    ends = [*vertices, vertices[0]]
    walls = [(ends[k], ends[k + 1], 2 * k, (2 * k + 2) % 8) for k in range(4)]
    lone = ((4.0, 0.0), (4.0, 4.0), 1, 2)
    corners = [(3, 0), (0, 1), (1, 2), (2, 3)]
    found = features_of([*walls, lone], corners, beams=[0, 2, 4, 6])
    alone, outline = polylines_of(found, around)
    np.testing.assert_allclose(alone, [[4.0, 0.0], [4.0, 4.0]], atol=1e-12)
    np.testing.assert_allclose(outline, [*vertices, vertices[0]])


def wall_benchmark(scans=2):
    bearings = np.linspace(-0.5, 0.5, 21)
    scan = LaserScan(np.where(np.arange(21) == 3, np.nan, 2 / np.cos(bearings)), angles=bearings)
    given = np.full((scans, 1, 2), 0.25)
    return Benchmark("wall", (scan,) * scans, (2, 10), ("peer",), dict.fromkeys(("rmse",), given))


def test_results_stand_beside_the_authors():
    result = run_benchmark(wall_benchmark(), lambda scan, _: [scan.points[[0, 20]]], name="chord")
    means = result.means()
    assert list(means) == ["vertices", "rmse", "f", "fnr"]
    assert (means["vertices"], means["f"]) == ([2.0, 2.0], [1.0, 1.0])
    assert result.benchmark.means() == {"rmse": {"peer": [0.25, 0.25]}}
    written = json.loads(result.to_json())
    assert written["mean"]["f"] == [1.0, 1.0]
    assert written["authors"]["rmse"]["peer"] == [0.25, 0.25]
    assert len(written["scans"]) == 2
    found = {"vertices": 2, "rmse": pytest.approx(0.0, abs=1e-12), "f": 1.0, "fnr": 0.0}
    unknown = {"area_error": None, "iou": None}
    assert written["scans"][0][1] == {"max_vertices": 10} | found | unknown


def test_a_method_of_the_registry():
    result = run_benchmark(wall_benchmark(), "iepf")
    assert result.scores["vertices"].tolist() == [[2, 2]] * 2
    assert result.scores["rmse"].max() < 1e-9
    assert [len(line) for line in method_map("iepf")(wall_benchmark().scans[0], 10)] == [2]


@pytest.mark.parametrize("seed", range(30))
def test_the_sparing_map_is_that_of_the_least_penalty(seed, monkeypatch):
    """Walls across the view, behind the true one and ending early, or at its very place.

    An error counts as 0.3 m at most, as does a return without a wall; none counts for nothing.
    """
    rng = np.random.default_rng(seed)
    bearings = np.linspace(-0.5, 0.5, 40)
    scan = LaserScan(
        np.where(rng.random(40) < 0.2, np.nan, 2.0 / np.cos(bearings)), angles=bearings
    )
    n, walls, penalties = int(scan.valid.sum()), {}, {}
    for v in range(2, 9):
        behind = rng.choice([0.0, 0.0005, 0.005, 0.02, 0.1, 0.5])
        end = rng.choice([-0.6, -0.6, 0.013, 0.4])
        x = 2.0 + behind
        walls[v] = [np.array([[x, x * math.tan(end)], [x, x * math.tan(0.6)]])]
        errors = np.where(bearings > end, np.minimum(behind / np.cos(bearings), 0.3), 0.3)
        squares = max(np.square(errors[scan.valid]).sum(), n * 1e-24)
        penalties[v] = n * math.log(squares / n) + v * (2 * math.log(n / v) + 5)
    monkeypatch.setattr(maps, "method_map", lambda _: lambda _, v: walls[v])
    assert sparing_map("any")(scan, 8) is walls[min(penalties, key=penalties.get)]


@pytest.mark.parametrize("sigma", [1e-3, 0.02])
def test_a_sparing_map_spends_no_vertices_on_noise(sigma):
    bearings = np.radians(np.arange(-60, 61))
    noise = np.random.default_rng(2).normal(0.0, sigma, 121)
    scan = LaserScan(2 / np.maximum(np.cos(bearings), 0.7) + noise, angles=bearings)
    sparing = sparing_map("optimal")
    assert sum(map(len, method_map("optimal")(scan, 14))) == 14
    assert 2 < sum(map(len, sparing(scan, 14))) < 14
    assert sparing(scan, 1) == []
    nothing = LaserScan(np.full(121, np.nan), angles=bearings)
    assert sparing(nothing, 5) == []


def archive(**changes):
    """Give the arrays of a whole simulated benchmark of two scans, of which the second is short."""
    arrays = {
        "azimuth": np.array([[0.0, 0.1, 0.2], [0.0, 0.5, np.nan]]),
        "radius": np.array([[1.0, 5.0, 0.5], [5.1, np.inf, np.nan]]),
        "beams": np.array([3, 2]),
        "radius_limits": np.array([[1.0, 5.0], [0.0, 5.0]]),
        "max_vertices": np.array([10, 20]),
        "methods": np.array(["ple"]),
        **{key: np.zeros((2, 1, 2)) for key in ("rmse", "f", "fnr", "area_error")},
        "polygon": np.array([[[1, 1], [2, 1], [1, 2]], [[1, 1], [2, 1], [np.nan, np.nan]]]),
        "pose": np.array([[1.0, 1.0, math.pi / 2], [0.0, 0.0, 0.0]]),
    }
    arrays.update(changes)
    return {key: array for key, array in arrays.items() if array is not None}


def test_what_a_file_holds(tmp_path):
    np.savez(tmp_path / "a.npz", **archive())
    benchmark = load_benchmark(tmp_path / "a.npz")
    assert benchmark.name == "a.npz"
    # Both limits belong to the range; what lies beyond is no return, and so is infinity.
    assert [scan.valid.tolist() for scan in benchmark.scans] == [[True, True, False], [False] * 2]
    assert benchmark.max_vertices == (10, 20)
    assert benchmark.methods == ("ple",)
    assert sorted(benchmark.scores) == ["area_error", "f", "fnr", "rmse"]
    np.testing.assert_allclose(benchmark.outlines[0], [[0, 0], [0, -1], [1, 0]], atol=1e-12)
    assert benchmark.outlines[1].tolist() == [[1, 1], [2, 1]]
    real = {"polygon": None, "pose": None, "area_error": None, "beams": np.array([3, 0])}
    np.savez(tmp_path / "a.npz", **archive(**real))
    benchmark = load_benchmark(tmp_path / "a.npz")
    assert ([len(scan) for scan in benchmark.scans], benchmark.outlines) == ([3, 0], None)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fnr": None}, "has no key fnr, which a benchmark has; found azimuth, radius"),
        ({"pose": None}, "has no key pose"),
        ({"beams": np.array([3])}, r"beams has shape \(1,\), expected \(2\)"),
        ({"beams": np.array([3, 4])}, r"beams\[1\] is 4, expected 0 … 3"),
        ({"beams": np.array([-1, 2])}, r"beams\[0\] is -1, expected 0 … 3"),
        ({"radius": np.ones((2, 4))}, r"radius has shape \(2, 4\), expected \(2, 3\)"),
        ({"radius_limits": np.ones((2, 3))}, r"radius_limits has shape \(2, 3\), expected \(2, 2"),
        ({"methods": np.array([1])}, "methods has type int64"),
        ({"rmse": np.full((2, 1, 2), "a")}, "rmse has type <U1"),
        ({"azimuth": np.zeros((2, 3))}, r"scan 0: angles\[1\] is 0.0 after 0.0"),
        (None, "is no whole npz archive"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, changes, message):
    path = tmp_path / "a.npz"
    if changes is None:
        path.write_bytes(b"PK\x03\x04 and nothing more")
    else:
        np.savez(path, **archive(**changes))
    with pytest.raises(LogError, match=rf"a\.npz.*{message}") as error:
        load_benchmark(path)
    assert "\n" not in str(error.value)
    with pytest.raises(LogError, match=r"b\.npz"):
        load_benchmark(tmp_path / "b.npz")
