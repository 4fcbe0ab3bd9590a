"""Parquet: one row a feature, one row group a thousand scans."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

import pyarrow.parquet as pq

from .rows import RowWriter
from .writer import Found

__all__ = ["ParquetWriter"]


class ParquetWriter(RowWriter):
    """Writes the table of `lineament.features.tables`, with the frames and the number of scans.

    A log without scans gives a file without rows, with the same schema.
    """

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._frames: dict[str, None] = {}
        self._file = files.enter_context(
            pq.ParquetWriter(
                temporary,
                self._schema,
                compression="zstd",
                # Of numbers a dictionary costs more time than it saves space.
                use_dictionary=["kind", "corner", "breakpoint", "topic"],
                # What rows are looked for by.
                write_statistics=["kind", "scan", "stamp", "topic"],
            )
        )

    def _write(self, found: list[Found], first_scan: int) -> None:
        self._frames.update(dict.fromkeys(one.features.frame_id for one in found))
        table = self._table(found, first_scan)
        self._file.write_table(table, row_group_size=max(table.num_rows, 1))

    def _close(self) -> None:
        # Only the end of a log tells these.
        self._file.add_key_value_metadata(
            {
                "lineament.frame_ids": json.dumps(list(self._frames)),
                "lineament.scans": str(self._written),
            }
        )
