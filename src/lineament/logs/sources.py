"""Where logs are: the beginnings of files, members of zip archives, addresses, temporary copies.

Nothing is ever written under a name that an archive or an address gives.
"""

import os
import shutil
import stat
import tempfile
import threading
import weakref
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from queue import Empty, Queue
from types import ModuleType
from typing import NoReturn, Self, TypeVar, cast

from ..errors import LogError, needs
from ..limits import LIMITS, Limits
from .base import Head
from .lines import BOM, GZIP, chunks, decompressed, opened, reading

#: How a zip archive begins.
ZIP = b"PK\x03\x04"
#: How much of a file is looked at to find its format [bytes].
HEAD_SIZE = 1 << 16

_PIECE = 1 << 20
_T = TypeVar("_T")


def read_head(path: str | os.PathLike[str]) -> Head:
    """Return the beginning of a file; LogError if it is missing, empty, a pipe or a device."""
    try:
        where = Path(path)
    except TypeError:
        raise LogError(path, "is no path, expected the path of a log") from None
    with reading(path):
        mode = where.stat().st_mode
        if stat.S_ISDIR(mode):
            return Head(where, b"", is_directory=True)
        # Pipes and devices cannot be read twice, and may never answer.
        if not stat.S_ISREG(mode):
            raise LogError(path, "is no regular file, expected a log")
    with opened(path) as read:
        return _head_of(where, path, read)


def _head_of(where: Path, name: object, read: Callable[[int], bytes]) -> Head:
    data, first = b"", read(HEAD_SIZE)
    is_gzip = first.startswith(GZIP)
    try:
        for piece in decompressed(name, read, first):
            data += piece
            if len(data) >= HEAD_SIZE:
                break
    except LogError:
        # A broken stream is reported when the log is read, with how far that went.
        if not data:
            raise
    if not data:
        raise LogError(name, f"is empty{' once decompressed' * is_gzip}, expected a log")
    return Head(where, data[:HEAD_SIZE].removeprefix(BOM), is_gzip=is_gzip)


class LocalCopy(os.PathLike[str]):
    """A temporary file under the name that a person knows it by; it goes when this object does.

    ``str`` gives the name, ``os.fspath`` the path.
    """

    def __init__(self, name: str, pieces: Iterable[bytes], limits: Limits = LIMITS) -> None:
        # In a separate folder: what a reader looks for beside its log is not there.
        folder = tempfile.mkdtemp(prefix="lineament-")
        self.remove = weakref.finalize(self, _remove, folder, os.getpid())
        self._name, self._path = name, str(Path(folder, "log"))
        size = 0
        try:
            with Path(self._path).open("wb") as file:
                for piece in pieces:
                    size += len(piece)
                    limits.check("copy", size, partial(LogError, name))
                    try:
                        file.write(piece)
                    except OSError as error:
                        problem = f"cannot be copied to {self._path}: {error.strerror or error}"
                        raise LogError(name, problem) from None
        except BaseException:
            self.remove()
            raise

    def __deepcopy__(self, memo: object) -> Self:
        return self  # The file does not change.

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            f"{self} is read from a temporary copy, which ends with this process: open it in the "
            "other one"
        )

    def __fspath__(self) -> str:
        return self._path

    def __str__(self) -> str:
        return self._name


def _remove(folder: str, process: int) -> None:
    if os.getpid() == process:  # A process that was forked has the object, but the file is not its.
        shutil.rmtree(folder, ignore_errors=True)


def unzip(path: str | os.PathLike[str], limits: Limits, *, keep_going: bool = False) -> LocalCopy:
    """Copy what a gzip file holds: up to a break in it, if asked to keep going, else LogError."""

    def pieces() -> Iterator[bytes]:
        try:
            yield from chunks(path, limits)
        except LogError:
            if not keep_going:  # Else the reader of the copy reports that it ends early.
                raise

    return LocalCopy(str(path), pieces(), limits)


# Zip archives


def member_heads(path: str | os.PathLike[str], limits: Limits) -> Iterator[tuple[str, Head]]:
    """Yield the name and the beginning of each file in an archive, sorted by name.

    Files that systems hide there are left out, as are those that cannot be read.
    """
    with _archive(path) as archive:
        names = sorted(info.filename for info in archive.infolist() if not info.is_dir())
        limits.check("members", len(names), partial(LogError, path))
        for name in filter(_is_shown, names):
            try:
                with archive.open(name) as file:
                    head = _head_of(Path(name), name, file.read)
            except Exception:
                continue
            yield name, head


def _is_shown(name: str) -> bool:
    # Names that lead out of the archive, /a and ../a, are hidden too.
    parts = name.split("/")
    return name.isprintable() and all(
        part and not part.startswith((".", "__MACOSX")) for part in parts
    )


def unzipped_member(path: str | os.PathLike[str], member: str, limits: Limits) -> LocalCopy:
    """Copy a member of a zip archive; LogError if it is missing, broken or encrypted."""
    name = f"{path}/{member}"
    with _archive(path) as archive:
        try:
            info = archive.getinfo(member)
        except KeyError:
            raise LogError(name, "there is no such file in the archive") from None
        # No more is unpacked than it says.
        limits.check_growth(info.file_size, info.compress_size, partial(LogError, name))
        with archive.open(info) as file:
            return LocalCopy(name, iter(partial(file.read, _PIECE), b""), limits)


@contextmanager
def _archive(path: str | os.PathLike[str]) -> Iterator[zipfile.ZipFile]:
    with reading(path):
        try:
            with zipfile.ZipFile(path) as archive:
                yield archive
        except LogError:
            raise
        # At what is damaged, encrypted or packed in a rare way the errors are those of zipfile,
        # struct and four decompressors.
        except Exception as error:
            reason = str(error) or "it ends early"
            raise LogError(path, f"is no whole zip archive: {reason}") from None


# Addresses


def is_address(path: str | os.PathLike[str]) -> bool:
    """Whether it is an address such as ``s3://bucket/key``, and no path."""
    return isinstance(path, str) and "://" in path


def fetched(address: str, limits: Limits) -> LocalCopy:
    """Copy what is at an address; LogError if it, fsspec or a driver of fsspec is missing."""
    with _fsspec(address) as fsspec:
        in_time = partial(_in_time, address, limits)
        with in_time(fsspec.open(address, "rb").open) as file:
            pieces = iter(partial(in_time, partial(file.read, _PIECE)), b"")
            return LocalCopy(address, pieces, limits)


def listed(address: str, limits: Limits = LIMITS) -> list[str]:
    """Return the files in the folder at an address or of its pattern, else the address alone."""
    with _fsspec(address) as fsspec:
        return _in_time(address, limits, partial(_listed, fsspec, address))


def _listed(fsspec: ModuleType, address: str) -> list[str]:
    system, root = fsspec.core.url_to_fs(address)
    if any(sign in root for sign in "*?["):
        names = system.glob(root)
    elif system.isdir(root):
        names = system.find(root)
    else:
        return [address]
    return sorted(system.unstrip_protocol(name) for name in names)


def _in_time(address: str, limits: Limits, call: Callable[[], _T]) -> _T:
    """Call in a thread that is given up, with a LogError, if it takes longer than the limit.

    Servers that send a byte now and then would keep a reader for days.
    """
    ends: Queue[tuple[_T | None, BaseException | None]] = Queue()

    def run() -> None:
        try:
            ends.put((call(), None))
        except BaseException as error:
            ends.put((None, error))

    threading.Thread(target=run, daemon=True).start()
    try:
        result, error = ends.get(timeout=limits.fetch)
    except Empty:
        limits.check("fetch", limits.fetch + 1, partial(LogError, address))
        raise
    if error is not None:
        raise error
    return cast("_T", result)


@contextmanager
def _fsspec(address: str) -> Iterator[ModuleType]:
    """Give fsspec, and turn whatever its many drivers raise into one line."""
    try:
        import fsspec

        yield fsspec
    except LogError:
        raise
    except ImportError as error:
        if error.name == "fsspec":
            raise LogError(address, needs("fsspec")) from None
        raise LogError(address, f"needs a driver of fsspec: {error}") from None
    except FileNotFoundError:
        raise LogError(address, "there is no such file, expected a log") from None
    except Exception as error:
        problem = " ".join(f"{type(error).__name__}: {error}".split())
        raise LogError(address, f"cannot be fetched: {problem}") from None
