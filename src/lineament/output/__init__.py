"""Features to files: one writer a format, imported when it is used."""

import os
from importlib import import_module

from ..errors import needed_by
from ..files import ending_of
from .writer import Writer

__all__ = ["ENDINGS", "Writer", "open_writer"]

#: Module and class of the writer of each ending. A new format is one class and one line here.
_WRITERS = {
    ".parquet": ("tables", "ParquetWriter"),
    ".csv": ("tables", "CsvWriter"),
    ".jsonl": ("tables", "JsonLinesWriter"),
    ".ros2.mcap": ("mcap", "Ros2Writer"),  # before the ending that it contains
    ".mcap": ("mcap", "FoxgloveWriter"),
    ".rrd": ("rrd", "RerunWriter"),
    ".svg": ("svg", "SvgWriter"),
    ".dxf": ("dxf", "DxfWriter"),
    ".geojson": ("geojson", "GeoJsonWriter"),
}

#: The endings that `open_writer` knows.
ENDINGS = tuple(_WRITERS)


def open_writer(path: str | os.PathLike[str]) -> Writer:
    """Make a writer of features for a file, in the format of its ending.

    Parameters
    ----------
    path : path-like
        The file, which is replaced if it is there: ``.parquet`` or ``.csv`` (one row a feature),
        ``.jsonl`` (one line a scan), ``.mcap`` (for Foxglove), ``.ros2.mcap`` (for RViz), ``.rrd``
        (for rerun), ``.svg``, ``.dxf`` or ``.geojson`` (a plan). They are described in
        ``docs/formats.md``.

    Returns
    -------
    Writer
        A context manager; the file appears when its block ends without an exception.

    Raises
    ------
    LineamentError
        If the ending is not known, or a package that its format needs is not installed; on
        entering, if the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01)
    >>> with open_writer(tempfile.mkdtemp() + "/features.jsonl") as writer:
    ...     writer.write(ln.extract(scan), scan)
    """
    module, name = _WRITERS[ending_of(path, ENDINGS)]
    with needed_by(f"{path}:"):
        writer: Writer = getattr(import_module(f".{module}", __name__), name)(path)
    return writer
