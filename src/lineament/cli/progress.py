"""Progress: a bar on a terminal, a line every two seconds elsewhere, nothing when quiet."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from ..progress import Track, untracked
from .options import complain

T = TypeVar("T")

#: Seconds between two plain lines, and before the first.
_PATIENCE = 2.0


def tracker(quiet: bool) -> Track:
    """Return the function that shows the progress of items."""
    if quiet:
        return untracked
    return _with_bar if sys.stderr.isatty() else _with_lines


def _with_bar(items: Iterable[T], about: str, total: int) -> Iterator[T]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task
    from rich.text import Text

    class Pace(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(_pace(int(task.completed), total, task.elapsed or 0.0))

    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), Pace())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        yield from progress.track(items, total, description=about)


def _with_lines(items: Iterable[T], about: str, total: int) -> Iterator[T]:
    started = last = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - last >= _PATIENCE:
            last = now
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
