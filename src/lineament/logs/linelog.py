"""What the logs of text lines have in common: lines of several kinds, some of them scans."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Collection, Iterator
from typing import ClassVar

from ..errors import LogError
from .base import Log, Topic
from .lines import numbered_lines

__all__ = ["LineLog"]


class LineLog(Log):
    """A log of text lines, plain or gzip; some kinds of them hold a scan each.

    A format tells the kind of a line (`_kind`) and makes scans of them (`_items`, over `_lines`).

    Raises
    ------
    LogError
        If there is no such topic, or no line with a scan at all.
    """

    #: The kinds of lines that hold a scan.
    scan_kinds: ClassVar[tuple[str, ...]]
    #: Those that are read unless one is asked for.
    read_kinds: ClassVar[tuple[str, ...]]

    def _open(self) -> None:
        self._counts: Counter[str] | None = None
        self._wanted = self.read_kinds if self.topic is None else (self.topic,)
        # Stops at the first scan: a good log opens at once, however long it is.
        known = self.topic is None or self.topic in self.scan_kinds
        found = self._survey(self._wanted if known else ())
        if not known or not any(found[name] for name in self._wanted):
            raise self._no_scans(found)

    @staticmethod
    @abstractmethod
    def _kind(line: bytes) -> str:
        """Name the kind of a line; empty for one that is none of the format's."""

    @property
    def topics(self) -> list[str]:
        """The kinds of lines in the log that hold a scan."""
        return [name for name in self.scan_kinds if self._all_counts()[name]]

    def contents(self) -> list[Topic]:
        """Tell all kinds of lines that the log holds."""
        return [Topic(name, "", count) for name, count in self._all_counts().most_common()]

    def __len__(self) -> int:
        return sum(self._all_counts()[name] for name in self._wanted)

    def _all_counts(self) -> Counter[str]:
        if self._counts is None:
            self._counts = self._survey(())
        return self._counts

    def _survey(self, until: Collection[str]) -> Counter[str]:
        """Count the lines of each kind, without parsing, up to the first one of `until`."""
        counts: Counter[str] = Counter()
        try:
            for _, line in numbered_lines(self.source):
                name = self._kind(line)
                if name:
                    counts[name] += 1
                    if name in until:
                        break
        except LogError:
            # Without a scan before the break there is nothing to keep going with.
            if not self.keep_going or not any(counts[name] for name in self._wanted):
                raise
        return counts

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        """Read the lines with their numbers; a stream that breaks is a fault at its end."""
        return self._until_broken(numbered_lines(self.source))

    def _bad_line(self, number: int, error: Exception) -> None:
        """Report what is wrong with a line."""
        self._fault(LogError(self.name, str(error), line=number))

    def _no_scans(self, found: Counter[str]) -> LogError:
        topics = [name for name in self.scan_kinds if found[name]]
        if not found:
            return LogError(self.name, f"is no log of {self.description}")
        if self.topic is not None:
            return self._no_such_topic(topics)
        there = ", ".join(f"{name} ({count})" for name, count in found.most_common(8))
        choose = f"; choose topic {topics[0]}" if topics else ""
        return LogError(
            self.name, f"holds {there}, expected {' or '.join(self.read_kinds)}{choose}"
        )
