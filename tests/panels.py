"""What is drawn in a panel of a figure, as numbers."""

from itertools import combinations

import numpy as np
from matplotlib.text import Text

from lineament.output.canvas import settle


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


def assert_legible(figure):
    """Panels are of a size to see; their texts lie on no other text, and names within panels."""
    settle(figure)
    width, height = figure.get_size_inches()
    assert 0.2 < height / width < 1.5
    for axes in figure.axes:
        panel = axes.get_window_extent()
        assert panel.width > 1.2 * figure.dpi
        assert panel.height > 0.8 * figure.dpi
        for text in axes.texts:
            if getattr(text, "xycoords", "data") == "data":
                box = Text.get_window_extent(text)  # without the arrow
                assert panel.x0 < box.x0, text
                assert panel.x1 > box.x1, text
                assert panel.y0 < box.y0, text
                assert panel.y1 > box.y1, text
    parts = [part for axes in figure.axes for part in axes.get_children()]
    assert_apart(part for part in parts if isinstance(part, Text))


def assert_apart(texts):
    """No text lies on another one."""
    texts = [text for text in texts if text.get_text().strip()]
    boxes = [Text.get_window_extent(text).shrunk(0.9, 0.7) for text in texts]
    for (one, box), (other, more) in combinations(zip(texts, boxes, strict=True), 2):
        assert not box.overlaps(more), (one, other)
