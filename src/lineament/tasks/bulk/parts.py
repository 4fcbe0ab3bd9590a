"""What a worker does: one log into its part of a data set."""

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from ...errors import LineamentError, heard
from ...extractor import Extractor
from ...files import made_folder
from ...logs.sources import is_address
from ...methods import Method
from ...output import ENDINGS
from ...progress import Track
from ...scan import RangeNoise
from ..extract import Extraction, extract_log
from .manifest import Row

#: Called as ``report(scans, total)``.
Report = Callable[[int, int], None]

#: Seconds between two reports.
_PERIOD = 0.2

#: What a row takes of an extraction; its log, output and time are its own.
_FOUND = {field.name for field in fields(Extraction)} - {"log", "output", "seconds"}


@dataclass(frozen=True, slots=True)
class Task:
    """All that a worker needs, wherever it runs."""

    row: Row
    folder: str  # full path of the data set
    method: Method
    noise: RangeNoise | None
    reading: dict[str, Any]  # as for `open_log`
    world: bool = False


def extract_part(task: Task, report: Report = lambda scans, total: None) -> Row:  # noqa: ARG005
    """Extract the features of one log into its file; return the completed row.

    A fault of the log is in the row. `report` is called several times a second; what it raises ends
    the work.
    """
    started = time.perf_counter()
    part = Path(task.folder, task.row.output)
    # Taken before it is read: a log that grows meanwhile is done again.
    size, state = log_state(task.row.log)
    row = replace(task.row, log_bytes=size, log_state=state)
    try:
        for left in made_folder(part.parent).glob(".part-0.*.part"):  # by a killed worker
            with suppress(OSError):
                left.unlink()
        with heard() as warnings:
            found = extract_log(
                row.log,
                part,
                Extractor(task.method, noise=task.noise),
                world=task.world,
                track=_reporting(report),
                **task.reading,
            )
        row = replace(row, warnings=warnings)
        written = part.stat().st_size
        for former in part.parent.glob("part-0.*"):
            # In another format: the data set has one file of each log.
            if former != part and former.name.removeprefix("part-0") in ENDINGS:
                former.unlink()
    except LineamentError as error:
        row = failed(row, str(error))
    except Exception as error:
        row = failed(row, f"{row.log}: {type(error).__name__}: {error}")
    else:
        kept = {name: getattr(found, name) for name in _FOUND}
        row = replace(row, outcome="done", bytes=written, **kept)
    finally:
        with suppress(OSError):
            part.parent.rmdir()  # if there is nothing in it
    return replace(row, seconds=time.perf_counter() - started)


def failed(row: Row, error: str) -> Row:
    """Return the row of a log that failed."""
    return replace(row, outcome="failed", error=" ".join(error.split()))


def _reporting(report: Report) -> Track:
    def track(items: Iterable[Any], about: str, whole: Sized) -> Iterator[Any]:  # noqa: ARG001
        last = time.monotonic()
        for done, item in enumerate(items):
            now = time.monotonic()
            if now - last >= _PERIOD:
                last = now
                report(done, len(whole))
            yield item

    return track


def log_state(log: str) -> tuple[int | None, str]:
    """Return the size of a log [bytes], and what changes when the log does; (None, '') if unknown.

    Of a log in an archive they are those of the archive; of an address, what its store reports.
    """
    try:
        return _remote_state(log) if is_address(log) else _local_state(Path(log))
    except Exception:  # whatever a driver raises: opening the log reports it
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
