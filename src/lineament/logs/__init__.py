"""Logs of laser scans: one reader a format behind `open_log`, streaming, imported lazily.

A reader is a class derived from `Log` in a file of this folder, and a line in
``opening.READERS``; one of text lines derives from ``linelog.LineLog``. What each format holds,
and what is made of it: ``docs/logs.md``.
"""

from typing import TYPE_CHECKING

from .._lazy import lazily

if TYPE_CHECKING:
    from .base import Log as Log
    from .info import LogInfo as LogInfo
    from .info import summarize as summarize
    from .opening import find_logs as find_logs
    from .opening import open_log as open_log
    from .saving import save_log as save_log
    from .saving import save_npz as save_npz

_HOME = {
    "Log": "base",
    "LogInfo": "info",
    "find_logs": "opening",
    "open_log": "opening",
    "save_log": "saving",
    "save_npz": "saving",
    "summarize": "info",
}

__all__ = [*_HOME]

__getattr__ = lazily(__name__, _HOME)
