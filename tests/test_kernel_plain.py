"""The kernels as plain Python: their indices, their lengths, and how many lines of them run.

Checked indices may still be negative, which count from the end, and slices are not checked: here
arrays refuse both. Work is counted in lines, not by the clock.
"""

import importlib
import statistics
import sys
from contextlib import contextmanager
from dataclasses import fields
from itertools import chain

import numpy as np
import pytest
from conftest import packages
from equality import WITH_KERNELS
from hostile import hard_scans
from worlds import degenerate_scans, random_scan

from lineament.features import TABLES

NAMES = [*WITH_KERNELS, "maps"]
every_name = pytest.mark.parametrize("name", NAMES)


def made(name):
    """Make a method of plain kernels; of `hough` a small one."""
    get_method = importlib.import_module("lineament.methods").get_method
    if name == "maps":
        return get_method("optimal", max_vertices=6)
    return get_method(name, **({"angles": 12, "distances": 32} if "hough" in name else {}))


#: Lengths of the world, by the modules that have them [m]; squares of lengths.
LENGTHS = (
    "TAU", "REACH", "MOST_DEVIATION", "ARC_RADIUS", "LEAST_SIGMA", "MOST_SIGMA", "TYPICAL_SIGMA",
    "NEAREST", "FARTHEST", "_COARSEST_QUANTUM", "LINK", "WORST", "_LINK", "_WORST",
)  # fmt: skip
SQUARES = {"_ROUNDING": 4.0}
#: How what a table has grows with lengths; what is not here does not.
POWERS = {
    "segments": {"start": 1, "end": 1, "centroid": 1, "length": 1, "rms": 1, "misfit": 1},
    "corners": {"position": 1, "covariance": 2},
    "edges": {"position": 1, "covariance": 2},
    "arcs": {"center": 1, "radius": 1, "rms": 1, "covariance": 2},
    "breakpoints": {"position": 1},
}
SCANS = [random_scan(seed, 120) for seed in range(6)]
SCANS += [degenerate_scans()[name] for name in ("noisy box", "grazing", "ring off centre")]


@contextmanager
def doubled_lengths():
    """Double each length that a kernel has, where the kernels are plain Python."""
    with pytest.MonkeyPatch.context() as patch:
        for module in packages().values():
            for name, factor in {**dict.fromkeys(LENGTHS, 2.0), **SQUARES}.items():
                if hasattr(module, name):
                    patch.setattr(module, name, getattr(module, name) * factor)
        yield


def doubled(method):
    """Return a method whose parameters that are lengths are doubled."""
    given = {field.name: getattr(method, field.name) for field in fields(method)}
    lengths = [field.name for field in fields(method) if field.metadata["unit"] == "m"]
    if given.get("response") == "tangent":
        lengths.append("threshold")
    return type(method)(**given | {name: 2 * given[name] for name in lengths})


def of(module, scan, factor):
    limits = {"range_min": factor * scan.range_min, "range_max": factor * scan.range_max}
    if scan.is_regular:
        return module.LaserScan(
            factor * scan.ranges, scan.angle_min, scan.angle_increment, **limits
        )
    return module.LaserScan(factor * scan.ranges, angles=scan.angles, **limits)


@pytest.mark.slow
@every_name
def test_lengths_have_no_unit(plain, name):
    """To the last digit: a new length that is not in the lists above fails here."""
    method = made(name)
    # The response of equation 22 is a sum of distances, that of the other methods a ratio.
    of_response = {"response": 1} if getattr(method, "response", "") == "tangent" else {}
    found = 0
    with np.errstate(all="ignore"):
        for scan in SCANS:
            one = plain.Extractor(method)(of(plain, scan, 1.0))
            with doubled_lengths():
                two = plain.Extractor(doubled(method))(of(plain, scan, 2.0))
            assert one.clusters.tolist() == two.clusters.tolist()
            assert two.noise.sigma == 2 * one.noise.sigma
            for table in TABLES:
                before, after = getattr(one, table), getattr(two, table)
                assert len(before) == len(after)
                found += len(before)
                for field in before.dtype.names:
                    power = {**POWERS[table], **of_response}.get(field, 0)
                    if table == "segments" and field == "covariance":
                        scale = np.array([[4.0, 2.0], [2.0, 1.0]])
                    else:
                        scale = 2.0**power
                    if before.dtype[field].base.kind == "f":
                        # But for the last digit of what is next to 0, which has fewer of them.
                        nearly = {"rtol": 0, "atol": 1e-300, "err_msg": field}
                        np.testing.assert_allclose(after[field], before[field] * scale, **nearly)
                    else:
                        np.testing.assert_array_equal(after[field], before[field], err_msg=field)
    assert found > 20


@pytest.mark.usefixtures("plain")
def test_the_lengths_are_all_there():
    """Each name is one of a module of the kernels or methods."""
    for name in NAMES:
        made(name)
    modules = packages().values()
    for name in (*LENGTHS, *SQUARES):
        assert any(hasattr(module, name) for module in modules), name


# Indices from the end, and slices beyond it


class Strict(np.ndarray):
    """An array that takes no index and no slice outside of it, from either end."""

    def __getitem__(self, key):
        self._check(key)
        return super().__getitem__(key)

    def __setitem__(self, key, value):
        self._check(key)
        super().__setitem__(key, value)

    def _check(self, key):
        for size, one in zip(self.shape, key if isinstance(key, tuple) else (key,), strict=False):
            if isinstance(one, slice):
                # A slice from the second on of nothing is nothing.
                assert one.start is None or 0 <= one.start <= size + 1, (key, self.shape)
                assert one.stop is None or 0 <= one.stop <= size, (key, self.shape)
            elif isinstance(one, int | np.integer):
                assert 0 <= one < size, (key, self.shape)


def strict(own):
    if isinstance(own, tuple):
        return tuple(map(strict, own))
    return own.view(Strict) if isinstance(own, np.ndarray) else own


@pytest.mark.slow
@every_name
def test_no_index_counts_from_the_end(plain, name):
    method, workspace = made(name), importlib.import_module("lineament.methods.workspace")
    for scan in chain(degenerate_scans().values(), (random_scan(k, 70) for k in range(3))):
        if len(scan) > 200:
            continue
        noise = plain.Extractor("optimal")._noise_row
        own = strict(method.own_arrays(len(scan)))
        block = workspace.Block(of(plain, scan, 1.0), noise, 1, own)
        for part in ("floats", "ints", "bearings", "noises", "ranges", "clusters", "offsets"):
            setattr(block, part, strict(getattr(block, part)))
        block.work = workspace.at.named(block.floats, block.ints)
        block.counts = block.work.counts
        block.load(scan.ranges)
        with np.errstate(all="ignore"):
            method.run(block)


# Work


def work_of(module, extractor, scan) -> int:
    """Count the lines of kernels that a scan takes."""
    count = 0

    def trace(_frame, event, _argument):
        nonlocal count
        count += event == "line"
        return trace

    def begin(frame, _event, _argument):
        return trace if "kernels" in frame.f_code.co_filename else None

    own = module.LaserScan(scan.ranges, scan.angle_min, scan.angle_increment)
    before = sys.gettrace()
    sys.settrace(begin)
    try:
        with np.errstate(all="ignore"):
            extractor(own)
    finally:
        sys.settrace(before)
    return count


def work_of_all(module, n):
    extractor = module.Extractor("optimal")
    return {name: work_of(module, extractor, scan) for name, scan in hard_scans(n).items()}


@pytest.mark.parametrize("n", [181, 540, pytest.param(2160, marks=pytest.mark.slow)])
def test_no_scan_takes_much_longer_than_others_of_its_size(plain, n):
    work = work_of_all(plain, n)
    assert max(work.values()) <= 4 * statistics.median(work.values()), work


@pytest.mark.slow
def test_a_beam_takes_as_long_among_many(plain):
    """Of a long wall, all that came before could be where its line begins."""
    few, many = (work_of_all(plain, n) for n in (540, 4320))
    for name, work in many.items():
        assert work / 4320 <= 2.5 * few[name] / 540, name
