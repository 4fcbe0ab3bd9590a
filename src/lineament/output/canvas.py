"""Empty figures and whole picture files, without a display or the global state of matplotlib."""

from __future__ import annotations

import io
import math
import os
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..files import ending_of, naming_errors, written_beside
from ..scan import Array

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Theme(NamedTuple):
    """The colours of a picture: its paper, texts and lines, marks of features, clusters.

    `gap` is what lies before no return; neighbours in the `palette` of clusters are easy to set
    apart. Kinds of marks differ in shape, too.
    """

    paper: str
    ink: str
    text: str
    faint: str
    grid: str
    frame: str
    gap: str
    corner: str
    edge: str
    breakpoint: str
    arc: str
    way: str
    palette: NDArray[np.str_]


#: Colours of Paul Tol's schemes, which stay apart with colour blindness: "vibrant" for marks,
#: "muted" for clusters on white, "light" on black (https://personal.sron.nl/~pault).
LIGHT = Theme(
    paper="#ffffff",
    ink="#1b1f24",
    text="#57606a",
    faint="#9aa1a9",
    grid="#e9ecef",
    frame="#d0d7de",
    gap="#f1f3f5",
    corner="#cc3311",
    edge="#eb9f8f",
    breakpoint="#7a5200",
    arc="#aa3377",
    way="#0077bb",
    palette=np.array([
        "#332288", "#cc6677", "#88ccee", "#117733", "#aa4499", "#999933", "#882255", "#ddcc77",
        "#44aa99",
    ]),
)  # fmt: skip
DARK = Theme(
    paper="#0d1117",
    ink="#e6edf3",
    text="#9aa4af",
    faint="#6e7681",
    grid="#21262d",
    frame="#30363d",
    gap="#1a2029",
    corner="#ee7733",
    edge="#94552f",
    breakpoint="#ffd37a",
    arc="#ee3377",
    way="#33bbee",
    palette=np.array([
        "#77aadd", "#ee8866", "#99ddff", "#aaaa00", "#ffaabb", "#bbcc33", "#44bb99", "#eedd88",
    ]),
)  # fmt: skip
INK, FAINT, GRID = LIGHT.ink, LIGHT.faint, LIGHT.grid
CORNER_COLOR, EDGE_COLOR, ARC_COLOR = LIGHT.corner, LIGHT.edge, LIGHT.arc
BREAK_COLOR, PALETTE = LIGHT.breakpoint, LIGHT.palette

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
#: Least and largest height of a plan, of its width; one that is out of shape by more than
#: `_OUT_OF_SHAPE` has its shorter side drawn larger, by a round factor.
_LEAST_SHAPE, _LARGEST_SHAPE, _OUT_OF_SHAPE = 0.4, 1.4, 3.0
_FEW = 9
#: Round numbers: of scales, of factors, and of lengths of bars.
ROUND = [step * 10.0**power for power in range(-4, 11) for step in (1, 2, 5)]


def check_ending(path: str | os.PathLike[str]) -> str:
    """Return the ending of a picture file; a LineamentError if it is not known."""
    return ending_of(path, PICTURE_ENDINGS)


def new_figure(width: float, height: float, *, dark: bool = False) -> Figure:
    """Make an empty figure [inch] that needs no display, on white paper or on black."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    paper = (DARK if dark else LIGHT).paper
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor=paper)
    FigureCanvasAgg(figure)
    return figure


def new_panels(count: int, columns: int, height: float = 1.0, **given: Any) -> tuple[Figure, Any]:
    """Make a figure as wide as a page, and so many panels (n,) in it, at most `columns` in a row.

    Their `height` is that of a row, of the width of a column.
    """
    rows = max(math.ceil(count / columns), 1)
    figure = new_figure(PAGE_WIDTH, PAGE_WIDTH * height * rows / columns)
    panels = figure.subplots(rows, columns, squeeze=False, **given).ravel()
    for axes in panels[count:]:
        axes.remove()
    return figure, panels[:count]


def theme_of(artist: Artist) -> Theme:
    """Return the colours that can be seen on the paper of a figure, whoever made it."""
    from matplotlib.colors import to_rgba

    figure = artist.get_figure(root=True)
    assert figure is not None
    *rgb, alpha = to_rgba(figure.get_facecolor())
    return DARK if alpha > 0.5 and sum(rgb) < 1.5 else LIGHT


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
    _fill(figure)
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
    _fill(figure)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")


def fitting(text: str, size: float, width: float) -> float:
    """Return the size [points], at most this one, at which a text is not wider than that [inch]."""
    return min(size, 110 * width / max(len(text), 1))


def _fill(figure: Figure) -> None:
    """Let the plans of a figure show more than they must where that fills their places.

    Bytes of a file's name that are not text become question marks, as matplotlib draws text alone.
    """
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_text(text.get_text().encode(errors="replace").decode())
    for axes in figure.axes:
        if axes.get_aspect() != "auto":
            axes.get_xlim()  # which are settled by this, and not scaled again
            axes.set_autoscale_on(True)  # else matplotlib warns that it changes them
            axes.set_adjustable("datalim")


def style(axes: Axes, title: str, subtitle: str = "", xlabel: str = "", ylabel: str = "") -> None:
    """Give a panel its title, the names of its axes, a light grid, and quiet edges."""
    theme, figure = theme_of(axes), axes.get_figure(root=True)
    assert figure is not None
    width = figure.get_figwidth() * axes.get_position().width / 0.85  # about, once it has its place
    axes.set_facecolor(theme.paper)
    axes.set_title(
        title,
        loc="left",
        fontsize=fitting(title, 12, width),
        fontweight="bold",
        color=theme.ink,
        pad=20 if subtitle else 6,
    ).set_parse_math(False)
    if subtitle:
        axes.annotate(
            subtitle,
            (0, 1),
            xytext=(0, 7),
            xycoords="axes fraction",
            textcoords="offset points",
            fontsize=fitting(subtitle, 8.5, 1.15 * width),
            color=theme.text,
        )
    axes.set_xlabel(xlabel, fontsize=9, color=theme.text)
    axes.set_ylabel(ylabel, fontsize=9, color=theme.text)
    axes.grid(color=theme.grid, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=8, color=theme.faint, labelcolor=theme.text)
    for spine in axes.spines.values():
        spine.set_color(theme.frame)


def style_plane(axes: Axes, title: str, subtitle: str, points: Array) -> None:
    """Make a panel a plan in metres that shows all of these points (n, 2).

    Its axes are equal, but for points along a line (a corridor): across it they are drawn larger
    by a round factor, which stands at the axis.
    """
    low, high = _bounds(points)
    aspect = _aspect(high - low)
    notes = (f", drawn {factor:g} ×" if factor > 1 else "" for factor in (1 / aspect, aspect))
    style(
        axes,
        title,
        subtitle,
        *(f"{name} [m]{note}" for name, note in zip("xy", notes, strict=True)),
    )
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect(aspect, adjustable="box")


def _bounds(points: Array) -> tuple[Array, Array]:
    """Return the least and the largest x and y of points, with a margin."""
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        points = np.zeros((1, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    extent = high - low
    if not extent.any():
        return low - 1, high + 1
    # Few points have no shape, and a plan is never a mere line.
    least = (0.5 if len(points) < _FEW else 0.01) * float(extent.max())
    margin = 0.04 * extent + np.maximum(least - extent, 0) / 2
    return low - margin, high + margin


def _aspect(extent: Array) -> float:
    """Return how much larger y is drawn than x: 1 in a plan that is not out of shape."""
    shape = float(extent[1] / extent[0])
    excess = max(_LEAST_SHAPE / shape, shape / _LARGEST_SHAPE)
    if excess < _OUT_OF_SHAPE:
        return 1.0
    factor = max(factor for factor in ROUND if factor <= excess)
    return factor if shape < 1 else 1 / factor


def plane_height(points: Array, width: float) -> float:
    """Return the height [inch] of a panel of some width that shows these points, within reason."""
    low, high = _bounds(points)
    extent = high - low
    inside = 0.9 * width  # the rest is for the numbers at the axis
    shape = _aspect(extent) * extent[1] / extent[0]
    return float(np.clip(inside * shape, _LEAST_SHAPE * width, _LARGEST_SHAPE * width))


def add_legend(figure: Figure, note: str = "") -> None:
    """Draw one legend for all panels of a figure, below them, and a note above it."""
    handles = {
        str(label): handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    look = _legend_look(figure, list(handles), figure.get_figwidth())
    legend = figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower center",
        fontsize=9,
        title=note or None,
        title_fontsize=8.5,
        **look,
    )
    legend.get_title().set_color(theme_of(figure).text)


def add_own_legend(axes: Axes, width: float) -> None:
    """Draw the legend of a panel of some width [inch], below the name of its x axis."""
    from matplotlib.transforms import ScaledTranslation

    figure = axes.get_figure(root=True)
    assert figure is not None
    labels = [str(label) for label in axes.get_legend_handles_labels()[1]]
    if labels:
        axes.legend(
            fontsize=8,
            loc="upper left",
            bbox_to_anchor=(0, 0),
            bbox_transform=axes.transAxes + ScaledTranslation(0, -0.45, figure.dpi_scale_trans),
            borderaxespad=0,
            **_legend_look(axes, labels, 0.9 * width),
        )


def _legend_look(artist: Artist, labels: list[str], width: float) -> dict[str, Any]:
    """Return how a legend of these labels looks: in as few rows of some width [inch] as hold it."""
    total = sum(0.6 + 0.08 * len(label) for label in labels)  # of one row [inch], about
    columns = max(1, math.ceil(len(labels) / math.ceil(total / width)))
    return {"ncols": columns, "frameon": False, "labelcolor": theme_of(artist).ink}


def count(number: int, one: str) -> str:
    """Write a number of things: 1 cluster, 2 clusters."""
    return f"{number} {one}" if number == 1 else f"{number} {one}s"
