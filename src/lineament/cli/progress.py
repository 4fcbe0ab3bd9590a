"""Progress: a bar on a terminal, a line every two seconds elsewhere, nothing when quiet.

Kernels that are compiled meanwhile are shown in its place, and are not counted into its speed.
"""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from ..progress import Compiling, Track, compiled_seconds, show_line, untracked
from .options import complain

T = TypeVar("T")

#: Seconds between two plain lines, and before the first.
_PATIENCE = 2.0

#: What changes the text of the bars and spinners that are on the terminal, the last in front; None
#: is its own text.
_fronts: list[Callable[[str | None], None]] = []


def show_compiling(state: Compiling) -> None:
    """Show the compilation of kernels: in place on a terminal, elsewhere its beginning and end."""
    if _fronts:
        _fronts[-1](None if state.is_last else str(state))
    elif sys.stderr.isatty():
        show_line(state)
    elif state.is_first or state.is_last:
        complain(str(state))


@contextmanager
def _in_front(set_text: Callable[[str | None], None]) -> Iterator[None]:
    _fronts.append(set_text)
    try:
        yield
    finally:
        _fronts.remove(set_text)


def tracker(quiet: bool) -> Track:
    """Return the function that shows the progress of items."""
    if quiet:
        return untracked
    return _with_bar if sys.stderr.isatty() else _with_lines


def _with_bar(items: Iterable[T], about: str, total: int) -> Iterator[T]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task
    from rich.text import Text

    compiled = compiled_seconds()

    class Pace(ProgressColumn):
        def render(self, task: Task) -> Text:
            rate = task.completed / max((task.elapsed or 0) - compiled_seconds() + compiled, 1e-9)
            if not rate:
                return Text()
            left = max(total - task.completed, 0) / rate
            return Text(f"{_rate_text(rate)}, {left:.0f} s left")

    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), Pace())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(about, total=total)
        with _in_front(lambda text: progress.update(task, description=text or about)):
            yield from progress.track(items, total, task_id=task)


def _with_lines(items: Iterable[T], about: str, total: int) -> Iterator[T]:
    started = last = time.monotonic()
    compiled = compiled_seconds()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - last >= _PATIENCE:
            last, rate = now, done / (now - started - compiled_seconds() + compiled)
            left = max(total - done, 0) / rate
            line = f"{about}: {done}/{total}, {_rate_text(rate)}, {left:.0f} s left"
            complain(line)


def _rate_text(rate: float) -> str:
    return f"{rate:.0f}/s" if rate >= 10 else f"{rate:.1f}/s"


@contextmanager
def status(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows in a few words what is being done."""
    if quiet:
        yield lambda about: None  # noqa: ARG005
    elif sys.stderr.isatty():
        from rich.console import Console

        own = ""
        with Console(stderr=True).status(own) as status:

            def show(about: str) -> None:
                nonlocal own
                own = about
                status.update(about)

            with _in_front(lambda text: status.update(own if text is None else text)):
                yield show
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
