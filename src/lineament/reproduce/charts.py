"""Charts that several experiments draw."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..output import canvas

__all__ = ["dot_chart"]

#: By the name of a series, the value of each row.
Panel = Mapping[str, Mapping[str, float]]


def dot_chart(panels: Mapping[str, Panel], *, log_axes: frozenset[str] = frozenset()) -> bytes:
    """Draw values as dots: a row for each name, a colour for each series, panels side by side.

    Parameters
    ----------
    panels : mapping of str to panel
        By the label of its axis, with its unit, each panel's values by series and row. The first
        series of the first panel has all rows; what is missing or not finite is not drawn.
    log_axes : frozenset of str
        Labels of the axes that are logarithmic.

    Returns
    -------
    bytes
        A PNG file.

    Examples
    --------
    >>> dot_chart({"F1": {"lms181": {"iepf": 0.9, "pdbs": math.nan}}})[1:4]
    b'PNG'
    """
    rows = list(next(iter(next(iter(panels.values())).values())))
    places = {row: len(rows) - 1 - i for i, row in enumerate(rows)}
    figure = canvas.new_figure(1.8 + 3.4 * len(panels), 1.1 + 0.32 * len(rows))
    for axes, (label, series) in zip(
        figure.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels.items(), strict=True
    ):
        canvas.style(axes, "")
        for k, (name, values) in enumerate(series.items()):
            shown = {row: value for row, value in values.items() if math.isfinite(value)}
            axes.plot(
                list(shown.values()),
                [places[row] for row in shown],
                "o",
                color=canvas.PALETTE[k % len(canvas.PALETTE)],
                markersize=6,
                alpha=0.85,
                label=name,
            )
        if label in log_axes:
            axes.set_xscale("log")
        axes.set_xlabel(label, fontsize=9)
        axes.set_yticks(list(places.values()), list(places), fontsize=9)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=8, fontsize=9, frameon=False)
    return canvas.figure_bytes(figure)
