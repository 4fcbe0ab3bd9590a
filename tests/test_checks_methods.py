"""check_method: every method passes, and what is broken in one is named in a line."""

import math
import re
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import lineament as ln
from lineament.checks import check_method
from lineament.checks.scans import plain_scans
from lineament.checks.sound import first_problem, led_backwards
from lineament.methods import method_names

#: Those that fit y over x, and those that are the same in a mirror: others go along the beams.
DIRECTED = ("liu:paper", "liu:figure9")
ALONG = ("line_tracking:paper", "ransac:paper", "region_growing", "region_growing:paper")


@pytest.mark.parametrize("name", method_names())
def test_every_method(name):
    check_method(name, turned=name not in DIRECTED, seam=True, mirrored=name not in ALONG)


def test_a_method_with_parameters_and_classes_and_functions():
    check_method("optimal", max_vertices=6)
    check_method(ln.methods.get_method("iepf", min_points=8), seam=True)
    check_method(Cut)
    check_method(Cut(0.5))
    check_method(jumps)
    check_method(bare)


def jumps(scan, jump=0.3):
    """Cut where neighbours are far apart, as in docs/own.md."""
    beams = np.flatnonzero(scan.valid)
    apart = np.hypot(*np.diff(scan.points[beams], axis=0).T)
    pieces = np.split(beams, np.flatnonzero(apart > jump) + 1)
    return [(piece[0], piece[-1]) for piece in pieces if len(piece) > 5]


def bare(scan):
    """Only where clusters end."""
    return [], scan.points[scan.valid][:1]


@dataclass(frozen=True)
class Cut:
    jump: float = 0.3

    def __call__(self, scan):
        return jumps(scan, self.jump)


DOCS = Path(__file__).parents[1] / "docs" / "own.md"


def test_the_method_of_the_docs_in_a_file_and_as_a_package(tmp_path, install):
    code = DOCS.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    (tmp_path / "my.py").write_text(code, encoding="utf-8")
    check_method(f"{tmp_path}/my.py:find")
    install(code, "[lineament.methods]\nmine = stranger:find\n")
    check_method("mine")
    code = code.replace(" if len(piece) > 5", "")
    install(code, "[lineament.methods]\nbad = other:find\n", "other")
    with pytest.raises(AssertionError, match=r"^bad: scan 'zero beams': raised .*\(other.py:10\)"):
        check_method("bad")


# What is broken


def fails(scan):
    return [(0, int(np.flatnonzero(scan.valid)[-1]))]


def warns(scan):
    np.sqrt(np.float64(-1.0))
    return jumps(scan)


def finds_nothing_to_stand_on(_):
    return [[50.0, 50.0, 51.0, 51.0]]


class Remembers:
    """It is given what comes from the scan before."""

    def __init__(self):
        self.before = 0

    def __call__(self, scan):
        found = jumps(scan)[self.before % 2 :]
        self.before = len(scan)
        return found


class Counts(Remembers):
    """Each call is another one."""

    def __call__(self, scan):
        self.before += 1
        return jumps(scan)[self.before % 2 :]


class Shares:
    """Threads see each other's scans."""

    def __call__(self, scan):
        self.scan = scan
        time.sleep(0.0002)
        return jumps(self.scan) if len(self.scan) == len(scan) else []


class CopiesBadly(Remembers):
    def __call__(self, scan):
        return jumps(scan, 0.3 + self.before)

    def __reduce__(self):
        return CopiesBadly._other, ()

    @classmethod
    def _other(cls):
        other = cls()
        other.before = 5.0
        return other


class Directed:
    """It is about the axes of the scanner."""

    def __call__(self, scan):
        return [(a, b) for a, b in jumps(scan) if scan.points[a, 0] > -0.5]


def one_way(scan):
    """The last of a few is left out."""
    return jumps(scan)[:-1] if len(jumps(scan)) > 1 else jumps(scan)


class Inner:
    """A method, of kernels or not, with something done before or after it."""

    name, presets = "inner", ()

    def __init__(self, harm):
        self.inner, self.harm = ln.methods.get_method("iepf"), harm

    def own_arrays(self, beams):
        return self.inner.own_arrays(beams)

    def run(self, block):
        self.harm(block)
        self.inner.run(block)

    def trace(self, scan, features, noise):
        return replace(self.inner.trace(scan, features, noise), features=ln.extract(scan))


def rows_depend(block):
    if block.rows > 1:
        block.ranges[: block.rows] *= 1.001


def nothing(block):
    pass


@pytest.mark.parametrize(
    ("method", "line"),
    [
        ("lui", "lui: raised ValueError: method 'lui' is unknown, expected one of: optimal, liu"),
        (3, "method: raised TypeError: method is 3, expected a name, a function of a scan"),
        (fails, "fails: scan 'zero beams': raised LineamentError: fails failed: IndexError: index"),
        (warns, "scan 'a room': .* RuntimeWarning: invalid value encountered in sqrt"),
        (lambda _: [], "<lambda>: a pickled copy: raised PicklingError: Can't pickle"),
        (finds_nothing_to_stand_on, "scan 'a room': raised LineamentWarning: segments on fewer"),
        (Remembers(), "after other scans it finds others: scan '.*': \\d segments in place of \\d"),
        (Counts(), "another extractor finds others: scan '.*': \\d segments in place of \\d"),
        (Shares(), "threads that share it find others: scan '.*': \\d segments in place of \\d"),
        (CopiesBadly(), "a deep copy finds others: scan '.*': \\d segments in place of \\d"),
        (Directed(), "a scanner that is turned sees others: scan '.*': \\d segments in place of"),
        (jumps, "where a circle begins matters: scan 'a room': segments are 2.94 m elsewhere"),
        (one_way, "in a mirror it finds others: scan '.*': segments are 2.2 m elsewhere"),
        (Inner(rows_depend), "inner: a batch by 1 workers: is not its scans: row 0: segments"),
        (Inner(nothing), "inner: a trace has others: scan 'a room': segments differ in"),
    ],
)
def test_what_is_broken_is_named(method, line):
    claims = {"seam": method is jumps, "mirrored": method is one_way}
    before = sys.getswitchinterval()
    with pytest.raises(AssertionError, match=line) as caught:
        check_method(method, **claims)
    assert str(caught.value).isprintable()
    assert sys.getswitchinterval() == before


@pytest.mark.parametrize(
    ("table", "field", "value", "problem"),
    [
        ("segments", "start", math.nan, r"segments\[0\] start is not finite"),
        ("segments", "covariance", 0.0, "covariance is not positive definite"),
        ("segments", "covariance", [[1, 2], [2, 1]], "covariance is not positive definite"),
        ("segments", "covariance", [[1, 0.1], [0, 1]], "covariance is not symmetric"),
        ("segments", "first_beam", -1, r"segments\[0\] first_beam is -1, expected 0 to 719"),
        ("segments", "last_beam", 720, r"segments\[0\] last_beam is 720, expected 0 to 719"),
        ("segments", "last_beam", 3, "last_beam is not a valid beam"),
        ("segments", "n_points", 1, "has fewer than 2 points, or more than beams"),
        ("segments", "cluster", 9, "cluster is not that of its first beam"),
        ("segments", "rms", -1.0, r"segments\[0\] rms is negative"),
        ("breakpoints", "kind", "scan_end", "has not two beams, or one where the scan ends"),
        ("segments", "angle", 0.1, "angle is not the direction from start to end"),
        ("segments", "length", 9.0, "length is not the distance from start to end"),
        ("corners", "segments", 99, r"corners\[0\] segments has 99, expected -1 to"),
        ("corners", "beam", 3, "beam is not a valid beam"),
        ("breakpoints", "beam", -2, r"breakpoints\[0\] beam is -2, expected -1 to 719"),
    ],
)
def test_what_cannot_be_of_features(table, field, value, problem):
    scan = plain_scans()["a pillar in a room"]
    ranges = scan.ranges.copy()
    ranges[3] = math.nan
    scan = ln.LaserScan(ranges, scan.angle_min, scan.angle_increment, range_max=20.0)
    features = ln.extract(scan, noise=0.01)
    assert first_problem(features, scan) == ""
    rows = features[table].copy()
    rows[field] = value
    found = first_problem(replace(features, **{table: rows}), scan)
    assert re.search(problem, found), found


def test_clusters_and_ways_of_features():
    scan = plain_scans()["a room"]
    features = ln.extract(scan, noise=0.01)
    assert led_backwards(features, scan) == ""
    rows = features.segments.copy()
    rows["start"], rows["end"] = features.segments["end"], features.segments["start"]
    assert "segments[0] leads from its last" in led_backwards(
        replace(features, segments=rows), scan
    )
    skipped = replace(features, clusters=np.full(720, 5, np.int32))
    assert "clusters have the numbers [5], expected 0 to 0" in first_problem(skipped, scan)
    short = replace(features, clusters=np.zeros(3, np.int32))
    assert first_problem(short, scan) == "clusters have shape (3,), expected (720,)"
    gone = ln.LaserScan(np.full(720, np.nan), scan.angle_min, scan.angle_increment)
    assert "not a valid beam" in first_problem(features, gone)
