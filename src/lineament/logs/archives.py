"""Logs in zip archives: nothing is ever written under a name that an archive gives."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import LogError
from .base import HEAD_SIZE, Head
from .copies import LocalCopy, pieces
from .lines import reading

__all__ = ["ZIP", "heads", "unpacked_member"]

#: How a zip archive begins.
ZIP = b"PK\x03\x04"
#: Members of an archive that are looked at.
MAX_MEMBERS = 10_000


def heads(path: str | os.PathLike[str]) -> Iterator[tuple[str, Head]]:
    """Yield the name and the beginning of each file in an archive, sorted by name.

    Files that systems hide there are left out, as are those that cannot be read.

    Raises
    ------
    LogError
        If the archive is broken or has too many files.
    """
    with _archive(path) as archive:
        names = sorted(info.filename for info in archive.infolist() if not info.is_dir())
        if len(names) > MAX_MEMBERS:
            raise LogError(path, f"holds {len(names)} files, expected at most {MAX_MEMBERS}")
        for name in filter(_is_shown, names):
            try:
                with archive.open(name) as file:
                    data = file.read(HEAD_SIZE)
            except Exception:
                continue
            yield name, Head.of(Path(name), data)


def _is_shown(name: str) -> bool:
    # Names that lead out of the archive, /a and ../a, are hidden too.
    hidden = any(not part or part.startswith((".", "__MACOSX")) for part in name.split("/"))
    return name.isprintable() and not hidden


def unpacked_member(path: str | os.PathLike[str], member: str) -> LocalCopy:
    """Copy a member of a zip archive.

    Raises
    ------
    LogError
        If there is no such member, or it is broken, encrypted or too large.
    """
    name = f"{path}/{member}"
    with _archive(path) as archive:
        try:
            info = archive.getinfo(member)
        except KeyError:
            raise LogError(name, "there is no such file in the archive") from None
        with archive.open(info) as file:
            return LocalCopy(name, pieces(file), info.compress_size)


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
