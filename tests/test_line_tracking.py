"""Method line_tracking: its lines equal those of its slow twin. See also test_line_methods."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_partition import clusters_of, noise_of, parted, track
from worlds import NOISE, degenerate_scans, fan, random_scan, scan_of, vertex, wall

from lineament import Extractor, RangeNoise
from lineament.features import noise_row
from lineament.kernels.layout import BEAM, FIRST, LAST, PIECES
from lineament.kernels.rivals.line_tracking import track_lines
from lineament.methods.pdbs import part
from lineament.methods.steps import estimate_noise
from lineament.methods.workspace import Block

DEGENERATE = degenerate_scans()
SENSOR = RangeNoise(0.01, 0.01, 0.002, 0.01)
EXTRACTORS = {
    "default": Extractor("line_tracking"),
    "changed": Extractor(
        "line_tracking",
        threshold=0.01,
        noise_factor=2.0,
        max_misses=0,
        min_piece=6,
        noise=SENSOR,
    ),
}


def tracked(scan, extractor):
    """First and last beam of the lines that the kernel tracks, before they are merged."""
    method = extractor.method
    block = Block(scan, noise_row(extractor.noise), 1)
    block.load(scan.ranges)
    block.take(0)
    estimate_noise(block, 0)
    part(
        block,
        0,
        angle=method.grazing_angle,
        max_missing=method.max_missing,
        min_points=method.min_points,
    )
    track_lines(
        block.floats,
        block.ints,
        block.counts,
        block.noises[0],
        method.threshold,
        method.noise_factor,
        method.max_misses,
        method.min_piece,
    )
    beam, lines = block.ints[BEAM], slice(block.counts[PIECES])
    first, last = beam[block.ints[FIRST, lines]], beam[block.ints[LAST, lines]]
    return list(zip(first.tolist(), last.tolist(), strict=True))


def assert_same_lines(scan, extractor):
    """Hold the tracked lines equal to the twin's. Returns how many there are."""
    noise = noise_of(scan, extractor)
    found = parted(scan, clusters_of(extractor.method), noise)
    lines = track(scan, found, noise, extractor.method)
    assert tracked(scan, extractor) == lines
    return len(lines)


@pytest.mark.parametrize("scan", DEGENERATE.values(), ids=DEGENERATE)
@pytest.mark.parametrize("extractor", EXTRACTORS.values(), ids=EXTRACTORS)
def test_degenerate_scans_equal_the_slow_twin(extractor, scan):
    assert_same_lines(scan, extractor)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(EXTRACTORS)))
def test_random_scans_equal_the_slow_twin(seed, name):
    assert_same_lines(random_scan(seed), EXTRACTORS[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTRACTORS)
def test_recorded_scans_equal_the_slow_twin(recorded_scans, name):
    assert sum(assert_same_lines(scan, EXTRACTORS[name]) for scan in recorded_scans) > 50


def test_a_line_passes_over_as_many_misses_as_it_may():
    angles = fan(20)
    for missed in (1, 2, 3):
        ranges = wall(angles, 2.0, 0.0)
        ranges[60 : 60 + missed] += 0.06
        scan = scan_of(ranges, angles)
        for max_misses in (0, 1, 2, 3):
            extractor = Extractor("line_tracking", max_misses=max_misses, noise=NOISE)
            whole = tracked(scan, extractor)[0] == (0, len(angles) - 1)
            assert whole == (missed <= max_misses)


def test_a_line_ends_about_the_vertex_and_the_next_begins_there():
    angles = fan(20)
    scan = scan_of(vertex(angles, 3.0, 90, convex=False), angles)
    (_, end), (begin, last) = tracked(scan, Extractor("line_tracking", noise=NOISE))
    assert begin == end + 1
    assert last == len(angles) - 1
    assert 0 <= end - len(angles) // 2 <= 4  # It runs past, where both walls are near.
    # Merging moves the border to where it belongs.
    (corner,) = Extractor("line_tracking", noise=NOISE)(scan).corners
    assert abs(corner["beam"] - len(angles) // 2) <= 1


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("threshold", [-0.1, math.nan, "1"]),
        ("noise_factor", [0, -1.0, None]),
        ("max_misses", [-1, 1.0]),
        ("min_piece", [2, 3.0]),
        ("unevenness", [-1.0]),
        ("reach", [-1.0, math.inf]),
        ("corner_trim", [-1]),
        ("grazing_angle", [0, 10, math.pi / 2]),
        ("max_missing", [-1]),
        ("min_points", [1]),
        ("max_vertices", [-1, 1.5]),
    ],
)
def test_bounds(name, refused):
    for value in refused:
        with pytest.raises(ValueError, match=f"{name} is ") as error:
            Extractor("line_tracking", **{name: value})
        assert str(value) in str(error.value)


def test_tracking_does_not_depend_on_what_the_block_held_before():
    extractor = Extractor("line_tracking")
    scans = [random_scan(seed, 200) for seed in range(4)]
    alone = [Extractor("line_tracking")(scan) for scan in scans]
    again = [extractor(scan) for scan in scans]
    for a, b in zip(alone, again, strict=True):
        for name in ("segments", "corners", "breakpoints"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
