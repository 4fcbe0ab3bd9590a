"""Many logs over an executor."""

import hashlib
import inspect
import json
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, cast
from uuid import uuid4

from ..._version import __version__
from ...extractor import Extractor, load_kernels
from ...features import TABLES
from ...files import alone_in, made_folder, spare_inputs
from ...limits import Limits
from ...logs import find_logs, open_log
from ...logs.base import ReadOptions
from ...logs.sources import is_address
from ...output import open_writer
from .manifest import Manifest, Row, full_path, names_of, part_path
from .parts import Task, extract_part, failed, log_state
from .workers import Threads

#: Seconds between two looks at the progress.
_PERIOD = 0.5


@dataclass(frozen=True, slots=True)
class Bulk:
    """Result of a run over many logs.

    The data set and its manifest; logs asked for, those that were complete before and skipped,
    those that failed; and as in `Extraction`, over the logs of this run. What was warned of, behind
    the name of its log.
    """

    folder: str
    manifest: str
    logs: int
    whole: int
    failed: int
    scans: int
    features: dict[str, int]
    seconds: float
    warnings: list[str]

    def __str__(self) -> str:
        found = ", ".join(f"{count} {name}" for name, count in self.features.items())
        rate = self.scans / self.seconds if self.seconds > 0 else 0.0
        done = self.logs - self.whole - self.failed
        return "\n".join(
            [
                f"{self.logs} logs -> {self.folder}",
                f"  {done} done, {self.failed} failed, {self.whole} whole before",
                f"  {self.scans} scans, {found}",
                f"  {self.seconds:.2f} s, {rate:.0f} scans/s",
            ]
        )


def extract_logs(
    logs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    extractor: Extractor,
    *,
    executor: Executor | None = None,
    ending: str = ".parquet",
    resume: bool = False,
    world: bool = False,
    show: Callable[[str], None] = lambda text: None,  # noqa: ARG005
    **reading: Any,
) -> Bulk:
    """Extract the features of many logs into a partitioned data set, one file a log.

    The file of a log is ``log=NAME/part-0.parquet``: Arrow, DuckDB and Spark read the folder as one
    table with a column ``log``. Logs extracted into the folder before stay in it; of the same log,
    a file with another ending is removed once the new one is whole. The manifest records each log
    as soon as it ends; a log that fails stops no other. Tables depend neither on the executor nor
    on the order of the logs.

    Parameters
    ----------
    logs : path-like, or iterable of them
        As for `find_logs`: files, folders, patterns, archives, addresses.
    folder : path-like
        The data set; created if missing. One run at a time writes to it.
    extractor : Extractor
        Method and noise; each worker makes an extractor from them.
    executor : concurrent.futures.Executor, optional
        `Threads` (default, one a processor), `Processes`, that of `dask_executor`, or any other.
        Those of this package report progress within a log, and end promptly when interrupted.
    ending : str
        Ending of the files, any that `open_writer` knows.
    resume : bool
        Skip logs that are complete: done by this version with this configuration, the file of the
        size in the manifest, and the log unchanged.
    world : bool
        Whether the tables have the features in the world, as for `extract_log`.
    show : callable
        ``show(text)`` is called twice a second with the progress.
    **reading
        As for `lineament.open_log`.

    Raises
    ------
    LineamentError
        If no logs are found, one of them is a file of the data set, the folder or its manifest
        cannot be written, or another run writes into it.
    ValueError
        If `reading` makes no sense.

    Examples
    --------
    >>> import tempfile
    >>> from lineament import LaserScan
    >>> from lineament.logs import save_npz
    >>> home = Path(tempfile.mkdtemp())
    >>> for name in ("a.npz", "b.npz"):
    ...     save_npz(home / name, [LaserScan([2.0, 2.0, 2.0], 0.0, 0.01)] * 5)
    >>> extract_logs(home, home / "out", Extractor("liu")).scans
    10
    >>> extract_logs(home, home / "out", Extractor("liu"), resume=True).whole
    2
    """
    settings = _settings(reading)
    open_writer(f"part-0{ending}")  # refuses an unknown ending before anything is computed
    found = [full_path(log) for log in find_logs(logs, settings["limits"])]
    with alone_in(made_folder(folder)):
        manifest = Manifest(folder)
        names = names_of(found, {row.log: row.name for row in manifest.rows.values()})
        configuration = _configuration(extractor, settings) | ({"world": True} if world else {})
        rows = [
            Row(
                log=log,
                name=name,
                output=part_path(name, ending),
                version=__version__,
                configuration=configuration,
            )
            for log, name in names.items()
        ]
        home = os.path.abspath(folder)  # noqa: PTH100
        # Those of former runs too: tables of features are no logs, whatever a folder holds.
        parts = {row.output for row in (*manifest.rows.values(), *rows)}
        spare_inputs([manifest.path, *(Path(home, part) for part in parts)], found)
        if executor is None or isinstance(executor, Threads):  # once here, not in each process
            load_kernels([extractor])
        started = time.perf_counter()
        todo = _unfinished(rows, manifest) if resume else rows
        method, noise = extractor.method, extractor.noise
        tasks = [Task(row, home, method, noise, settings, world) for row in todo]
        manifest.rows |= {row.log: row for row in todo}
        with Threads() if executor is None else nullcontext(executor) as workers:
            _run(tasks, workers, manifest, show)
    done = [manifest.rows[row.log] for row in todo]
    return Bulk(
        folder=str(folder),
        manifest=str(manifest.path),
        logs=len(rows),
        whole=len(rows) - len(todo),
        failed=sum(row.outcome != "done" for row in done),
        scans=sum(row.scans for row in done),
        features={name: sum(row.features.get(name, 0) for row in done) for name in TABLES},
        seconds=time.perf_counter() - started,
        warnings=[f"{row.log}: {text}" for row in done for text in row.warnings],
    )


class _Progress:
    """How far a run over these logs is, from what the workers report."""

    def __init__(self, logs: Iterable[str]) -> None:
        # Many stores take long to report sizes.
        sizes = {log: None if is_address(log) else log_state(log)[0] for log in logs}
        known = [size for size in sizes.values() if size]
        typical = sum(known) / len(known) if known else 1.0
        # A log weighs its size, or that of a typical one, in the time left.
        self._weights = {log: size or typical for log, size in sizes.items()}
        self._started = time.monotonic()
        self._scans, self._shares = dict.fromkeys(sizes, 0), dict.fromkeys(sizes, 0.0)
        self._done, self._failed = 0, 0

    def report(self, log: str, scans: int, total: int) -> None:
        """Note how far a log is, from any thread."""
        self._scans[log], self._shares[log] = scans, scans / max(total, 1)

    def finish(self, row: Row) -> None:
        """Note that a log is done or has failed."""
        self._scans[row.log], self._shares[row.log] = row.scans, 1.0
        self._done += 1
        self._failed += row.outcome != "done"

    def __str__(self) -> str:
        seconds = max(time.monotonic() - self._started, 1e-9)
        weight = sum(self._weights[log] * share for log, share in self._shares.items())
        share = weight / sum(self._weights.values())
        parts = [f"{self._done}/{len(self._weights)} logs"]
        if self._failed:
            parts.append(f"{self._failed} failed")
        parts.append(f"{sum(self._scans.values()) / seconds:.0f} scans/s")
        if share > 0:
            parts.append(f"{_duration(seconds * max(1 / share - 1, 0.0))} left")
        return ", ".join(parts)


def _duration(seconds: float) -> str:
    """Format a duration: 75.4 as 1:15, 3600 as 1:00:00."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _run(
    tasks: list[Task], executor: Executor, manifest: Manifest, show: Callable[[str], None]
) -> None:
    """Work on all tasks, and record each as it ends."""
    progress = _Progress(task.row.log for task in tasks)
    ended: SimpleQueue[Future[Row]] = SimpleQueue()
    rows: dict[Future[Row], Row] = {}
    with manifest.recording() as record:
        try:
            for task in tasks:
                if isinstance(executor, Threads):
                    future = executor.begin(task, partial(progress.report, task.row.log))
                else:
                    future = executor.submit(extract_part, task)
                rows[future] = task.row
                future.add_done_callback(ended.put)
            while rows:
                with suppress(Empty):
                    future = ended.get(timeout=_PERIOD)
                    row = _result(future, rows.pop(future))
                    progress.finish(row)
                    record(row)
                show(str(progress))
        except BaseException:
            for future in rows:
                future.cancel()
            if isinstance(executor, Threads):
                executor.stop()
            for future in rows:
                if future.done() and not future.cancelled() and future.exception() is None:
                    record(future.result())
            raise


def _result(future: Future[Row], row: Row) -> Row:
    """Return the row of a task that ended; a lost worker is a failure."""
    try:
        return future.result()
    except (Exception, CancelledError) as error:
        return failed(row, f"{row.log}: its worker failed: {type(error).__name__}: {error}")


def _settings(reading: dict[str, Any]) -> dict[str, Any]:
    """Return the options of reading, with defaults."""
    parameters = inspect.signature(open_log).parameters.values()
    defaults = {p.name: p.default for p in parameters if p.default is not p.empty}
    for name in reading:
        if name not in defaults:
            raise ValueError(f"{name!r} is unknown, expected one of: {', '.join(defaults)}")
    settings = defaults | reading
    options = {one.name: settings[one.name] for one in fields(ReadOptions)}
    ReadOptions(**options | {"limits": Limits.of(options["limits"])})  # checks them
    return settings


def _configuration(extractor: Extractor, settings: dict[str, Any]) -> dict[str, Any]:
    """Return all that a table depends on besides its log, as JSON."""
    method = cast(Any, extractor.method)
    own = getattr(method, "function", method)  # of somebody's function, that
    configuration = {
        "method": method.name,
        "parameters": asdict(cast(Any, own)) if is_dataclass(own) else {},
        "noise": None if extractor.noise is None else asdict(extractor.noise),
        "reading": settings,
        **_code_of(own),
    }
    return cast(dict[str, Any], json.loads(json.dumps(configuration, default=str)))


def _code_of(method: Any) -> dict[str, str]:
    """Return a hash of the file of a method that is not ours: it may change, our version stays.

    Of one without a file nothing is known: what it made before is made again.
    """
    documented = method if inspect.isfunction(method) else type(method)
    if str(documented.__module__).partition(".")[0] in ("lineament", "lineament_lab"):
        return {}
    try:
        code = Path(inspect.getfile(documented)).read_bytes()
    except (OSError, TypeError):
        return {"code": uuid4().hex}
    return {"code": hashlib.sha256(code).hexdigest()[:16]}


def _unfinished(rows: list[Row], manifest: Manifest) -> list[Row]:
    # In parallel: stores take a while to answer.
    with ThreadPoolExecutor(16) as pool:
        whole = pool.map(lambda row: _is_whole(row, manifest), rows)
        return [row for row, is_whole in zip(rows, whole, strict=True) if not is_whole]


def _is_whole(row: Row, manifest: Manifest) -> bool:
    """Whether the manifest has this row as done, its file and its log unchanged."""
    before = manifest.rows.get(row.log)
    if before is None or before.outcome != "done":
        return False
    same = ("output", "version", "configuration")
    if any(getattr(before, name) != getattr(row, name) for name in same):
        return False
    size, state = log_state(row.log)
    if not state or (size, state) != (before.log_bytes, before.log_state):
        return False
    try:
        return Path(manifest.path.parent, row.output).stat().st_size == before.bytes
    except OSError:
        return False
