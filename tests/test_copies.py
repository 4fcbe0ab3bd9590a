"""Copies: pickled, copied and in other processes, everything gives what a fresh object gives."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields

import numpy as np
import pytest
from text_logs import FLASER, flaser, zipped

import lineament as ln
from lineament import Extractor, LaserScan, Tracker, open_log
from lineament.checks.claims import words_of
from lineament.checks.sound import difference
from lineament.live.config import LiveConfig
from lineament.live.pipeline import Pipeline
from lineament.mapping import LineMap, LocalMap
from lineament.mapping.drive_map import Drive
from lineament.mapping.following import Follower
from lineament.methods import get_method
from lineament.motion import Dock, Odometer
from lineament.simulation import SENSORS, drive, room

COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    **{
        f"pickle {protocol}": lambda of, protocol=protocol: pickle.loads(pickle.dumps(of, protocol))
        for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)
    },
}
every_copy = pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
BEARINGS = np.linspace(-0.9, 0.9, 91)
#: One wall each, whose lengths are as different as their distances.
WALLS = [LaserScan(x / np.cos(BEARINGS), angles=BEARINGS, range_max=30.0) for x in (2, 3, 4, 5)]


def test_a_copy_traces_and_takes_batches():
    used = Extractor("optimal")
    used(WALLS[0])
    rows = [scan.ranges for scan in WALLS]
    used.batch(rows[::-1], angles=BEARINGS, range_max=30.0)
    other = pickle.loads(pickle.dumps(used))
    assert words_of(other.trace(WALLS[2])) == words_of(Extractor("optimal").trace(WALLS[2]))
    batch = other.batch(rows, angles=BEARINGS, range_max=30.0)
    for found, scan in zip(batch, WALLS, strict=True):
        assert difference(found, Extractor("optimal")(scan)) == ""


# Threads of other tests may be about: the pool uses none of their locks.
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_a_used_extractor_in_other_processes(start):
    if start not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {start} on this system")
    used = Extractor("optimal")
    used(WALLS[3])
    with ProcessPoolExecutor(1, multiprocessing.get_context(start)) as pool:
        found = list(pool.map(used, WALLS))
    assert not any(difference(a, used(scan)) for a, scan in zip(found, WALLS, strict=True))
    lengths = [one.segments["length"][0] for one in found]
    np.testing.assert_allclose(lengths, 2 * np.tan(0.9) * np.array([2, 3, 4, 5]), rtol=1e-6)


def test_method_and_noise_of_an_extractor_stay():
    extractor = Extractor("liu", noise=0.01)
    for name, value in (("method", get_method("pdbs")), ("noise", ln.RangeNoise(0.02))):
        with pytest.raises(AttributeError, match=name):
            setattr(extractor, name, value)


@every_copy
def test_arrays_stay_read_only(copied):
    scan = WALLS[0].with_pose((1.0, 2.0, 0.5), np.eye(3))
    regular = LaserScan([1.0, 2.0], 0.0, 0.1, intensities=[3.0, 4.0])
    assert len(scan.points) == 91
    assert regular.valid.all()
    features = ln.extract(scan)
    batch = Extractor().batch([scan.ranges] * 2, angles=BEARINGS)
    for of, count in ((scan, 5), (regular, 3)):
        other = copied(of)
        arrays = {k: v for k, v in vars(other).items() if isinstance(v, np.ndarray)}
        assert len(arrays) == count
        assert not any(array.flags.writeable for array in arrays.values())
        assert words_of(other) == words_of(of)
        assert not other.angles.flags.writeable
    for of, count in ((features, 6), (features.transform(1.0, 2.0, 3.0), 6), (batch, 9)):
        for one in (of, copied(of)):
            arrays = [getattr(one, field.name) for field in fields(one)]
            arrays = [array for array in arrays if isinstance(array, np.ndarray)]
            assert len(arrays) == count
            assert not any(array.flags.writeable for array in arrays)
        assert words_of(copied(of)) == words_of(of)
    plan = copied(LineMap.from_lines([[0, 0, 4, 0], [4, 0, 4, 3]], [(1, 1, 0.1)]))
    assert not any(of.flags.writeable for of in (plan.walls, plan.columns, plan.corners))


def test_a_copy_leaves_what_was_given_as_it_is():
    clusters, columns = np.zeros(3, np.int32), np.zeros(1, ln.mapping.COLUMN)
    empty = ln.extract(LaserScan([], 0.0, 0.1))
    tables = {name: empty[name] for name in empty}
    copy.copy(ln.Features(**tables, clusters=clusters))
    LineMap(LineMap.from_lines([[0, 0, 4, 0]]).walls, columns)
    assert clusters.flags.writeable
    assert columns.flags.writeable


def test_results_and_noises_are_copied():
    tracker, extract = Tracker(), Extractor()
    tracks = [tracker(extract(scan)) for scan in drive_of(2)][1]
    for of in (tracks, tracks.motion, ln.RangeNoise(0.01, 0.002), extract.trace(WALLS[0])):
        for copied in COPIES.values():
            assert words_of(copied(of)) == words_of(of)


# What keeps a state


def drive_of(count):
    path = [(-2, 0), (-1.0, 0.3)]
    return list(drive(room(), path, SENSORS["utm30lx"], speed=1, rate=10))[:count]


def step_of(kind):
    """Make an object with a state, and the function that gives it the next scan."""
    tracker, extract = Tracker(), Extractor()
    odometer = Odometer()
    seen = []
    for scan in drive_of(8):
        features = extract(scan)
        tracks = tracker(features)
        seen.append((scan, features, tracks, odometer(tracks, scan.stamp).pose))
    made, step = {
        "tracker": (Tracker(), lambda of, _, features, *__: (of(features), of.twist)),
        "odometer": (Odometer(), lambda of, scan, _, tracks, __: of(tracks, scan.stamp)),
        "dock": (Dock((5.0, 2.0)), lambda of, _, *seen: of(*seen)),
        "local map": (
            LocalMap(),
            lambda of, _, features, tracks, pose: (of.add(features, tracks, pose), of.query()),
        ),
        "follower": (
            Follower(LineMap.from_lines(room().segments)),
            lambda of, _, features, *__: of(features),
        ),
        "drive": (
            Drive(),
            lambda of, scan, features, *_: (of.add(scan, features), of.scans.copy()),
        ),
        "pipeline": (Pipeline(LiveConfig(track=True)), lambda of, scan, *_: of("front", scan)),
    }[kind]
    return made, lambda of, k: words_of(step(of, *seen[k]))


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["tracker", "odometer", "dock", "local map", "follower", "drive", "pipeline"]
)
def test_a_copy_goes_on_from_the_state_that_it_was_made_in(kind):
    made, step = step_of(kind)
    others, results = [], []
    for k in range(8):
        if k == 4:
            others = [(name, copied(made)) for name, copied in COPIES.items()]
            # Copies first: the original, and the other copies, must not notice.
            rest = {name: [step(other, j) for j in range(4, 8)] for name, other in others}
        results.append(step(made, k))
    assert len(COPIES) == 6
    for name, of in rest.items():
        assert of == results[4:], name


# Logs


def scans_of(log):
    return [words_of(scan) for scan in log]


@every_copy
def test_a_copy_of_a_log_keeps_its_options(write, copied):
    path = write(flaser([1.5, 2.5, 3.5]) * 3 + "FLASER 3 1.5 x\n")
    log = open_log(path, keep_going=True, stamp="last")
    next(iter(log))
    other = copied(log)
    assert scans_of(other) == scans_of(open_log(path, keep_going=True, stamp="last"))
    assert (len(other), repr(other)) == (len(log), repr(log))
    assert (other.options, other.skipped) == (log.options, 1)


@pytest.mark.usefixtures("temporary")
def test_a_log_in_a_temporary_copy_stays_in_its_process(write):
    log = open_log(write(zipped(**{"a.log": FLASER * 3}), "a.zip"))
    for copied in (copy.copy, copy.deepcopy):
        assert scans_of(copied(log)) == scans_of(log)
    with pytest.raises(TypeError, match=r"^.*a\.zip/a\.log is read from a temporary copy.*$"):
        pickle.dumps(log)
    if "fork" in multiprocessing.get_all_start_methods():
        process = multiprocessing.get_context("fork").Process(target=log.source.remove)
        process.start()
        process.join()
        assert len(list(log)) == 3
    del log


def test_iterations_at_the_same_time_count_their_own_faults(write):
    path = write(b"FLASER 3 1.5 x\n".join([FLASER] * 4), "a.log")
    log = open_log(path, keep_going=True)
    first, second = iter(log), iter(log)
    next(first)
    next(second)
    assert len(list(second)) == 3
    assert (log.skipped, len(log.faults)) == (3, 3)
    assert len(list(first)) == 3
    assert (log.skipped, len(log.faults)) == (3, 3)
