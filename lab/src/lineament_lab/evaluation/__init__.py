"""How good a method is: features found in a scan against the true ones, and against themselves.

`evaluate` scores one scan; scores of many scans add up, so that precision, recall and F1 over
five hundred scenes come from the sums.

Found and true features are matched one to one. What has fewer than `MIN_BEAMS` beams in the
truth is too small to be demanded: to miss it or to find it is no mistake. Needs scipy.

Examples
--------
>>> from lineament_lab.evaluation import Scores, evaluate
>>> import lineament as ln
>>> scan = ln.LaserScan([2.0] * 9, angle_min=-0.04, angle_increment=0.01)
>>> features = ln.extract(scan)
>>> scores = evaluate(features, features) + evaluate(features, features)
>>> scores.scans, scores.summary()["segment_f1"]
(2, 1.0)
"""

from .beams import MIN_BEAMS
from .consistency import NormalisedErrors
from .counts import Counts, Summable
from .free_space import FreeSpaceScores, free_space_scores
from .kinds import FeatureScores, arc_scores, corner_scores, segment_scores
from .matching import match
from .partition import PartitionScores, partition_scores
from .repeatability import RankedRepeats, Repeatability, Repeats, ranked_repeats, repeatability
from .scores import Scores, evaluate
from .similarity import SimilarityScores, similarity_errors, similarity_scores
from .standing import ScatterScores, StandingScores, standing_scores

__all__ = [
    "MIN_BEAMS",
    "Counts",
    "FeatureScores",
    "FreeSpaceScores",
    "NormalisedErrors",
    "PartitionScores",
    "RankedRepeats",
    "Repeatability",
    "Repeats",
    "ScatterScores",
    "Scores",
    "SimilarityScores",
    "StandingScores",
    "Summable",
    "arc_scores",
    "corner_scores",
    "evaluate",
    "free_space_scores",
    "match",
    "partition_scores",
    "ranked_repeats",
    "repeatability",
    "segment_scores",
    "similarity_errors",
    "similarity_scores",
    "standing_scores",
]
