"""The cluster of a segment is that of its beams, whatever finds it."""

from functools import cache

import numpy as np
import pytest
from equality import WITH_KERNELS
from worlds import degenerate_scans, fan, random_scan, scan_of, wall

from lineament import Extractor, open_log
from lineament.methods import get_method

pytestmark = pytest.mark.slow

#: Methods and presets, with any number of vertices and with few of them; some know no vertices.
SETTINGS = [
    (name, vertices)
    for name in WITH_KERNELS
    for vertices in (0, 5, 20)
    if not vertices or hasattr(get_method(name), "max_vertices")
]


@cache
def extractor(name, vertices):
    return Extractor(name, **({"max_vertices": vertices} if vertices else {}))


def assert_in_their_clusters(scan, features):
    """The beams at the ends of a segment are in its cluster, and all between that are in one."""
    n, measured = len(scan), np.flatnonzero(scan.valid)
    for line in features.segments:
        first, last = int(line["first_beam"]), int(line["last_beam"])
        assert features.clusters[first] == features.clusters[last] == line["cluster"] >= 0
        beams = measured[(measured - first) % n <= (last - first) % n]
        assert set(features.clusters[beams]) <= {line["cluster"], -1}  # -1: of a spike
    for sides in features.corners["segments"][features.corners["kind"] == "corner"]:
        assert len(set(features.segments["cluster"][sides])) == 1
    # Between two beams of a cluster is no breakpoint.
    for point in features.breakpoints:
        a, b = features.clusters[point["beam"]]
        assert a != b or point["kind"] == "scan_end" or scan.is_full_circle


@pytest.mark.parametrize(("name", "vertices"), SETTINGS)
def test_random_scans(name, vertices):
    for scan in (*map(random_scan, range(30)), *degenerate_scans().values()):
        assert_in_their_clusters(scan, extractor(name, vertices)(scan))


@pytest.mark.parametrize(("name", "vertices"), SETTINGS)
def test_recorded_scans(name, vertices, data_dir):
    log = open_log(data_dir / "carmen" / "csail-corrected.log.gz")
    for index in range(0, len(log), len(log) // 20):
        assert_in_their_clusters(log[index], extractor(name, vertices)(log[index]))


def test_a_line_of_a_map_over_a_jump_joins_its_clusters():
    """Two halves of a wall, the second 0.3 m behind, and two points between them."""
    angles = fan(30)
    far = np.arange(len(angles)) >= len(angles) // 2
    scan = scan_of(np.where(far, wall(angles, 2.3, 0.0), wall(angles, 2.0, 0.0)), angles)
    apart, joined = (extractor("optimal", vertices)(scan) for vertices in (0, 2))
    assert (len(apart.segments), apart.clusters.max(), len(apart.breakpoints)) == (2, 1, 3)
    (line,) = joined.segments
    assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
    assert set(joined.clusters) == {line["cluster"]} == {0}
    assert joined.breakpoints["kind"].tolist() == ["scan_end", "scan_end"]
