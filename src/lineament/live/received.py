"""What comes to a live node, and what it comes from."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from ..rosmsg.poses import Odometry
from ..scan import LaserScan

__all__ = ["Odometry", "Received", "Source", "Time"]

#: Seconds and nanoseconds of a stamp, exactly as a message has them.
Time = tuple[int, int]


class Received(NamedTuple):
    """A message that came, not yet decoded: most of those that wait are never worked at.

    Attributes
    ----------
    publisher : str
        Who sent it; of each publisher only the newest scan is worked at.
    read : callable
        Decodes it; ValueError in one line if it makes no sense.
    arrived : float
        When it was taken, by the clock `time.monotonic` [s].
    is_odometry : bool
        Whether it is an odometry rather than a scan.
    time : (int, int), optional
        Its stamp, exactly: what is told of it has the same. None where only `LaserScan.stamp`
        tells it.
    """

    publisher: str
    read: Callable[[], LaserScan | Odometry]
    arrived: float
    is_odometry: bool = False
    time: Time | None = None


class Source(Protocol):
    """Where scans come from: a topic, or a log that is played."""

    @property
    def lost(self) -> int:
        """Messages that are known to have been lost before they could be received."""

    @property
    def ended(self) -> bool:
        """Whether nothing will come any more."""

    @property
    def publishers(self) -> int:
        """How many there are at the moment."""

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds, and give all that came, oldest first."""

    def problems(self) -> list[str]:
        """Tell what keeps messages from coming, a line each; each is told once."""

    def close(self) -> None:
        """Stop listening."""
