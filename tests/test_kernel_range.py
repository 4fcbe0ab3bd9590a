"""No kernel leaves its arrays, whatever the scan and the parameters; and none remembers a scan.

`make boundscheck` runs this with checked indices. Those that count from the end, and slices, are
not checked there, but in test_kernel_plain.py.
"""

import math
from dataclasses import fields
from itertools import product

import numpy as np
import pytest
from equality import WITH_KERNELS, direction_of
from hostile import hard_scans, hostile_scans
from worlds import degenerate_scans, full_circle, random_scan

from lineament import Extractor, LaserScan, RangeNoise
from lineament.checks.sound import difference, directions, positive
from lineament.features import TABLES
from lineament.methods import get_method, method_names
from lineament.methods.workspace import Block

pytestmark = [
    pytest.mark.slow,
    # Such ranges are of no unit; tests/test_units.py has what is warned of.
    pytest.mark.filterwarnings("ignore::lineament.LineamentWarning"),
]

every_name = pytest.mark.parametrize("name", [*WITH_KERNELS, "maps"])
#: Ranges of the scans of up to 5 beams that are all tried, and of those of up to 8: what is not
#: valid is left out by one function, `usable`, so that one such range stands for all.
ALPHABETS = {5: (math.nan, 0.0, 1.0, 2.0, math.inf), 8: (math.nan, 1.0, 2.0)}
FEW = [
    *degenerate_scans().values(),
    *(random_scan(seed, 90) for seed in range(8)),
    *(LaserScan(r, -0.5, 0.01) for r in hostile_scans(61, np.random.default_rng(0)).values()),
    *hard_scans(60).values(),
]


def made(name):
    return get_method("optimal", max_vertices=6) if name == "maps" else get_method(name)


# What holds of any features


def assert_in_range(features, clusters, valid):
    """Hold what is true of the tables of some scans of n beams: `clusters`, `valid` are (m, n)."""
    tables = {name: getattr(features, name) for name in TABLES}
    rows = {
        name: np.repeat(np.arange(len(valid)), np.diff(features.offsets[name])) for name in TABLES
    }
    n = valid.shape[1]
    for name in ("segments", "corners", "arcs"):
        for field in tables[name].dtype.names:
            values = tables[name][field]
            # The corners of maps have no response.
            assert field in ("kind", "response") or np.isfinite(values).all(), (name, field)
        assert positive(tables[name]["covariance"]).all()
    for name in ("segments", "arcs"):
        first, last, row = tables[name]["first_beam"], tables[name]["last_beam"], rows[name]
        count = tables[name]["n_points"]
        assert valid[row, [first, last]].all()
        assert ((first >= 0) & (first < n) & (last >= 0) & (last < n)).all()
        assert ((count >= 2) & (count <= (last - first) % max(n, 1) + 1)).all()
    segments, row = tables["segments"], rows["segments"]
    assert (clusters[row, segments["first_beam"]] == segments["cluster"]).all()
    assert not [*directions(segments)]
    between, own = tables["corners"]["segments"], np.diff(features.offsets["segments"])
    assert ((between >= -1) & (between < own[rows["corners"], None])).all()
    beam = tables["breakpoints"]["beam"]
    assert ((beam >= -1) & (beam < n)).all()
    assert np.isfinite(tables["breakpoints"]["position"]).all()
    assert (clusters[~valid] == -1).all()


def assert_sound(extractor, scan):
    found = extractor.batch(
        scan.ranges[None], angles=scan.angles, range_min=scan.range_min, range_max=scan.range_max
    )
    assert_in_range(found, found.clusters, scan.valid[None])
    return found


# Any scan


@every_name
def test_all_scans_of_few_beams(name):
    """All of up to so many beams, with ranges of nothing, of two sizes, and beyond."""
    for noise, n in product((None, 0.01), range(max(ALPHABETS) + 1)):
        alphabet = next(letters for most, letters in ALPHABETS.items() if n <= most)
        ranges = np.array(list(product(alphabet, repeat=n))).reshape(len(alphabet) ** n, n)
        valid = np.isfinite(ranges) & (ranges > 0)
        extractor = Extractor(made(name), noise=noise)
        for angles in (0.3 * np.arange(n), full_circle(n) if n else np.zeros(0)):
            found = extractor.batch(ranges, angles=angles)
            assert_in_range(found, found.clusters, valid)


@every_name
def test_any_scan(name):
    for noise in (None, RangeNoise(0.0), RangeNoise(0.05, proportional=0.02, bearing=1e-3)):
        extractor = Extractor(made(name), noise=noise)
        for scan in FEW:
            assert_sound(extractor, scan)


# Any parameters


def ends_of(bounds):
    """Values at the ends of what a parameter may be."""
    if bounds.choices:
        return tuple(bounds.choices)
    if bounds.kind is bool:
        return (False, True)
    if bounds.kind is int:
        return (int(bounds.low), int(min(bounds.below, 2**31)) - 1)
    low = bounds.low if bounds.low > -1e300 else np.nextafter(bounds.above, math.inf)
    return (low, min(np.nextafter(bounds.below, 0.0), 1e300))


def at_their_ends():
    for name in [name for name in WITH_KERNELS if ":" not in name]:
        for field in fields(type(get_method(name))):
            for value in ends_of(field.metadata["bounds"]):
                yield pytest.param(name, {field.name: value}, id=f"{name}-{field.name}={value}")


@pytest.mark.parametrize(("name", "changed"), list(at_their_ends()))
def test_parameters_at_the_ends_of_their_bounds(name, changed):
    """A new parameter is tried by itself."""
    try:
        method = get_method(name, **changed)
    except ValueError as error:
        assert " all 0" in str(error) or " both 0" in str(error)  # noqa: PT017
        return
    for noise in (None, 0.001):
        extractor = Extractor(method, noise=noise)
        for scan in FEW[::3]:
            assert_sound(extractor, scan)


def test_a_window_wider_than_the_scan_takes_in_all_of_it():
    ranges = 2 + 0.01 * np.random.default_rng(0).normal(size=50)
    for first, step in ((0.0, 0.01), (-math.pi, 2 * math.pi / 50)):
        scan = LaserScan(ranges, first, step)
        whole, wider = (
            Extractor("liu", half_width=width).trace(scan).filtered for width in (50, 2**31 - 1)
        )
        assert whole.tolist() == wider.tolist()


# What was found


@pytest.mark.parametrize("name", ["iepf", "split_and_merge"])
@pytest.mark.parametrize("budget", [0, 3])
def test_pieces_of_two_points(name, budget):
    """They went on beyond the last point, once cut apart."""
    extractor = Extractor(name, min_piece=2, max_vertices=budget, noise=0.001)
    angles = np.linspace(-0.7, 0.7, 400)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        scan = LaserScan(100 / np.cos(angles) + rng.normal(0, 0.05, 400), angles=angles)
        assert_sound(extractor, scan)


@pytest.mark.parametrize("name", ["line_tracking", "hough", "iepf", "region_growing"])
@pytest.mark.parametrize("n", [102, 360])
def test_a_ring_of_one_piece_has_each_beam_once(name, n):
    """The point at which it was opened was counted twice."""
    scan = LaserScan(
        2 + 0.01 * np.random.default_rng(0).normal(size=n), *full_circle(n)[[0]], 2 * math.pi / n
    )
    found = assert_sound(Extractor(name, noise=0.99), scan)
    assert (found.segments["n_points"] <= n).all()


def test_noise_of_ranges_that_no_scanner_reports_is_none():
    ranges = 1.79e308 * np.random.default_rng(0).uniform(0.5, 1, (2, 50))
    for name in method_names():
        found = Extractor(name).batch(ranges, angle_min=0.0, angle_increment=0.01)
        assert found[0].noise is None or found[0].noise.sigma <= 0.1


def test_noise_among_sparse_clutter_is_that_of_the_scanner():
    """The median of second differences was that of the clutter."""
    from lineament.simulation import Sensor, World

    sigmas = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        trunks = [[*rng.uniform(-10, 10, 2), rng.uniform(0.05, 0.2)] for _ in range(60)]
        trunks = [trunk for trunk in trunks if math.hypot(*trunk[:2]) > 0.6]
        sensor = Sensor("lms", 181, -math.pi / 2, math.pi / 180, 0.0, 30.0, RangeNoise(0.01))
        scan = sensor.scan(World([], trunks), (0.0, 0.0, 0.0), rng)
        noises = [Extractor(name)(scan).noise for name in method_names(presets=False)]
        sigmas.append([noise.range_variance(2.0) ** 0.5 for noise in noises])
    assert np.median(sigmas, axis=0).max() < 0.03
    assert np.max(sigmas) <= 0.1 * (1 + 1e-9)


@every_name
def test_segments_lead_from_their_start_to_their_end(name, recorded_scans):
    """Corners open as their arms do."""
    extractor, corners = Extractor(made(name)), 0
    for scan in recorded_scans:
        features = extractor(scan)
        assert not [*directions(features.segments)]
        for corner in features.corners:
            before, after = features.segments[corner["segments"]]
            turn = math.acos(np.clip(direction_of(before) @ direction_of(after), -1, 1))
            assert corner["opening"] == pytest.approx(math.pi - turn, abs=1e-6)
            corners += 1
    assert corners > 0 or name in ("pdbs", "pdbs:paper") or ":paper" in name


# Memory of the scan before


def poisoned(arrays, keep=()):
    """Fill arrays, and those within, with what no kernel may read."""
    for array in arrays:
        if isinstance(array, tuple):
            poisoned(array, keep)
        elif isinstance(array, np.ndarray) and not any(array is kept for kept in keep):
            array[...] = np.nan if array.dtype.kind == "f" else np.iinfo(array.dtype).max


@every_name
def test_a_workspace_full_of_poison_gives_the_same_features(name):
    method = made(name)
    for scan in FEW:
        fresh, used = Extractor(method)(scan), Extractor(method)
        block = Block(scan, used._noise_row, 1, method.own_arrays(len(scan)))
        used._blocks.append(block)
        own = block.own if isinstance(block.own, tuple) else ()
        keep = own[1:] if method.name == "hough" else ()  # The directions that are voted for.
        tables = *block.features, block.clusters
        poisoned((block.floats, block.ints, block.noises, block.offsets[1:], *tables, own), keep)
        again = used(scan)
        assert difference(again, fresh) == ""
        assert fresh.noise == again.noise
