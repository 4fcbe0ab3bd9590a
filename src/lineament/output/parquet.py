"""Parquet: one row a feature, one row group a thousand scans."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

import pyarrow.parquet as pq

from ..features import Features
from ..tables import SCHEMA, features_table
from .writer import Writer

__all__ = ["ParquetWriter"]


class ParquetWriter(Writer):
    """Writes the table of `lineament.tables`, with the frames and the number of scans.

    A log without scans gives a file without rows, with the same schema.
    """

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._frames: dict[str, None] = {}
        self._file = files.enter_context(
            pq.ParquetWriter(
                temporary,
                SCHEMA,
                compression="zstd",
                # Of numbers a dictionary costs more time than it saves space.
                use_dictionary=["kind", "breakpoint"],
                # What rows are looked for by.
                write_statistics=["kind", "scan", "stamp"],
            )
        )

    def _write(self, scans: list[Features], first_scan: int) -> None:
        self._frames.update(dict.fromkeys(features.frame_id for features in scans))
        table = features_table(scans, first_scan).replace_schema_metadata(SCHEMA.metadata)
        self._file.write_table(table, row_group_size=max(table.num_rows, 1))

    def _close(self) -> None:
        # Only the end of a log tells these.
        self._file.add_key_value_metadata(
            {
                "lineament.frame_ids": json.dumps(list(self._frames)),
                "lineament.scans": str(self._written),
            }
        )
