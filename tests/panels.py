"""What is drawn in a panel of a figure, as numbers."""

import numpy as np


def drawn(axes):
    """The points of each line of a panel, without those that cross all of it."""
    return [np.array(line.get_xydata(), float) for line in axes.lines]


def notes(axes):
    """The texts of a panel that point at a place, and the place."""
    return [(t.get_text(), t.xy) for t in axes.texts if getattr(t, "xycoords", "") == "data"]


def texts_of(axes):
    return " ".join(text.get_text() for text in axes.texts)


def by_label(axes):
    return {line.get_label(): np.array(line.get_xydata(), float) for line in axes.lines}


def beside(vectors, direction):
    """How far vectors lead to the left of a direction."""
    return np.asarray(vectors) @ (-direction[1], direction[0])


def angle_of(points):
    return np.degrees(np.arctan2(*np.transpose(points)[::-1]))
