"""What holds logs: files, folders, patterns, archives, addresses."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

from ..errors import LogError
from . import readers
from .archives import ZIP, heads, unpacked_member
from .base import Head, Log
from .remote import fetched, is_address, listed

__all__ = ["by_ending", "find_logs", "located", "only_log", "recognised"]

#: Endings that other files have too: these are logs if they look like one.
_SHARED_ENDINGS = (".log", ".json", ".csv", ".tsv", ".dat", ".npz", ".txt")


def find_logs(paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]]) -> list[str]:
    """Expand folders, patterns, and archives of several logs into the logs that they hold.

    Parameters
    ----------
    paths : path-like, or iterable of them
        Files, which are taken as they are; folders, with all folders in them; patterns such as
        ``day*/**/*.bag``; zip archives; addresses of any of these but archives. Of folders,
        patterns and archives what is no log is left out: files are told by what they hold, or by
        an ending that only logs have; those at addresses by their ending alone.

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
    >>> from lineament.logs import open_log
    >>> folder = Path(tempfile.mkdtemp())
    >>> for name in ("b.csv", "a.csv", "readme.csv"):
    ...     _ = (folder / name).write_text("see a.csv" if "read" in name else "0.1,2.5")
    >>> [open_log(path).path.name for path in find_logs(folder)]
    ['a.csv', 'b.csv']
    """
    if isinstance(paths, (str, os.PathLike)):
        paths = [paths]
    found = (log for path in paths for log in _expanded(path))
    return list(dict.fromkeys(found))


def _expanded(path: str | os.PathLike[str]) -> list[str]:
    if is_address(path):
        names = listed(str(path))
        logs = names if names == [path] else [name for name in names if _has_ending(name)]
    elif Path(path).is_dir():
        logs = list(_logs_in_folder(Path(path)))
    elif not os.path.lexists(path) and glob.has_magic(str(path)):
        matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207
        logs = [log for match in matches for log in _logs_at(Path(match))]
    else:
        return _members_or_itself(path)
    if not logs:
        raise LogError(path, "holds no log")
    return logs


def _logs_at(path: Path) -> list[str]:
    if path.is_dir():
        return list(_logs_in_folder(path))
    return _members_or_itself(path) if _is_log(path) else []


def _logs_in_folder(folder: Path) -> Iterator[str]:
    """Yield the logs in a folder and those in it; one that is a log itself is not looked into."""
    if recognised(Head(folder, b"", is_directory=True)):
        yield str(folder)
        return
    try:
        inside = sorted(folder.iterdir())
    except OSError:
        return
    for path in inside:
        if path.name.startswith("."):
            continue
        if path.is_dir() and not path.is_symlink():
            yield from _logs_in_folder(path)
        elif _is_log(path):
            yield from _members_or_itself(path)


def _is_log(path: Path) -> bool:
    if path.is_dir():
        return False
    name = path.name.lower().removesuffix(".gz")
    if by_ending(name) and not name.endswith(_SHARED_ENDINGS):
        return True
    try:
        head = Head.read(path)
        return recognised(head) is not None or any(_zipped(path, head))
    except LogError:
        # Of a log that is broken or must not be read, opening it tells so.
        return path.is_file() and path.stat().st_size > 0 and _has_ending(name)


def _has_ending(name: str) -> bool:
    return by_ending(name) is not None or name.lower().endswith(".zip")


def _members_or_itself(path: str | os.PathLike[str]) -> list[str]:
    """Return the logs in an archive of several, else the path itself."""
    try:
        inside = list(_zipped(path, Head.read(path)))
    except LogError:
        # Opening it tells what is wrong.
        inside = []
    return inside if len(inside) > 1 else [str(path)]


def _zipped(path: str | os.PathLike[str], head: Head) -> Iterator[str]:
    is_archive = head.data.startswith(ZIP) and not head.is_gzip and recognised(head) is None
    return _logs_in_archive(path) if is_archive else iter(())


def _logs_in_archive(path: str | os.PathLike[str]) -> Iterator[str]:
    """Yield the logs in a zip archive, as paths behind that of the archive."""
    return (f"{path}/{name}" for name, head in heads(path) if recognised(head))


def only_log(path: str | os.PathLike[str], head: Head) -> str | os.PathLike[str]:
    """Return the only log in a zip archive, unpacked; the path itself for other files.

    Raises
    ------
    LogError
        If it is an archive of several, or a folder.
    """
    is_folder = head.is_directory
    inside = list(islice(_logs_in_folder(Path(path)) if is_folder else _zipped(path, head), 4))
    if not is_folder and len(inside) == 1:
        return unpacked_member(path, inside[0].removeprefix(f"{path}/"))
    if inside or is_folder:
        some = f": {', '.join(inside[:3])}{', …' if len(inside) > 3 else ''}" if inside else ""
        what = "is a directory" if is_folder else "holds several logs"
        raise LogError(path, f"{what}, expected a log file{some}")
    return path


def recognised(head: Head) -> type[Log] | None:
    """Return the reader that knows what a file begins with."""
    return next((reader for reader in readers() if reader.recognises(head)), None)


def by_ending(name: str) -> type[Log] | None:
    """Return the first reader that a file of this name could be for."""
    plain = name.lower().removesuffix(".gz")
    return next((reader for reader in readers() if plain.endswith(reader.endings)), None)


def located(path: str | os.PathLike[str]) -> str | os.PathLike[str]:
    """Return what can be opened as a file: the path itself, or a copy of what is behind it.

    Raises
    ------
    LogError
        If an address cannot be fetched, or an archive has no such member.
    """
    if is_address(path):
        return fetched(str(path))
    archive = _archive_above(path)
    if archive is None:
        return path
    return unpacked_member(archive, Path(path).relative_to(archive).as_posix())


def _archive_above(path: str | os.PathLike[str]) -> Path | None:
    """Return the file that a path treats as a folder, where there is one."""
    try:
        return next((above for above in Path(path).parents if above.is_file()), None)
    except (TypeError, ValueError, OSError):
        return None
