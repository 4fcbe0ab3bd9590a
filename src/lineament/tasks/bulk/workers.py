"""Where logs are worked on: threads, processes of which each may die alone, or Dask."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context, popen_spawn_posix, resource_tracker
from multiprocessing.connection import Connection
from threading import Event
from typing import Any

from ...errors import LineamentError, needed_by
from .manifest import Row
from .parts import Report, Task, extract_part, failed

#: What starts a process is imported here, not by the threads that start them: a tool that takes
#: modules out of `sys.modules` meanwhile, as coverage does, would have their logs fail.
_STARTS = popen_spawn_posix
#: Seconds between two looks at whether to stop, and until a process is killed.
_PERIOD, _PATIENCE = 0.2, 3.0
#: Seconds to wait for a Dask scheduler.
_ANSWER = 10.0


def cores() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Threads(ThreadPoolExecutor):
    """Threads of this process, one a processor unless `count` is given."""

    def __init__(self, count: int | None = None) -> None:
        super().__init__(count or cores())
        self._stopping = Event()

    def begin(self, task: Task, report: Report) -> Future[Row]:
        """Submit a task; `report` is called from its thread."""

        def stoppable(scans: int, total: int) -> None:
            if self._stopping.is_set():
                raise KeyboardInterrupt
            report(scans, total)

        return self.submit(self._work, task, stoppable)

    def _work(self, task: Task, report: Report) -> Row:
        return extract_part(task, report)

    def stop(self) -> None:
        """End all work promptly and wait; partial files are removed."""
        self._stopping.set()
        self.shutdown(cancel_futures=True)


class Processes(Threads):
    """Threads that each run their tasks in a child process.

    A process that dies is known by its log, and the others go on; its task is tried once more.
    Processes are spawned: a script that uses them needs ``if __name__ == "__main__":``.
    """

    def __init__(self, count: int | None = None) -> None:
        super().__init__(count)
        self._idle: list[_Worker] = []

    def _work(self, task: Task, report: Report) -> Row:
        deaths: list[str] = []
        while len(deaths) < 2:
            worker = self._free_worker()
            try:
                row = worker.run(task, report)
            except (EOFError, OSError):
                deaths.append(worker.end())
            except BaseException:
                worker.end()
                raise
            else:
                self._idle.append(worker)
                return row
        return failed(task.row, f"{task.row.log}: its process died twice ({', '.join(deaths)})")

    def _free_worker(self) -> _Worker:
        try:
            return self._idle.pop()
        except IndexError:
            return _Worker()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when their tasks are done."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        while wait and self._idle:
            self._idle.pop().end()


class _Worker:
    """A process that does one task after the other, and the pipe to it."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        with _interrupts_held():
            self._process.start()
        theirs.close()

    def run(self, task: Task, report: Report) -> Row:
        """Do a task; EOFError or OSError if the process dies in it."""
        self._pipe.send(task)
        scans, total = 0, 0
        while True:
            if self._pipe.poll(_PERIOD):
                answer = self._pipe.recv()
                if isinstance(answer, Row):
                    return answer
                scans, total = answer
            report(scans, total)

    def end(self) -> str:
        """End the process; return how it ended."""
        # By a signal; if that is lost, its next report fails; if it makes none, by force.
        for end in (self._process.terminate, self._pipe.close, self._process.kill):
            if self._process.exitcode is None:
                end()
                self._process.join(_PATIENCE)
        self._pipe.close()
        return _ending_of(self._process.exitcode)


def _ending_of(status: int | None) -> str:
    if status is None or status >= 0:
        return f"exit status {status}"
    with suppress(ValueError):
        return signal.Signals(-status).name
    return f"signal {-status}"


def _serve(pipe: Connection) -> None:
    """Run the tasks from the pipe until its other end closes."""
    # Ctrl-C reaches all processes of a terminal: the parent ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    with suppress(EOFError, OSError):
        while True:
            task: Task = pipe.recv()
            pipe.send(extract_part(task, lambda scans, total: pipe.send((scans, total))))


def _leave(number: int, _frame: Any) -> None:
    # As an exception, so that a partial file is removed; a second signal would interrupt that.
    signal.signal(number, signal.SIG_IGN)
    raise SystemExit


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Keep Ctrl-C from a process that starts and does not ignore it yet."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Started below otherwise, which would undo the mask.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Yield the executor of a Dask cluster whose workers see the same paths.

    The address of its scheduler is such as ``tcp://10.0.0.1:8786``. A LineamentError if none
    answers or `distributed` is not installed.
    """
    with needed_by(f"{address}:"):
        from distributed import Client
    try:
        client = Client(address, timeout=_ANSWER)
    except (OSError, ValueError) as error:
        raise LineamentError(f"{address}: no Dask scheduler answers: {error}") from None
    with client:
        # Not pure: the same log may have other content in the next run.
        yield client.get_executor(pure=False)
