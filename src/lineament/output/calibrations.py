"""Pictures of a calibration: what is left of the odometry of each step."""

from __future__ import annotations

import os

import numpy as np

from ..motion.calibration import Calibration
from ..scan import Array
from . import canvas

_LABELS = ("forward [mm]", "to the left [mm]", "turn [°]")
_SCALES = (1e3, 1e3, 180 / np.pi)


def plot_calibration(
    found: Calibration, stamps: Array, path: str | os.PathLike[str], *, title: str = ""
) -> None:
    """Draw what is left of each step at its stamp [s], with two deviations of its noise.

    Steps that were left out as slips are crosses; those far outside are drawn at the border. The
    picture is a ``.png``, ``.svg`` or ``.pdf``.
    """
    canvas.check_ending(path)
    figure = canvas.new_figure(canvas.PAGE_WIDTH, 6.5)
    panels, time = figure.subplots(3, 1, sharex=True), stamps - stamps[0]
    kept = ~found.is_slip
    for k, axes in enumerate(panels):
        left, band = found.residuals[:, k] * _SCALES[k], 2 * found.deviates[:, k] * _SCALES[k]
        most = 1.5 * float(np.percentile(band, 98))
        shown = np.clip(left, -most, most)
        axes.fill_between(time, -band, band, color=canvas.GRID, linewidth=0)
        axes.plot(time[kept], shown[kept], ".", ms=3, color=canvas.INK)
        axes.plot(time[~kept], shown[~kept], "x", ms=5, color=canvas.CORNER_COLOR)
        axes.set(ylabel=_LABELS[k], ylim=(-1.05 * most, 1.05 * most))
    slips = int(found.is_slip.sum())
    panels[0].set_title(f"{title} · {len(kept)} steps, {slips} left out (crosses); band: ± 2 σ")
    panels[-1].set_xlabel("time [s]")
    canvas.save(figure, path)
