"""`terminating`: SIGTERM and SIGHUP end a command as Ctrl-C does, and leave no half files."""

import os
import signal
import sys
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: Seconds until a signal is sent again that was lost.
_PATIENCE = 0.05


class Terminated(BaseException):
    """A signal of this number ends the command."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


@contextmanager
def terminating() -> Iterator[None]:
    """Raise `Terminated` where SIGTERM or SIGHUP comes within; later ones change nothing.

    Compiled code, of packages that are imported say, may clear errors or report them in place of
    raising them: if the exception is gone and the command is not, the signal is sent again. Other
    threads than the main one cannot: there nothing changes. What is ignored, as by ``nohup``, stays
    so.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ending: weakref.ref[Terminated] | None = None
    again: list[threading.Timer] = []

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        if ending is None or ending() is None:
            raise watched(Terminated(number))

    def watched(stopped: Terminated) -> Terminated:
        nonlocal ending
        number = stopped.number

        def lost(_: "weakref.ref[Terminated]") -> None:
            again.append(threading.Timer(_PATIENCE, os.kill, (os.getpid(), number)))
            again[-1].start()

        ending = weakref.ref(stopped, lost)
        return stopped

    def note(unraisable: "sys.UnraisableHookArgs") -> None:
        if not isinstance(unraisable.exc_value, Terminated):
            hook(unraisable)

    hook, sys.unraisablehook = sys.unraisablehook, note
    numbers = (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM))
    before = {n: signal.signal(n, end) for n in numbers if signal.getsignal(n) == signal.SIG_DFL}
    try:
        yield
    finally:
        ending = None  # From here on it may be gone.
        for timer in again:
            timer.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook
