"""`stopping`: SIGINT and SIGTERM end a node after the scan in work; imported before all else."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


class _Stop(BaseException):
    """Ends a start; a KeyboardInterrupt that passes through `exec` would end all of Python."""


@contextmanager
def stopping() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether SIGINT or SIGTERM has come.

    Once it has been called, the signals interrupt nothing. Before, while a node starts, which may
    compile for a minute, the first of them leaves the block at once. Later ones change nothing: a
    launcher may send one beside that of the terminal.
    """
    is_running = has_come = False

    def note(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        nonlocal has_come
        is_first, has_come = not has_come, True
        if is_first and not is_running:
            raise _Stop

    def is_stopped() -> bool:
        nonlocal is_running
        is_running = True
        return has_come

    def report_unraisable(unraisable: "sys.UnraisableHookArgs") -> None:
        # Raised within a callback of the compiler it is lost there, but `is_stopped` knows.
        if unraisable.exc_type is not _Stop:
            hook(unraisable)

    hook, sys.unraisablehook = sys.unraisablehook, report_unraisable
    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield is_stopped
    except BaseException:
        # An interrupted start may fail with anything, in an import say: that is no error.
        if is_running or not has_come:
            raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook
