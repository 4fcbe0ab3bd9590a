"""Whole files or none: write beside the target, then rename."""

import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import LineamentError

__all__ = ["ending_of", "made_folder", "naming_errors", "write_text", "written_beside"]


@contextmanager
def written_beside(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary file in the folder of `path` that becomes `path` when all went well.

    Whatever interrupts the block, Ctrl-C included, removes the temporary file and leaves `path` as
    it was. A run that is killed leaves at most the temporary file, whose name is hidden and ends in
    ``.part``. What was written is on the disk before it gets its name, so that a loss of power
    leaves no empty file under it.

    Parameters
    ----------
    path : path-like
        The target. If it is a link, the file behind it is replaced.

    Yields
    ------
    pathlib.Path
        An empty file to be written to. It must be closed when the block ends.

    Raises
    ------
    LineamentError
        If the folder does not exist or cannot be written to, or `path` is a folder.

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
    if target.is_dir():
        raise LineamentError(f"{path}: is a folder, expected the name of a file")
    if not target.parent.is_dir():
        raise LineamentError(f"{path}: the folder {target.parent} does not exist")
    # mkstemp would make the file private to its owner; this one follows the umask.
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    with naming_errors(path):
        temporary.touch(exist_ok=False)
    try:
        yield temporary
        with naming_errors(path):
            _flush_to_disk(temporary)
            temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def _flush_to_disk(path: Path) -> None:
    # Windows flushes only what is open for writing.
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8: the whole of it, or nothing.

    A name that no encoding knows (of a file, say) is written with a mark, and is no failure.

    Raises
    ------
    LineamentError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "a.txt"
    >>> write_text(target, "1 m²")
    >>> target.read_text(encoding="utf-8")
    '1 m²'
    """
    with written_beside(path) as temporary, naming_errors(path):
        temporary.write_bytes(text.encode("utf-8", errors="replace"))


def ending_of(path: str | os.PathLike[str], endings: Iterable[str]) -> str:
    """Return which of some endings, a longer one before one that it contains, a name has.

    Raises
    ------
    LineamentError
        If it has none of them.

    Examples
    --------
    >>> ending_of("A.ros2.MCAP", [".ros2.mcap", ".mcap"])
    '.ros2.mcap'
    """
    name, own = Path(path).name.lower(), Path(path).suffix.lower()
    for ending in endings:
        if name.endswith(ending):
            return ending
    problem = f"the ending {own!r} is not known" if own else "the name has no ending"
    raise LineamentError(f"{path}: {problem}, expected one of {', '.join(endings)}")


def made_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder, and those that it is in, unless it is there.

    Raises
    ------
    LineamentError
        If it cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> made_folder(Path(tempfile.mkdtemp()) / "a" / "b").is_dir()
    True
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LineamentError(f"{path}: cannot make this folder: {error.strerror}") from None
    return folder


@contextmanager
def naming_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an OSError into a LineamentError of one line that names `path`.

    Examples
    --------
    >>> with naming_errors("a.parquet"):
    ...     raise OSError(28, "No space left on device")
    Traceback (most recent call last):
    lineament.errors.LineamentError: a.parquet: cannot be written: No space left on device
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split()) or type(error).__name__
        raise LineamentError(f"{path}: cannot be written: {reason}") from error
