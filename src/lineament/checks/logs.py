"""Check of a reader: what every log offers, and what comes of one that is damaged."""

from __future__ import annotations

import copy
import math
import pickle
import shutil
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import zip_longest
from pathlib import Path
from random import Random

import numpy as np

from ..errors import LogError
from ..files import StrPath
from ..logs import Log
from ..logs.base import Topic
from ..scan import LaserScan
from .claims import claim, claim_raises, during, taking_turns, without_warnings, words_of

#: Opens a log by its path; ``keep_going=True`` has it skip what is faulty.
Reader = Callable[..., Log]

#: Scans, each so that it can be compared.
Words = list[object]

_THREADS = 4


def check_log(
    reader: Reader, sample: StrPath, *, streams: bool = True, marked: bool = False, tries: int = 40
) -> None:
    """Check a reader: what its log offers, and that damage ends in one line or in fewer scans.

    A log has as many scans as it says, the same at each reading, by index, by slice, by threads and
    in copies; scans have finite stamps and bearings that increase. Of the sample cut off anywhere
    come scans that the whole one has (but for the last, where a number may break off), and at most
    one LogError of one line that begins with the path. With bytes changed anything may be read, but
    it is scans or such an error; with ``keep_going``, as many scans at least, and faults are
    counted.

    Parameters
    ----------
    reader : callable
        ``reader(path, keep_going=False)`` opens a log: `open_log`, or a subclass of `Log`.
    sample : path-like
        A log without faults, of a few scans: a file, or the folder of a bag. It is copied.
    streams : bool
        Whether what comes before a cut is read by `keep_going`, of some cut 0.7 of the scans; not
        where all of a log is one object, or its index is at its end.
    marked : bool
        Whether such a log says where it ends, as bags do and archives: without its end there is an
        error, or every scan.
    tries : int
        Cuts, and copies with bytes changed, that are tried; always the same.

    Raises
    ------
    AssertionError
        If anything of this does not hold: one line that names the sample and what broke.

    Examples
    --------
    >>> import tempfile, lineament as ln
    >>> path = tempfile.mkdtemp() + "/two.npz"
    >>> ln.logs.save_npz(path, [ln.LaserScan([1.0, 2.0], 0.0, 0.1, stamp=k) for k in (1.0, 2.0)])
    >>> check_log(ln.open_log, path, streams=False)
    """
    with during(Path(sample).name), without_warnings(), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(sample).name
        (shutil.copytree if Path(sample).is_dir() else shutil.copyfile)(sample, path)
        with during("a whole log"):
            whole = _read_in_every_way(partial(reader, path))
        parts = sorted(path.iterdir()) if path.is_dir() else [path]
        part = max(parts, key=lambda one: one.stat().st_size)
        data, chance = part.read_bytes(), Random(0)
        most = 0
        for size in np.linspace(0, len(data) - 1, tries).astype(int).tolist():
            part.write_bytes(data[:size])
            with during(f"cut off after {size} of {len(data)} bytes"):
                scans, kept, error = _damaged(reader, path)
                is_said = error or not marked or len(scans) == len(whole)
                claim(is_said, f"{len(scans)} of {len(whole)} scans, and no error")
                _claim_beginning(scans, whole)
                _claim_beginning(kept, whole)
            most = max(most, len(kept))
        claim(not streams or most >= 0.7 * len(whole), f"cut off: {most} of {len(whole)} scans")
        for _ in range(tries):
            changes = [(chance.randrange(len(data)), chance.randrange(256)) for _ in range(3)]
            changed = bytearray(data)
            for at, byte in changes:
                changed[at] = byte
            part.write_bytes(bytes(changed))
            with during(f"with bytes {changes} changed"):
                _damaged(reader, path)


def _words(log: Log) -> Words:
    return [words_of(scan) for scan in log]


def _read_in_every_way(opened: Callable[..., Log]) -> Words:
    """Return the scans of a log without faults."""
    log = opened()
    items, n = list(log.items()), len(log)
    whole = [words_of(scan) for _, scan in items]
    claim(n > 0, "has no scans: they are few to check")
    claim(len(items) == n, f"len is {n}, and {len(items)} scans come")
    for k, (topic, scan) in enumerate(items):
        claim(topic in log.topics, f"scan {k} is of topic {topic!r}, which topics has not")
        problem = _problem(scan)
        claim(not problem, f"scan {k}: {problem}")
    claim(all(isinstance(one, Topic) for one in log.contents()), "contents are no Topics")
    for topic in log.topics:
        with during(f"topic {topic!r}"):
            claim(topic in dict(items), "has no scans")
    claim_raises(IndexError, lambda: log[n], f"log[{n}]")
    claim_raises(LogError, lambda: log.scan(-1), "log.scan(-1)")
    claim_raises(LogError, lambda: log.scan(n), f"log.scan({n})")
    middle = n // 2
    ways: dict[str, Callable[[], object]] = {
        "a second reading": lambda: _words(log),
        "two readings at once": lambda: [
            words_of(scan) for scan, _ in zip_longest(log, log, fillvalue=items[0][1])
        ],
        "a slice": lambda: [words_of(scan) for scan in (*log[:middle], *log[middle:])],
        "an index": lambda: [*whole[:-1], words_of(log[-1])],
        "scan": lambda: [words_of(log.scan(0)), *whole[1:]],
        "a copy": lambda: _words(copy.copy(log)),
        "a pickled copy": lambda: _words(pickle.loads(pickle.dumps(log))),
        "keep_going": lambda: _words(opened(keep_going=True)),
    }
    for way, read in ways.items():
        with during(way):
            claim(read() == whole, "gives other scans")
    claim(log.skipped == 0 and not log.faults, "faults are counted where there are none")
    with during("threads"), taking_turns(), ThreadPoolExecutor(_THREADS) as pool:
        found = list(pool.map(_words, [log] * _THREADS))
        claim(found == [whole] * _THREADS, "that read one log get other scans")
    return whole


def _problem(scan: object) -> str:
    """Return what cannot be of a scan, "" if all can be."""
    if type(scan) is not LaserScan:
        return f"is a {type(scan).__name__}, expected a LaserScan"
    if not math.isfinite(scan.stamp):
        return f"stamp is {scan.stamp}"
    if not np.isfinite(scan.angles).all() or not (np.diff(scan.angles) > 0).all():
        return "bearings do not increase"
    if scan.ranges.flags.writeable or scan.angles.flags.writeable:
        return "its arrays can be written to"
    if scan.pose is not None and not np.isfinite(scan.pose).all():
        return f"pose is {scan.pose}"
    return ""


def _damaged(reader: Reader, path: Path) -> tuple[Words, Words, str]:
    """Return the scans of a damaged log up to the first error, those by `keep_going`, the error."""
    scans, error, _ = _until_error(reader, path, False)
    kept, broken, skipped = _until_error(reader, path, True)
    claim(len(kept) >= len(scans), f"keep_going gives {len(kept)} scans, and without {len(scans)}")
    claim(kept[: len(scans)] == scans, "keep_going gives other scans before the first fault")
    claim(broken or skipped or not error, f"keep_going counts no fault, and without it: {error}")
    return scans, kept, error


def _until_error(reader: Reader, path: Path, keep: bool) -> tuple[Words, str, int]:
    """Return the scans of a log, the error that ends it, and how many faults it counts."""
    scans: Words = []
    try:
        log = reader(path, keep_going=keep)
        count = len(log)
        for scan in log:
            problem = _problem(scan)
            claim(not problem, f"scan {len(scans)}: {problem}")
            scans.append(words_of(scan))
    except LogError as error:
        line = str(error)
        claim(line.isprintable() and len(line) < 2000, f"the error is not one line: {line!r:.200}")
        claim(line.startswith(str(path)), f"the error does not begin with the path: {line}")
        return scans, line, 0
    claim(keep or log.skipped == 0, "faults are skipped without keep_going")
    claim(len(scans) <= count, f"len is {count}, and {len(scans)} scans come")
    claim(bool(log.faults) == (log.skipped > 0), "skipped is not the number of faults")
    claim(all(fault.isprintable() for fault in log.faults), "a fault is not one line")
    return scans, "", log.skipped


def _claim_beginning(scans: Words, whole: Words) -> None:
    """Claim that scans are those that a whole log begins with; the last may have broken off."""
    claim(len(scans) <= len(whole), f"{len(scans)} scans, more than the {len(whole)} of all of it")
    for k, (one, other) in enumerate(zip(scans[:-1], whole, strict=False)):
        claim(one == other, f"scan {k} is not that of the whole log")
