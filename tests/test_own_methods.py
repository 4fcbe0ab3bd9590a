"""A function of a scan as a method: what is made of what it returns, and what is refused."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass

import numpy as np
import pytest

import lineament as ln
from lineament.cli import run
from lineament.methods import get_method
from lineament.methods.functions import as_method
from lineament.tasks.bulk import extract_logs

BEARINGS = np.linspace(-0.6, 0.6, 121)
#: A wall at x = 2, seen with noise of 1 cm.
RANGES = 2.0 / np.cos(BEARINGS) + np.random.default_rng(3).normal(0, 0.01, 121)
SCAN = ln.LaserScan(RANGES, angles=BEARINGS)
#: Two walls that meet at (2, 1) at a right angle, without noise.
CORNER = ln.LaserScan(
    np.minimum(2.0 / np.cos(BEARINGS), 1.0 / np.maximum(np.sin(BEARINGS), 1e-3)), angles=BEARINGS
)


def extracted(found, scan=SCAN, **noise):
    return ln.extract(scan, method=lambda _: found, **(noise or {"noise": 0.01}))


def test_beams_are_fitted_as_stages_do():
    features = extracted([(10, 100)])
    (segment,) = features.segments
    expected = ln.methods.stages.fit_line(
        SCAN.points[10:101], noise=ln.RangeNoise(0.01), fit="weighted"
    )
    for name in ("start", "end", "centroid", "angle", "covariance", "rms", "length"):
        np.testing.assert_array_equal(segment[name], expected[name])
    assert (segment["first_beam"], segment["last_beam"], segment["n_points"]) == (10, 100, 91)
    assert segment["cluster"] == 0
    assert features.clusters.tolist() == [0] * 121


def test_ends_are_kept_and_have_the_covariance_of_their_measurements():
    given = [2.01, -1.0, 2.01, 1.0]
    (segment,) = extracted([given]).segments
    assert [*segment["start"], *segment["end"]] == given
    on = np.flatnonzero(np.abs(SCAN.points[:, 1]) <= 1.0 + 0.05)
    assert (segment["first_beam"], segment["last_beam"]) == (on[0], on[-1])
    assert segment["n_points"] == len(on)
    assert segment["length"] == pytest.approx(2.0)
    assert segment["angle"] == pytest.approx(math.pi / 2)
    fitted = extracted([(on[0], on[-1])]).segments[0]
    np.testing.assert_array_equal(segment["covariance"], fitted["covariance"])
    assert segment["centroid"][0] == 2.01
    assert segment["rms"] == pytest.approx(np.sqrt(np.mean((SCAN.points[on, 0] - 2.01) ** 2)))


def test_covariance_of_beams_is_true():
    """Mean NEES over noise that is drawn anew is that of two degrees of freedom."""
    rng, nees = np.random.default_rng(5), []
    extractor = ln.Extractor(lambda _: [(0, 120)], noise=0.02)
    for _ in range(300):
        noisy = ln.LaserScan(2.0 / np.cos(BEARINGS) + rng.normal(0, 0.02, 121), angles=BEARINGS)
        (segment,) = extractor(noisy).segments
        angle = segment["angle"] - math.pi / 2
        offset = (2.0 - segment["centroid"][0]) * -1.0
        error = np.array([-offset, angle])
        nees.append(error @ np.linalg.solve(segment["covariance"], error) / 2)
    assert np.mean(nees) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("form", ["flat", "pairs", "reversed", "list"])
def test_forms_of_ends(form):
    ends = np.array([[2.0, -1.0], [2.0, 0.0]]), np.array([[2.0, 0.2], [2.0, 1.0]])
    given = {
        "flat": np.reshape(ends, (2, 4)),
        "pairs": np.array(ends),
        "reversed": np.array(ends)[::-1, ::-1],  # clockwise, and in the other order
        "list": [pair.ravel().tolist() for pair in ends],
    }[form]
    segments = extracted(given).segments
    np.testing.assert_array_equal(segments["start"], [ends[0][0], ends[1][0]])
    np.testing.assert_array_equal(segments["end"], [ends[0][1], ends[1][1]])


def test_corners_join_the_segments_that_end_there():
    segments = [[2.0, -1.0, 2.0, 1.0], [2.0, 1.0, 1.6, 1.0]]
    alone = [2.0, -0.4]
    features = extracted((segments, [[2.0, 1.0], alone]), CORNER)
    lone, joint = features.corners
    assert joint["segments"].tolist() == [0, 1]
    assert joint["opening"] == pytest.approx(math.pi / 2)
    assert not joint["convex"]
    # x is known as the first wall's offset there is, y as that of the second.
    first, second = features.segments
    lever = np.array([1.0, 1.0 - first["centroid"][1]])
    assert joint["covariance"][0, 0] == pytest.approx(lever @ first["covariance"] @ lever)
    lever = np.array([1.0, second["centroid"][0] - 2.0])
    assert joint["covariance"][1, 1] == pytest.approx(lever @ second["covariance"] @ lever)
    assert lone["segments"].tolist() == [-1, -1]
    assert lone["position"].tolist() == alone
    assert math.isnan(lone["opening"])
    assert math.isnan(lone["quality"])
    assert (np.linalg.eigvalsh(features.corners["covariance"]) > 0).all()


def test_corners_alone_by_beams():
    features = extracted(([], np.array([60, 20])))
    assert features.corners["beam"].tolist() == [20, 60]
    np.testing.assert_array_equal(features.corners["position"], SCAN.points[[20, 60]])
    # Along the beam the noise; across a spacing, uniformly.
    across = (2.0 * 0.01) ** 2 / 12
    np.testing.assert_allclose(
        np.linalg.eigvalsh(features.corners["covariance"][1]), [across, across + 1e-4], rtol=0.02
    )
    assert ln.Tracker()(features) is not None


def test_over_the_seam_of_a_full_circle():
    angles = np.arange(360) * math.radians(1)
    scan = ln.LaserScan(2.0 / np.maximum(np.cos(angles), 0.3), angles=angles)
    (segment,) = extracted([(320, 40)], scan).segments
    assert segment["n_points"] == 81
    np.testing.assert_allclose(segment["centroid"], [2.0, 0.0], atol=1e-9)
    (segment,) = extracted([[2.0, -0.9, 2.0, 0.9]], scan).segments
    assert (segment["first_beam"], segment["last_beam"]) == (335, 25)


def test_what_has_no_measurements_is_left_out_and_said():
    with pytest.warns(ln.LineamentWarning, match="fewer than two measurements are left out"):
        features = extracted([[5.0, 5.0, 6.0, 6.0], [2.0, -1.0, 2.0, 1.0], [2.0, 0.5, 2.0, 0.5]])
    assert len(features.segments) == 1


@pytest.mark.parametrize(
    ("found", "problem"),
    [
        (np.ones((3, 5)), r"segments of shape \(3, 5\) and type float64, expected \(L, 4\) or"),
        ([[1.0, 2.0]], r"segments of shape \(1, 2\) and type float64"),
        ([[1.0, np.nan, 1.0, 1.0]], "segments with a number that is not finite"),
        ([[0, 500]], "beam 500, expected one of 0 to 120"),
        ([[-1, 5]], "beam -1, expected one of 0 to 120"),
        ([[50, 20]], "a segment from beam 50 to 20, expected the first one first"),
        ([[1, 2], [3]], "segments of several lengths"),
        (["left", "right"], "segments of type <U5"),
        (None, "segments of type object"),
        (([[10, 100]], [1.0, 2.0]), r"corners of shape \(2,\) and type float64"),
        (([[10, 100]], np.array([121])), "beam 121, expected one of 0 to 120"),
    ],
)
def test_what_it_may_not_return(found, problem):
    with pytest.raises(ln.LineamentError, match=f"<lambda> returned {problem}"):
        extracted(found)


def test_nothing_found():
    for nothing in ([], np.empty((0, 4)), ([], []), (np.empty((0, 2), int), np.empty((0, 2)))):
        features = extracted(nothing)
        assert len(features.segments) == len(features.corners) == 0
        assert len(features.breakpoints) == 2


@dataclass(frozen=True)
class Cut:
    """Every so many beams."""

    every: int = 40

    def __call__(self, scan):
        return [(i, i + self.every - 1) for i in range(0, len(scan) - self.every, self.every)]


def test_a_class_with_parameters():
    assert len(ln.extract(SCAN, method=Cut(30), noise=0.01).segments) == 4
    assert len(ln.extract(SCAN, method=Cut, every=30, noise=0.01).segments) == 4
    assert as_method(Cut(30)).name == "Cut"
    extractor = ln.Extractor(Cut(30), noise=0.01)
    copied = pickle.loads(pickle.dumps(extractor))
    assert copied(SCAN).segments.tobytes() == extractor(SCAN).segments.tobytes()
    with pytest.raises(TypeError, match="method is 3, expected a name, a function of a scan"):
        ln.Extractor(3)


CODE = """
from dataclasses import dataclass
from beside import SHIFT

def find(scan):
    return [(SHIFT, len(scan) - 1)]

def fails(scan):
    return [][3]

def empty():
    return []

@dataclass(frozen=True)
class Cut:
    "Cuts in two."
    at: int = 60
    def __call__(self, scan):
        return [(0, self.at), (self.at + 1, len(scan) - 1)]

number = 3
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    (tmp_path / "my.py").write_text(CODE, encoding="utf-8")
    (tmp_path / "beside.py").write_text("SHIFT = 2\n", encoding="utf-8")
    ln.logs.save_npz(tmp_path / "wall.npz", [SCAN])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_file_by_name(mine):
    (segment,) = ln.extract(SCAN, method="my.py:find").segments
    assert (segment["first_beam"], segment["last_beam"]) == (2, 120)
    assert get_method("my.py:find").name == "my.py:find"
    assert len(ln.extract(SCAN, method=f"{mine}/my.py:Cut", at=30).segments) == 2
    copied = pickle.loads(pickle.dumps(get_method("my.py:Cut", at=30)))
    first, _ = ln.extract(SCAN, method=copied).segments
    assert first["last_beam"] == 30


@pytest.mark.parametrize(
    ("name", "parameters", "problem"),
    [
        ("none.py:find", {}, "there is no file none.py"),
        ("my.py:lost", {}, "my.py has no function or class 'lost'"),
        ("my.py:number", {}, "my.py has no function or class 'number'"),
        ("my.py:find", {"a": 1}, "is a function, expected no parameters: a"),
        ("my.py:Cut", {"bt": 1}, r"method 'my.py:Cut' has no parameter 'bt': .* one of: at"),
        ("bad.py:find", {}, r"cannot be loaded: ZeroDivisionError: division by zero \(bad.py:2\)"),
        ("worse.py:find", {}, "cannot be loaded: SyntaxError"),
    ],
)
def test_a_file_that_cannot_be_had(mine, name, parameters, problem):
    (mine / "bad.py").write_text("\n1 / 0\n", encoding="utf-8")
    (mine / "worse.py").write_text("def find(:\n", encoding="utf-8")
    with pytest.raises(ValueError, match=problem):
        get_method(name, **parameters)


def test_commands_take_it(mine, capsys, refused):
    assert run(["extract", "wall.npz", "-m", "my.py:find", "-o", "mine.csv", "-q"]) == 0
    assert "segment" in (mine / "mine.csv").read_text()
    words = ["extract", "wall.npz", "-m", "my.py:Cut", "--set", "at=20", "-o", "cut.csv", "-q"]
    assert run(words) == 0
    assert run(["plot", "wall.npz", "-m", "my.py:find", "-o", "mine.png"]) == 0
    assert run(["methods", "my.py:Cut"]) == 0
    assert "at               60" in capsys.readouterr().out
    words = ["compare", "wall.npz", "-m", "optimal", "-m", "my.py:Cut", "-o", "c.html", "-q"]
    assert run(words) == 0
    assert "my.py:Cut" in (mine / "c.html").read_text(encoding="utf-8")
    line = refused("extract wall.npz -m my.py:fails -o f.csv -q")
    assert line == "lineament: my.py:fails failed: IndexError: list index out of range (my.py:9)"
    assert refused("extract wall.npz -m my.py:empty -o f.csv -q").endswith("but 1 was given")
    assert not (mine / "f.csv").exists()
    refused("extract wall.npz -m my.py:lost -o f.csv -q", 2)


@pytest.mark.parametrize("workers", [["--threads", "1"], ["--processes", "2"]])
def test_many_logs_are_made_again_where_the_code_has_changed(mine, workers):
    ln.logs.save_npz(mine / "other.npz", [SCAN, SCAN])
    words = ["extract", "wall.npz", "other.npz", "-m", "my.py:Cut", "--set", "at=20", "-o", "many/"]

    def parts():
        assert run([*words, *workers, "--resume", "-q"]) == 0
        return {path.parent.name: path.stat().st_mtime_ns for path in mine.rglob("*.parquet")}

    first = parts()
    assert len(first) == 2
    assert parts() == first  # nothing has changed
    code = (mine / "my.py").read_text(encoding="utf-8")
    (mine / "my.py").write_text(code.replace("self.at + 1", "self.at + 3"), encoding="utf-8")
    again = parts()
    assert again.keys() == first.keys()
    assert all(again[name] > first[name] for name in first)


def test_of_a_function_without_a_file_nothing_is_taken_for_done(mine):
    made = {}
    exec("def find(scan):\n    return [(0, 20)]", made)
    for _ in range(2):
        extractor = ln.Extractor(made["find"], noise=0.01)
        assert extract_logs([mine / "wall.npz"], mine / "out", extractor, resume=True).whole == 0
