"""Features to files: one module a format, imported when it is used."""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path

from ..atomic import written_beside
from ..errors import LineamentError
from .writer import Writer

__all__ = ["ENDINGS", "Writer", "open_writer", "written_beside"]

#: Module and class of the writer of each ending. A new format is one file and one line here.
_WRITERS = {
    ".parquet": ("parquet", "ParquetWriter"),
    ".jsonl": ("jsonl", "JsonLinesWriter"),
}

#: The endings that `open_writer` knows.
ENDINGS = tuple(_WRITERS)


def open_writer(path: str | os.PathLike[str]) -> Writer:
    """Make a writer of features for a file, of the format that its ending tells.

    Parameters
    ----------
    path : path-like
        The file: ``.parquet`` (one row a feature) or ``.jsonl`` (one line a scan). Both are
        described in ``docs/formats.md``.

    Returns
    -------
    Writer
        A context manager. The file appears when its block ends without an exception.

    Raises
    ------
    LineamentError
        If the ending is not known; on entering, if the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01)
    >>> path = Path(tempfile.mkdtemp()) / "features.jsonl"
    >>> with open_writer(path) as writer:
    ...     writer.write(ln.extract(scan))
    >>> path.read_text(encoding="utf-8")[:25]
    '{"scan": 0, "stamp": 0.0,'
    """
    ending = Path(path).suffix.lower()
    if ending not in _WRITERS:
        told = f"the ending {ending!r} is not known" if ending else "the name has no ending"
        raise LineamentError(f"{path}: {told}, expected one of {', '.join(ENDINGS)}")
    module, name = _WRITERS[ending]
    writer: type[Writer] = getattr(import_module(f".{module}", __name__), name)
    return writer(path)
