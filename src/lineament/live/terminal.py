"""`Terminal`: a line where a robot is found or lost, or another localiser becomes wrong."""

from collections import Counter
from collections.abc import Callable

from ..mapping.judging import JUDGEMENTS
from .config import LiveConfig
from .counters import Report
from .pipeline import Frame
from .plan_topics import statuses

#: A status is a line once it has lasted for so long [s]: at its bounds it changes to and fro.
_LASTING = 1.0
#: From this level on a pose is not known, or wrong.
_ERROR = 2


class Terminal:
    """A sink that writes where a status of a pose becomes an error, or is one no longer.

    Parameters
    ----------
    write : callable
        Called with each line.
    config : LiveConfig
        Of a node with a plan.
    """

    unsent = 0

    def __init__(self, write: Callable[[str], None], config: LiveConfig) -> None:
        self._write, self._config = write, config
        self._written: dict[str, bool] = {}
        self._last: dict[str, tuple[bool, float]] = {}
        self._judged: Counter[str] = Counter()

    @property
    def summary(self) -> str:
        """Verdicts on the poses of the other localiser, in one line; empty where none is judged."""
        if self._config.judge is None:
            return ""
        n = sum(map(self._judged.__getitem__, JUDGEMENTS))
        shares = (f"{name} {100 * self._judged[name] / max(n, 1):.1f} %" for name in JUDGEMENTS)
        lacking = f"; {self._judged['']} without a pose" if self._judged[""] else ""
        return f"{self._config.judge_topic}: {n} scans judged, {', '.join(shares)}{lacking}"

    def publish(self, frame: Frame) -> None:
        """Write what has changed, once it lasts."""
        stamp = frame.scan.stamp
        for status in statuses(frame, self._config):
            name, is_error = status.name, status.level >= _ERROR
            was_error, since = self._last.get(name, (None, stamp))
            if was_error != is_error:
                since = stamp
            self._last[name] = is_error, since
            if self._written.get(name) != is_error and abs(stamp - since) >= _LASTING:
                self._written[name] = is_error
                self._write(f"{name}: {status.summary}, since {since:.3f} s")
        judgement = frame.judgement
        self._judged["" if judgement is None else judgement.verdict] += 1

    def diagnose(self, report: Report, time: tuple[int, int]) -> None:
        """Do nothing: the report is shown elsewhere."""
