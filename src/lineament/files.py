"""Whole files or none: look first whether they may be written, write beside, then rename."""

import json
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .errors import LineamentError

StrPath = str | os.PathLike[str]

#: What the files of a log that is a folder, a bag of ROS 2, end with.
_PARTS = (".yaml", ".db3", ".mcap", ".zstd")


@contextmanager
def written_beside(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary file in the folder of `path` that becomes `path` when all went well.

    Whatever interrupts the block, Ctrl-C included, removes the temporary file and leaves `path` as
    it was; a run that is killed leaves at most a hidden file that ends in ``.part``. What was
    written is on the disk before it gets its name, so that a loss of power leaves no empty file.
    If `path` is a link, the file behind it is replaced.

    Raises
    ------
    LineamentError
        If the folder does not exist or cannot be written to, or `path` is a folder or read-only.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "a.txt"
    >>> with written_beside(target) as temporary:
    ...     _ = temporary.write_text("all of it")
    ...     target.exists()
    False
    >>> target.read_text()
    'all of it'
    """
    target = Path(os.path.realpath(path))
    temporary = _made_beside(path, target)
    try:
        yield temporary
        with naming_errors(path):
            with temporary.open("rb+") as file:  # Windows flushes only what is open for writing
                os.fsync(file.fileno())
            temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def _made_beside(path: str | os.PathLike[str], target: Path) -> Path:
    """Make an empty temporary file beside the target that `path` leads to."""
    with naming_errors(path):
        if target.is_dir():
            raise LineamentError(f"{path}: is a folder, expected the name of a file")
        if target.exists() and not target.is_file():  # It would be replaced.
            raise LineamentError(f"{path}: is a device or a pipe, expected the name of a file")
        if not target.parent.is_dir():
            raise LineamentError(f"{path}: the folder {target.parent} does not exist")
        if target.exists() and not os.access(target, os.W_OK):  # To rename needs no permission.
            raise LineamentError(f"{path}: is read-only, expected a file that may be replaced")
        # mkstemp would make the file private to its owner; this one follows the umask.
        # Arrow and other writers refuse a name that is not text in UTF-8.
        name = target.name.encode(errors="ignore").decode()
        temporary = target.with_name(f".{name}.{secrets.token_hex(4)}.part")
        temporary.touch(exist_ok=False)
    return temporary


def check_outputs(outputs: Iterable[StrPath], inputs: Iterable[StrPath] = ()) -> None:
    """Refuse, before any work, outputs that cannot be written or would replace an input.

    Parameters
    ----------
    outputs, inputs : iterable of path-like
        As for `spare_inputs`.

    Raises
    ------
    LineamentError
        If an output is an input or another output, or `written_beside` would refuse it.
    """
    outputs = list(outputs)
    spare_inputs(outputs, inputs)
    for output in outputs:
        _made_beside(output, Path(os.path.realpath(output))).unlink()


def spare_inputs(outputs: Iterable[StrPath], inputs: Iterable[StrPath]) -> None:
    """Refuse an output that is a file that is read, by whatever name, or that is written twice.

    Parameters
    ----------
    outputs : iterable of path-like
        Files to write, which need not exist.
    inputs : iterable of path-like
        Logs and plans: files, folders that are one log, members of archives, addresses.

    Raises
    ------
    LineamentError
        If two of them are the same file.

    Examples
    --------
    >>> spare_inputs(["features.mcap"], ["drive.mcap", "s3://bucket/features.mcap"])
    >>> spare_inputs(["./drive.mcap"], ["drive.mcap"])
    Traceback (most recent call last):
    lineament.errors.LineamentError: ./drive.mcap: would replace drive.mcap, which is read
    """
    taken = {
        _identity(file): f"{source}, which is read"
        for source in inputs
        for file in _files_read(source)
    }
    for output in outputs:
        file = _identity(output)
        if file in taken:
            raise LineamentError(f"{output}: would replace {taken[file]}")
        taken[file] = f"{output}, which is written too"


def _files_read(source: StrPath) -> Iterator[str]:
    """Yield the files of this machine that a log or a plan is read from."""
    path = os.fspath(source)
    if "://" in path:
        # Of a chain, zip://a.log::file:///logs.zip, the last is what holds the others.
        scheme, _, path = path.rpartition("::")[2].partition("://")
        if scheme not in ("file", "local"):
            return
    yield path
    if os.path.isdir(path):  # noqa: PTH112  (Path raises where a name is too long)
        with suppress(OSError):  # Reading it reports what is wrong.
            yield from (str(file) for file in Path(path).iterdir() if file.suffix in _PARTS)
    # A member of an archive is named as if that were a folder.
    yield from (str(above) for above in Path(path).parents if os.path.isfile(above))  # noqa: PTH113


def _identity(path: StrPath) -> object:
    """Return what all names of a file have in common; of one that is not there, its full path."""
    try:
        state = os.stat(path)  # noqa: PTH116
    except OSError:
        return os.path.normcase(os.path.realpath(path))
    except ValueError:  # A null byte: to read or to write it reports that.
        return path
    return state.st_dev, state.st_ino


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8: the whole of it, or nothing (a LineamentError).

    What no encoding knows (of the name of a file, say) is written with a mark.
    """
    with written_beside(path) as temporary, naming_errors(path):
        temporary.write_bytes(text.encode("utf-8", errors="replace"))


def strict_json(value: Any) -> str:
    """Write a value as JSON, with null in place of numbers that are not finite."""
    try:
        return json.dumps(value, allow_nan=False)
    except ValueError:
        return json.dumps(json.loads(json.dumps(value), parse_constant=lambda _: None))


def ending_of(path: str | os.PathLike[str], endings: Iterable[str]) -> str:
    """Return which of some endings, a longer one before one that it contains, a name has.

    Raises a LineamentError if it has none of them.
    """
    name, own = Path(path).name.lower(), Path(path).suffix.lower()
    for ending in endings:
        if name.endswith(ending):
            return ending
    problem = f"the ending {own!r} is not known" if own else "the name has no ending"
    raise LineamentError(f"{path}: {problem}, expected one of {', '.join(endings)}")


def made_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder and its parents unless they are there; a LineamentError if it cannot."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LineamentError(f"{path}: cannot make this folder: {error.strerror}") from None
    return folder


@contextmanager
def alone_in(folder: str | os.PathLike[str]) -> Iterator[None]:
    """Keep other runs out of a folder; a LineamentError if there is one in it.

    The system forgets a run that was killed. Where it knows no locks of folders, nothing is kept.
    """
    try:
        import fcntl

        place = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        yield
        return
    try:
        with suppress(OSError):  # Not all file systems know them.
            try:
                fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise LineamentError(f"{folder}: another run writes into this folder") from None
        yield
    finally:
        os.close(place)


@contextmanager
def naming_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an OSError into a LineamentError of one line that names `path`.

    So is the UnicodeEncodeError of a writer that refuses a path that is not text in UTF-8.
    """
    try:
        yield
    except UnicodeEncodeError as error:
        if str(path) == str(path).encode(errors="ignore").decode():
            raise  # The path is text: it is about what is written.
        raise LineamentError(f"{path}: cannot be written: its path is not text in UTF-8") from error
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split()) or type(error).__name__
        raise LineamentError(f"{path}: cannot be written: {reason}") from error
