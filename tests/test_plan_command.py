"""`lineament plan` and `info` of plans: every format into every other, and what is refused."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from crafted_plans import ROOM
from handmade import arc, features, segment

import lineament as ln
from lineament.cli import run
from lineament.mapping import Grid, LineMap
from lineament.mapping.index import MAPPED
from lineament.output import open_writer


@pytest.fixture
def plan(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = LineMap.from_lines(ROOM, [[2.0, 1.5, 0.25]])
    made.write("room.svg")
    return made


def ends_of(plan):
    return sorted(map(tuple, plan.ends.reshape(-1, 4).round(5).tolist()))


@pytest.mark.parametrize("ending", ["dxf", "svg", "parquet"])
def test_a_plan_goes_through_each_format_and_back(plan, ending):
    source = "room.dxf" if ending == "svg" else "room.svg"
    plan.write(source)
    layers = ["WALLS", "ARCS"]  # of a DXF, columns are not among the walls
    given = ["--layers", ",".join(layers)] if source == "room.dxf" else []
    assert run(["plan", source, "-o", f"a.{ending}", "-q", *given]) == 0
    again = LineMap.read(f"a.{ending}", layers=layers if ending == "dxf" else None)
    if ending == "parquet":  # seen from the left alone: each wall twice
        assert len(again.walls) == 8
        assert (again.walls["side"] == 1).all()
        both = [*ROOM.tolist(), *ROOM[:, [2, 3, 0, 1]].tolist()]
        np.testing.assert_allclose(ends_of(again), sorted(map(tuple, both)), atol=1e-5)
    else:
        assert (again.walls["side"] == 0).all()
        np.testing.assert_allclose(ends_of(again), ends_of(plan), atol=1e-5)
    np.testing.assert_allclose(again.columns["center"], [[2.0, 1.5]])
    np.testing.assert_allclose(again.columns["radius"], [0.25])


@pytest.mark.usefixtures("plan")
def test_a_plan_becomes_a_grid_and_a_grid_keeps_its_cells(capsys):
    assert run(["plan", "room.svg", "-o", "a.yaml", "--resolution", "0.1"]) == 0
    assert "no cell is free" in capsys.readouterr().out
    grid = Grid.read("a.yaml")
    assert grid.resolution == 0.1
    assert run(["plan", "a.yaml", "-o", "b.yml", "-q"]) == 2
    assert run(["plan", "a.yaml", "-o", "b.yaml", "-q"]) == 0
    assert (Grid.read("b.yaml").cells == grid.cells).all()


def test_geojson_has_walls_columns_and_corners_in_metres(plan):
    assert run(["plan", "room.svg", "-o", "a.geojson", "-q"]) == 0
    found = json.loads(Path("a.geojson").read_text(encoding="utf-8"))
    assert found["type"] == "FeatureCollection"
    assert found["unit"] == "metre"
    kinds = [one["properties"]["kind"] for one in found["features"]]
    assert kinds == ["wall"] * 4 + ["arc"] + ["corner"] * 4
    wall, column = found["features"][0]["geometry"], found["features"][4]["geometry"]
    assert wall == {"type": "LineString", "coordinates": [[0, 0], [4, 0]]}
    (ring,) = column["coordinates"]
    assert column["type"] == "Polygon"
    assert ring[0] == pytest.approx(ring[-1], abs=1e-6)
    assert len(plan.corners) == 4


def test_geojson_of_a_grid_has_what_is_free(tmp_path):
    cells = np.full((20, 30), 100, np.int8)
    cells[4:16, 4:26] = 0
    cells[8:12, 10:20] = -1
    Grid(cells, 0.1, (1.0, 2.0, math.pi / 2)).write(tmp_path / "a.yaml")
    assert run(["plan", str(tmp_path / "a.yaml"), "-o", str(tmp_path / "a.geojson"), "-q"]) == 0
    found = json.loads((tmp_path / "a.geojson").read_text(encoding="utf-8"))["features"]
    (free,) = [one["geometry"] for one in found if one["properties"]["kind"] == "free"]
    assert free["type"] == "Polygon"
    outer, hole = free["coordinates"]
    # A cell (column, row) is at x = 1 - 0.1 row, y = 2 + 0.1 column.
    corners = {(0.6, 2.4), (0.6, 4.6), (-0.6, 4.6), (-0.6, 2.4)}
    assert {tuple(place) for place in outer} == corners
    assert len(hole) == 5
    assert sum(one["properties"]["kind"] == "wall" for one in found) == 4


def test_walls_of_any_file_or_grid_are_some_centimetres_off(plan):
    """Buildings off their drawings, maps off the buildings; unless somebody knows better."""
    assert LineMap.from_grid(plan.to_grid()).sigma == MAPPED
    for ending in ("dxf", "svg", "parquet", "yaml"):
        plan.write(f"a.{ending}")
        assert LineMap.read(f"a.{ending}").sigma == MAPPED
        assert LineMap.read(f"a.{ending}", sigma=0.0).sigma == 0.0


@pytest.mark.usefixtures("plan")
@pytest.mark.parametrize("ending", ["png", "pdf", "csv", "jsonl"])
def test_pictures_and_tables_are_written(ending):
    dark = ["--dark"] if ending in ("png", "pdf") else []
    assert run(["plan", "room.svg", "-o", f"a.{ending}", "-q", *dark]) == 0
    assert Path(f"a.{ending}").stat().st_size > 300


def test_arcs_of_an_svg_are_the_circles_that_they_are_parts_of(tmp_path):
    n, center = 200, np.array((2.0, 0.3))
    for first, last in ((-0.5, 0.4), (-1.2, 1.2)):
        bearings = np.linspace(first, last, n)
        scan = ln.LaserScan(np.full(n, 1.0), first, bearings[1] - bearings[0])
        round_ = arc(*center, 0.5, 0, n - 1)
        with open_writer(tmp_path / "a.svg") as writer:
            writer.write(features(segments=[segment((0, -1), (3, -1), 0, 9)], arcs=[round_]), scan)
        (column,) = LineMap.read(tmp_path / "a.svg").columns
        np.testing.assert_allclose(column["center"], center, atol=1e-5)
        assert math.isclose(column["radius"], 0.5, abs_tol=1e-6)


def test_info_describes_a_plan_or_a_grid(plan, capsys):
    assert run(["info", "room.svg"]) == 0
    said = capsys.readouterr().out
    assert "walls    4, 14.0 m in all, 0 of them" in said
    assert "columns  1" in said
    plan.write("a.yaml")
    assert run(["info", "a.yaml"]) == 0
    said = capsys.readouterr().out
    assert "cells of 0.05 m" in said
    assert "0.0 % free" in said


@pytest.mark.parametrize(
    ("arguments", "status", "line"),
    [
        (["plan", "room.svg", "-o", "a.gif"], 2, "expected an ending of .dxf, .yaml, .svg"),
        (["plan", "room.svg", "-o", "room.svg"], 1, "would replace room.svg, which is read"),
        (["plan", "none.svg", "-o", "a.dxf"], 1, "none.svg: No such file"),
        (["plan", "log.npz", "-o", "a.dxf"], 1, "a plan is a .dxf, .parquet, .svg or the .yaml"),
        (["plan", "other.svg", "-o", "a.dxf"], 1, "other.svg: is no plan that lineament wrote"),
        (["plan", "broken.svg", "-o", "a.dxf"], 1, "broken.svg: is no SVG: "),
        (["plan", "a.yaml", "-o", "a.yaml"], 1, "a.yaml: would replace a.yaml, which is read"),
        (["info", "other.svg"], 1, "other.svg: is no plan that lineament wrote"),
        (["info", "a.pgm"], 1, "a.pgm: is an image, expected the .yaml of the grid"),
        (["info", "a.geojson"], 1, "a.geojson: a plan is a .dxf, .parquet, .svg or the .yaml"),
    ],
)
def test_what_cannot_be_converted_is_one_line(plan, refused, arguments, status, line):
    for name, text in (
        ("other.svg", '<svg xmlns="http://www.w3.org/2000/svg"><g id="walls"/></svg>'),
        ("broken.svg", "<svg"),
        ("log.npz", ""),
        ("a.geojson", "{}"),
    ):
        Path(name).write_text(text, encoding="utf-8")
    plan.write("a.yaml")
    assert line in refused(arguments, status)


@pytest.mark.parametrize(("given", "output"), [("a.svg", "b.dxf"), ("a.dxf", "b.svg")])
def test_a_home_that_cannot_be_written_is_no_line(tmp_path, given, output):
    """There ezdxf, which is imported anew, logs that it has no cache."""
    LineMap.from_lines(ROOM).write(tmp_path / given)
    (tmp_path / "home").touch()
    home = str(tmp_path / "home")
    command = [sys.executable, "-m", "lineament", "plan", given, "-o", output]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=os.environ | {"HOME": home, "XDG_CACHE_HOME": f"{home}/cache"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
