"""Progress: a bar on a terminal, a line every two seconds elsewhere, nothing when quiet.

What is done at once needs no progress: until then nobody counts what there is to do.
"""

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import ExitStack, contextmanager
from typing import TypeVar

from ..progress import Track, untracked
from .options import complain

T = TypeVar("T")

#: Seconds between two plain lines, and before the first; the same of changes of a bar.
_PATIENCE, _AT_ONCE = 2.0, 0.2


def tracker(quiet: bool) -> Track:
    """Return the function that shows the progress of items."""
    if quiet:
        return untracked
    return _with_bar if sys.stderr.isatty() else _with_lines


def _with_bar(items: Iterable[T], about: str, whole: Sized) -> Iterator[T]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task
    from rich.text import Text

    class Pace(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(_pace(int(task.completed), int(task.total or 0), last - started))

    started = last = time.monotonic()
    done, bar = 0, None
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), Pace())
    progress = Progress(*columns, console=Console(stderr=True), transient=True)
    with ExitStack() as stack:
        for done, item in enumerate(items, 1):
            yield item
            if time.monotonic() - last < _AT_ONCE:
                continue
            last = time.monotonic()
            if bar is None:
                stack.enter_context(progress)
                bar = progress.add_task(about, total=len(whole))
            progress.update(bar, completed=done)
        if bar is not None:
            progress.update(bar, completed=done, refresh=True)


def _with_lines(items: Iterable[T], about: str, whole: Sized) -> Iterator[T]:
    started = last = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - last >= _PATIENCE:
            last = now
            total = len(whole)
            complain(f"{about}: {done}/{total}, {_pace(done, total, now - started)}")


def _pace(done: int, total: int, seconds: float) -> str:
    """Write how fast items are done, and how long the others take; "" before the first."""
    rate = done / max(seconds, 1e-9)
    if not rate:
        return ""
    return f"{rate:.{0 if rate >= 10 else 1}f}/s, {max(total - done, 0) / rate:.0f} s left"


@contextmanager
def status(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows in a few words what is being done."""
    if quiet:
        yield lambda about: None  # noqa: ARG005
    elif sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status("") as spinner:
            yield spinner.update
    else:
        yield _now_and_then(time.monotonic())


def _now_and_then(last: float) -> Callable[[str], None]:
    def show(about: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _PATIENCE:
            last = now
            complain(about)

    return show
