"""How far a run over many logs is."""

from __future__ import annotations

import time
from collections.abc import Iterable

from ...logs.sources import is_address
from .manifest import Row
from .parts import log_state

__all__ = ["Progress"]


class Progress:
    """Adds up what the workers report.

    Parameters
    ----------
    logs : iterable of str
        The logs that are to be done.
    """

    def __init__(self, logs: Iterable[str]) -> None:
        # Many stores take longer to tell sizes than they are worth here.
        sizes = {log: None if is_address(log) else log_state(log)[0] for log in logs}
        known = [size for size in sizes.values() if size]
        typical = sum(known) / len(known) if known else 1.0
        #: What a log counts for in the time left: its size, or that of a typical one.
        self._weights = {log: size or typical for log, size in sizes.items()}
        self._started = time.monotonic()
        self._under_way: dict[str, tuple[int, int]] = {}
        self._done, self._failed, self._scans, self._weight_done = 0, 0, 0, 0.0

    def report(self, log: str, scans: int, total: int) -> None:
        """Note how far a log is, from any thread."""
        self._under_way[log] = scans, total

    def finish(self, row: Row) -> None:
        """Note that a log is done or has failed."""
        self._under_way.pop(row.log, None)
        self._done += 1
        self._failed += row.outcome != "done"
        self._scans += row.scans
        self._weight_done += self._weights[row.log]

    def __str__(self) -> str:
        seconds = max(time.monotonic() - self._started, 1e-9)
        under_way = list(self._under_way.items())
        scans = self._scans + sum(done for _, (done, _) in under_way)
        weight = self._weight_done + sum(
            self._weights[log] * done / max(total, 1) for log, (done, total) in under_way
        )
        share = weight / sum(self._weights.values())
        told = [f"{self._done}/{len(self._weights)} logs"]
        if self._failed:
            told.append(f"{self._failed} failed")
        told.append(f"{scans / seconds:.0f} scans/s")
        if share > 0:
            told.append(f"{_duration(seconds * max(1 / share - 1, 0.0))} left")
        return ", ".join(told)


def _duration(seconds: float) -> str:
    """Write a time as hours, minutes and seconds.

    Examples
    --------
    >>> _duration(75.4), _duration(3600)
    ('1:15', '1:00:00')
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
