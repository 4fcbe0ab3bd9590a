"""Progress: a bar on a terminal, a plain line now and then elsewhere, nothing when quiet."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from ..progress import Track, untracked

__all__ = ["telling", "tracker"]

T = TypeVar("T")

#: Seconds between two plain lines, and before the first.
_PATIENCE = 2.0


def tracker(quiet: bool) -> Track:
    """Choose how to show how far items are."""
    if quiet:
        return untracked
    return _with_bar if sys.stderr.isatty() else _with_lines


def _with_bar(items: Iterable[T], about: str, total: int) -> Iterator[T]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
    from rich.progress import TimeRemainingColumn as TimeLeft

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeLeft(),
    )
    started, done = time.monotonic(), 0
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(about, total=total, rate="")
        for item in items:
            yield item
            done += 1
            if done % 32 == 0 or done == total:
                rate = done / max(time.monotonic() - started, 1e-9)
                progress.update(task, completed=done, rate=_rate_text(rate))


def _with_lines(items: Iterable[T], about: str, total: int) -> Iterator[T]:
    started = told = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - told >= _PATIENCE:
            told, rate = now, done / (now - started)
            left = max(total - done, 0) / rate
            line = f"{about}: {done}/{total}, {_rate_text(rate)}, {left:.0f} s left"
            print(line, file=sys.stderr, flush=True)


def _rate_text(rate: float) -> str:
    return f"{rate:.0f}/s" if rate >= 10 else f"{rate:.1f}/s"


@contextmanager
def telling(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Give a function that shows in a few words what is being done."""
    if quiet:
        yield lambda about: None  # noqa: ARG005
    elif sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status("") as status:
            yield status.update
    else:
        yield _tell_now_and_then(time.monotonic())


def _tell_now_and_then(told: float) -> Callable[[str], None]:
    def tell(about: str) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told >= _PATIENCE:
            told = now
            print(about, file=sys.stderr, flush=True)

    return tell
