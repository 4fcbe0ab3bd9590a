"""All scores of a scan against its truth, and of many scans together."""

from dataclasses import dataclass, field
from functools import partial

from lineament.features import Features

from .counts import Summable, finite_figures
from .kinds import FeatureScores, arc_scores, corner_scores, segment_scores
from .partition import PartitionScores, partition_scores


@dataclass(frozen=True, slots=True, eq=False)
class Scores(Summable):
    """Scores of some scans; they add up: ``a + b``, or `Scores.total` of many.

    Examples
    --------
    >>> (Scores() + Scores()).scans, Scores.total([]).segments.counts.found
    (0, 0)
    """

    scans: int = 0
    corners: FeatureScores = field(default_factory=partial(FeatureScores.none, "corners"))
    segments: FeatureScores = field(default_factory=partial(FeatureScores.none, "segments"))
    arcs: FeatureScores = field(default_factory=partial(FeatureScores.none, "arcs"))
    partition: PartitionScores = field(default_factory=PartitionScores)

    def summary(self) -> dict[str, float]:
        """List all figures by name, in metres and radians, as JSON takes them.

        Names are those of the scores' own summaries behind ``corner_``, ``segment_``, ``arc_``
        and ``partition_``: ``corner_f1_0.10``, ``segment_end_p90``, ``arc_nees``. A figure that
        nothing defines, such as a precision if nothing is found, is left out.

        Examples
        --------
        >>> Scores().summary()
        {'scans': 0, 'corner_nees_unusable': 0, 'segment_nees_unusable': 0, 'arc_nees_unusable': 0}
        """
        figures: dict[str, float] = {"scans": self.scans}
        for name in ("corners", "segments", "arcs", "partition"):
            of_kind = getattr(self, name).summary()
            figures |= {f"{name.rstrip('s')}_{key}": value for key, value in of_kind.items()}
        return finite_figures(figures)


def evaluate(found: Features, truth: Features) -> Scores:
    """Score the features found in one scan against the true ones.

    The truth is what a perfect method would find, in the same frame, with the Cramér-Rao bounds as
    covariances. Raises ValueError if the two are of scans with different numbers of beams.

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
