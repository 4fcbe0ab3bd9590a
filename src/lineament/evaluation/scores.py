"""All scores of a scan against its truth, and of many scans together."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ..features import Features
from .arcs import ArcScores, arc_scores
from .corners import CornerScores, corner_scores
from .counts import Summable
from .partition import PartitionScores, partition_scores
from .segments import SegmentScores, segment_scores

__all__ = ["Scores", "evaluate"]


@dataclass(frozen=True, slots=True, eq=False)
class Scores(Summable):
    """Scores of some scans; they add up: ``a + b``, or `Scores.total` of many.

    Attributes
    ----------
    scans : int
        How many scans.
    corners, segments, arcs, partition
        Scores of each kind.

    Examples
    --------
    >>> (Scores() + Scores()).scans, Scores.total([]).segments.counts.found
    (0, 0)
    """

    scans: int = 0
    corners: CornerScores = field(default_factory=CornerScores)
    segments: SegmentScores = field(default_factory=SegmentScores)
    arcs: ArcScores = field(default_factory=ArcScores)
    partition: PartitionScores = field(default_factory=PartitionScores)

    def summary(self) -> dict[str, float]:
        """List all figures by name, in metres and radians, as JSON takes them.

        Names are those of the scores' own summaries behind ``corner_``, ``segment_``, ``arc_``
        and ``partition_``: ``corner_f1_0.10``, ``segment_end_p90``, ``arc_nees``. A figure that
        nothing defines, such as a precision where nothing was found, is left out.

        Examples
        --------
        >>> Scores().summary()
        {'scans': 0, 'corner_nees_unusable': 0, 'segment_nees_unusable': 0, 'arc_nees_unusable': 0}
        """
        figures: dict[str, float] = {"scans": self.scans}
        for name, part in (
            ("corner", self.corners),
            ("segment", self.segments),
            ("arc", self.arcs),
            ("partition", self.partition),
        ):
            figures |= {f"{name}_{key}": value for key, value in part.summary().items()}
        return {name: value for name, value in figures.items() if math.isfinite(value)}


def evaluate(found: Features, truth: Features) -> Scores:
    """Score the features found in one scan against the true ones.

    Parameters
    ----------
    found : Features
        What a method found.
    truth : Features
        What a perfect method would find, in the same frame, with the Cramér-Rao bounds as
        covariances.

    Returns
    -------
    Scores

    Raises
    ------
    ValueError
        If the two are of scans with different numbers of beams.

    Examples
    --------
    >>> import lineament as ln
    >>> features = ln.extract(ln.LaserScan([2.0] * 9, angle_min=-0.04, angle_increment=0.01))
    >>> evaluate(features, features).summary()["segment_recall"]
    1.0
    """
    return Scores(
        1,
        corner_scores(found, truth),
        segment_scores(found, truth),
        arc_scores(found, truth),
        partition_scores(found, truth),
    )
