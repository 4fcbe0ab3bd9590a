"""Many logs over an executor."""

from __future__ import annotations

import inspect
import json
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, cast

from ..._version import __version__
from ...extractor import Extractor
from ...features import COUNTED
from ...files import made_folder
from ...logs import find_logs, open_log
from ...logs.base import ReadOptions
from ...output import open_writer
from .manifest import Manifest, Row
from .naming import full_path, names_of, part_path
from .parts import Task, extract_part, failed, log_state
from .progress import Progress
from .workers import Threads

__all__ = ["Bulk", "extract_logs"]

#: Seconds between two looks at the progress.
_PERIOD = 0.5


@dataclass(frozen=True, slots=True)
class Bulk:
    """What came of many logs.

    Attributes
    ----------
    folder : str
        The data set.
    manifest : str
        Its manifest.
    logs : int
        Logs that were asked for.
    whole : int
        Those that were whole before, and left.
    failed : int
        Those that failed.
    scans : int
        Scans that were read.
    features : dict of str to int
        Features of each kind.
    seconds : float
        Wall time.
    """

    folder: str
    manifest: str
    logs: int
    whole: int
    failed: int
    scans: int
    features: dict[str, int]
    seconds: float

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
    tell: Callable[[str], None] = lambda about: None,  # noqa: ARG005
    **reading: Any,
) -> Bulk:
    """Extract the features of many logs into a partitioned data set, one file a log.

    The file of a log lies at ``log=NAME/part-0.parquet``: Arrow, DuckDB and Spark read the folder
    as one table with a column ``log``. Logs that were extracted into the folder before stay in it.
    What becomes of each log stands in the manifest from the moment it is known; a log that fails
    stops no other. Tables depend neither on the executor nor on the order of the logs.

    Parameters
    ----------
    logs : path-like, or iterable of them
        What `find_logs` takes: files, folders, patterns, archives, addresses.
    folder : path-like
        The data set; made if it is not there. One run at a time may write to it.
    extractor : Extractor
        The method and the noise. Each worker has its own extractor of them.
    executor : concurrent.futures.Executor, optional
        Where the logs are worked on: `Threads` (one a processor, if not given), `Processes`, that
        of `dask_executor`, or any other. Those of this package tell how far each log is, and end
        promptly when they are interrupted.
    ending : str
        Of the files: any that `open_writer` knows.
    resume : bool
        Leave the logs that are whole: done by this version with this configuration, their files of
        the size that the manifest tells, and the logs unchanged.
    tell : callable
        ``tell(about)`` is told, in a few words, how far the run is.
    **reading
        How logs are read: ``topic``, ``keep_going``, ``echo``, ``ring``, ``pose_topic``, as for
        `open_log`.

    Returns
    -------
    Bulk
        Sums over the logs of this run.

    Raises
    ------
    LineamentError
        If no logs are found, or the folder or its manifest cannot be written.
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
    started = time.perf_counter()
    settings = _settings(reading)
    open_writer(f"part-0{ending}")  # refuses what is no ending, before anything is computed
    found = [full_path(log) for log in find_logs(logs)]
    manifest = Manifest(made_folder(folder))
    names = names_of(found, {row.log: row.name for row in manifest.rows.values()})
    configuration = _configuration(extractor, settings)
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
    todo = _unfinished(rows, manifest) if resume else rows
    home = os.path.abspath(folder)  # noqa: PTH100
    tasks = [Task(row, home, extractor.method, extractor.noise, settings) for row in todo]
    manifest.rows |= {row.log: row for row in todo}
    if executor is None:
        with Threads() as threads:
            _run(tasks, threads, manifest, tell)
    else:
        _run(tasks, executor, manifest, tell)
    done = [manifest.rows[row.log] for row in todo]
    return Bulk(
        folder=str(folder),
        manifest=str(manifest.path),
        logs=len(rows),
        whole=len(rows) - len(todo),
        failed=sum(row.outcome != "done" for row in done),
        scans=sum(row.scans for row in done),
        features={name: sum(row.features.get(name, 0) for row in done) for name in COUNTED},
        seconds=time.perf_counter() - started,
    )


def _run(
    tasks: list[Task], executor: Executor, manifest: Manifest, tell: Callable[[str], None]
) -> None:
    """Work on all tasks, and record each as it ends."""
    progress = Progress(task.row.log for task in tasks)
    ended: SimpleQueue[Future[Row]] = SimpleQueue()
    rows: dict[Future[Row], Row] = {}
    with manifest.recording() as record:
        try:
            for task in tasks:
                future = _begin(task, executor, progress)
                rows[future] = task.row
                future.add_done_callback(ended.put)
            while rows:
                try:
                    future = ended.get(timeout=_PERIOD)
                except Empty:
                    pass
                else:
                    row = _result(future, rows.pop(future))
                    progress.finish(row)
                    record(row)
                tell(str(progress))
        except BaseException:
            _stop(executor, rows)
            for future in rows:
                if future.done() and not future.cancelled() and future.exception() is None:
                    record(future.result())
            raise


def _begin(task: Task, executor: Executor, progress: Progress) -> Future[Row]:
    if isinstance(executor, Threads):
        return executor.begin(task, partial(progress.report, task.row.log))
    return executor.submit(extract_part, task)


def _result(future: Future[Row], row: Row) -> Row:
    """Return the row of a task that ended; a worker that was lost is told as a failure."""
    try:
        return future.result()
    except (Exception, CancelledError) as error:
        return failed(row, f"{row.log}: its worker failed: {type(error).__name__}: {error}")


def _stop(executor: Executor, futures: Iterable[Future[Row]]) -> None:
    for future in futures:
        future.cancel()
    if isinstance(executor, Threads):
        executor.stop()


def _settings(reading: dict[str, Any]) -> dict[str, Any]:
    """Return how logs are read, the defaults too."""
    parameters = inspect.signature(open_log).parameters.values()
    defaults = {p.name: p.default for p in parameters if p.default is not p.empty}
    for name in reading:
        if name not in defaults:
            raise ValueError(f"{name!r} is unknown, expected one of: {', '.join(defaults)}")
    settings = defaults | reading
    ReadOptions(settings["echo"], settings["ring"], settings["pose_topic"])  # checks them
    return settings


def _configuration(extractor: Extractor, settings: dict[str, Any]) -> dict[str, Any]:
    """Describe all that a table depends on besides its log, as JSON has it."""
    method = cast(Any, extractor.method)
    told = {
        "method": method.name,
        "parameters": asdict(method),
        "noise": None if extractor.noise is None else asdict(extractor.noise),
        "reading": settings,
    }
    return cast(dict[str, Any], json.loads(json.dumps(told)))


def _unfinished(rows: list[Row], manifest: Manifest) -> list[Row]:
    # Many at a time, as logs at addresses take a while to tell their state.
    with ThreadPoolExecutor(16) as pool:
        whole = pool.map(lambda row: _is_whole(row, manifest), rows)
        return [row for row, is_whole in zip(rows, whole, strict=True) if not is_whole]


def _is_whole(row: Row, manifest: Manifest) -> bool:
    """Whether the manifest has this row as done, and neither its file nor its log has changed."""
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
