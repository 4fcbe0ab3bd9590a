"""Probabilistic line extraction: polylines whose vertices are removed while the scan stays likely.

A. Schaefer, D. Büscher, L. Luft, W. Burgard, *A maximum likelihood approach to extract polylines
from 2-D laser range scans*, IROS 2018 (arXiv 1910.10711).
"""

from typing import Any, ClassVar

from lineament.kernels.breakpoints import FIXED
from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from ..kernels.vertex_removal import remove_vertices
from .lines import VertexMethod


@method
class PLE(VertexMethod):
    """Probabilistic line extraction.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Connect* all points of a cluster by a polyline.
    3. *Remove* the vertex without which the scan is least less likely: the sum of the squared
       errors along the beams, over their variances, rises least. Again, until it would rise by
       more than `rise`, and while there are more than `max_vertices`.
    4. *Merge* neighbours that one line fits as well, put borders where both lines fit best, and
       corners where lines meet.

    The preset `paper` is the first step of the paper, PLE: parted where neighbours are 1 m apart or
    a beam returns nothing, as in its experiments, and corners on measurements. Its second, PLE+,
    moves the vertices to where the scan is most likely; here step 4 does so with each line.
    """

    name = "ple"
    published: ClassVar[dict[str, Any]] = {
        "clusters": "fixed",
        "distance": 1.0,
        "max_missing": 0,
        "min_points": 2,
        "line_error": 0.5,
        "corner": "beam",
    }

    rise: float = parameter(
        1000.0,
        "most by which Σ (Δρ/σ)² may rise as a vertex is removed; the paper leaves it to the user "
        "(chosen by F1 of corners, in simulated scenes of which nothing is reported)",
        above=0,
    )
    line_error: float = parameter(
        1.0, "error of a measurement that no line explains", above=0, unit="m"
    )

    def part(self, block: Block, min_points: int, noise_factor: float = 3.0) -> None:
        """Part the scan into clusters, at a fixed distance also where beams return nothing."""
        if self.clusters == "fixed":
            block.part((FIXED, self.distance, 0.0), self.max_missing, min_points)
        else:
            VertexMethod.part(self, block, min_points, noise_factor)

    def find(self, block: Block) -> None:
        """Cluster, connect, remove, merge and fit."""
        self.part(block, self.min_points)
        remove_vertices(*block.workspace, self.rise, self.line_error, self.max_vertices)
        self.finish(block)
