"""Empty figures and whole picture files, without a display or the global state of matplotlib."""

from __future__ import annotations

import io
import math
import os
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ..files import ending_of, naming_errors, written_beside
from ..scan import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, FAINT, GRID = "#1b1f24", "#9aa1a9", "#e9ecef"
CORNER_COLOR, EDGE_COLOR = "#d1242f", "#eba0a5"
BREAK_COLOR, ARC_COLOR, WAY_COLOR = "#8a5a00", "#8250df", "#0969da"
_TEXT_COLOR, _FRAME_COLOR = "#57606a", "#d0d7de"

#: Colours of clusters; neighbours in this list are easy to tell apart, also with colour blindness.
PALETTE = np.array(
    [
        *("#4477aa", "#ee9933", "#228833", "#cc6699", "#33a9c9"),
        *("#aa7744", "#8866bb", "#a3a22a", "#dd6655", "#44aa88"),
    ]
)

#: Endings of picture files, with what keeps their bytes the same from run to run.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}
#: The endings of pictures.
PICTURE_ENDINGS = tuple(_METADATA)
DPI = 150
#: Of the pictures of pages; those of this width [inch] are legible in print, on 7 inches.
PAGE_DPI, PAGE_WIDTH = 200, 9.0


def check_ending(path: str | os.PathLike[str]) -> str:
    """Return the ending of a picture file; a LineamentError if it is not known."""
    return ending_of(path, PICTURE_ENDINGS)


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure [inch] that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure: the whole file, or none."""
    import matplotlib as mpl

    ending = check_ending(path)
    with (
        written_beside(path) as temporary,
        naming_errors(path),
        mpl.rc_context({"svg.hashsalt": "lineament"}),
    ):
        _write(figure, temporary, ending, DPI)


def figure_bytes(figure: Figure, dpi: int = PAGE_DPI) -> bytes:
    """Return a figure as the bytes of a PNG file, and free its memory."""
    buffer = io.BytesIO()
    _write(figure, buffer, ".png", dpi)
    figure.clear()
    return buffer.getvalue()


def _write(figure: Figure, file: Path | IO[bytes], ending: str, dpi: int) -> None:
    figure.savefig(
        file,
        format=ending[1:],
        dpi=dpi,
        metadata=_METADATA[ending],
        bbox_inches="tight",
        pad_inches=0.15,
    )


def settle(figure: Figure) -> None:
    """Give all panels their final places, so that labels can be put among points."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")


def style(axes: Axes, title: str, subtitle: str = "", xlabel: str = "", ylabel: str = "") -> None:
    """Give a panel its title, the names of its axes, a light grid, and quiet edges."""
    axes.set_title(
        title, loc="left", fontsize=12, fontweight="bold", color=INK, pad=20 if subtitle else 6
    ).set_parse_math(False)
    if subtitle:
        axes.annotate(
            subtitle,
            (0, 1),
            xytext=(0, 7),
            xycoords="axes fraction",
            textcoords="offset points",
            fontsize=8.5,
            color=_TEXT_COLOR,
        )
    axes.set_xlabel(xlabel, fontsize=9, color=_TEXT_COLOR)
    axes.set_ylabel(ylabel, fontsize=9, color=_TEXT_COLOR)
    axes.grid(color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, color=FAINT, labelcolor=_TEXT_COLOR)
    for spine in axes.spines.values():
        spine.set_color(_FRAME_COLOR)


def style_plane(axes: Axes, title: str, subtitle: str, points: Array) -> None:
    """Make a panel a plan in metres that shows all of these points (n, 2), of equal axes."""
    style(axes, title, subtitle, "x [m]", "y [m]")
    points = points[np.isfinite(points).all(axis=1)]
    points = points if len(points) else np.array([[-1.0, -1.0], [1.0, 1.0]])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(0.04 * float((high - low).max()), 0.05)
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal", adjustable="box")


def plane_height(points: Array, width: float) -> float:
    """Return the height [inch] of a panel of some width that shows these points, within reason."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        return width
    extent = np.ptp(points, axis=0)
    extent += 0.08 * extent.max() + 1e-9
    inside = 0.86 * width  # the rest is for the numbers at the axis
    return float(np.clip(inside * extent[1] / extent[0], 0.4 * width, 1.4 * width))


def add_legend(figure: Figure) -> None:
    """Draw one legend for all panels of a figure, below them."""
    handles = {
        str(label): handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    width = sum(0.6 + 0.08 * len(label) for label in handles)  # of one line [inch], about
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower center",
        ncols=max(1, math.ceil(len(handles) / math.ceil(width / figure.get_figwidth()))),
        fontsize=9,
        frameon=False,
    )


def count(number: int, one: str) -> str:
    """Write a number of things: 1 cluster, 2 clusters."""
    return f"{number} {one}" if number == 1 else f"{number} {one}s"
