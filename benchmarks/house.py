"""The picture of the house in CONTRIBUTING, from the real imports: ``make house``.

Each room is a package or module at the top of `lineament`, with the first sentence of its
docstring, on the floor that the contract in pyproject.toml gives it. A line leads from a room to
each room below that it imports, unless a room between them leads there too. Those to the lowest
floor, which every room may import, are left out.
"""

from __future__ import annotations

import ast
import html
import sys
import tomllib
from itertools import pairwise
from pathlib import Path
from textwrap import wrap

import grimp

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "house.svg"
WIDTH, HIGH, GAP, MARGIN = 1160, 76, 44, 20
STYLE = """
  svg { background: #fff; font: 12px system-ui, sans-serif; fill: #24292f; }
  rect { fill: #eef3f8; stroke: #5a7fa5; } path { fill: none; stroke: #8a97a5; stroke-width: 1.2; }
  .name { font-weight: 600; font-size: 14px; }
  @media (prefers-color-scheme: dark) {
    svg { background: #0d1117; fill: #e6edf3; }
    rect { fill: #182433; stroke: #5a7fa5; } path { stroke: #6e7b88; } }
"""


def floors() -> list[list[str]]:
    """Return the rooms of each floor, from the roof down, as the contract has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract = settings["tool"]["importlinter"]["contracts"][0]
    return [[r.strip() for r in row.replace(":", "|").split("|")] for row in contract["layers"]]


def sentence(room: str) -> str:
    """Return the first sentence of a room's docstring."""
    place = ROOT / "src" / "lineament" / room
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    doc = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    text = " ".join(doc.split("\n\n")[0].split()).replace("`", "").replace("et al. ", "et al.\xa0")
    return text.split(". ")[0].rstrip(".")


def imports() -> dict[str, set[str]]:
    """Return the rooms that each room imports, without those that one of them leads to."""
    graph = grimp.build_graph("lineament", cache_dir=None)
    rooms = [room for floor in floors() for room in floor]
    direct: dict[str, set[str]] = {room: set() for room in rooms}
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            if module.count(".") and other.count("."):
                one, two = module.split(".")[1], other.split(".")[1]
                direct[one] |= {two} - {one}
    reached: dict[str, set[str]] = {}
    for room in reversed(rooms):  # what is below comes first
        reached[room] = direct[room].union(*(reached.get(r, set()) for r in direct[room]))
    return {
        room: {r for r in below if not any(r in reached.get(s, set()) for s in below - {r})}
        for room, below in direct.items()
    }


def draw() -> str:
    """Return the picture as SVG."""
    rows, boxes, places = floors(), [], {}
    for level, floor in enumerate(rows):
        wide = (WIDTH - MARGIN * (len(floor) + 1)) / len(floor)
        wide = min(wide, 560)
        left = (WIDTH - len(floor) * wide - (len(floor) - 1) * MARGIN) / 2
        for k, room in enumerate(floor):
            x, y = left + k * (wide + MARGIN), MARGIN + level * (HIGH + GAP)
            places[room] = x, y, wide
            lines = wrap(sentence(room), int(wide / 7.2))[:4]
            texts = [f'<text class="name" x="{x + 10:.0f}" y="{y + 20:.0f}">{room}</text>']
            texts += [
                f'<text x="{x + 10:.0f}" y="{y + 36 + 13 * n:.0f}">{html.escape(line)}</text>'
                for n, line in enumerate(lines)
            ]
            boxes.append(
                f'<rect x="{x:.0f}" y="{y:.0f}" width="{wide:.0f}" height="{HIGH}" rx="6"/>'
                + "".join(texts)
            )
    paths = []
    for room, below in imports().items():
        x, y, wide = places[room]
        below = {r for r in below if r not in rows[-1] and places[r][1] > y}
        ends = sorted(below, key=lambda r: places[r][:2])
        for k, other in enumerate(ends):
            a = x + wide * (k + 1) / (len(ends) + 1)
            left, top, size = places[other]
            b = min(max(a, left + 0.1 * size), left + 0.9 * size)
            start = y + HIGH
            bend = GAP if top - start <= GAP else 0.5 * (top - start)
            paths.append(
                f'<path d="M{a:.0f} {start:.0f} C{a:.0f} {start + bend:.0f} {b:.0f} '
                f'{top - bend:.0f} {b:.0f} {top:.0f}"><title>{room} → {other}</title></path>'
            )
    high = MARGIN + len(rows) * (HIGH + GAP)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {high}">'
    return "\n".join([head, f"<style>{STYLE}</style>", *paths, *boxes, "</svg>", ""])


def main() -> None:
    """Write the picture; with --check, complain if it is not as the imports are."""
    assert all(upper and lower for upper, lower in pairwise(floors()))
    if sys.argv[1:] != ["--check"]:
        PICTURE.write_text(draw(), encoding="utf-8")
    elif not PICTURE.exists() or PICTURE.read_text(encoding="utf-8") != draw():
        sys.exit("docs/house.svg is not as the imports are: run `make house`")


if __name__ == "__main__":
    main()
