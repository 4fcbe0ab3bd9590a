"""SVG: a plan to scale on a sheet of A3, with its layers as groups."""

import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np

from ..scan import Array
from .canvas import ARC_COLOR, CORNER_COLOR, EDGE_COLOR, INK, ROUND
from .markers import Markers
from .markup import escape
from .plans import Plan, PlanWriter

#: The plan and the room below it for scale and caption, and the margin, of a sheet of A3 [mm].
WIDTH, HEIGHT, FOOT, MARGIN = 400.0, 260.0, 17.0, 10.0
#: Widths of lines and radius of a corner on paper [mm].
WALL_LINE, THIN_LINE, CORNER_DOT = 0.45, 0.2, 0.4


class SvgWriter(PlanWriter):
    """Writes walls, arcs, corners, edges and ellipses in metres, x to the right and y upwards.

    The group that they are in is turned and scaled to the paper. Numbers are rounded to 1 µm.
    """

    def _draw(self, temporary: Path, plan: Plan) -> None:
        text = "\n".join(_document(plan)) + "\n"
        temporary.write_text(text, encoding="utf-8", newline="\n")


def _document(plan: Plan) -> Iterator[str]:
    points = plan.markers.points
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else np.zeros((2, 2))
    extent = np.maximum(high - low, 1e-3)
    least = max(1000 * extent[0] / WIDTH, 1000 * extent[1] / HEIGHT, 1.0)
    scale = min(scale for scale in ROUND if scale >= least)
    per_metre = 1000 / scale
    width = max(per_metre * extent[0], 120.0) + 2 * MARGIN  # room for the caption
    height = per_metre * extent[1] + 2 * MARGIN + FOOT
    left, top = MARGIN - per_metre * low[0], MARGIN + per_metre * high[1]
    yield (
        '<svg xmlns="http://www.w3.org/2000/svg"'
        ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
        f' width="{_n(width)}mm" height="{_n(height)}mm" viewBox="0 0 {_n(width)} {_n(height)}">'
    )
    yield f"<title>{escape(plan.caption)}</title>"
    yield '<rect width="100%" height="100%" fill="white"/>'
    yield (
        f'<g transform="matrix({_n(per_metre)} 0 0 {_n(-per_metre)} {_n(left)} {_n(top)})"'
        f' fill="none" stroke-linecap="round" stroke-width="{_n(WALL_LINE / per_metre)}">'
    )
    thin, dot = f'stroke-width="{_n(THIN_LINE / per_metre)}"', CORNER_DOT / per_metre
    inks = {
        "walls": f'stroke="{INK}"',
        "arcs": f'stroke="{ARC_COLOR}"',
        "ellipses": f'stroke="{CORNER_COLOR}" {thin}',
        "edges": f'fill="{EDGE_COLOR}"',
        "corners": f'fill="{CORNER_COLOR}"',
    }
    for name, elements in layers(plan.markers, lambda _, x, y: _circle(x, y, dot), plan.views):
        yield f'<g id="{name}" inkscape:groupmode="layer" inkscape:label="{name}" {inks[name]}>'
        yield from elements
        yield "</g>"
    yield "</g>"
    yield from _foot(MARGIN, height - MARGIN, scale, float(extent[0]), plan.caption)
    yield "</svg>"


def layers(
    markers: Markers, mark: Callable[[str, float, float], str], views: Iterable[int] = ()
) -> Iterator[tuple[str, Iterator[str]]]:
    """Yield name and elements of each layer, in metres, the lowest first.

    `mark(name, x, y)` draws a point. Lines say how often they were seen, where that is given.
    """
    seen = [f' data-views="{number}"' for number in views] or len(markers.segments) * [""]
    walls = zip(markers.segments, seen, strict=True)
    arcs = (_circle(*arc[:3]) if is_whole else _arc(*arc) for arc, is_whole in markers.arc_rows())
    yield "walls", (_line(ends, about) for ends, about in walls)
    yield "arcs", arcs
    yield "ellipses", (_ellipse(*ellipse) for ellipse in markers.ellipses)
    yield "edges", (mark("edges", x, y) for x, y in markers.edges)
    yield "corners", (mark("corners", x, y) for x, y in markers.corners)


def _line(ends: Array, about: str) -> str:
    (x1, y1), (x2, y2) = ends
    return f'<line x1="{_n(x1)}" y1="{_n(y1)}" x2="{_n(x2)}" y2="{_n(y2)}"{about}/>'


def _circle(x: float, y: float, r: float) -> str:
    return f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(r)}"/>'


def _arc(x: float, y: float, r: float, first: float, last: float) -> str:
    begin, end = (f"{_n(x + r * math.cos(a))} {_n(y + r * math.sin(a))}" for a in (first, last))
    is_large = int(last - first > math.pi)
    return f'<path d="M {begin} A {_n(r)} {_n(r)} 0 {is_large} 1 {end}"/>'


def _ellipse(x: float, y: float, a: float, b: float, direction: float) -> str:
    turn = f"translate({_n(x)} {_n(y)}) rotate({_n(math.degrees(direction))})"
    return f'<ellipse rx="{_n(a)}" ry="{_n(b)}" transform="{turn}"/>'


def _foot(x: float, y: float, scale: float, extent: float, caption: str) -> Iterator[str]:
    """Draw a bar of a round length, the scale, and the caption."""
    length = max(length for length in ROUND if length <= extent / 4)
    bar = 1000 * length / scale
    style = 'font-family="sans-serif" font-size="3.5"'
    ink = f'stroke="{INK}" stroke-width="0.35" fill="none"'
    about = f"{length:g} m, 1 : {scale:.0f}"
    yield f'<path d="M {_n(x)} {_n(y - 9)} v 2 h {_n(bar)} v -2" {ink}/>'
    yield f'<text x="{_n(x + bar + 2)}" y="{_n(y - 6.5)}" {style}>{about}</text>'
    yield f'<text x="{_n(x)}" y="{_n(y)}" {style}>{escape(caption)}</text>'


def _n(value: float) -> str:
    """Write a number, rounded to six decimals."""
    return f"{value:.6f}".rstrip("0").rstrip(".")
