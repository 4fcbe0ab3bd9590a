"""Empty figures and whole picture files: no display, no global state of matplotlib."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from ..files import naming_errors, written_beside

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, FAINT, GRID = "#1b1f24", "#9aa1a9", "#e9ecef"
CORNER_COLOR, EDGE_COLOR = "#d1242f", "#eba0a5"
BREAK_COLOR, ARC_COLOR = "#8a5a00", "#8250df"

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


def check_ending(path: str | os.PathLike[str]) -> str:
    """Tell the ending of a picture file; a LineamentError if it is not known."""
    ending = Path(path).suffix.lower()
    if ending not in _METADATA:
        told = f"the ending {ending!r} is not known" if ending else "the name has no ending"
        raise LineamentError(f"{path}: {told}, expected one of {', '.join(PICTURE_ENDINGS)}")
    return ending


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure of some inches that needs no display."""
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
        figure.savefig(
            temporary,
            format=ending[1:],
            dpi=DPI,
            metadata=_METADATA[ending],
            bbox_inches="tight",
            pad_inches=0.15,
        )


def figure_bytes(figure: Figure, dpi: int = DPI) -> bytes:
    """Give the bytes of a figure as a PNG file, and free its memory."""
    buffer = io.BytesIO()
    figure.savefig(
        buffer,
        format="png",
        dpi=dpi,
        metadata=_METADATA[".png"],
        bbox_inches="tight",
        pad_inches=0.15,
    )
    figure.clear()
    return buffer.getvalue()


def settle(figure: Figure) -> None:
    """Give all panels their final places, so that labels can be put among points."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")


def style(axes: Axes, title: str, subtitle: str = "") -> None:
    """Give a panel its title, a light grid, and quiet edges."""
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
            color="#57606a",
        )
    axes.grid(color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8, color=FAINT, labelcolor="#57606a")
    for spine in axes.spines.values():
        spine.set_color("#d0d7de")


def style_plane(axes: Axes, title: str, subtitle: str, points: NDArray[np.float64]) -> None:
    """Make a panel a plan in metres that shows all of these points (n, 2), of equal axes."""
    style(axes, title, subtitle)
    points = np.vstack([points[np.isfinite(points).all(axis=1)], np.zeros((0, 2))])
    low, high = (
        (points.min(axis=0), points.max(axis=0)) if len(points) else (-np.ones(2), np.ones(2))
    )
    margin = max(0.04 * float((high - low).max()), 0.05)
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x [m]", fontsize=9, color="#57606a")
    axes.set_ylabel("y [m]", fontsize=9, color="#57606a")


def plane_size(points: NDArray[np.float64], width: float) -> float:
    """Height [inch] of a panel of some width that shows these points, within reason."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        return width
    extent = np.ptp(points, axis=0)
    extent += 0.08 * extent.max() + 1e-9
    inside = 0.86 * width  # the rest is for the numbers at the axis
    return float(np.clip(inside * extent[1] / extent[0], 0.4 * width, 1.4 * width))


def colors_of(labels: NDArray[np.int32]) -> NDArray[np.str_]:
    """Colour of each beam by its cluster."""
    return PALETTE[np.asarray(labels) % len(PALETTE)]


def count(number: int, one: str, many: str = "") -> str:
    """Write a number of things.

    Examples
    --------
    >>> count(1, "class", "classes"), count(2, "corner")
    ('1 class', '2 corners')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"
