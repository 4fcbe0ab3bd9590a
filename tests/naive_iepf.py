"""The IEPF of the public benchmark's authors: its rows are theirs to the last digit."""

import math

import numpy as np

#: Distances closer than this are equal but for rounding [m].
TIE = 1e-12


def iepf_map(scan, max_vertices):
    """Map a scan by `authors_iepf`: one polyline through all returns, whatever the gaps."""
    return [authors_iepf(scan.points[scan.valid], max_vertices)]


def authors_iepf(points, max_vertices):
    """Split a polyline of points (n, 2) at the point farthest from its chord, as the authors did.

    The iterative end-point fit begins with the first and the last point, and splits where the
    distance to the infinite line through the ends of a part is the largest of all parts, until
    there are min(n, `max_vertices`) vertices. Of points that tie, the first is taken.
    """
    vertices = [0, len(points) - 1]
    splits = [_farthest(points, *vertices)]
    while len(vertices) < min(max_vertices, len(points)):
        k = max(range(len(splits)), key=lambda k: splits[k][0])
        vertices.insert(k + 1, splits[k][1])
        splits[k : k + 1] = (_farthest(points, *vertices[j : j + 2]) for j in (k, k + 1))
    return points[vertices]


def _farthest(points, first, last):
    """Return the largest distance of a point between two others from their line, and which."""
    if last - first < 2:
        return -1.0, first
    chord = points[last] - points[first]
    arms = points[first + 1 : last] - points[first]
    distances = np.abs(chord[0] * arms[:, 1] - chord[1] * arms[:, 0]) / math.hypot(*chord)
    largest = float(distances.max())
    return largest, first + 1 + int(np.argmax(distances >= largest - TIE))
