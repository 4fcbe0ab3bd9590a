"""The document of results is as new as the code that it measures."""

import ast
import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from handmade import arc

from lineament import LaserScan, RangeNoise
from lineament.simulation import SENSORS, Sensor, scene, truth

ROOT = Path(__file__).parents[1]


sys.path.append(str(ROOT / "benchmarks"))
results, aims = map(importlib.import_module, ("results", "aims"))


def test_tables_are_of_the_code_that_is_here():
    text = results.DOCUMENTS[0].read_text(encoding="utf-8")
    found = re.search(r"Code measured: `(\w+)`", text)
    assert found, "docs/results.md has no stamp: run `make results`"
    assert found[1] == results.source_hash(), "what is measured changed: run `make results`"


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_benchmarks_import_what_is_there(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lineament"):
            module = importlib.import_module(node.module)
            for name in (alias.name for alias in node.names):
                if not hasattr(module, name):
                    importlib.import_module(f"{node.module}.{name}")


def test_every_table_has_its_place_and_is_filled():
    texts = [path.read_text(encoding="utf-8") for path in results.DOCUMENTS]
    for name in (*results.TABLES, "stamp"):
        text = next(text for text in texts if f"<!-- {name} -->" in text)
        (table,) = re.findall(rf"<!-- {name} -->\n(.*?)<!-- end -->", text, re.DOTALL)
        assert table.strip(), name
    assert len(texts[0].split()) <= 2000
    assert len(texts[1].splitlines()) <= 130


def test_the_hash_is_of_methods_scenes_metrics_and_experiments():
    names = {path.relative_to(ROOT).as_posix() for path in results.measured_files()}
    lab = "lab/src/lineament_lab"
    assert {
        *("src/lineament/kernels/liu.py", "src/lineament/methods/liu.py"),
        *("src/lineament/simulation/scenes.py", "src/lineament/bounds.py"),
        *(f"{lab}/evaluation/kinds.py", f"{lab}/reproduce/grid.py"),
        *(f"{lab}/methods/iepf.py", f"{lab}/kernels/splitting.py"),
    } <= names


@pytest.mark.parametrize(
    ("changed", "same"),
    [
        ('def f(x):  # why\n    """What."""\n    return x + 1\n', True),
        ('"""Module."""\n\ndef f(x):\n\n    return (x + 1)\n', True),
        ("def f(x):\n    return x + 2\n", False),
        ("def f(x):\n    return x - 1\n", False),
        ("def f(y):\n    return y + 1\n", False),
        ('def f(x):\n    return "What."\n', False),
    ],
)
def test_the_hash_is_of_the_meaning(changed, same):
    before = results.shape(ast.parse("def f(x):\n    return x + 1\n"))
    assert (results.shape(ast.parse(changed)) == before) == same


def test_tables_are_written_between_their_marks():
    text = "a\n<!-- one -->\nold\n<!-- end -->\nb\n<!-- two -->\n<!-- end -->\n"
    assert results.written(text, {"one": "|\\1|", "two": "|y|"}) == (
        "a\n<!-- one -->\n|\\1|\n<!-- end -->\nb\n<!-- two -->\n|y|\n<!-- end -->\n"
    )
    table = results.markdown(("m", "n"), [("a", 0.12345), ("b", None)])
    assert table == "|m|n|\n|---|---|\n|a|0.123|\n|b|–|"
    assert results.two_digits(0.125) == "0.12"
    assert results.two_digits(None) == results.two_digits(float("nan")) == "–"


class TestCurvedArcs:
    """Arcs that differ from a line, and those that look straight."""

    def test_line_through_an_arc_is_off_by_what_a_search_finds(self):
        """The least χ² over all lines, by brute force over offset and direction."""
        angles, noise = np.radians(np.arange(-4, 5)), RangeNoise(sigma=0.005, proportional=0.002)
        column = arc(1.5, 0.05, 0.2, 0, 8)
        along = 1.5 * np.cos(angles) + 0.05 * np.sin(angles)
        ranges = along - np.sqrt(0.2**2 - (1.5**2 + 0.05**2 - along**2))
        normals = np.linspace(-0.8, 0.8, 321)[:, np.newaxis, np.newaxis]
        offsets = np.linspace(1.0, 1.5, 501)[:, np.newaxis]
        # Errors of 1/ρ as ρ² in range: what the misfit is defined by.
        errors = ranges**2 * (np.cos(angles - normals) / offsets - 1 / ranges)
        least = (errors**2 / noise.range_variance(ranges)).sum(axis=2).min()
        assert aims.line_misfit(angles, column, noise) == pytest.approx(least, rel=0.02)

    def test_far_columns_look_straight(self, monkeypatch):
        world, pose = scene("hall", 3)
        sensor = SENSORS["rplidar"]
        true = truth(world, pose, sensor)
        shown = {evidence: aims.Optimal(evidence=evidence) for evidence in (1e-9, 1e9)}
        found = []
        for made in shown.values():
            monkeypatch.setattr(aims, "Optimal", lambda made=made: made)
            found.append(sum(aims.curved_arcs(true, sensor)))
        assert found == [(true.arcs["n_points"] >= 6).sum(), 0]
        assert found[0] > 0

    def test_an_arc_over_the_seam(self):
        sensor = Sensor("ring", 360, -np.pi, np.radians(1), 0.0, 30.0, noise=RangeNoise(0.01))
        behind, ahead = arc(-2.0, 0.0, 0.2, 356, 4), arc(2.0, 0.0, 0.2, 176, 184)
        behind["n_points"] = 9
        one, other = (aims.line_misfit(sensor.angles, a, sensor.noise) for a in (behind, ahead))
        assert one == pytest.approx(other)


def test_garbage_has_the_same_beams():
    like = LaserScan([2.0] * 50, angle_min=-0.3, angle_increment=0.01, range_max=12.0)
    for scan in aims.garbage(like):
        assert np.array_equal(scan.angles, like.angles)
        assert scan.valid.any()


@pytest.mark.parametrize(
    ("limits", "text", "marks"),
    [
        (aims.least(0.97), "≥ 0.97", "*  "),
        (aims.most(1.2), "≤ 1.2", "  *"),
        ((0.9, 1.15), "0.9–1.15", "* *"),
        (aims.NONE, "–", "   "),
    ],
)
def test_limits(limits, text, marks):
    assert aims.limits_text(limits) == text
    values = (0.5, 1.0, 1.3)
    assert [aims.mark(v, limits) or " " for v in values] == list(marks)
