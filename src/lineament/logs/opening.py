"""Logs found and opened: by what files hold, then by their endings."""

import glob
import os
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from itertools import islice
from pathlib import Path

from ..errors import LogError, one_line, warn
from ..limits import Limits
from ..scan.changes import Mask
from . import sources
from .base import Head, Log, ReadOptions

#: Module and class of each reader, in the order in which they look at a file.
READERS = (
    ("mcap", "McapLog"),
    ("rosbag1", "Rosbag1Log"),
    ("rosbag2", "Rosbag2Log"),
    ("npz", "NpzLog"),
    ("graph", "GraphLog"),
    ("carmen", "CarmenLog"),
    ("player", "PlayerLog"),
    ("dpslam", "DpslamLog"),
    ("csm", "CsmLog"),
    ("rplidar", "RplidarLog"),
    ("tinyslam", "TinyslamLog"),
    ("csv", "CsvLog"),
    ("csv", "CsvBeamsLog"),
)
#: Endings that other files have too: these are logs if they look like one.
_SHARED_ENDINGS = (".log", ".json", ".csv", ".tsv", ".dat", ".npz", ".txt", ".zip")


def readers() -> Iterator[type[Log]]:
    """Yield the classes of all readers, in the order in which they look at a file."""
    for name, reader in READERS:
        yield getattr(import_module(f".{name}", __package__), reader)


def _recognised(head: Head) -> type[Log] | None:
    """Return the reader that knows what a file begins with."""
    return next((reader for reader in readers() if reader.recognises(head)), None)


def _by_ending(name: str) -> type[Log] | None:
    """Return the first reader that a file of this name could be for."""
    plain = name.lower().removesuffix(".gz")
    return next((reader for reader in readers() if plain.endswith(reader.endings)), None)


def open_log(
    path: str | os.PathLike[str],
    topic: str | None = None,
    *,
    keep_going: bool = False,
    echo: str = "first",
    ring: int | None = None,
    pose_topic: str | None = None,
    limits: Mapping[str, int] | None = None,
    stamp: str = "first",
    scale: float = 1.0,
    laser_pose: tuple[float, float, float] | None = None,
    mask: Mask = (),
) -> Log:
    """Open a log of laser scans; its format is found by what it holds, then by its ending.

    What cannot be read where it is, in an archive or at an address, is copied to a temporary file
    that goes when the log does.

    Parameters
    ----------
    path : path-like
        The file, compressed by gzip or not; the folder of a ROS 2 bag; a zip archive of one log; a
        path behind an archive, ``logs.zip/day/a.log``; or an address that fsspec knows, such as
        ``s3://bucket/a.bag``. For folders and patterns see `find_logs`.
    topic : str, optional
        Which scans to read where a log has several kinds; see `Log.topics`.
    keep_going : bool
        Skip and count what is faulty instead of raising an error at it.
    echo : str
        Which return of a beam that has several (ROS logs): ``first``, ``last`` or ``strongest``.
    ring : int, optional
        Which ring of a point cloud is the scan (ROS logs).
    pose_topic : str, optional
        Which topic gives the poses (ROS logs).
    limits : mapping, optional
        Limits of :class:`~lineament.limits.Limits` that are to be others, by name.
    stamp : str
        Which beam is taken at the stamp: ``first``, ``middle`` or ``last``, in time.
    scale : float
        What ranges and their limits are multiplied by to be in metres: 0.001 where the log has
        millimetres. Poses are not.
    laser_pose : (x, y, theta), optional
        Pose of the scanner on what the poses of the log are of [m, m, rad]. By default, poses of a
        ROS log are moved by ``/tf_static``, with a `LineamentWarning` where it does not say where
        the scanner is; poses of other logs are those of the scanner.
    mask : sequence of (from, to)
        Sectors of bearings [rad] that see the robot itself, see `LaserScan.masked`.

    Returns
    -------
    Log
        An iterable of `lineament.LaserScan` with a length.

    Raises
    ------
    ValueError
        If `echo`, `ring`, `pose_topic`, `stamp`, `scale`, `laser_pose`, `mask` or a limit is
        not a value that it can have.
    LogError
        If the file cannot be read, has no format that is known, holds no scans, has no such topic,
        or is beyond a limit. While the log is iterated: if a scan in it is faulty, unless
        `keep_going`.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp(), "two.log")
    >>> _ = path.write_text("FLASER 2 1.5 1.6 0 0 0 0 0 0 7.5 robot 7.5")
    >>> log = open_log(path)
    >>> log.format, len(log), [scan.stamp for scan in log]
    ('carmen', 1, [7.5])
    """
    most = Limits.of(limits)
    options = ReadOptions(echo, ring, pose_topic, most, stamp, scale, laser_pose, mask)
    source = _located(path, options.limits)
    head = sources.read_head(source)
    reader = _recognised(head)
    if reader is None:
        source = _only_log(source, head, options.limits)
        head = sources.read_head(source)
        # A damaged or unusual beginning: its ending shows which reader's error helps most.
        reader = _recognised(head) or _by_ending(str(source))
    if reader is None:
        known = " or ".join(reader.description for reader in readers())
        raise LogError(source, f"is no log that lineament knows: expected {known}")
    if head.is_gzip and reader.needs_seek:
        source = sources.unzip(source, options.limits, keep_going=keep_going)
    if pose_topic is not None and not reader.has_pose_topics:
        warn(one_line(f"{path}: has no topics of poses: its own are taken, not {pose_topic!r}"))
    if (ring is not None or echo != "first") and not reader.has_pose_topics:
        warn(one_line(f"{path}: has neither rings nor echoes: all of it is read"))
    return reader(source, topic, keep_going=keep_going, options=options)


def _located(path: str | os.PathLike[str], limits: Limits) -> str | os.PathLike[str]:
    """Return what can be opened as a file: the path itself, or a copy of what is behind it."""
    if sources.is_address(path):
        return sources.fetched(str(path), limits)
    try:
        archive = next((above for above in Path(path).parents if above.is_file()), None)
    except (TypeError, ValueError, OSError):
        return path  # Reading it reports what is wrong.
    if archive is None:
        return path
    return sources.unzipped_member(archive, Path(path).relative_to(archive).as_posix(), limits)


def _only_log(path: str | os.PathLike[str], head: Head, limits: Limits) -> str | os.PathLike[str]:
    """Return a copy of the only log in a zip archive; the path itself for other files."""
    if head.is_directory:
        inside = _logs_in_folder(Path(path), limits)
    else:
        inside = _logs_in_archive(path, head, limits)
    first = list(islice(inside, 4))
    if len(first) == 1 and not head.is_directory:
        return sources.unzipped_member(path, first[0].removeprefix(f"{path}/"), limits)
    if first or head.is_directory:
        some = f": {', '.join(first[:3])}{', …' if len(first) > 3 else ''}" if first else ""
        what = "is a directory" if head.is_directory else "holds several logs"
        raise LogError(path, f"{what}, expected a log file{some}")
    return path


def find_logs(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    limits: Mapping[str, int] | None = None,
) -> list[str]:
    """Expand folders, patterns, and archives of several logs into the logs that they hold.

    Parameters
    ----------
    paths : path-like, or iterable of them
        Files, which are taken as they are; folders, with all folders in them; patterns such as
        ``day*/**/*.bag``; zip archives; addresses of any of these but archives. Of folders,
        patterns and archives what is no log is left out: files are recognised by what they hold,
        or by an ending that only logs have; those at addresses by their ending alone.
    limits : mapping, optional
        As for :func:`open_log`: ``members`` bounds archives.

    Returns
    -------
    list of str
        What `open_log` takes, sorted within each of the paths, none twice. A log in an archive is
        named as if the archive were a folder: ``logs.zip/day/a.log``.

    Raises
    ------
    LogError
        If a folder, pattern or archive holds no log.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> for name in ("b.csv", "a.csv", "readme.csv"):
    ...     _ = (folder / name).write_text("see a.csv" if "read" in name else "0.1,2.5")
    >>> [open_log(path).path.name for path in find_logs(folder)]
    ['a.csv', 'b.csv']
    """
    paths = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    most = Limits.of(limits)
    return list(dict.fromkeys(log for path in paths for log in _expanded(path, most)))


def _expanded(path: str | os.PathLike[str], limits: Limits) -> list[str]:
    if sources.is_address(path):
        names = sources.listed(str(path), limits)
        logs = names if names == [path] else [name for name in names if _has_ending(name)]
    elif Path(path).is_dir():
        logs = list(_logs_in_folder(Path(path), limits))
    elif not os.path.lexists(path) and glob.has_magic(str(path)):
        matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207
        logs = [log for match in matches for log in _logs_at(Path(match), limits)]
    else:
        return _logs_in_file(path, limits, is_named=True)
    if not logs:
        raise LogError(path, "holds no log")
    return logs


def _logs_at(path: Path, limits: Limits) -> Iterable[str]:
    return _logs_in_folder(path, limits) if path.is_dir() else _logs_in_file(path, limits)


def _logs_in_folder(folder: Path, limits: Limits) -> Iterator[str]:
    """Yield the logs in a folder and those in it; one that is a log itself is not looked into."""
    if _recognised(Head(folder, b"", is_directory=True)):
        yield str(folder)
        return
    try:
        inside = sorted(folder.iterdir())
    except OSError:
        return
    for path in inside:
        # Links to folders may lead round in circles.
        if not path.name.startswith(".") and not (path.is_dir() and path.is_symlink()):
            yield from _logs_at(path, limits)


def _logs_in_file(
    path: str | os.PathLike[str], limits: Limits, *, is_named: bool = False
) -> list[str]:
    """Return the logs in an archive of several, else the file itself if it is a log or named."""
    file = Path(path)
    name = file.name.lower().removesuffix(".gz")
    is_log = is_named or (_has_ending(name) and not name.endswith(_SHARED_ENDINGS))
    inside: list[str] = []
    try:
        head = sources.read_head(path)
        inside = list(_logs_in_archive(path, head, limits))
        is_log = is_log or bool(inside) or _recognised(head) is not None
    except LogError:
        # Opening a log that is broken or must not be read reports that.
        is_log = is_log or (file.is_file() and file.stat().st_size > 0 and _has_ending(name))
    if len(inside) > 1:
        return inside
    return [str(path)] if is_log else []


def _has_ending(name: str) -> bool:
    return _by_ending(name) is not None or name.lower().endswith(".zip")


def _logs_in_archive(path: str | os.PathLike[str], head: Head, limits: Limits) -> Iterator[str]:
    """Yield the logs in a zip archive, as paths behind that of the archive; none of other files."""
    if head.data.startswith(sources.ZIP) and not head.is_gzip and _recognised(head) is None:
        for name, member in sources.member_heads(path, limits):
            if _recognised(member):
                yield f"{path}/{name}"
