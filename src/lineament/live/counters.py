"""What a live node counts, and what it reports of it each second."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from ..features import COUNTED, Features
from ..scan import LaserScan

__all__ = ["Counters", "Report"]

#: Latencies that are kept of one report: those of the last scans.
_MOST = 4096


@dataclass(frozen=True, slots=True)
class Report:
    """What happened since the last report, and all in all.

    Attributes
    ----------
    seconds : float
        Time since the last report [s].
    scans : int
        Scans whose features were told.
    latency : (float, float)
        Median and 99 % quantile of the time from a scan's arrival until all of its messages were
        handed over [s]; NaN where there were no scans.
    invalid : float
        Share of the beams that were invalid; NaN where there were none.
    features : dict of str to float
        Features of each kind in a scan, on average.
    dropped : int
        Scans that a newer one replaced before they were worked at.
    lost : int
        Scans that the transport knows to have lost.
    malformed : int
        Messages that made no sense.
    unsent : int
        Messages that could not be sent, since who listens did not keep up.
    publishers : int
        Publishers of scans at the moment.
    total_scans, total_dropped, total_lost, total_malformed : int
        The same since the start.
    """

    seconds: float
    scans: int
    latency: tuple[float, float]
    invalid: float
    features: dict[str, float]
    dropped: int
    lost: int
    malformed: int
    unsent: int
    publishers: int
    total_scans: int
    total_dropped: int
    total_lost: int
    total_malformed: int

    @property
    def rate(self) -> float:
        """Scans a second."""
        return self.scans / self.seconds if self.seconds > 0 else 0.0

    @property
    def level(self) -> int:
        """0: all is well; 1: scans are dropped, lost or malformed; 3: none came (as in ROS)."""
        if not self.scans:
            return 3
        return int(self.dropped + self.lost + self.malformed + self.unsent > 0)

    @property
    def values(self) -> dict[str, str]:
        """The figures by name, as text."""
        p50, p99 = (f"{1e3 * value:.3f}" for value in self.latency)
        return {
            "rate [1/s]": f"{self.rate:.2f}",
            "latency p50 [ms]": p50,
            "latency p99 [ms]": p99,
            "dropped": f"{self.dropped}",
            "lost": f"{self.lost}",
            "malformed": f"{self.malformed}",
            "unsent": f"{self.unsent}",
            "invalid beams [%]": f"{100 * self.invalid:.1f}",
            **{f"{name} per scan": f"{mean:.1f}" for name, mean in self.features.items()},
            "publishers": f"{self.publishers}",
            "scans in all": f"{self.total_scans}",
            "dropped in all": f"{self.total_dropped}",
            "lost in all": f"{self.total_lost}",
            "malformed in all": f"{self.total_malformed}",
        }

    @property
    def totals(self) -> str:
        """What happened since the start, in a line."""
        return (
            f"{self.total_scans} scans, {self.total_dropped} dropped, {self.total_lost} lost, "
            f"{self.total_malformed} malformed messages"
        )

    def __str__(self) -> str:
        if not self.scans:
            publishers = f"{self.publishers} publisher{'s' if self.publishers != 1 else ''}"
            return f"no scans, {publishers}"
        p50, p99 = (1e3 * value for value in self.latency)
        found = ", ".join(f"{mean:.1f} {name}" for name, mean in self.features.items())
        faults = f"{self.dropped} dropped, {self.lost} lost, {self.malformed} malformed"
        return (
            f"{self.rate:.1f} scans/s, latency {p50:.2f} ms (p99 {p99:.2f}), {faults}, "
            f"{100 * self.invalid:.1f} % of beams invalid, per scan: {found}"
        )


class Counters:
    """Counts scans and faults, and makes a report of them now and then.

    Parameters
    ----------
    now : float
        The time at which counting begins [s].

    Examples
    --------
    >>> import lineament as ln
    >>> counters, scan = Counters(0.0), ln.LaserScan([2.0, 2.0, 2.0], 0.0, 0.01)
    >>> counters.add(scan, ln.extract(scan), 0.002)
    >>> print(counters.report(0.5, publishers=1))  # doctest: +ELLIPSIS
    2.0 scans/s, latency 2.00 ms (p99 2.00), 0 dropped, 0 lost, 0 malformed, 0.0 % of beams ...
    """

    def __init__(self, now: float) -> None:
        self.dropped = self.malformed = 0
        self.scans = 0
        self._total = dict.fromkeys(("scans", "dropped", "lost", "malformed", "unsent"), 0)
        self._reported = now
        self._begin()

    def _begin(self) -> None:
        self._latencies: deque[float] = deque(maxlen=_MOST)
        self._beams = self._invalid = 0
        self._found = dict.fromkeys(COUNTED, 0)

    def add(self, scan: LaserScan, features: Features, latency: float) -> None:
        """Count a scan whose features were told `latency` seconds after it came."""
        self.scans += 1
        self._latencies.append(latency)
        self._beams += len(scan)
        self._invalid += len(scan) - int(np.count_nonzero(scan.valid))
        for name, count in features.counts().items():
            self._found[name] += count

    def report(self, now: float, *, publishers: int, lost: int = 0, unsent: int = 0) -> Report:
        """Report on what was counted since the last report.

        Parameters
        ----------
        now : float
            The time [s].
        publishers : int
            Publishers of scans at the moment.
        lost, unsent : int
            Messages that the transport has lost, or could not send, since the start.
        """
        total = {
            "scans": self.scans,
            "dropped": self.dropped,
            "lost": lost,
            "malformed": self.malformed,
            "unsent": unsent,
        }
        since = {name: total[name] - self._total[name] for name in total}
        scans = since.pop("scans")
        latencies = np.array(self._latencies or [np.nan])
        p50, p99 = np.quantile(latencies, (0.5, 0.99)).tolist()
        report = Report(
            seconds=now - self._reported,
            scans=scans,
            latency=(p50, p99),
            invalid=self._invalid / self._beams if self._beams else float("nan"),
            features={name: count / max(scans, 1) for name, count in self._found.items()},
            publishers=publishers,
            **since,
            total_scans=total["scans"],
            total_dropped=total["dropped"],
            total_lost=total["lost"],
            total_malformed=total["malformed"],
        )
        self._total, self._reported = total, now
        self._begin()
        return report
