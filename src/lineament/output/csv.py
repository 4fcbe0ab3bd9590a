"""CSV: one row a feature, the columns of the Parquet table."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pyarrow as pa
import pyarrow.csv

from .rows import RowWriter
from .writer import Found

__all__ = ["CsvWriter"]


class CsvWriter(RowWriter):
    """Writes a line of names, then the rows; a column that a kind does not fill is empty."""

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._file = files.enter_context(pa.csv.CSVWriter(temporary, self._schema))

    def _write(self, found: list[Found], first_scan: int) -> None:
        self._file.write_table(self._table(found, first_scan))
