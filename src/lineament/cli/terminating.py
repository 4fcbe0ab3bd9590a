"""`terminating`: SIGTERM and SIGHUP end a command as Ctrl-C does, and leave no half files."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: Seconds until a signal is sent again that was lost in a callback.
_PATIENCE = 0.05


class Terminated(BaseException):
    """A signal of this number ends the command."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@contextmanager
def terminating() -> Iterator[None]:
    """Raise `Terminated` where SIGTERM or SIGHUP comes within; later ones change nothing.

    Other threads than the main one cannot: there nothing changes. What is ignored, as by ``nohup``,
    stays so.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    is_ending = False

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        nonlocal is_ending
        if not is_ending:
            is_ending = True
            raise Terminated(number)

    def note(unraisable: "sys.UnraisableHookArgs") -> None:
        # Raised within a callback, of the compiler say, it is lost.
        nonlocal is_ending
        if not isinstance(unraisable.exc_value, Terminated):
            hook(unraisable)
            return
        is_ending = False
        again = os.getpid(), unraisable.exc_value.number
        threading.Timer(_PATIENCE, os.kill, again).start()

    hook, sys.unraisablehook = sys.unraisablehook, note
    numbers = (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM))
    before = {n: signal.signal(n, end) for n in numbers if signal.getsignal(n) == signal.SIG_DFL}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook
