"""Logs of text lines: what a line is, which numbers its words are, and which scan they make."""

import re
from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..scan import LaserScan
from .base import Head, Log, Topic
from .lines import numbered_lines

#: Of so short words there are few, as of ranges in centimetres: so many are kept. One word in so
#: many of a list shows whether it has such.
_SHORT, _MOST, _EVERY = 5, 1 << 14, 16

#: What may stand before the first word.
_BLANKS = tuple(bytes((code,)) for code in b" \t\r\v\f")

#: Makes a scan of a line of some kind; None where the line holds what later scans need.
Parser = Callable[[str, bytes], LaserScan | None]


class LineLog(Log):
    """A log of text lines, plain or gzip; some kinds of them hold a scan each.

    A format states how its lines begin and what makes scans of them (`_parser`).
    """

    #: What the beginning of a file in this format contains.
    signature: ClassVar[re.Pattern[bytes]]
    #: The kinds of lines, which are their first words.
    kinds: ClassVar[tuple[str, ...]] = ()
    #: The kinds of lines that hold a scan, and those that are read unless one is asked for.
    scan_kinds: ClassVar[tuple[str, ...]]
    read_kinds: ClassVar[tuple[str, ...]]
    #: The kinds of lines that hold what the scans behind them need.
    other_kinds: ClassVar[tuple[str, ...]] = ()

    def _open(self) -> None:
        self._known = {kind.encode(): kind for kind in self.kinds}
        self._wanted = self.read_kinds if self.topic is None else (self.topic,)
        # Stops at the first scan: a good log opens at once, however long it is.
        known = self.topic is None or self.topic in self.scan_kinds
        found = self._survey(self._wanted if known else ())
        if not known or not any(found[name] for name in self._wanted):
            raise self._no_scans(found)

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether the beginning of the file contains the signature of the format."""
        return cls.signature.search(head.data) is not None

    @abstractmethod
    def _parser(self) -> Parser:
        """Return what makes scans of the lines of one iteration."""

    def _kind(self, line: bytes) -> str:
        """Return the kind of a line; empty for one that the format does not know."""
        # No need to split the thousand characters behind it.
        words = line[:24].split(None, 1)
        return self._known.get(words[0], "") if words else ""

    def _lines(self, kinds: Collection[str] = ()) -> Iterator[tuple[int, bytes]]:
        """Yield numbered lines: those that begin as some kinds do, and a few others; or all."""
        begins = (*map(str.encode, kinds), *_BLANKS) if kinds else ()
        return numbered_lines(self.source, self.limits, begins)

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        parse = self._parser()
        needed = {*self._wanted, *self.other_kinds}
        for number, line in self._until_broken(self._lines(needed & {*self.kinds})):
            kind = self._kind(line)
            if kind not in needed:
                continue
            try:
                scan = parse(kind, line)
            except (ValueError, OverflowError) as error:
                self._fault(LogError(self.name, str(error), line=number))
            else:
                if scan is not None:
                    yield kind, scan

    @property
    def topics(self) -> list[str]:
        """The kinds of lines in the log that hold a scan."""
        return [name for name in self.scan_kinds if self._counts[name]]

    def contents(self) -> list[Topic]:
        """Return all kinds of lines in the log."""
        return [Topic(name, "", count) for name, count in self._counts.most_common()]

    def __len__(self) -> int:
        return sum(self._counts[name] for name in self._wanted)

    @cached_property
    def _counts(self) -> Counter[str]:
        return self._survey(())

    def _survey(self, until: Collection[str]) -> Counter[str]:
        """Count the lines of each kind, without parsing, up to the first one of `until`."""
        counts: Counter[str] = Counter()
        try:
            for _, line in self._lines():
                kind = self._kind(line)
                if kind:
                    counts[kind] += 1
                    if kind in until:
                        break
        except LogError:
            # Without a scan before the break there is nothing to keep going with.
            if not self.keep_going or not any(counts[name] for name in self._wanted):
                raise
        return counts

    def _no_scans(self, found: Counter[str]) -> LogError:
        topics = [name for name in self.scan_kinds if found[name]]
        if not found:
            return LogError(self.name, f"is no log of {self.description}: has no such line")
        if self.topic is not None:
            return self._no_such_topic(topics)
        there = ", ".join(f"{name} ({count})" for name, count in found.most_common(8))
        choose = f"; choose topic {topics[0]}" if topics else ""
        return LogError(
            self.name, f"holds {there}, expected {' or '.join(self.read_kinds)}{choose}"
        )


class Fields:
    """The words of a line by name, as a pattern gives them.

    In the pattern ``x`` is a number, ``_`` a word that is not read, and ``ranges*`` a count and as
    many numbers. Words behind a pattern without such a list are not read.
    ``ranges,intensities*`` is a count and as many pairs.

    Examples
    --------
    >>> line = Fields("Laser", "ranges* stamp _").read(b"Laser 2 1.5 81.83 7 host")
    >>> line["ranges"].tolist(), line["stamp"]
    ([1.5, 81.83], 7.0)
    """

    def __init__(self, kind: str, pattern: str) -> None:
        self._kind, self._least = kind, len(pattern.split())
        #: Numbers by their places, how many words these are, and the list behind them.
        self._pieces: list[tuple[list[tuple[str, int]], int, str]] = []
        for piece in re.split(r"(?<=\*)", pattern):
            names = piece.split()
            name = names.pop().removesuffix("*") if "*" in piece else ""
            places = [(name, at) for at, name in enumerate(names) if name != "_"]
            self._pieces.append((places, len(names), name))

    def read(self, line: bytes) -> dict[str, Any]:
        """Return numbers and arrays by name; ValueError if the line does not fit."""
        kind, words, number = self._kind, line.split(), number_parser(line)
        if len(words) <= self._least:
            raise ValueError(f"{kind} has {len(words) - 1} values, expected {self._least} or more")
        values: dict[str, Any] = {}
        at, behind = 1, self._least
        for i, (places, width, name) in enumerate(self._pieces):
            try:
                for field, place in places:
                    values[field] = number(words[at + place])
            except ValueError:
                raise _no_number(f"{kind} {field}", words[at + place]) from None
            at, behind = at + width + 1, behind - width - 1
            if name:
                count = words[at - 1]
                if not count.isdigit() or len(count) > 9:
                    raise _no_number(f"{kind}: the number of {name}", count, "a whole number")
                lists = name.split(",")
                n, left = int(count), (len(words) - at - behind) / len(lists)
                # Behind the last list are as many words as the pattern has.
                if n > left or (n < left and i == len(self._pieces) - 2):
                    where = f" before its last {behind} values" if behind else ""
                    raise ValueError(f"{kind} says {n} {name} and has {left:g} of them{where}")
                end = at + n * len(lists)
                for k, each in enumerate(lists):
                    given = words[at + k : end : len(lists)]
                    values[each] = numbers(each.removesuffix("s"), given, number)
                at = end
        return values


def number_parser(line: bytes) -> Callable[[bytes], float]:
    """Return what makes numbers of the words of a line: Python's own notation 1_0 is refused."""
    return _plain_float if b"_" in line else float


def _plain_float(word: bytes) -> float:
    if b"_" in word:
        raise ValueError
    return float(word)


class _Values(dict[bytes, float]):
    """Numbers of short words: a log has the same ones over and over, to be parsed once."""

    def __missing__(self, word: bytes) -> float:
        if len(self) >= _MOST:
            self.clear()
        value = self[word] = float(word)
        return value


_VALUES = _Values()


def numbers(
    what: str, words: list[bytes], number: Callable[[bytes], float] = _plain_float
) -> NDArray[np.float64]:
    """Return words as numbers; ValueError names the first that is not one."""
    known = number is float and max(map(len, words[::_EVERY]), default=0) <= _SHORT
    try:
        return np.fromiter(
            map(_VALUES.__getitem__ if known else number, words), np.float64, len(words)
        )
    except ValueError:
        for i, word in enumerate(words):
            scalar(f"{what} {i + 1} of {len(words)}", word, number)
        raise


def scalar(what: str, word: bytes, number: Callable[[bytes], float] = _plain_float) -> float:
    """Return a word as a number; ValueError if it is not one."""
    try:
        return number(word)
    except ValueError:
        raise _no_number(what, word) from None


def _no_number(what: str, word: bytes, expected: str = "a number") -> ValueError:
    shown = word[:24].decode("ascii", "backslashreplace")  # Whatever its bytes.
    return ValueError(f"{what} is '{shown}', expected {expected}")
