"""One scan given in many ways, which must all have the same features; results read again.

Other types, masks, units, directions of the beams, mountings, and copies or threads of one
extractor: nothing raises where these go wrong, so that only the features of the plain scan can
tell. The files of `map` and `locate` must hold what was found.
"""

import copy
import math
import pickle
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pyarrow.csv
import pyarrow.parquet
from fuzz_targets import NOISES, Target, any_method, any_scan

from lineament import Extractor, Features, LaserScan, open_log
from lineament.features import TABLES
from lineament.logs import save_npz
from lineament.mapping import VERDICTS, LineMap
from lineament.mapping.evidence import Evidence
from lineament.mapping.following import Whereabouts
from lineament.scan.poses import compose
from lineament.tasks.locate import _table_written
from lineament.tasks.mapping import tum_written

THREADS = 4

#: A way to give the first of some scans to a used extractor: what it finds, or all that it finds.
Form = Callable[[Extractor, list[LaserScan]], Any]


def words_of(features: Features) -> list[bytes]:
    """Everything that was found, as bytes."""
    return [features.clusters.tobytes(), *(features[name].tobytes() for name in TABLES)]


class Forms(Target):
    """A scan and what an extractor was used for before; a way to give the scan again."""

    def __init__(self, _: Path) -> None:
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(1e-5)  # Threads take turns within a call.

    def close(self) -> None:
        sys.setswitchinterval(self._interval)

    def make(self, chance: Random) -> tuple[str, Any, Any, list[LaserScan]]:
        form = chance.choice(list(self.FORMS))
        scans = [any_scan(chance, 120) for _ in range(THREADS if form == "threads" else 2)]
        return form, any_method(chance), chance.choice(NOISES), scans

    def check(self, made: tuple[str, Any, Any, list[LaserScan]]) -> str:
        form, method, noise, scans = made
        used = Extractor(method, noise=noise)
        scan, *others = scans
        for other in others:
            used(other)
        expected = Extractor(method, noise=noise)(self.AS.get(form, lambda one: one)(scan))
        found = self.FORMS[form](used, scans)
        for one in found if isinstance(found, list) else [found]:
            assert words_of(one) == words_of(expected), form
        return f"{form}: {'found' if any(expected.counts().values()) else 'nothing'}"

    #: What the plain scan is before it is compared, where that is another.
    AS: ClassVar[dict[str, Callable[[LaserScan], LaserScan]]] = {
        "millimetres": lambda scan: fields_of(scan, 1e-3 * milli(scan)),
        "scaled": lambda scan: there_and_back(scan),
        "single precision": lambda scan: fields_of(scan, narrow(scan.ranges)),
        "log": lambda scan: there_and_back(scan),
        "message": lambda scan: fields_of(scan, narrow(scan.ranges)),
    }
    #: Those that are more than a line are added below.
    FORMS: ClassVar[dict[str, Form]] = {
        "again": lambda used, scans: used(scans[0]),
        "pickled": lambda used, scans: dumped(used)(dumped(scans[0])),
        "deep copy": lambda used, scans: copy.deepcopy(used)(copy.deepcopy(scans[0])),
        "batch": lambda used, scans: [
            *batch_of(used, np.stack([scans[0].ranges] * 3), scans[0], workers=2)
        ],
        "masked": lambda used, scans: alone_and_in_a_batch(used, scans[0], hidden(scans[0])),
        "list of numbers": lambda used, scans: used(
            fields_of(scans[0], [None if math.isnan(r) else r for r in scans[0].ranges.tolist()])
        ),
        "other memory": lambda used, scans: [
            used(fields_of(scans[0], ranges))
            for ranges in (np.repeat(scans[0].ranges, 2)[::2], scans[0].ranges.astype(">f8"))
        ],
        "single precision": lambda used, scans: used(
            fields_of(scans[0], narrow(scans[0].ranges).astype(np.float64))
        ),
        # Ranges alone are in millimetres; limits stay in metres.
        "millimetres": lambda used, scans: alone_and_in_a_batch(
            used, scans[0], milli(scans[0]), scale=1e-3
        ),
        "scaled": lambda used, scans: used(fields_of(scans[0], milli(scans[0]), 1e3).scaled(1e-3)),
    }


def form(function: Form) -> Form:
    """Add a way to give a scan; the underscores of its name are spaces."""
    Forms.FORMS[function.__name__.replace("_", " ")] = function
    return function


def dumped(of: Any) -> Any:
    return pickle.loads(pickle.dumps(of))


def hidden(scan: LaserScan) -> Any:
    """Return ranges of which those that are not valid are masked."""
    return np.ma.masked_array(np.where(scan.valid, scan.ranges, 1.0), ~scan.valid)


def narrow(ranges: Any) -> Any:
    with np.errstate(over="ignore"):
        return ranges.astype(np.float32)


def fields_of(scan: LaserScan, ranges: Any, factor: float = 1.0, **given: Any) -> LaserScan:
    """Return the same scan with other ranges, and limits that are rounded by a factor."""
    return LaserScan(ranges, **frame_of(scan, factor), **given)


def frame_of(scan: LaserScan, factor: float = 1.0) -> dict[str, Any]:
    bearings: dict[str, Any] = {"angles": scan.angles}
    if scan.is_regular:
        bearings = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
    return bearings | {"range_min": factor * scan.range_min, "range_max": factor * scan.range_max}


def milli(scan: LaserScan) -> Any:
    with np.errstate(over="ignore"):
        return 1e3 * scan.ranges


def there_and_back(scan: LaserScan) -> LaserScan:
    """Return a scan that was in millimetres: ranges and limits are rounded twice."""
    far = fields_of(scan, milli(scan), 1e3)
    return fields_of(far, 1e-3 * far.ranges, 1e-3)


def batch_of(extractor: Extractor, rows: Any, scan: LaserScan, **given: Any) -> Any:
    return extractor.batch(rows, **frame_of(scan), **given)


def alone_and_in_a_batch(used: Extractor, scan: LaserScan, ranges: Any, **given: Any) -> Any:
    one, (row,) = fields_of(scan, ranges, **given), batch_of(used, ranges[None], scan, **given)
    return [used(one), row]


@form
def copies_take_turns(used: Extractor, scans: list[LaserScan]) -> Any:
    other = copy.copy(used)
    other(scans[1])
    first = used(scans[0])
    other(scans[1])
    return [first, other(scans[0])]


@form
def threads(used: Extractor, scans: list[LaserScan]) -> Any:
    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(used, scans * 3))
    for scan, features in zip(scans, found, strict=False):
        assert words_of(features) == words_of(used(scan))
    return found[::THREADS]


@form
def masked_anew(used: Extractor, scans: list[LaserScan]) -> Any:
    """A mask over measurements is as if they were NaN."""
    scan = scans[0]
    hidden = np.arange(len(scan)) % 5 == 2
    expected = used(fields_of(scan, np.where(hidden, np.nan, scan.ranges)))
    found = used(fields_of(scan, np.ma.masked_array(scan.ranges, hidden)))
    assert words_of(found) == words_of(expected)
    return used(scan)


@form
def sector(used: Extractor, scans: list[LaserScan]) -> Any:
    """Beams of a sector are as if they were NaN, one after the other, in a scan and in a log."""
    scan, turn, chance = scans[0], 2 * math.pi, Random(scans[0].ranges.tobytes())
    low, high = chance.uniform(-4.0, 4.0), chance.uniform(-4.0, 4.0)
    ranges = scan.ranges.copy()
    for k, bearing in enumerate(scan.angles.tolist()):
        past, end = (math.fmod(one - low + 4 * turn, turn) for one in (bearing, high))
        if past <= end:
            ranges[k] = math.nan
    expected = words_of(used(fields_of(scan, ranges)))
    assert words_of(used(scan.masked([(low, high)]))) == expected
    if not len(scan):
        return used(scan)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.npz"
        save_npz(path, [scan])
        (read,) = open_log(path, mask=[(low, high)])
    assert words_of(used(read)) == expected
    return used(scan)


@form
def clockwise(used: Extractor, scans: list[LaserScan]) -> Any:
    """Beams in the other order are put in the order of their bearings."""
    scan = scans[0]
    ranges, limits = scan.ranges[::-1], {"range_min": scan.range_min, "range_max": scan.range_max}
    if len(scan) < 2:
        return used(scan)
    reversed_scan = LaserScan(ranges, angles=scan.angles[::-1], **limits)
    ordered = LaserScan(scan.ranges, angles=scan.angles, **limits)
    assert words_of(used(reversed_scan)) == words_of(used(ordered))
    return used(scan)


@form
def message(used: Extractor, scans: list[LaserScan]) -> Any:
    scan = scans[0]
    if not scan.is_regular:
        return used(fields_of(scan, narrow(scan.ranges)))
    names = "angle_min angle_increment range_min range_max scan_time time_increment"
    fields = {name: getattr(scan, name) for name in names.split()}
    return used(LaserScan.from_message(SimpleNamespace(ranges=narrow(scan.ranges), **fields)))


@form
def log(used: Extractor, scans: list[LaserScan]) -> Any:
    """A log in millimetres with poses of a robot, read in metres with those of its scanner."""
    scan, robot, laser = scans[0], (1.0, -2.0, 0.7), (0.2, 0.1, -1.3)
    if not len(scan):
        return used(fields_of(scan, scan.ranges))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.npz"
        save_npz(path, [fields_of(scan, milli(scan), 1e3).with_pose(robot)])
        (read,) = open_log(path, scale=1e-3, laser_pose=laser)
    np.testing.assert_allclose(read.pose, compose(robot, laser), rtol=1e-12)
    return used(read)


class Results(Target):
    """What `map` and `locate` write is what they found."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def make(self, chance: Random) -> tuple[str, int]:
        return chance.choice((".parquet", ".csv", ".tum", "map.parquet", "map.dxf")), (
            chance.getrandbits(32)
        )

    def check(self, made: tuple[str, int]) -> str:
        ending, seed = made
        rng, path = np.random.default_rng(seed), self._folder / f"results{ending}"
        if ending.startswith("map"):
            return self._plan(rng, path)
        n = int(rng.integers(0, 9))
        stamps = (rng.uniform(0, 2e9) + np.cumsum(rng.exponential(0.1, n))).tolist()
        poses = [tuple(pose) for pose in rng.normal(size=(n, 3), scale=(50, 50, 4)).tolist()]
        if ending == ".tum":
            with tum_written(path, stamps, poses):
                pass
            rows = np.array([line.split() for line in path.read_text().splitlines()], float)
            rows = rows.reshape(n, 8)
            np.testing.assert_allclose(rows[:, 0], stamps, atol=1e-6)
            np.testing.assert_allclose(rows[:, 1:3], np.reshape(poses, (n, 3))[:, :2], atol=1e-6)
            turn = 2 * np.arctan2(rows[:, 6], rows[:, 7]) - np.reshape(poses, (n, 3))[:, 2]
            np.testing.assert_allclose(np.cos(turn), 1, atol=1e-12)
            return ".tum: the same"
        spread = [np.diag(rng.exponential(10.0 ** rng.integers(-6, 2), 3)) for _ in poses]
        evidence = [Evidence(rng.normal(), *rng.random(3), 9) for _ in poses]
        places = [
            Whereabouts(str(rng.choice(VERDICTS)), *given)
            for given in zip(poses, spread, evidence, strict=True)
        ]
        found = list(zip(stamps, places, strict=True))
        if not found:  # which is an error before
            return f"{ending}: nothing"
        with _table_written(path, found, is_csv=ending == ".csv"):
            pass
        reading = pyarrow.csv.read_csv if ending == ".csv" else pyarrow.parquet.read_table
        rows = reading(path).to_pylist()
        for row, stamp, place in zip(rows, stamps, places, strict=True):
            assert (row["stamp"], row["verdict"]) == (stamp, place.verdict)
            pose = (row["x"], row["y"], row["theta"])
            assert pose == (place.pose if place.is_known else (None,) * 3)
            assert row["cov_yy"] == (place.covariance[1, 1] if place.is_known else None)
            assert row["explained"] == place.evidence.explained
        return f"{ending}: the same"

    def _plan(self, rng: np.random.Generator, path: Path) -> str:
        """Walls a metre apart, none of which is one with another."""
        n = int(rng.integers(1, 12))
        y, start, length = np.arange(n), rng.uniform(-20, 20, n), rng.uniform(0.5, 30, n)
        turn, (dx, dy) = rng.uniform(-3, 3), rng.uniform(-500, 500, 2)
        ends = np.stack((np.c_[start, y], np.c_[start + length, y]), axis=1)
        turned = ends @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        plan = LineMap.from_lines(turned + np.array((dx, dy)))
        plan.write(path)
        read = LineMap.read(path)
        assert read.left_out == 0
        # Of a wall that may be seen from either side, a table has two rows.
        sides = 2 if path.suffix == ".parquet" else 1
        ends = np.repeat(plan.ends, sides, axis=0), read.ends
        own, again = (np.sort(one.reshape(-1, 2), axis=0) for one in ends)
        np.testing.assert_allclose(again, own, atol=1e-5)
        return f"{path.name[7:]}: the same"
