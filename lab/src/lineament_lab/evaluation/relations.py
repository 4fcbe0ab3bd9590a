"""Relations of a log, verified by hand: how far off poses are where the truth is known.

Kümmerle, Steder, Dornhege, Ruhnke, Grisetti, Stachniss, Kleiner, *On measuring the accuracy of SLAM
algorithms*, Autonomous Robots 27, 2009. Most relations are of neighbouring scans, and nearly blind
to a map that is broken: those over a minute apart stand by themselves.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lineament.errors import LogError
from lineament.logs.lines import reading
from lineament.scan import Array, Pose
from lineament.scan.poses import relative

from .tracking import MotionErrors

#: Stamps within this are the same [s]. Scanners move on: poses are not interpolated.
SAME = 1e-3
#: Scans that are more than this apart are far apart [s].
FAR_APART = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """Relative poses of pairs of scans."""

    #: Indices of the scans, shape (m, 2).
    scans: NDArray[np.intp]
    #: Pose of the second scan in the frame of the first [m, m, rad], shape (m, 3).
    motions: Array
    #: Time between them [s], shape (m,).
    seconds: Array

    def far_apart(self, far: bool = True) -> "Relations":
        """Return those over a minute apart, which show whether a way closes, or the others."""
        kept = (self.seconds > FAR_APART) == far
        return Relations(self.scans[kept], self.motions[kept], self.seconds[kept])

    def errors(self, poses: Sequence[Pose]) -> MotionErrors:
        """How far the motions between these poses of all scans are off."""
        off = [
            relative((x, y, turn), relative(poses[i], poses[j]))
            for (i, j), (x, y, turn) in zip(self.scans.tolist(), self.motions.tolist(), strict=True)
        ]
        return MotionErrors.of(off)


def read_relations(path: str | os.PathLike[str], stamps: Array) -> Relations:
    """Read the relations between scans with these stamps [s], in any order.

    A line has two stamps, then x, y, z [m], roll, pitch and yaw [rad] of the second scan in the
    frame of the first; relations whose scans are not there are left out. LogError if the file
    cannot be read, or a line is not of eight numbers.
    """
    with reading(path):
        lines = Path(path).read_text("utf-8", "replace").splitlines()
    try:
        rows = np.array([line.split() for line in lines if line.strip()], dtype=np.float64)
        x, y, _, _, _, yaw = rows.reshape(-1, 8)[:, 2:].T
    except ValueError:
        raise LogError(path, "is no file of relations: expected eight numbers a line") from None
    order = np.argsort(stamps, kind="stable")
    middles = (stamps[order][1:] + stamps[order][:-1]) / 2
    asked = rows.reshape(-1, 8)[:, :2]
    scans = order[np.searchsorted(middles, asked)]
    known = (abs(stamps[scans] - asked) <= SAME).all(axis=1)
    motions = np.column_stack((x, y, yaw))
    return Relations(scans[known], motions[known], abs(np.diff(asked)[known, 0]))
