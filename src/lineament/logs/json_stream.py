"""Streams of JSON objects, one after the other, in bounded memory."""

import codecs
import json
import os
import re
from collections.abc import Iterator
from typing import Any

from ..errors import LogError
from ..limits import LIMITS, Limits
from .lines import chunks

#: What is broken may be read several times, up to so many characters beside 16 times the whole.
SPARE = 1 << 24
_SPARE_RATIO = 16
#: Each fault counts as at least so many characters.
_LEAST_WASTE = 1000

_decode = json.JSONDecoder().raw_decode
_SPACE = re.compile(r"[\s\ufeff]*")
_NEXT = re.compile(r"\n(?=\{)")
_NESTING = re.compile(r'"(?:[^"\\]|\\.)*+"|[][{}]')


def json_objects(
    path: str | os.PathLike[str], limits: Limits = LIMITS
) -> Iterator[dict[str, Any] | LogError]:
    """Yield each JSON object of a file, plain or gzip, or what is wrong with it.

    After an object that is broken, reading goes on at the next line that begins with a brace; in a
    file that is broken all over, where that would take much longer than to read it, it ends. A
    fault has the line on which what is broken begins; LogError if the file cannot be opened.
    """
    text = _Text(path, limits)
    while text.skip_space():
        line = text.line
        try:
            found = text.read_value()
        except ValueError as error:
            # Of a stream that breaks, only that is reported: it ends within a value.
            if text.broken is None:
                yield LogError(path, str(error), line=line)
            text.skip_to_object()
        else:
            is_object = isinstance(found, dict)
            yield found if is_object else LogError(path, "is no JSON object", line=line)
    if text.broken is not None:
        yield LogError(path, text.broken.problem, line=text.line)


class _Text:
    """A text that is read as far as it is needed, and how far that is."""

    def __init__(self, path: str | os.PathLike[str], limits: Limits) -> None:
        self._path, self._limits, self._pieces = path, limits, chunks(path, limits)
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._text, self._at = "", 0
        self._passed = self._wasted = 0
        #: Number of the line that was reached, from 1.
        self.line = 1
        #: What ended the stream too early.
        self.broken: LogError | None = None

    def skip_space(self) -> bool:
        """Go to the next value; False if there is none."""
        while True:
            match = _SPACE.match(self._text, self._at)
            self._go(match.end() if match else self._at)
            if self._at < len(self._text):
                return True
            if not self._grow():
                return False

    def read_value(self) -> Any:
        """Return the value that begins here, and go behind it; ValueError if it is broken."""
        while True:
            problem, found = "", None
            try:
                found, end = _decode(self._text, self._at)
            except RecursionError:
                problem, end = "nested too deep for this Python", len(self._text)
            except ValueError as error:
                if len(self._text) - self._at <= self._limits.line and self._grow():
                    continue
                # Of a number with too many digits there is no place.
                problem = getattr(error, "msg", str(error))
                end = getattr(error, "pos", len(self._text))
            try:
                self._check(end)
                if problem:
                    raise ValueError(f"JSON is broken: {problem}")
            except ValueError:
                self._waste(end - self._at)
                raise
            self._go(end)
            return found

    def _check(self, end: int) -> None:
        """Check the length and depth of what begins here; ValueError if it is beyond a limit."""
        text, begin, depth = self._text, self._at, 0
        self._limits.check("line", end - begin)
        # Brackets in strings count here, so that most objects need no other look.
        if text.count("[", begin, end) + text.count("{", begin, end) > self._limits.depth:
            for token in _NESTING.finditer(text, begin, end):
                depth += {"[": 1, "{": 1, "]": -1, "}": -1}.get(token[0], 0)
                self._limits.check("depth", depth)

    def skip_to_object(self) -> None:
        """Go to the next line that begins with a brace, or to the end."""
        while True:
            match = _NEXT.search(self._text, self._at)
            if match:
                self._go(match.end())
                return
            # The last line end may be followed by a brace.
            self._go(max(self._at, len(self._text) - self._text.endswith("\n")))
            if not self._grow():
                self._go(len(self._text))
                return

    def _go(self, end: int) -> None:
        self.line += self._text.count("\n", self._at, end)
        self._passed += end - self._at
        self._at = end

    def _waste(self, n: int) -> None:
        """Note that `n` characters were read in vain; too many of them end the stream."""
        self._wasted += max(n, _LEAST_WASTE)
        if self._wasted > SPARE + _SPARE_RATIO * self._passed:
            self.broken = LogError(self._path, "is broken in too many places, expected JSON")
            self._pieces, self._text, self._at = iter(()), "", 0

    def _grow(self) -> bool:
        """Have at least twice as much ahead, which bounds the work; False at the end."""
        more, self._at = [self._text[self._at :]], 0
        before = size = len(more[0])
        try:
            while size <= 2 * before:
                more.append(self._decoder.decode(next(self._pieces)))
                size += len(more[-1])
        except StopIteration:
            pass
        except LogError as error:
            self.broken = error.fresh()
        self._text = "".join(more)
        return size > before
