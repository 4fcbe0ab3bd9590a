"""What the methods share that find keypoints: corners without segments."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lineament.features.records import CORNER, SEGMENT
from lineament.kernels.breakpoints import BORGES_ALDON
from lineament.methods.base import MethodBase
from lineament.methods.parameters import method
from lineament.methods.workspace import Block
from lineament.methods.written import corner_records, write
from lineament.scan import Array, LaserScan

#: λ and deviations of the detector of Borges and Aldon, missing beams and least points of the
#: clusters, which keypoints know nothing of.
_CLUSTERS = (BORGES_ALDON, 3.0, math.radians(6.0)), 5, 3


class Keypoints(NamedTuple):
    """Keypoints of a scan: positions (k, 2) [m], and their scores (k,), from 0 to 1."""

    positions: Array
    scores: Array


@method
class KeypointMethod(MethodBase):
    """A method that finds points that are likely to be found again, and no lines.

    Its corners have the covariance of a measurement, and its score as their quality.
    """

    def keypoints(self, scan: LaserScan) -> Keypoints:
        """Find the keypoints of a scan."""
        raise NotImplementedError

    def find(self, block: Block) -> None:
        """Find the keypoints of the scan that a block has taken."""
        block.part(*_CLUSTERS)
        scan, noise = block.scan(), block.noises[block.row]
        none = np.zeros(0, SEGMENT)
        found = [np.zeros(0, CORNER)]
        for place, score in zip(*self.keypoints(scan), strict=True):
            corner = corner_records(place[np.newaxis], none, scan, noise)
            corner["response"] = corner["quality"] = score
            found.append(corner)
        corners = np.concatenate(found)
        in_order = np.argsort(corners["beam"], kind="stable")
        write(block, none, corners[in_order], gap=_CLUSTERS[1] + 1.0)


def runs_of(flags: NDArray[np.bool_], circular: bool) -> list[NDArray[np.intp]]:
    """Return the runs of neighbours that are true, in order; over the seam if `circular`.

    Examples
    --------
    >>> flags = np.array([True, False, True, True, False, True])
    >>> [run.tolist() for run in runs_of(flags, circular=True)]
    [[2, 3], [5, 0]]
    """
    true = np.flatnonzero(flags)
    if not len(true):
        return []
    runs = np.split(true, np.flatnonzero(np.diff(true) > 1) + 1)
    if circular and len(runs) > 1 and flags[0] and flags[-1]:
        runs[-1] = np.concatenate((runs[-1], runs.pop(0)))
    return runs
