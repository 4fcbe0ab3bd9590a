"""Progress: a bar on a terminal, a line every two seconds elsewhere, nothing when quiet."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from ..progress import Track, untracked

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
    from rich.progress import TimeRemainingColumn as TimeLeft
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(_rate_text(task.speed or 0.0))

    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), Rate(), TimeLeft())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        yield from progress.track(items, total, description=about)


def _with_lines(items: Iterable[T], about: str, total: int) -> Iterator[T]:
    started = last = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - last >= _PATIENCE:
            last, rate = now, done / (now - started)
            left = max(total - done, 0) / rate
            line = f"{about}: {done}/{total}, {_rate_text(rate)}, {left:.0f} s left"
            print(line, file=sys.stderr, flush=True)


def _rate_text(rate: float) -> str:
    return f"{rate:.0f}/s" if rate >= 10 else f"{rate:.1f}/s"


@contextmanager
def status(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows in a few words what is being done."""
    if quiet:
        yield lambda about: None  # noqa: ARG005
    elif sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status("") as status:
            yield status.update
    else:
        yield _now_and_then(time.monotonic())


def _now_and_then(last: float) -> Callable[[str], None]:
    def show(about: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _PATIENCE:
            last = now
            print(about, file=sys.stderr, flush=True)

    return show
