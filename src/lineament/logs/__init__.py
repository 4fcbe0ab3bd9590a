"""Logs of laser scans: one reader a format behind :func:`open_log`, streaming, imported lazily.

A reader is one module with a class derived from :class:`lineament.logs.base.Log`; adding one
is adding its file and its line in ``READERS``.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

from ..errors import LogError
from .base import Head, Log

if TYPE_CHECKING:
    from .info import LogInfo, summarize
    from .npz import save_npz
    from .saving import save_log

__all__ = ["Log", "LogInfo", "open_log", "save_log", "save_npz", "summarize"]

#: Module and class of each reader, in the order in which they look at a file.
READERS = (
    ("npz", "NpzLog"),
    ("carmen", "CarmenLog"),
)

_HOME = {"LogInfo": "info", "summarize": "info", "save_log": "saving", "save_npz": "npz"}


def open_log(
    path: str | os.PathLike[str], topic: str | None = None, *, keep_going: bool = False
) -> Log:
    """Open a log of laser scans; its format is found by what it holds, then by its ending.

    Parameters
    ----------
    path : path-like
        The file, compressed by gzip or not.
    topic : str, optional
        Which scans to read where a log has several kinds; see :attr:`Log.topics`.
    keep_going : bool
        Skip and count what is faulty instead of raising an error at it.

    Returns
    -------
    Log
        An iterable of :class:`~lineament.LaserScan` with a length.

    Raises
    ------
    LogError
        If the file cannot be read, has no format that is known, holds no scans, or has no such
        topic. While the log is iterated: if a scan in it is faulty, unless `keep_going`.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp(), "two.log")
    >>> _ = path.write_text("FLASER 2 1.5 1.6 0 0 0 0 0 0 7.5 robot 7.5")
    >>> log = open_log(path)
    >>> log.format, len(log), [scan.stamp for scan in log]
    ('carmen', 1, [7.5])
    """
    head = Head.read(path)
    readers = [_reader(*where) for where in READERS]
    for reader in readers:
        if reader.recognises(head):
            return reader(head.path, topic, keep_going=keep_going)
    known = " or ".join(reader.description for reader in readers)
    if head.is_directory:
        raise LogError(path, f"is a directory, expected a log file: {known}")
    # A damaged or unusual beginning: its ending tells which reader's error helps most.
    name = head.path.name.lower().removesuffix(".gz")
    for reader in readers:
        if name.endswith(reader.endings):
            return reader(head.path, topic, keep_going=keep_going)
    raise LogError(path, f"is no log that lineament knows: expected {known}")


def _reader(module: str, name: str) -> type[Log]:
    reader: type[Log] = getattr(import_module(f".{module}", __name__), name)
    return reader


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)
