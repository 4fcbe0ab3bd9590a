"""Logs at addresses such as ``s3://bucket/key``, by fsspec."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from ..errors import LogError, needs
from .copies import LocalCopy, pieces

__all__ = ["fetched", "is_address", "listed"]


def is_address(path: str | os.PathLike[str]) -> bool:
    """Whether it is an address, and no path.

    Examples
    --------
    >>> is_address("memory://a.log"), is_address("a.log")
    (True, False)
    """
    return isinstance(path, str) and "://" in path


def fetched(address: str) -> LocalCopy:
    """Copy what is at an address to a temporary file.

    Raises
    ------
    LogError
        If fsspec, or what it needs for such addresses, is missing, or nothing can be read there.
    """
    with _fsspec(address) as fsspec, fsspec.open(address, "rb") as file:
        return LocalCopy(address, pieces(file))


def listed(address: str) -> list[str]:
    """Name what an address stands for: the files in a folder or those that match a pattern.

    An address that is neither is given back alone, whether or not there is a file.

    Raises
    ------
    LogError
        As from `fetched`.
    """
    with _fsspec(address) as fsspec:
        system, root = fsspec.core.url_to_fs(address)
        if any(sign in root for sign in "*?["):
            names = system.glob(root)
        elif system.isdir(root):
            names = system.find(root)
        else:
            return [address]
        return sorted(system.unstrip_protocol(name) for name in names)


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
