"""Methods side by side: what the table says, and what is drawn."""

from dataclasses import replace

import numpy as np
import pytest
from lineament_lab.compare import compare_log, compare_scan, write_comparison

import lineament as ln
from lineament import LineamentError, LogError
from lineament.logs import save_npz
from lineament.simulation import SENSORS, room

PNG = b"\x89PNG\r\n\x1a\n"


def step_scan():
    """Two walls across the view, at 2 m and at 4 m, of five beams each."""
    bearings = 0.02 * np.arange(10)
    ranges = np.where(bearings < 0.1, 2.0, 4.0) / np.cos(bearings)
    return ln.LaserScan(ranges, angle_min=0.0, angle_increment=0.02)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "room.npz"
    rng = np.random.default_rng(0)
    save_npz(path, [SENSORS["ld19"].scan(room(), (0.1 * i, 0.0, 0.0), rng) for i in range(3)])
    return path


def test_table_counts_and_errors():
    extractors = {"liu": ln.Extractor("liu"), "pdbs": ln.Extractor("pdbs")}
    comparison = compare_scan(step_scan(), extractors)
    table = comparison.table()
    liu, pdbs = table.rows
    assert table.columns[:5] == ("method", "segments", "corners", "arcs", "clusters")
    assert liu[:6] == ("liu", 2, 0, 0, 2, 100.0)
    assert liu[6:10] == pytest.approx([0.0] * 4, abs=1e-6)  # points on their own lines
    assert liu[10] > 0
    assert (table.columns[11], liu[11]) == ("÷ liu", "1.00 (1.00–1.00)")
    assert pdbs[:10] == ("pdbs", 0, 0, 0, 2, 0.0, *[None] * 4)
    assert str(table).splitlines()[2].split()[:6] == ["pdbs", "0", "0", "0", "2", "0"]


def test_similarity_errors_are_those_of_each_beam():
    features = ln.extract(step_scan(), method="liu")
    segments = features.segments.copy()
    segments["centroid"][0, 0] += 0.5
    far_off = replace(features, segments=segments)
    comparison = compare_scan(step_scan(), {"off": lambda scan: far_off})  # noqa: ARG005
    table = comparison.table()
    (row,) = table.rows
    assert dict(zip(table.columns, row, strict=True))["mean error [mm]"] == pytest.approx(250)
    assert dict(zip(table.columns, row, strict=True))["largest [mm]"] == pytest.approx(500)


def test_log_is_compared_by_all_methods_in_the_order_asked_for(log):
    assert list(compare_log(log, 1, ["iepf", "liu"]).features) == ["iepf", "liu"]
    with pytest.raises(LogError, match="expected 0 to 2"):
        compare_log(log, 7, ["liu"])
    with pytest.raises(ValueError, match="method 'lui' is unknown"):
        compare_log(log, 0, ["lui"])


@pytest.mark.slow
def test_default_is_every_method(log):
    from lineament.methods import method_names

    comparison = compare_log(log)
    assert list(comparison.features) == method_names(presets=False)
    assert {taken.shape[1] for taken in comparison.seconds.values()} == {3}


@pytest.mark.parametrize("name", ["a.png", "a.html", "a.svg"])
def test_files(tmp_path, name):
    path = tmp_path / name
    write_comparison(compare_scan(step_scan(), {"pdbs": ln.Extractor("pdbs")}), path)
    content = path.read_bytes()
    if name == "a.png":
        assert content.startswith(PNG)
    else:
        assert b"no lines, no similarity error" in content or b"base64,iVBOR" in content
    if name == "a.html":
        assert b"<td>pdbs</td>" in content
        assert b"http" not in content


def test_unknown_ending(tmp_path):
    comparison = compare_scan(step_scan(), {"pdbs": ln.Extractor("pdbs")})
    with pytest.raises(LineamentError, match=r"\.bmp.*expected one of \.png"):
        write_comparison(comparison, tmp_path / "a.bmp")


def test_empty_scan_is_compared():
    scan = ln.LaserScan([np.nan] * 4, angle_min=0.0, angle_increment=0.1)
    comparison = compare_scan(scan, {"pdbs": ln.Extractor("pdbs")})
    assert comparison.table().rows[0][1:5] == (0, 0, 0, 0)
    comparison.figure()
