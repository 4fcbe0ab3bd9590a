"""What a notebook shows: `plot` on axes of matplotlib, and scans, features and logs as HTML."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import LineamentError
from ..extractor import extract
from ..features import Features
from ..logs import Log, open_log
from ..methods import DEFAULT_METHOD, Method
from ..output import canvas, drawing
from ..output.canvas import ARC_COLOR, CORNER_COLOR, EDGE_COLOR, PALETTE, ROUND, count
from ..output.markers import Markers, markers_of
from ..output.markup import escape
from ..output.svg import layers
from ..scan import Array, LaserScan, NoiseLike

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Largest size of a picture, and the margin around what it shows [px].
WIDTH, HEIGHT, MARGIN = 640.0, 420.0, 12.0
#: Least width: the bar and the legend have room below.
_LEAST_WIDTH, _FOOT = 440.0, 22.0
#: Points beyond this share of the ranges, by this factor, do not shrink the picture.
_SHARE, _FACTOR = 0.97, 1.6
#: Rows of a kind in the table below a picture of features.
MOST_ROWS = 5
_LEGEND = {"ncols": 4, "fontsize": 8, "frameon": False, "borderaxespad": 0}
#: Readable on white and on black.
_BREAK_COLOR, _NOISE_COLOR = "#b5832a", "#8b949e"


def plot(
    source: str | os.PathLike[str] | Log | LaserScan | Features,
    scan: int | LaserScan | None = None,
    *,
    ax: Axes | None = None,
    method: str | Method = DEFAULT_METHOD,
    noise: NoiseLike | None = None,
    **parameters: Any,
) -> Axes:
    """Draw a scan and its features, on axes of matplotlib.

    Parameters
    ----------
    source : path, log, LaserScan or Features
        What holds the scan. Features are drawn as they are, over the scan that they have.
    scan : int or LaserScan, optional
        Of a log the index of the scan, 0 by default; of features the scan where they have none.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure of pyplot by default.
    method, noise, **parameters
        As in `lineament.Extractor`; they matter where features are yet to be extracted.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    TypeError
        If the source is something else. The message says what to pass.
    ValueError
        If the features are of a scan with another number of beams.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0] * 50, angle_min=-0.125, angle_increment=0.005)
    >>> ln.plot(scan, method="liu").get_xlabel()
    'x [m]'
    """
    if isinstance(source, Features):
        features, title = source, ""
        seen = scan if isinstance(scan, LaserScan) else source.scan
    else:
        seen, title = _scan_of(source, scan)
        name = method if isinstance(method, str) else method.name
        title = " · ".join(filter(None, (title, name)))
        features = extract(seen, method=method, noise=noise, **parameters)
    if seen is not None and len(seen) != len(features.clusters):
        beams = len(features.clusters)
        raise ValueError(f"scan has {len(seen)} beams, expected the {beams} of the features")
    from matplotlib.transforms import offset_copy

    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.subplots(figsize=(7, 6), layout="constrained")[1]
    if seen is None:
        drawing.draw_sensor(ax)
        marks = markers_of(features)
        shown = np.vstack([marks.segments.reshape(-1, 2), marks.corners, np.zeros((1, 2))])
    else:
        shown = drawing.draw_beams(ax, seen, features.clusters)
    about = f"{_counts(features)} · {features.stamp:.3f} s"
    canvas.style_plane(ax, title or "Features", about, shown)
    extent = float(np.ptp(shown, axis=0).max())
    drawing.draw_features(ax, features, seen or LaserScan([], 0.0, 1.0), extent)
    below = offset_copy(ax.transAxes, ax.get_figure(root=True), y=-32, units="points")
    ax.legend(loc="upper left", bbox_to_anchor=(0, 0), bbox_transform=below, **_LEGEND)
    return ax


def _scan_of(source: Any, index: Any) -> tuple[LaserScan, str]:
    """Return a scan, and what it is called."""
    if isinstance(source, LaserScan):
        return source, source.frame_id
    if isinstance(source, str | os.PathLike):
        source = open_log(source)
    if not isinstance(source, Log):
        raise TypeError(
            f"source is of type {type(source).__name__}, expected a path, a log, a LaserScan, or "
            "Features"
        )
    number = 0 if index is None else index
    return source[number], f"{os.path.basename(source.name)} · scan {number}"  # noqa: PTH119


def picture(shown: Features | LaserScan | Log) -> str:
    """Return a picture and a table as HTML that needs nothing else: what notebooks show.

    Of a log the first scan is drawn. Features of scans are those of the default method.
    """
    if isinstance(shown, Features):
        return _page(
            f"{_counts(shown)} · {shown.stamp:.3f} s", svg(shown.scan, shown), _rows(shown)
        )
    if isinstance(shown, LaserScan):
        found = extract(shown)
        return _page(_title(shown), svg(shown, found), _facts(_about(shown)) + _rows(found))
    facts, drawn = {"format": shown.format}, ""
    try:
        facts["topics"] = ", ".join(shown.topics)
        facts["scans"] = f"{len(shown)}, the first is drawn" if len(shown) else "none"
        if len(shown):
            found = extract(first := shown[0])
            drawn = svg(first, found)
            facts["features"] = _counts(found)
    except LineamentError as error:
        facts["error"] = str(error)
    return _page(shown.name, drawn, _facts(facts))


def svg(scan: LaserScan | None, features: Features) -> str:
    """Draw the beams of a scan by cluster, and features over them, as SVG for light and dark.

    A few points that are much farther than the others are left outside.
    """
    points = np.zeros((0, 2)) if scan is None else scan.points
    valid = np.isfinite(points).all(axis=1)
    labels = features.clusters[: len(points)]
    marks = markers_of(features, scan)
    near = np.vstack(
        [points[valid], marks.segments.reshape(-1, 2), marks.corners, np.zeros((1, 2))]
    )
    distance = np.hypot(*near.T)
    near = near[distance <= _FACTOR * np.quantile(distance, _SHARE)]
    low, high = near.min(axis=0), near.max(axis=0)
    extent = np.maximum(high - low, 0.05)
    scale = min((WIDTH - 2 * MARGIN) / extent[0], (HEIGHT - 2 * MARGIN) / extent[1])
    size = np.maximum(extent * scale + 2 * MARGIN, (_LEAST_WIDTH, 6 * MARGIN))
    middle = (low + high) / 2

    def place(at: Array) -> Array:
        """Turn metres into pixels: y runs down."""
        return np.asarray((at - middle) * (scale, -scale) + size / 2)

    width, height = size.round().astype(int).tolist()
    rings = features.breakpoints["position"]
    rings = place(rings[np.isfinite(rings).all(axis=1)])
    x, y = place(np.zeros(2))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height + _FOOT:.0f}" '
        f'viewBox="0 0 {width} {height + _FOOT:.0f}" style="max-width:100%" role="img">',
        f'<svg width="{width}" height="{height}">',  # cuts off what is too far away
        *_dots(place(points[valid]), labels[valid]),
        *_features(marks, place(np.zeros(2)), scale),
        *(
            f'<circle cx="{u:.1f}" cy="{v:.1f}" r="2" fill="none" stroke="{_BREAK_COLOR}"/>'
            for u, v in rings
        ),
        f'<path d="M{x - 4:.1f} {y - 4:.1f}l10 4l-10 4z" fill="currentColor"/></svg>',
        *_foot(height, width / scale, scale, features),
        "</svg>",
    ]
    return "\n".join(parts)


def _dots(points: Array, labels: Any) -> Iterator[str]:
    """Draw points as dots in the colour of their cluster, one path a colour."""
    for label in np.unique(labels):
        color = _NOISE_COLOR if label < 0 else PALETTE[label % len(PALETTE)]
        dots = dict.fromkeys(f"M{x:.1f} {y:.1f}h0" for x, y in points[labels == label])
        yield (
            f'<path d="{"".join(dots)}" stroke="{color}" stroke-width="2.6" '
            'stroke-linecap="round" fill="none"/>'
        )


def _features(marks: Markers, origin: Array, scale: float) -> Iterator[str]:
    """Draw lines, arcs, ellipses, and diamonds, in metres from an origin [px]."""
    shown = replace(marks, ellipses=marks.ellipses[marks.ellipses[:, 2] * scale > 4])
    sizes = {"edges": 3 / scale, "corners": 4.5 / scale}  # of diamonds: they hide what is smaller
    looks = {
        "walls": ("currentColor", 1.0),
        "arcs": (ARC_COLOR, 2.0),
        "ellipses": (f'{CORNER_COLOR}" fill="{CORNER_COLOR}22', 1.0),
        "edges": (EDGE_COLOR, 1.4),
        "corners": (CORNER_COLOR, 1.4),
    }
    x, y = origin
    yield f'<g fill="none" transform="matrix({scale:.9g} 0 0 {-scale:.9g} {x:.9g} {y:.9g})">'
    for name, elements in layers(shown, lambda name, x, y: _diamond(x, y, sizes[name])):
        color, width = looks[name]
        yield f'<g class="{name}" stroke="{color}" stroke-width="{width / scale:.3g}">'
        yield from elements
        yield "</g>"
    yield "</g>"


def _diamond(x: float, y: float, size: float) -> str:
    s = f"{size:.3g}"
    return f'<path d="M{x:.6f} {y - size:.6f}l{s} {s}l-{s} {s}l-{s} -{s}z"/>'


def _foot(top: float, across: float, scale: float, features: Features) -> Iterator[str]:
    """Draw a bar of a round length, and a legend of what there is."""
    length = max(length for length in ROUND if length <= across / 5)
    y, end = top + 12, MARGIN + scale * length
    yield f'<path d="M{MARGIN} {y - 4}v4H{end:.1f}v-4" fill="none" stroke="currentColor"/>'
    counts = features.counts()
    legend = [
        f'<tspan fill="{color}" dx="9">{sign}</tspan> {name}'
        for name, sign, color in (
            ("segments", "\u2014", "currentColor"),
            ("corners", "\u25c7", CORNER_COLOR),
            ("edges", "\u25c7", EDGE_COLOR),
            ("arcs", "\u2312", ARC_COLOR),
            ("breakpoints", "\u25cb", _BREAK_COLOR),
        )
        if counts[name]
    ]
    yield (
        f'<text x="{end + 6:.1f}" y="{y:.0f}" font-family="sans-serif" font-size="11" '
        f'fill="currentColor">{length:g} m{"".join(legend)}</text>'
    )


def _page(title: str, drawn: str, below: str) -> str:
    head = f"<div><b>{escape(title)}</b></div>"
    return f'<div style="font-size:13px">{head}\n{drawn}\n{below}</div>'


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    titles = "".join(f"<th>{escape(text)}</th>" for text in head)
    lines = [f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows]
    style = "font-size:12px;text-align:right;border-collapse:collapse"
    return f'<table cellpadding="4" style="{style}"><tr>{titles}</tr>{"".join(lines)}</table>'


def _facts(facts: dict[str, str]) -> str:
    return _table((), facts.items())


def _title(scan: LaserScan) -> str:
    return f"{count(len(scan), 'beam')}, {int(scan.valid.sum())} valid · {scan.stamp:.3f} s"


def _about(scan: LaserScan) -> dict[str, str]:
    """Describe the fields of a scan."""
    seen = scan.ranges[scan.valid]
    ends = [math.degrees(angle) for angle in scan.angles[[0, -1]]] if len(scan) else [0.0, 0.0]
    facts = {
        "bearings": f"{ends[0]:.1f}° to {ends[1]:.1f}°",
        "step": f"{math.degrees(scan.angle_increment):.4g}°{' (median)' * (not scan.is_regular)}",
        "ranges": f"{seen.min():.2f} to {seen.max():.2f} m" if len(seen) else "none",
        "limits": f"{scan.range_min:g} to {scan.range_max:g} m",
    }
    if scan.frame_id:
        facts["frame"] = scan.frame_id
    if scan.pose:
        x, y, theta = scan.pose
        facts["pose"] = f"{x:.3f} m, {y:.3f} m, {math.degrees(theta):.2f}°"
    return facts


def _rows(features: Features) -> str:
    """Make the table of the longest segments, the best corners and edges, the largest arcs."""
    rows, total = [], 0
    for name, by, at, deviation in (
        ("segments", "length", "centroid", (0, 0)),
        ("corners", "quality", "position", None),
        ("edges", "quality", "position", None),
        ("arcs", "radius", "center", (2, 2)),
    ):
        table = features[name]
        total += len(table)
        for one in table[np.argsort(-table[by], kind="stable")[:MOST_ROWS]]:
            spread = one["covariance"]
            variance = np.trace(spread) / 2 if deviation is None else spread[deviation]
            sigma = f"{1000 * math.sqrt(variance):.1f}" if variance >= 0 else ""
            x, y = one[at]
            kind = one["kind"] if name == "corners" else name[:-1]
            rows.append((kind, f"{x:.3f}", f"{y:.3f}", _what(name, one), sigma))
    left = total - len(rows)
    note = f"<p>{left} more: <code>.to_pandas()</code></p>" if left else ""
    return _table(("", "x [m]", "y [m]", "", "σ [mm]"), rows) + note


def _what(name: str, one: np.void) -> str:
    """Describe a feature by what its kind has besides a place."""
    if name == "segments":
        return (
            f"{one['length']:.3f} m at {math.degrees(one['angle']):.1f}°, {one['n_points']} beams"
        )
    if name == "arcs":
        return f"radius {one['radius']:.3f} m, {one['n_points']} beams"
    if name == "edges":
        return f"{one['side']} of segment {one['segment']}, quality {one['quality']:.2f}"
    return f"{math.degrees(one['opening']):.1f}°, quality {one['quality']:.2f}"


def _counts(features: Features) -> str:
    numbers = features.counts()
    return ", ".join(count(n, name[:-1]) for name, n in numbers.items() if n) or "nothing found"
