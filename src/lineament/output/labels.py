"""Texts beside points of a plan, where they hide little."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .canvas import CORNER_COLOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

#: More positions than this are left without their texts.
MAX_LABELS = 29


def label_points(
    axes: Axes, positions: Array, texts: list[str], obstacles: Array, color: str = CORNER_COLOR
) -> None:
    """Write a text beside each position, where it hides the fewest points and no other text.

    The axes must have their final limits and place in the figure.
    """
    from matplotlib.patheffects import withStroke

    finite = np.isfinite(positions).all(axis=1)
    texts = [texts[i] for i in np.flatnonzero(finite)]
    positions = positions[finite]
    if not len(positions) or len(positions) > MAX_LABELS:
        return
    figure = axes.get_figure(root=True)
    assert figure is not None
    points_of = 72 / figure.dpi
    at = axes.transData.transform(positions) * points_of
    hidden = axes.transData.transform(obstacles[np.isfinite(obstacles).all(axis=1)]) * points_of
    inside = np.array(axes.get_window_extent().extents) * points_of
    boxes: list[Array] = []
    for position, here, text in zip(positions, at, texts, strict=True):
        size = np.array([4.6 * len(text), 9.0])  # of a text of 7 points
        offset, box = _free_place(here, size, hidden, at, boxes, inside)
        boxes.append(box)
        axes.annotate(
            text,
            tuple(position),
            xytext=tuple(offset),
            textcoords="offset points",
            fontsize=7,
            color=color,
            ha="center",
            va="center",
            zorder=7,
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
        )


def _free_place(
    here: Array, size: Array, points: Array, markers: Array, boxes: list[Array], inside: Array
) -> tuple[Array, Array]:
    """Offset of a text's middle and its box (left, bottom, right, top), in points."""
    best, least = (np.zeros(2), np.zeros(4)), math.inf
    for ring in (1.0, 1.7, 2.6, 4.0, 6.0):
        for turn in range(12):
            direction = np.array([math.cos(turn * math.pi / 6), math.sin(turn * math.pi / 6)])
            offset = direction * (size / 2 + 6 * ring)
            box = np.concatenate([here + offset - size / 2, here + offset + size / 2])
            cost = 4 * ring + 1.0 * _within(points, box) + 12 * _within(markers, box)
            cost += sum(60 for b in boxes if (box[:2] < b[2:]).all() and (b[:2] < box[2:]).all())
            if (box[:2] < inside[:2]).any() or (box[2:] > inside[2:]).any():
                cost += 100
            if cost < least:
                best, least = (offset, box), cost
    return best


def _within(points: Array, box: Array) -> int:
    return int(((points > box[:2]) & (points < box[2:])).all(axis=1).sum())
