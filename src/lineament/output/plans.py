"""What plans share: one scan as it was seen, or all scans of a log in one floor plan."""

import os
from abc import abstractmethod
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from .canvas import count
from .floor_plan import FloorPlan
from .markers import Markers, markers_of
from .writer import Found, Writer

#: How often a part of a wall must have been seen to be drawn; once, in a log of few scans.
MIN_VIEWS, FEW = 3, 10


class Plan(NamedTuple):
    """What is drawn, how often each of its segments was seen, and a caption."""

    markers: Markers
    views: NDArray[np.int64]
    caption: str


class PlanWriter(Writer):
    """Draws one scan in its own frame, or the floor plan of several in the frame of their poses.

    A part of a wall, a corner or an arc is drawn in a floor plan if it was seen `min_views` times;
    by default 3 times, or once where the log has fewer than 10 scans. On writing, a LineamentError
    if one of several scans has no pose.
    """

    needs_scan = True

    def __init__(self, path: str | os.PathLike[str], *, min_views: int | None = None) -> None:
        super().__init__(path)
        self.min_views = min_views

    def _open(self, temporary: Path, files: ExitStack) -> None:  # noqa: ARG002  (open at the end)
        self._temporary, self._floor = temporary, FloorPlan()

    def _write(self, found: list[Found], first_scan: int) -> None:
        for i, one in enumerate(found, first_scan):
            if i == 0:  # placed when the next one comes: alone it needs no pose
                self._first = one
                continue
            if i == 1:
                self._place(self._first, 0)
            self._place(one, i)

    def _place(self, found: Found, index: int) -> None:
        pose = found.scan.pose if found.scan else None
        if pose is None:
            raise LineamentError(
                f"{self.path}: scan {index} has no pose, expected poses: several scans are drawn "
                "where they were taken"
            )
        self._floor.add(found.features.transform(*pose))

    def _close(self) -> None:
        least = self.min_views or (MIN_VIEWS if self._written >= FEW else 1)
        if self._written == 1:
            least, markers = 1, markers_of(self._first.features, self._first.scan)
            views = np.ones(len(markers.segments), dtype=np.int64)
        else:
            markers, views = self._floor.markers(least)
        found = f"{count(len(markers.segments), 'wall')}, {count(len(markers.corners), 'corner')}"
        if len(markers.edges):
            found += f", {count(len(markers.edges), 'edge')} (lighter)"
        often = f", each seen {count(least, 'time')} at least" if least > 1 else ""
        if self._floor.every > 1:
            often += f"; walls of one scan in {self._floor.every}"
        # A map is written as features of no beams.
        is_map = self._written == 1 and not len(self._first.features.clusters)
        scans = "" if is_map else f" of {count(self._written, 'scan')}"
        caption = f"{' and '.join(found.rsplit(', ', 1))}{scans}{often}"
        self._draw(self._temporary, Plan(markers, views, caption))

    @abstractmethod
    def _draw(self, temporary: Path, plan: Plan) -> None:
        """Write the plan."""
