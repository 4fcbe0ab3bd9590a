"""Occupancy grids: read as map_server reads them, walls at hand-worked places, written again."""

import math
import os
import re
import sys
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import label

import lineament as ln
from lineament.cli import run
from lineament.limits import Limits
from lineament.logs import save_log
from lineament.mapping import Grid, LineMap
from lineament.mapping.grid_files import parse_flat
from lineament.mapping.outlines import areas, outlines, partition
from lineament.simulation import SENSORS, World, drive

YAML = "image: a.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n"


def written(folder, pixels, about=YAML, ending="pgm"):
    """Write a grid by hand: pixels from the top, in plain PGM or as PIL writes them."""
    pixels = np.asarray(pixels, np.uint8)
    if ending == "pgm":
        rows, columns = pixels.shape
        text = " ".join(map(str, pixels.ravel().tolist()))
        (folder / "a.pgm").write_text(f"P2\n# by hand\n{columns} {rows}\n255\n{text}\n")
    else:
        Image.fromarray(pixels).save(folder / f"a.{ending}")
    (folder / "a.yaml").write_text(about)
    return folder / "a.yaml"


def room(columns=60, rows=40, thick=2):
    """A room of free cells with walls around it, unknown beyond."""
    cells = np.full((rows, columns), -1, np.int8)
    cells[5:-5, 5:-5] = 100
    cells[5 + thick : -5 - thick, 5 + thick : -5 - thick] = 0
    return cells


def test_walls_lie_in_the_middle_of_their_cells_and_look_at_what_is_free():
    plan = LineMap.from_grid(Grid(room(), 0.1))
    # The room's cells are 7 … 52 and 7 … 32: the walls' middles are at 6.5, 53.5, 6.5 and 33.5.
    ends = {tuple(np.round(wall.ravel(), 3).tolist()) for wall in plan.ends}
    assert ends == {
        (0.65, 0.65, 5.35, 0.65),
        (5.35, 0.65, 5.35, 3.35),
        (5.35, 3.35, 0.65, 3.35),
        (0.65, 3.35, 0.65, 0.65),
    }
    assert (plan.walls["side"] == 1).all()
    assert plan.corners["solid"].tolist() == [0] * 4
    sigma = np.sqrt(plan.walls["covariance"][:, 0, 0])
    np.testing.assert_allclose(sigma, 0.1 * math.sqrt(1 / 12 + 0.05))


def test_both_faces_of_a_thin_wall_and_all_sides_of_a_box():
    cells = np.zeros((60, 60), np.int8)
    cells[40, 10:50] = 100
    cells[5:15, 20:30] = 100
    plan = LineMap.from_grid(Grid(cells, 0.05))
    ends = np.round(plan.ends / 0.05, 3).reshape(-1, 4).tolist()
    assert [10.0, 40.5, 50.0, 40.5] in ends
    assert [50.0, 40.5, 10.0, 40.5] in ends
    assert len(ends) == 6
    assert [29.5, 5.5, 20.5, 5.5] in ends  # seen from below: free on the left of going left
    assert plan.corners["solid"].tolist() == [1] * 4


def test_unknown_is_not_free_unless_nothing_is():
    cells = room(thick=1)
    assert len(LineMap.from_grid(Grid(cells, 0.1)).walls) == 4
    cells[cells == 0] = -1
    assert len(LineMap.from_grid(Grid(cells, 0.1)).walls) == 8


@pytest.mark.parametrize("slope", [0.02, 0.1, 0.5, 1.0, -0.3, 3.0])
def test_a_wall_across_the_cells_is_one_line_where_it_was_drawn(slope):
    u = np.array((1.0, slope)) / math.hypot(1, slope)
    line = np.array([(0.013, 0.021), (0.013, 0.021) + 4 * u])
    left = np.array((-u[1], u[0]))
    poses = [(*(line.mean(axis=0) + 0.7 * left + s * u), 0.0) for s in (-1.5, 0, 1.5)]
    world = World(line.reshape(1, 4))
    seen = [(SENSORS["utm30lx"].scan(world, p, np.random.default_rng(0)), p) for p in poses]
    grid = Grid.drawn(line[None], seen)
    walls = LineMap.from_grid(grid).ends
    facing = walls[(walls[:, 1] - walls[:, 0]) @ u > 0.9]
    lengths = np.linalg.norm(facing[:, 1] - facing[:, 0], axis=1)
    assert lengths.max() > 3.7
    off = (facing[lengths.argmax()] - line[0]) @ left
    assert np.abs(off).max() < 0.015


def area_of(ring):
    """Area within a ring, less than 0 if it leads clockwise."""
    return 0.5 * sum(a[0] * b[1] - a[1] * b[0] for a, b in pairwise(ring))


def test_outlines_go_around_cells_that_touch_at_a_corner():
    occupied = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]], bool)
    (one,) = outlines(occupied, ~occupied)
    assert one.closed
    assert len(one.corners) == 9
    assert area_of(one.corners) == -2.0  # free on the left: around what is solid, clockwise


def test_areas_are_rings_with_holes():
    rows = [
        "#########",
        "#.......#",
        "#.#.###.#",
        "#...#.#.#",
        "#.#.###..",
        "#...#...#",
        "#########",
    ]
    free = np.array([[letter == "." for letter in row] for row in rows])
    found = areas(free)
    assert sorted(len(polygon) for polygon in found) == [1, 3]
    for polygon in found:
        inner = len(polygon) == 1
        assert sum(map(area_of, polygon)) == (1 if inner else free.sum() - 1)
        assert all((ring[0] == ring[-1]).all() for ring in polygon)
    assert areas(np.zeros((3, 3), bool)) == []
    (whole,) = areas(np.ones((3, 4), bool))
    assert sorted(map(tuple, whole[0][1:].tolist())) == [(0, 0), (0, 3), (4, 0), (4, 3)]
    rng = np.random.default_rng(0)
    for share in (0.3, 0.6, 0.8):
        free = rng.random((30, 40)) < share
        found = areas(free)
        assert sum(map(len, found)) == len(outlines(~np.pad(free, 1), np.pad(free, 1)))
        _, count = label(free)
        assert len(found) == count


def test_the_partition_is_the_best_of_all():
    """Of a small outline, no other choice of lines has less energy, by definition."""
    from lineament.mapping import outlines as module

    rng = np.random.default_rng(3)
    heights = np.repeat([0, 1, 0, 3, 3], [6, 4, 6, 5, 4]) + (rng.random(25) < 0.1)
    corners = [(0.0, float(heights[0]))]
    for x, high in enumerate(heights):
        while corners[-1][1] != high:
            corners.append((float(x), corners[-1][1] + np.sign(high - corners[-1][1])))
        corners.append((float(x + 1), float(high)))
    corners = np.array(corners)
    middles = (corners[1:] + corners[:-1]) / 2
    variance = module._UNIFORM + module._NOISE

    def cost(i, j):
        way = math.dist(corners[i], corners[j])
        if j - i < module._FEWEST or way < module._ONWARD * (j - i):
            return math.inf
        part = middles[i:j] - middles[i:j].mean(axis=0)
        square = np.linalg.svd(part, compute_uv=False)[1] ** 2
        beyond = max(square - module._UNIFORM * (j - i), 0.0)
        return module._EVIDENCE + (beyond + module._CELLS * square) / variance

    steps = np.diff(corners, axis=0)
    turns = [k for k in range(1, len(steps)) if (steps[k] != steps[k - 1]).any()]
    at = [0, *turns, len(steps)]
    least = {0: 0.0}
    for j, i in product(range(1, len(at)), range(len(at))):
        if i < j:
            none = module._CLUTTER * (at[j] - at[i])
            least[j] = min(least.get(j, math.inf), least[i] + min(cost(at[i], at[j]), none))
    pieces = partition(corners)
    free = len(steps) - sum(j - i for i, j in pieces)
    assert sum(cost(i, j) for i, j in pieces) + module._CLUTTER * free == pytest.approx(
        least[len(at) - 1]
    )
    assert len(pieces) >= 2


def test_a_turned_origin_moves_the_walls(tmp_path):
    about = YAML.replace("[0, 0, 0]", "[2.0, 3.0, 1.0]") + "free_thresh: 0.196\n"
    Grid(room(), 0.1).write(tmp_path / "plain.yaml")
    plain = LineMap.read(tmp_path / "plain.yaml")
    (tmp_path / "a.yaml").write_text(about.replace("a.pgm", "plain.pgm"))
    turned = LineMap.read(tmp_path / "a.yaml")
    c, s = math.cos(1.0), math.sin(1.0)
    np.testing.assert_allclose(turned.ends, plain.ends @ np.array([[c, s], [-s, c]]) + (2, 3))
    np.testing.assert_allclose(turned.walls["angle"] - plain.walls["angle"], 1.0, atol=2 * math.pi)


SHADES = [0, 50, 89, 90, 100, 204, 205, 206, 254, 255]


@pytest.mark.parametrize(
    ("more", "values"),
    [
        # By map_server: 1 - shade / 255 > 0.65 is occupied, < 0.25 (its default) free.
        ("", [100, 100, 100, -1, -1, 0, 0, 0, 0, 0]),
        ("free_thresh: 0.196\n", [100, 100, 100, -1, -1, -1, -1, 0, 0, 0]),
        ("negate: 1\nfree_thresh: 0.196\n", [0, -1, -1, -1, -1, 100, 100, 100, 100, 100]),
        ("negate: true\noccupied_thresh: 0.9\n", [0, 0, -1, -1, -1, -1, -1, -1, 100, 100]),
        ("mode: scale\nfree_thresh: 0.2\n", [100, 100, 100, 99, 91, 0, 0, 0, 0, 0]),
        ("mode: Raw\n", [0, 50, 89, 90, 100, -1, -1, -1, -1, -1]),
    ],
)
def test_shades_are_what_map_server_takes_them_for(tmp_path, more, values):
    grid = Grid.read(written(tmp_path, [SHADES], YAML + more))
    assert grid.cells.tolist() == [values]
    assert grid.resolution == 0.1


def test_raw_cells_are_judged_by_the_thresholds(tmp_path):
    about = YAML + "mode: raw\noccupied_thresh: 0.9\nfree_thresh: 0.5\n"
    grid = Grid.read(written(tmp_path, [SHADES], about))
    assert grid.occupied.tolist() == [[False] * 3 + [True] * 2 + [False] * 5]
    assert grid.free.tolist() == [[True] * 2 + [False] * 8]
    grid.write(tmp_path / "b.yaml")
    again = Grid.read(tmp_path / "b.yaml")
    assert (again.cells == grid.cells).all()
    assert (again.least, again.most) == (90, 50)


def test_the_first_row_of_an_image_is_the_highest(tmp_path):
    grid = Grid.read(written(tmp_path, [[0, 254], [254, 254], [205, 205]]))
    assert grid.cells.tolist() == [[0, 0], [0, 0], [100, 0]]
    grid = Grid.read(written(tmp_path, [[0, 254], [205, 205]], YAML + "free_thresh: 0.196\n"))
    assert grid.cells.tolist() == [[-1, -1], [100, 0]]


def test_images_of_all_kinds_are_the_same_grid(tmp_path):
    """Grey, 16 bits, colours, a palette, transparency, one bit: as map_server averages channels."""
    grey = np.array([[0, 254, 254, 0], [254, 0, 254, 254]], np.uint8)
    expected = [[0, 100, 0, 0], [100, 0, 0, 100]]
    images = {
        "grey": Image.fromarray(grey),
        "rgb": Image.fromarray(np.stack([grey] * 3, axis=-1)),
        "rgba": Image.fromarray(np.stack([*[grey] * 3, np.full_like(grey, 255)], axis=-1)),
        "la": Image.fromarray(grey).convert("LA"),
        "palette": Image.fromarray(grey).convert("P"),
        "bit": Image.fromarray(grey).convert("1"),
        "deep": Image.fromarray(grey.astype(np.uint16) * 257),
    }
    for name, image in images.items():
        image.save(tmp_path / f"{name}.png")
        (tmp_path / "a.yaml").write_text(YAML.replace("a.pgm", f"'{name}.png'"))
        assert Grid.read(tmp_path / "a.yaml").cells.tolist() == expected, name
    # Of trinary maps, map_server takes opacity for a channel; of scaled, what is clear is unknown.
    clear = np.stack([*[grey] * 3, np.zeros_like(grey)], axis=-1)
    Image.fromarray(clear).save(tmp_path / "clear.png")
    about = YAML.replace("a.pgm", "clear.png")
    for mode, left in (("trinary", [-1, 100]), ("scale", [-1, -1])):
        (tmp_path / "a.yaml").write_text(f"{about}mode: {mode}\nfree_thresh: 0.1\n")
        assert Grid.read(tmp_path / "a.yaml").cells[:, 0].tolist() == left


def test_binary_and_plain_pgm_with_comments(tmp_path):
    (tmp_path / "a.pgm").write_bytes(b"P5\n# CREATOR: a map\n2 1\n# more\n255\n\x00\xfe")
    (tmp_path / "a.yaml").write_text(YAML)
    assert Grid.read(tmp_path / "a.yaml").cells.tolist() == [[100, 0]]


@pytest.mark.parametrize(
    ("text", "fields"),
    [
        ("a: b", {"a": "b"}),
        ("---\n# all\n\na:   b c  # d\n", {"a": "b c"}),
        ("a: 'b # c'\r\nd: \"e: f\"", {"a": "b # c", "d": "e: f"}),
        ("a: [1, -2.5e-3, 0.]", {"a": "1, -2.5e-3, 0."}),
        ("a:\n- 1\n- 2\n  # c\n- 3\nb: 4", {"a": "1, 2, 3", "b": "4"}),
        ("a: b#c", {"a": "b#c"}),
        ("a: it's", {"a": "it's"}),
    ],
)
def test_flat_yaml_is_read_as_yaml(text, fields):
    yaml = pytest.importorskip("yaml")
    assert parse_flat(text) == fields
    for name, value in yaml.safe_load(text).items():
        if isinstance(value, list):
            assert [float(part) for part in fields[name].split(",")] == [float(v) for v in value]
        else:
            assert str(value) == fields[name]


def test_an_image_may_have_a_name_that_is_not_utf_8(tmp_path):
    path = written(tmp_path, np.full((3, 3), 254))
    path.write_bytes(YAML.encode().replace(b"a.pgm", b"\xe9.pgm"))
    with pytest.raises(ln.LineamentError, match=r"a\.yaml: \\udce9\.pgm: No such file"):
        Grid.read(path)
    if sys.platform == "linux":
        (tmp_path / "a.pgm").rename(tmp_path / "\udce9.pgm")
        assert Grid.read(path).cells.shape == (3, 3)


def replaced(old, new):
    return YAML.replace(old, new)


@pytest.mark.parametrize(
    ("about", "line"),
    [
        (replaced("resolution: 0.1", "resolution: 0"), r"a\.yaml: .*resolution is 0 m a cell"),
        (
            replaced("0, 0, 0", "0, 0, 90"),
            r"a\.yaml: .*origin has theta = 90 rad, more than a turn",
        ),
        (replaced("resolution: 0.1", "resolution: nan"), "resolution is 'nan', expected a number"),
        (replaced("resolution: 0.1\n", ""), r"a\.yaml: is no grid of map_server: resolution is mi"),
        (replaced("[0, 0, 0]", "[0, 0]"), "origin has 2 numbers, expected 3: x, y, yaw"),
        (replaced("[0, 0, 0]", "[1e300, 0, 0]"), "origin is 1e\\+300 m away, expected a building"),
        (replaced("[0, 0, 0]", "[0, 0, a]"), "origin is 'a', expected a number"),
        (replaced("[0, 0, 0]", "[0, 0, 0"), r"line 3: origin has no closing \]"),
        (replaced("image: a.pgm\n", ""), "image is missing"),
        (replaced("a.pgm", "b.pgm"), r"a\.yaml: b\.pgm: No such file"),
        (replaced("a.pgm", "a\0.pgm"), "is no name of a file: embedded null byte"),
        (replaced("a.pgm", "a.yaml"), r"a\.yaml: is no whole PGM or PNG"),
        (YAML + "mode: grey\n", "mode is 'grey', expected one of trinary, scale, raw"),
        (YAML + "negate: 2\n", "negate is '2', expected 0 or 1"),
        (YAML + "occupied_thresh: 0.1\n", "free_thresh is 0.25 and occupied_thresh 0.1, expected"),
        (YAML + "mode: raw\nmode: raw\n", "line 5 has mode again"),
        (YAML + "{1: 2}\n", r"line 4 is '\{1: 2\}', expected `name: value`"),
        ("rosbag2_bagfile_information:\n  version: 5\n", "line 2 is 'version: 5'"),
        ("", "image is missing"),
    ],
)
def test_what_is_no_grid_is_one_clear_line(tmp_path, about, line):
    path = written(tmp_path, np.full((3, 3), 254), about)
    with pytest.raises(ln.LineamentError, match=line) as caught:
        LineMap.read(path)
    assert "\n" not in str(caught.value)


def test_images_that_are_damaged_huge_or_alone(tmp_path):
    path = written(tmp_path, np.full((30, 30), 254), YAML.replace("pgm", "png"), "png")
    with pytest.raises(ln.LineamentError, match=r"a\.yaml: has no walls: 0 of 900 cells are occ"):
        LineMap.read(path)
    with pytest.raises(ln.LineamentError, match=r"a\.png: has 900 cells, more than .* cells=N"):
        LineMap.read(path, limits={"cells": 899})
    with pytest.raises(ln.LineamentError, match=r"a\.png: is an image, expected the \.yaml"):
        LineMap.read(tmp_path / "a.png")
    whole = (tmp_path / "a.png").read_bytes()
    for end in (3, 20, len(whole) // 2):
        (tmp_path / "a.png").write_bytes(whole[:end])
        with pytest.raises(ln.LineamentError, match=r"a\.png: is no whole PGM or PNG") as caught:
            LineMap.read(path)
        assert str(caught.value).isprintable()
    huge = b"P5\n100000 100000\n255\n\x00"
    (tmp_path / "a.png").write_bytes(huge)
    with pytest.raises(
        ln.LineamentError, match=r"a\.png: has more than the limit of 67108864 cells"
    ):
        LineMap.read(path)
    chess = np.where(np.indices((40, 40)).sum(axis=0) % 2, 0, 254)
    path = written(tmp_path, chess)
    with pytest.raises(ln.LineamentError, match=r"has \d+ entities, rows or borders of cells"):
        LineMap.read(path, limits={"entities": 1000})


def test_a_grid_that_is_written_is_read_again_exactly(tmp_path):
    cells = room()
    grid = Grid(cells, 0.05, (-1.25, 3.1, 0.25))
    grid.write(tmp_path / "m.yaml")
    again = Grid.read(tmp_path / "m.yaml")
    assert (again.cells == cells).all()
    assert (again.resolution, again.origin) == (0.05, (-1.25, 3.1, 0.25))
    assert (tmp_path / "m.pgm").read_bytes().startswith(b"P5\n60 40\n255\n")
    text = (tmp_path / "m.yaml").read_text()
    assert re.match(r"image: m\.pgm\nmode: trinary\nresolution: 0\.05\norigin: \[-1\.25,", text)
    cells[20, 20] = 42
    Grid(cells, 0.05).write(tmp_path / "n.yaml")
    assert (Grid.read(tmp_path / "n.yaml").cells == cells).all()


def test_a_grid_is_written_whole_or_not_at_all(tmp_path):
    (tmp_path / "m.pgm").mkdir()
    with pytest.raises(ln.LineamentError, match=r"m\.pgm: is a folder"):
        Grid(room(), 0.05).write(tmp_path / "m.yaml")
    assert [p.name for p in tmp_path.iterdir()] == ["m.pgm"]


def test_a_plan_drawn_into_a_grid_is_found_in_it(tmp_path):
    ring = [(0.02, 0.03, 4.03, 0.03), (4.03, 0.03, 4.03, 3.02)]
    ring += [(4.03, 3.02, 0.02, 3.02), (0.02, 3.02, 0.02, 0.03)]
    plan = LineMap.from_lines(ring, [[2.0, 1.5, 0.3]], side=1)
    plan.write(tmp_path / "m.yaml")
    grid = Grid.read(tmp_path / "m.yaml")
    assert not grid.free.any()
    again = LineMap.read(tmp_path / "m.yaml")
    ends = again.ends[np.linalg.norm(again.ends[:, 1] - again.ends[:, 0], axis=1) > 2]
    assert len(ends) == 8  # both faces, as nothing says which is free
    left = (ends[:, 1] - ends[:, 0])[:, ::-1] * (-1, 1)
    inside = ends[(left * ((2, 1.5) - ends[:, 0])).sum(axis=1) > 0]
    for start, end in np.array(ring).reshape(-1, 2, 2):
        off = [np.abs(wall - (start, end)).max() for wall in inside]
        assert min(off) < 0.026


def test_what_beams_pass_through_is_free():
    scan = ln.LaserScan([1.0, 1.0, np.nan], 0.0, math.pi / 2)
    line = np.array([[[1.0, -0.1], [1.0, 0.1]]])
    grid = Grid.drawn(line, [(scan, (0.025, 0.025, 0.0))], 0.05)
    x, y, _ = grid.origin
    row, column = round(-y / 0.05), round(-x / 0.05)
    assert (grid.cells[row, column : column + 19] == 0).all()
    assert grid.cells[row, column + 20] == 100
    assert (grid.cells[row + 1 : row + 5, column] == 0).all()
    assert (grid.cells[:, :column] == -1).all()
    for resolution in (0, 50, math.nan, math.inf):
        with pytest.raises(ValueError, match=f"resolution is {resolution} m a cell, expected 0.00"):
            Grid.drawn(line, resolution=resolution)
    for name in ("m", "m.pgm", "m.png"):
        with pytest.raises(ValueError, match=f"{name}: is the name of no grid, expected an end"):
            grid.write(name)
    with pytest.raises(ln.LineamentError, match="cells, more than the limit of 90"):
        Grid.drawn(line, limits=Limits(cells=90))


PLANS = Path(os.environ.get("LINEAMENT_DATA", "../shared/data"), "..", "plans")


@pytest.mark.skipif(not (PLANS / "depot.yaml").exists(), reason="there are no plans of robots")
@pytest.mark.parametrize(
    ("name", "size", "metres", "longest"),
    [
        ("depot", (30.1, 15.2), (280, 360), 10.0),  # racks, boxes and columns in one hall
        ("warehouse", (30.1, 50.1), (420, 520), 20.0),  # cells of 3 cm
        ("tb3_sandbox", (5.6, 5.1), (20, 32), 1.5),  # a hexagon around nine columns
        ("stata_basement", (85.8, 42.0), (450, 600), 10.0),  # turned by 180°, colours, broken walls
        pytest.param(  # furniture, walls of one to three cells
            *("building_31", (30.3, 31.5), (500, 800), 4.0), marks=pytest.mark.slow
        ),
        ("testmap", (1.2, 1.0), (2, 4), 0.6),  # turned by 1 rad
    ],
)
@pytest.mark.filterwarnings("ignore:.* is its resolution right")
def test_plans_of_robots_have_their_walls(name, size, metres, longest):
    plan = LineMap.read(PLANS / f"{name}.yaml")
    np.testing.assert_allclose(plan.size, size, atol=0.15)
    lengths = np.linalg.norm(plan.ends[:, 1] - plan.ends[:, 0], axis=1)
    assert metres[0] < lengths.sum() < metres[1]
    assert lengths.max() > longest


@pytest.mark.skipif(not (PLANS / "depot.yaml").exists(), reason="there are no plans of robots")
def test_a_grid_without_its_image_names_it():
    with pytest.raises(ln.LineamentError, match=r"invalid_image\.yaml: invalid\.png: No such file"):
        LineMap.read(PLANS / "invalid_image.yaml")


WORLD = World([[-3, -2, 3, -2], [3, -2, 3, 1.5], [3, 1.5, 1, 1.5], [1, 1.5, 1, 2.5],
               [1, 2.5, -3, 2.5], [-3, 2.5, -3, -2]])  # fmt: skip


@pytest.mark.slow
def test_commands_write_a_grid_and_find_a_drive_on_it(tmp_path, refused):
    log, target = tmp_path / "log.npz", tmp_path / "map.yaml"
    way = [(-2, 0), (1.0, 0.5), (-2, 1), (1.0, -1)]
    scans = list(drive(WORLD, way, SENSORS["utm30lx"], speed=0.5, rate=2))
    save_log(log, scans)
    assert run(["map", str(log), "-o", str(target), "-q"]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.npz", "map.pgm", "map.yaml"]
    grid = Grid.read(target)
    assert 0.6 * 26 / 0.05**2 < grid.free.sum() < 26 / 0.05**2
    plan = LineMap.read(target)
    long = np.linalg.norm(plan.ends[:, 1] - plan.ends[:, 0], axis=1) > 1.5
    assert 5 <= long.sum() <= 7
    where = str(tmp_path / "where.csv")
    assert run(["locate", str(log), "--map", str(target), "-o", where, "-q"]) == 0
    assert run(["map", str(log), "-o", str(tmp_path / "b.dxf"), "--onto", str(target), "-q"]) == 0
    said = refused(["map", log, "-o", target, "--onto", target, "-q"])
    assert "map.yaml, which is read" in said
