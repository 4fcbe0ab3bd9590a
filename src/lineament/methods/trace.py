"""Every intermediate of one run of a method: for pictures, tests, and the question why."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..kernels import layout as at
from ..scan import LaserScan
from .workspace import Block

Array = NDArray[np.float64]

#: A beam that was examined as a corner: how far it lies from the chord of its piece (equation 14,
#: [m]), the response of the corner operator there (equation 22), and whether it was taken.
CANDIDATE = np.dtype(
    [
        ("beam", "i4"),
        ("cluster", "i4"),
        ("chord_distance", "f8"),
        ("response", "f8"),
        ("accepted", "?"),
    ],
    align=True,
)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trace:
    """Every intermediate of one run, by beam of the scan. NaN marks beams that a stage left out.

    Attributes
    ----------
    scan : LaserScan
        What was given.
    method : str
        Name of the method.
    features : Features
        What came out.
    filtered : float64 array, shape (n,)
        Ranges that the detection worked on [m].
    spacing : float64 array, shape (n,)
        Distance of each valid beam's filtered point to that of the valid beam before it [m].
    distance_threshold, density_threshold : float64 array, shape (n,)
        What the spacing was compared with (equations 10, 11-13) [m]; the second is NaN where it
        was not needed.
    clusters : int32 array, shape (n,)
        Cluster of each beam, noise as -1.
    candidates : structured array of dtype `CANDIDATE`
        Primary corners in the order in which they were examined.
    threshold : float
        What their responses were compared with.
    cuts : int32 array
        Beams at which clusters were cut into pieces.
    evidence : dict of str to float64 array
        By table ("segments", "corners", "arcs"), how much χ² would rise without each feature;
        empty where a method does not decide by that.
    scale : float
        Standard deviation of surfaces from straight lines [m] that χ² allows for, besides the
        noise; 0 where a method has none.
    """

    scan: LaserScan
    method: str
    features: Features
    filtered: Array
    spacing: Array
    distance_threshold: Array
    density_threshold: Array
    clusters: NDArray[np.int32]
    candidates: NDArray[np.void]
    threshold: float
    cuts: NDArray[np.int32]
    evidence: dict[str, Array] = field(default_factory=dict)
    scale: float = 0.0

    def __repr__(self) -> str:
        return f"Trace({self.method}: {len(self.candidates)} candidates, {self.features})"


def intermediates(block: Block, threshold: float) -> dict[str, Any]:
    """Return the intermediates of the scan that a method has just run on, alone in its block."""
    filtered = block.work.beams[at.FILTERED, : block.beams]
    usable = ~np.isnan(filtered)
    by_beam = np.full((3, block.beams), np.nan)
    rows = [at.SPACING, at.DISTANCE_THRESHOLD, at.DENSITY_THRESHOLD]
    by_beam[:, usable] = block.work.points[rows, : int(usable.sum())]
    if not block.circular and usable.any():
        by_beam[:, np.argmax(usable)] = np.nan  # Nothing lies before the first.
    candidates = candidate_records(block, threshold)
    return {
        "filtered": filtered,
        "spacing": by_beam[0],
        "distance_threshold": by_beam[1],
        "density_threshold": by_beam[2],
        "candidates": candidates,
        "threshold": threshold,
        "cuts": np.sort(candidates["beam"][candidates["accepted"]]),
    }


def candidate_records(block: Block, threshold: float) -> NDArray[np.void]:
    """Return the candidates of the last scan of a block as records."""
    candidates = block.work.candidates[:, : block.counts[at.CANDIDATES]]
    points = candidates[at.POINT].astype(int)
    records = np.zeros(len(points), CANDIDATE)
    records["beam"], records["cluster"] = block.work.marks[[at.BEAM, at.LABEL]][:, points]
    records["chord_distance"] = candidates[at.CHORD_DISTANCE]
    records["response"] = candidates[at.RESPONSE]
    records["accepted"] = records["response"] > threshold
    return records
