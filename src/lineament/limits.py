"""What a log or a plan may be at most: limits of every reader and of the live node."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Self

#: So much may be unpacked from however little [bytes].
SPARE = 1 << 24


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of logs and plans, each above what programs write, and below what hurts.

    What is beyond one of them is a fault of one line, before memory or time is spent on it.

    Parameters
    ----------
    beams : int
        Beams of a scan.
    points : int
        Points of a cloud, or echoes of a scan.
    scans : int
        Scans of a log, or vertices of a graph.
    piece : int
        Bytes of a record, a chunk or a message of a bag.
    ratio : int
        How many times its packed size something has unpacked, beyond the first 16 MiB: recorded
        logs have 3 to 8.
    copy : int
        Bytes of a temporary copy, of what is in an archive or at an address.
    members : int
        Files in an archive.
    rows : int
        Rows of a database. At most 32 bytes of temporary files are used for each, and no more rows
        or bytes are read than the file has room for.
    line : int
        Bytes of a line of text, of a JSON object, or of the metadata of a bag.
    depth : int
        Depth of JSON, and of blocks in blocks.
    name : int
        Bytes of a name: of a topic, a type, a frame.
    drawing : int
        Bytes of the file of a plan.
    entities : int
        Entities of a drawing with its blocks expanded, rows of a table that is a plan, or borders
        between free and occupied cells of a grid.
    chords : int
        Chords that a curve of a drawing becomes, each off it by at most 1 cm.
    walls : int
        Lines of a drawing, those of curves included.
    cells : int
        Cells of an occupancy grid.
    fetch : int
        Seconds that a log at an address may take to answer, and each megabyte of it to arrive.

    Examples
    --------
    >>> Limits.of({"beams": 100}).check("beams", 181)
    Traceback (most recent call last):
    ValueError: has 181 beams in a scan, more than the limit of 100 (raise it by --limit beams=N, \
in Python limits={'beams': N})
    """

    beams: int = 1 << 16
    points: int = 4_000_000
    scans: int = 10_000_000
    piece: int = 1 << 27
    ratio: int = 100
    copy: int = 1 << 34
    members: int = 10_000
    rows: int = 100_000_000
    line: int = 1 << 22
    depth: int = 32
    name: int = 4096
    drawing: int = 1 << 26
    entities: int = 250_000
    chords: int = 10_000
    walls: int = 100_000
    cells: int = 1 << 26
    fetch: int = 60

    def __post_init__(self) -> None:
        for limit in fields(self):
            value = getattr(self, limit.name)
            if type(value) is not int or value < 1:
                raise ValueError(f"limit {limit.name} is {value!r}, expected a whole number ≥ 1")

    @classmethod
    def of(cls, given: Mapping[str, int] | None) -> Self:
        """Return the limits with some of them changed; ValueError for one that is not known."""
        known = [limit.name for limit in fields(cls)]
        for name in given or ():
            if name not in known:
                raise ValueError(f"limit {name!r} is unknown, expected one of {', '.join(known)}")
        return cls(**given or {})

    def check(self, name: str, value: int, error: Callable[[str], Exception] = ValueError) -> None:
        """Raise an error, made of a message of one line, if a value is beyond a limit."""
        most = getattr(self, name)
        if value > most:
            raise error(
                f"{_ABOUT[name].format(value)}, more than the limit of {most} "
                f"(raise it by --limit {name}=N, in Python limits={{{name!r}: N}})"
            )

    def check_growth(
        self, size: int, packed: int, error: Callable[[str], Exception] = ValueError
    ) -> None:
        """Check how many bytes something has unpacked, of so many that it was packed in."""
        if size > SPARE:
            self.check("ratio", size // max(packed, 1), error)


_ABOUT = {
    "beams": "has {} beams in a scan",
    "points": "has {} points or echoes in a scan",
    "scans": "has {} scans",
    "piece": "has {} bytes in a record, chunk or message",
    "ratio": "unpacks to {} times its packed size",
    "copy": "has {} bytes, to be copied",
    "members": "has {} files",
    "rows": "has {} rows",
    "line": "has {} bytes in a line or JSON object",
    "depth": "has {} levels of JSON, or of blocks",
    "name": "has {} bytes in a name",
    "drawing": "has {} bytes in a plan",
    "entities": "has {} entities, rows or borders of cells, blocks expanded",
    "chords": "has {} chords in a curve",
    "walls": "has {} lines",
    "cells": "has {} cells",
    "fetch": "takes {} s to answer, or to send a megabyte",
}
#: What holds unless something else is asked for.
LIMITS = Limits()
