"""The layers of a 3-D scene of a scan's features: what Foxglove, RViz and rerun are given alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .markers import Markers

__all__ = ["Layer", "layers_of"]

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Layer:
    """Marks of one kind that are drawn alike.

    Attributes
    ----------
    name : str
        Name of the entity, or namespace of the marker.
    color : tuple
        Red, green, blue and opacity, 0 to 1.
    size : float
        Width of the lines, or diameter of the spheres [m].
    strips : sequence of float64 arrays, shape (n, 2), or one array, shape (m, n, 2)
        Vertices that are joined by lines [m]; in one array where all strips have as many.
    points : float64 array, shape (m, 2)
        Centres of spheres [m].
    """

    name: str
    color: Color
    size: float
    strips: Sequence[Array] | Array
    points: Array

    @property
    def pairs(self) -> Array:
        """Both ends of each straight piece of the strips, one after the other, shape (2 k, 2).

        What a list of lines takes, where one message has to hold many strips.
        """
        strips = [self.strips] if isinstance(self.strips, np.ndarray) else self.strips
        pieces = [
            np.repeat(strip, 2, axis=-2)[..., 1:-1, :].reshape(-1, 2)
            for strip in strips  # each of them one, or many of as many vertices
        ]
        return np.concatenate(pieces) if pieces else np.zeros((0, 2))


def layers_of(markers: Markers) -> tuple[Layer, ...]:
    """Make the layers segments, arcs, corners, edges and ellipses; those without marks too.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.output.markers import markers_of
    >>> scan = ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01)
    >>> layers = layers_of(markers_of(ln.extract(scan), scan))
    >>> [(layer.name, len(layer.strips), len(layer.points)) for layer in layers]
    [('segments', 1, 0), ('arcs', 0, 0), ('corners', 0, 0), ('edges', 0, 0), ('ellipses', 0, 0)]
    """
    none = np.zeros((0, 2))
    return (
        Layer("segments", (0.16, 0.47, 0.84, 1.0), 0.03, markers.segments, none),
        Layer("arcs", (0.51, 0.31, 0.87, 1.0), 0.03, markers.arc_strips(), none),
        Layer("corners", (0.82, 0.14, 0.18, 1.0), 0.08, (), markers.corners),
        Layer("edges", (0.94, 0.65, 0.67, 1.0), 0.05, (), markers.edges),
        Layer("ellipses", (0.93, 0.60, 0.20, 1.0), 0.01, markers.ellipse_strips(), none),
    )
