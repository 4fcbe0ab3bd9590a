"""Logs of laser scans: one reader a format behind :func:`open_log`, streaming, imported lazily.

A reader is one module with a class derived from :class:`lineament.logs.base.Log`; adding one
is adding its file and its line in ``READERS``.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

from .._lazy import lazily
from ..errors import LogError
from .base import Head, Log, ReadOptions

if TYPE_CHECKING:
    from .finding import find_logs
    from .info import LogInfo, summarize
    from .npz import save_npz
    from .saving import save_log

__all__ = ["Log", "LogInfo", "find_logs", "open_log", "save_log", "save_npz", "summarize"]

#: Module and class of each reader, in the order in which they look at a file.
READERS = (
    ("mcap", "McapLog"),
    ("rosbag1", "Rosbag1Log"),
    ("rosbag2", "Rosbag2Log"),
    ("npz", "NpzLog"),
    ("graph", "GraphLog"),
    ("carmen", "CarmenLog"),
    ("dpslam", "DpslamLog"),
    ("csm", "CsmLog"),
    ("rplidar", "RplidarLog"),
    ("tinyslam", "TinyslamLog"),
    ("csv", "CsvLog"),
    ("csv_beams", "CsvBeamsLog"),
)

_HOME = {
    "LogInfo": "info",
    "find_logs": "finding",
    "save_log": "saving",
    "save_npz": "npz",
    "summarize": "info",
}


def open_log(
    path: str | os.PathLike[str],
    topic: str | None = None,
    *,
    keep_going: bool = False,
    echo: str = "first",
    ring: int | None = None,
    pose_topic: str | None = None,
) -> Log:
    """Open a log of laser scans; its format is found by what it holds, then by its ending.

    What cannot be read where it is, in an archive or at an address, is copied to a temporary file
    that goes when the log does.

    Parameters
    ----------
    path : path-like
        The file, compressed by gzip or not; the folder of a ROS 2 bag; a zip archive of one log; a
        path behind an archive, ``logs.zip/day/a.log``; or an address that fsspec knows, such as
        ``s3://bucket/a.bag``. For folders and patterns see :func:`find_logs`.
    topic : str, optional
        Which scans to read where a log has several kinds; see :attr:`Log.topics`.
    keep_going : bool
        Skip and count what is faulty instead of raising an error at it.
    echo : str
        Which return of a beam that has several (ROS logs): ``first``, ``last`` or ``strongest``.
    ring : int, optional
        Which ring of a point cloud is the scan (ROS logs).
    pose_topic : str, optional
        Which topic gives the poses (ROS logs).

    Returns
    -------
    Log
        An iterable of :class:`~lineament.LaserScan` with a length.

    Raises
    ------
    ValueError
        If `echo`, `ring` or `pose_topic` is none of these.
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
    from . import finding
    from .copies import unpacked

    options = ReadOptions(echo, ring, pose_topic)
    source = finding.located(path)
    head = Head.read(source)
    reader = finding.recognised(head)
    if reader is None:
        source = finding.only_log(source, head)
        head = Head.read(source)
        # A damaged or unusual beginning: its ending tells which reader's error helps most.
        reader = finding.recognised(head) or finding.by_ending(str(source))
    if reader is None:
        known = " or ".join(reader.description for reader in readers())
        raise LogError(source, f"is no log that lineament knows: expected {known}")
    if head.is_gzip and reader.needs_seek:
        source = unpacked(source, keep_going=keep_going)
    return reader(source, topic, keep_going=keep_going, options=options)


def readers() -> list[type[Log]]:
    """Return the classes of all readers, in the order in which they look at a file."""
    return [getattr(import_module(f".{module}", __name__), name) for module, name in READERS]


__getattr__ = lazily(__name__, _HOME)
