"""The partition of a scan into clusters: which are right, and where they end."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineament.features import Features

from .beams import MIN_BEAMS, beam_masks, common_beams
from .counts import Counts, Summable, ratio
from .matching import match

#: A found cluster is right if the beams that only one of the two has are at most so many (one at
#: each end), or at most this share of those that either has.
BEAMS_APART, SHARE_APART = 2, 0.1
#: A found breakpoint is right if the beam on each side is at most so many off.
BREAK_BEAMS = 1


@dataclass(frozen=True, slots=True)
class PartitionScores(Summable):
    """Scores of the clusters and breakpoints of some scans."""

    regions: Counts = field(default_factory=Counts)
    breakpoints: Counts = field(default_factory=Counts)
    #: Pairs of beams of a scan, of those beams that are in a found or a true cluster; of these,
    #: pairs in one found cluster, in one true cluster, and in one of both.
    pairs: int = 0
    together_found: int = 0
    together_true: int = 0
    together: int = 0

    @property
    def success(self) -> float:
        """Partition success of the paper: correct clusters over true ones."""
        return self.regions.recall

    @property
    def rand_index(self) -> float:
        """Share of the pairs on which both agree: together, or not (Rand 1971)."""
        agreed = self.pairs + 2 * self.together - self.together_found - self.together_true
        return ratio(agreed, self.pairs)

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        figures = {"success": self.success, "rand_index": self.rand_index}
        for name, counts in (("region", self.regions), ("breakpoint", self.breakpoints)):
            figures |= {f"{name}_{key}": value for key, value in counts.summary().items()}
        return figures


def partition_scores(found: Features, truth: Features) -> PartitionScores:
    """Compare the clusters and breakpoints of one scan with the true ones.

    A found cluster is right if it has the beams of a true one, but for at most one at each end
    or a tenth of those that either has. A found breakpoint is right if the beams on both its
    sides are within one of those of a true one, whatever its kind; the ends of the scan, which
    are always known, are left out.

    True clusters of fewer than `MIN_BEAMS` beams, and breakpoints next to them, are not demanded.
    Not counted as mistakes are found clusters that have at least half of their beams in those or
    in none, and found breakpoints next to them or across them.

    Raises ValueError if the two are of scans with different numbers of beams.

    Examples
    --------
    >>> import lineament as ln
    >>> features = ln.extract(ln.LaserScan([2.0] * 9 + [4.0] * 9, 0.0, 0.01))
    >>> scores = partition_scores(features, features)
    >>> scores.success, scores.breakpoints, scores.rand_index
    (1.0, Counts(correct=1, found=1, true=1), 1.0)
    """
    n = common_beams(found, truth)
    # Beams by true cluster (row) and found cluster (column); those of none, -1, come last.
    n_found, n_true = (int(f.clusters.max(initial=-1)) + 1 for f in (found, truth))
    table = np.zeros((n_true + 1, n_found + 1), dtype=np.int64)
    np.add.at(table, (truth.clusters, found.clusters), 1)
    shared = table[:-1, :-1]
    true_sizes, found_sizes = table.sum(axis=1)[:-1], table.sum(axis=0)[:-1]
    demanded = np.append(true_sizes >= MIN_BEAMS, False)
    # Of 6 beams or more that differ so little most are shared: no cluster has two such partners.
    either = true_sizes[:, np.newaxis] + found_sizes - shared
    right = either - shared <= np.maximum(BEAMS_APART, SHARE_APART * either)
    matched = np.flatnonzero((right & demanded[:-1, np.newaxis]).any(axis=0))
    # Numbers of clusters that no beam has are no clusters.
    excused = table[~demanded, :-1].sum(axis=0) >= 0.5 * found_sizes
    return PartitionScores(
        Counts.of(matched, excused, demanded),
        _breakpoint_counts(found, truth, demanded),
        *(
            int((sizes * (sizes - 1) // 2).sum())
            for sizes in (n - table[-1, -1], found_sizes, true_sizes, shared)
        ),
    )


def _breakpoint_counts(found: Features, truth: Features, demanded: NDArray[np.bool_]) -> Counts:
    n = len(truth.clusters)
    is_judged = demanded[truth.clusters]
    is_small = (truth.clusters >= 0) & ~is_judged
    sides, true_sides = (
        f.breakpoints["beam"][f.breakpoints["kind"] != "scan_end"] for f in (found, truth)
    )
    off = abs(sides[:, np.newaxis] - true_sides)
    off = np.minimum(off, n - off)
    demanded_breaks = is_judged[true_sides].all(axis=1)
    near = (off <= BREAK_BEAMS).all(axis=2) & demanded_breaks
    matched, _ = match(off.sum(axis=2).astype(np.float64), near)
    across_small = (beam_masks(sides[:, 0], sides[:, 1], n) & is_small).any(axis=1)
    excused = across_small | ~is_judged[sides].all(axis=1)
    return Counts.of(matched, excused, demanded_breaks)
