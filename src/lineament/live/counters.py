"""What a live node counts, and its report of it each second."""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..features import TABLES, Features
from ..scan import LaserScan

#: Latencies that are kept for a report: those of the last scans.
_MOST = 4096


class Counts(NamedTuple):
    """Scans and faults over some time.

    Attributes
    ----------
    scans : int
        Scans whose features were published.
    dropped : int
        Scans that a newer one displaced before they were processed.
    lost : int
        Scans that the transport knows to have lost.
    malformed : int
        Messages that make no sense.
    unsent : int
        Messages that could not be sent, since a listener did not keep up.
    """

    scans: int = 0
    dropped: int = 0
    lost: int = 0
    malformed: int = 0
    unsent: int = 0


@dataclass(frozen=True, slots=True)
class Report:
    """What happened since the last report, and in total.

    Attributes
    ----------
    seconds : float
        Time since the last report [s].
    since, total : Counts
        Since the last report, and since the start.
    latency : (float, float)
        Median and 99 % quantile of the time from a scan's arrival until all of its messages were
        handed over [s]; NaN without scans.
    invalid : float
        Share of invalid beams; NaN without beams.
    features : dict of str to float
        Mean number of features of each kind in a scan.
    publishers : int
        Publishers of scans at the moment.
    """

    seconds: float
    since: Counts
    total: Counts
    latency: tuple[float, float]
    invalid: float
    features: dict[str, float]
    publishers: int

    @property
    def rate(self) -> float:
        """Scans per second."""
        return self.since.scans / self.seconds if self.seconds > 0 else 0.0

    @property
    def level(self) -> int:
        """Level of ROS diagnostics: 0 all is well; 1 something was lost; 3 no scans came."""
        return int(any(self.since[1:])) if self.since.scans else 3

    @property
    def values(self) -> dict[str, str]:
        """The figures by name, as text."""
        latencies = zip(("p50", "p99"), self.latency, strict=True)
        totals = list(self.total._asdict().items())[:-1]
        return {
            "rate [1/s]": f"{self.rate:.2f}",
            **{f"latency {name} [ms]": f"{1e3 * value:.3f}" for name, value in latencies},
            **{name: f"{count}" for name, count in list(self.since._asdict().items())[1:]},
            "invalid beams [%]": f"{100 * self.invalid:.1f}",
            **{f"{name} per scan": f"{mean:.1f}" for name, mean in self.features.items()},
            "publishers": f"{self.publishers}",
            **{f"{name} in all": f"{count}" for name, count in totals},
        }

    @property
    def totals(self) -> str:
        """What happened since the start, in one line."""
        return f"{self.total.scans} scans, {_faults(self.total)} messages"

    @property
    def taken(self) -> str:
        """The scans that were processed since the start, and whether others were missed."""
        missed = self.total.dropped + self.total.lost
        return f"{self.total.scans} scans" + (f", {missed} came too fast" if missed else "")

    def __str__(self) -> str:
        if not self.since.scans:
            return f"no scans, {self.publishers} publisher{'s' if self.publishers != 1 else ''}"
        p50, p99 = self.latency
        found = ", ".join(f"{mean:.1f} {name}" for name, mean in self.features.items())
        return (
            f"{self.rate:.1f} scans/s, latency {1e3 * p50:.2f} ms (p99 {1e3 * p99:.2f}), "
            f"{_faults(self.since)}, {100 * self.invalid:.1f} % of beams invalid, per scan: {found}"
        )


def _faults(counts: Counts) -> str:
    return f"{counts.dropped} dropped, {counts.lost} lost, {counts.malformed} malformed"


class Counters:
    """Counts scans and faults, and makes reports; the node adds to `dropped` and `malformed`."""

    def __init__(self, now: float) -> None:
        self.scans = self.dropped = self.malformed = 0
        self._begin(now, Counts())

    def _begin(self, now: float, total: Counts) -> None:
        self._reported, self._total = now, total
        self._latencies: deque[float] = deque(maxlen=_MOST)
        self._beams = self._invalid = 0
        self._found = dict.fromkeys(TABLES, 0)

    def add(self, scan: LaserScan, features: Features, latency: float) -> None:
        """Count a scan whose features were published `latency` seconds after it came."""
        self.scans += 1
        self._latencies.append(latency)
        self._beams += len(scan)
        self._invalid += len(scan) - int(np.count_nonzero(scan.valid))
        for name, count in features.counts().items():
            self._found[name] += count

    def report(self, now: float, *, publishers: int, lost: int = 0, unsent: int = 0) -> Report:
        """Report on what was counted since the last report; `lost` and `unsent` are in all."""
        total = Counts(self.scans, self.dropped, lost, self.malformed, unsent)
        since = Counts(*(new - old for new, old in zip(total, self._total, strict=True)))
        p50, p99 = np.quantile(self._latencies or [np.nan], (0.5, 0.99)).tolist()
        report = Report(
            seconds=now - self._reported,
            since=since,
            total=total,
            latency=(p50, p99),
            invalid=self._invalid / self._beams if self._beams else float("nan"),
            features={name: n / max(since.scans, 1) for name, n in self._found.items()},
            publishers=publishers,
        )
        self._begin(now, total)
        return report
