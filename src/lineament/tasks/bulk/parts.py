"""What a worker does: one log into its part of a data set."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...errors import LineamentError
from ...extractor import Extractor
from ...files import made_folder
from ...logs.sources import is_address
from ...methods import Method
from ...scan import RangeNoise
from ..extract import extract_log
from .manifest import Row

__all__ = ["Report", "Task", "extract_part", "failed", "log_state"]

#: ``report(scans, total)`` tells how far a log is.
Report = Callable[[int, int], None]

#: Seconds between two reports.
_PERIOD = 0.2


@dataclass(frozen=True, slots=True)
class Task:
    """All that a worker needs to know, wherever it runs.

    Parameters
    ----------
    row : Row
        The log, its name, its output, and the configuration.
    folder : str
        Full path of the data set.
    method : Method
        The method.
    noise : RangeNoise or None
        The noise, unless it is estimated.
    reading : dict
        How the log is read, as `open_log` takes it.
    """

    row: Row
    folder: str
    method: Method
    noise: RangeNoise | None
    reading: dict[str, Any]


def _unreported(scans: int, total: int) -> None:
    """Report to nobody."""


def extract_part(task: Task, report: Report = _unreported) -> Row:
    """Extract the features of one log into its file.

    Whatever is wrong with the log is told by the row, and stops no other log.

    Parameters
    ----------
    task : Task
        The log.
    report : callable
        ``report(scans, total)`` is called several times a second. What it raises ends the work.

    Returns
    -------
    Row
        The row of the task, completed.
    """
    started = time.perf_counter()
    part = Path(task.folder, task.row.output)
    # Before it is read: a log that grows meanwhile is not what its row says, and is done again.
    size, state = log_state(task.row.log)
    row = replace(task.row, log_bytes=size, log_state=state)
    try:
        _clear(made_folder(part.parent))
        found = extract_log(
            row.log,
            part,
            Extractor(task.method, noise=task.noise),
            topic_column=True,
            track=_reporting(report),
            **task.reading,
        )
        written = part.stat().st_size
    except LineamentError as error:
        row = failed(row, str(error))
    except Exception as error:
        row = failed(row, f"{row.log}: {type(error).__name__}: {error}")
    else:
        row = replace(
            row,
            outcome="done",
            bytes=written,
            topics=found.topics,
            scans=found.scans,
            features=found.features,
            invalid=found.invalid,
            skipped=found.skipped,
            faults=found.faults,
        )
    finally:
        with suppress(OSError):
            part.parent.rmdir()  # if there is nothing in it
    return replace(row, seconds=time.perf_counter() - started)


def failed(row: Row, error: str) -> Row:
    """Complete the row of a log that failed."""
    return replace(row, outcome="failed", error=" ".join(error.split()))


def _clear(folder: Path) -> None:
    """Remove what a worker that was killed has left of its file."""
    for left in folder.glob(".part-0.*.part"):
        with suppress(OSError):
            left.unlink()


def _reporting(report: Report) -> Callable[[Any, str, int], Iterable[Any]]:
    def track(items: Iterable[Any], about: str, total: int) -> Iterator[Any]:  # noqa: ARG001
        told = -_PERIOD
        for done, item in enumerate(items):
            now = time.monotonic()
            if now - told >= _PERIOD:
                told = now
                report(done, total)
            yield item

    return track


def log_state(log: str) -> tuple[int | None, str]:
    """Tell the size of a log, and what changes when the log does.

    Returns
    -------
    size : int or None
        Bytes; of the whole archive for a log in one. None if it is not known.
    state : str
        The time of the last change [ns], or what the store of an address tells; empty if unknown.

    Examples
    --------
    >>> log_state("/none.bag")
    (None, '')
    """
    try:
        return _remote_state(log) if is_address(log) else _local_state(Path(log))
    except Exception:  # whatever a driver raises: opening the log tells what is wrong
        return None, ""


def _local_state(path: Path) -> tuple[int, str]:
    archive = next((above for above in path.parents if above.is_file()), path)
    files = [file for file in path.rglob("*") if file.is_file()] if path.is_dir() else [archive]
    states = [os.stat(file) for file in files]  # noqa: PTH116
    return sum(s.st_size for s in states), str(max(s.st_mtime_ns for s in states))


def _remote_state(address: str) -> tuple[int | None, str]:
    import fsspec

    system, root = fsspec.core.url_to_fs(address)
    return system.info(root).get("size"), str(system.ukey(root))
