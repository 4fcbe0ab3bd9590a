"""SVG: a plan to scale on a sheet of A3, with its layers as groups."""

from __future__ import annotations

import math
from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .canvas import ARC_COLOR, CORNER_COLOR, EDGE_COLOR, INK
from .plans import Plan, PlanWriter

__all__ = ["SvgWriter"]

#: The plan and the room below it for scale and caption, and the margin, of a sheet of A3 [mm].
WIDTH, HEIGHT, FOOT, MARGIN = 400.0, 260.0, 17.0, 10.0
#: Widths of lines and radius of a corner on paper [mm].
WALL_LINE, THIN_LINE, CORNER_DOT = 0.45, 0.2, 0.4


class SvgWriter(PlanWriter):
    """Writes walls, arcs, corners, edges and ellipses in metres, x to the right and y upwards.

    The group that they are in is turned and scaled to the paper. Numbers are rounded to 1 µm.
    """

    def _draw(self, temporary: Path, plan: Plan) -> None:
        temporary.write_text(_document(plan), encoding="utf-8", newline="\n")


def _document(plan: Plan) -> str:
    markers = plan.markers
    points = markers.points
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else np.zeros((2, 2))
    extent = np.maximum(high - low, 1e-3)
    scale = _scale(max(1000 * extent[0] / WIDTH, 1000 * extent[1] / HEIGHT))
    per_metre = 1000 / scale
    width = max(per_metre * extent[0], 120.0) + 2 * MARGIN  # room for the caption
    height = per_metre * extent[1] + 2 * MARGIN + FOOT
    left, top = MARGIN - per_metre * low[0], MARGIN + per_metre * high[1]
    x, y, dot = MARGIN, height - MARGIN, CORNER_DOT / per_metre
    return "\n".join(
        [
            '<svg xmlns="http://www.w3.org/2000/svg"'
            ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
            f' width="{_n(width)}mm" height="{_n(height)}mm"'
            f' viewBox="0 0 {_n(width)} {_n(height)}">',
            f"<title>{escape(plan.caption)}</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            f'<g transform="matrix({_n(per_metre)} 0 0 {_n(-per_metre)} {_n(left)} {_n(top)})"'
            f' fill="none" stroke-linecap="round" stroke-width="{_n(WALL_LINE / per_metre)}">',
            *_layer("walls", f'stroke="{INK}"', _walls(plan)),
            *_layer("arcs", f'stroke="{ARC_COLOR}"', _arcs(plan)),
            *_layer(
                "ellipses",
                f'stroke="{CORNER_COLOR}" stroke-width="{_n(THIN_LINE / per_metre)}"',
                _ellipses(plan),
            ),
            *_layer("edges", f'fill="{EDGE_COLOR}"', _dots(markers.edges, dot)),
            *_layer("corners", f'fill="{CORNER_COLOR}"', _dots(markers.corners, dot)),
            "</g>",
            *_foot(x, y, scale, float(extent[0]), plan.caption),
            "</svg>\n",
        ]
    )


def _scale(least: float) -> int:
    """Denominator 1, 2 or 5 times a power of ten that is at least this.

    Examples
    --------
    >>> _scale(71.2), _scale(200.0), _scale(0.3)
    (100, 200, 1)
    """
    power: int = 10 ** math.floor(math.log10(max(least, 1.0)))
    return min(power * step for step in (1, 2, 5, 10) if power * step >= least)


def _n(value: float) -> str:
    """Write a number, rounded to six decimals."""
    return f"{value:.6f}".rstrip("0").rstrip(".")


def _layer(name: str, style: str, lines: Iterator[str]) -> Iterator[str]:
    yield f'<g id="{name}" inkscape:groupmode="layer" inkscape:label="{name}" {style}>'
    yield from lines
    yield "</g>"


def _walls(plan: Plan) -> Iterator[str]:
    for ((x1, y1), (x2, y2)), views in zip(plan.markers.segments, plan.views, strict=True):
        yield (
            f'<line x1="{_n(x1)}" y1="{_n(y1)}" x2="{_n(x2)}" y2="{_n(y2)}" data-views="{views}"/>'
        )


def _arcs(plan: Plan) -> Iterator[str]:
    for x, y, r, first, last in plan.markers.arcs:
        if last - first >= 2 * math.pi - 1e-6:
            yield f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(r)}"/>'
            continue
        begin = f"{_n(x + r * math.cos(first))} {_n(y + r * math.sin(first))}"
        end = f"{_n(x + r * math.cos(last))} {_n(y + r * math.sin(last))}"
        is_large = int(last - first > math.pi)
        yield f'<path d="M {begin} A {_n(r)} {_n(r)} 0 {is_large} 1 {end}"/>'


def _dots(points: NDArray[np.float64], radius: float) -> Iterator[str]:
    for x, y in points:
        yield f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(radius)}"/>'


def _ellipses(plan: Plan) -> Iterator[str]:
    for x, y, a, b, direction in plan.markers.ellipses:
        turn = f"translate({_n(x)} {_n(y)}) rotate({_n(math.degrees(direction))})"
        yield f'<ellipse rx="{_n(a)}" ry="{_n(b)}" transform="{turn}"/>'


def _foot(x: float, y: float, scale: int, extent: float, caption: str) -> Iterator[str]:
    """Draw a bar of a round length, the scale, and what is drawn."""
    length = _bar(extent / 4)
    bar = 1000 * length / scale
    style = 'font-family="sans-serif" font-size="3.5"'
    ink = f'stroke="{INK}" stroke-width="0.35" fill="none"'
    yield f'<path d="M {_n(x)} {_n(y - 9)} v 2 h {_n(bar)} v -2" {ink}/>'
    yield (
        f'<text x="{_n(x + bar + 2)}" y="{_n(y - 6.5)}" {style}>{length:g} m, 1 : {scale}</text>'
    )
    yield f'<text x="{_n(x)}" y="{_n(y)}" {style}>{escape(caption)}</text>'


def _bar(most: float) -> float:
    """Length 1, 2 or 5 times a power of ten that is at most this."""
    power = 10.0 ** math.floor(math.log10(most))
    return max(power * step for step in (1, 2, 5) if power * step <= most)
