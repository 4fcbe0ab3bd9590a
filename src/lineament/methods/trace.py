"""Every intermediate of one run of a method: for pictures, tests, and the question why."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..kernels import layout as at
from ..scan import LaserScan
from .workspace import Block

__all__ = ["CANDIDATE", "Trace", "candidate_records", "trace_of"]

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


@dataclass(frozen=True, slots=True, eq=False)
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
    filtered: NDArray[np.float64]
    spacing: NDArray[np.float64]
    distance_threshold: NDArray[np.float64]
    density_threshold: NDArray[np.float64]
    clusters: NDArray[np.int32]
    candidates: NDArray[np.void]
    threshold: float
    cuts: NDArray[np.int32]
    evidence: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    scale: float = 0.0


def trace_of(
    block: Block,
    method: str,
    scan: LaserScan,
    features: Features,
    threshold: float,
    evidence: dict[str, NDArray[np.float64]],
) -> Trace:
    """Make the trace of the scan that a method has just run on, alone in its block."""
    candidates = candidate_records(block, threshold)
    return Trace(
        scan=scan,
        method=method,
        features=features,
        filtered=block.work.beams[at.FILTERED, : len(scan)],
        spacing=block.by_beam(at.SPACING),
        distance_threshold=block.by_beam(at.DISTANCE_THRESHOLD),
        density_threshold=block.by_beam(at.DENSITY_THRESHOLD),
        clusters=features.clusters,
        candidates=candidates,
        threshold=threshold,
        cuts=np.sort(candidates["beam"][candidates["accepted"]]),
        evidence=evidence,
    )


def candidate_records(block: Block, threshold: float) -> NDArray[np.void]:
    """Candidates of the last scan of a block as records."""
    candidates = block.work.candidates[:, : block.counts[at.CANDIDATES]]
    points = candidates[at.POINT].astype(int)
    records = np.zeros(len(points), CANDIDATE)
    records["beam"], records["cluster"] = block.work.marks[[at.BEAM, at.LABEL]][:, points]
    records["chord_distance"] = candidates[at.CHORD_DISTANCE]
    records["response"] = candidates[at.RESPONSE]
    records["accepted"] = records["response"] > threshold
    return records
