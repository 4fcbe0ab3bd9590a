"""Tables in files, a row a feature: Parquet and CSV; and JSON lines, a line a scan."""

import json
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from ..features.tables import SCHEMA, features_table
from ..files import strict_json
from .writer import Found, Writer

#: The column that a table has besides those of `SCHEMA` where its scans come from several topics.
TOPIC = pa.field(
    "topic",
    pa.dictionary(pa.int32(), pa.string()),
    metadata={"unit": "", "description": "topic of the scan"},
)


class _RowWriter(Writer):
    """A writer of rows; its `_table` makes those of some scans."""

    chunk = 1000

    @property
    def _schema(self) -> pa.Schema:
        return SCHEMA.append(TOPIC) if self.topics else SCHEMA

    def _table(self, found: list[Found], first_scan: int) -> pa.Table:
        table = features_table([one.features for one in found], first_scan)
        if self.topics:
            of_scan = np.array([self.topics.index(one.topic) for one in found], dtype=np.int32)
            codes = of_scan[table["scan"].to_numpy() - first_scan]
            topics = pa.DictionaryArray.from_arrays(codes, pa.array(self.topics, pa.string()))
            table = table.append_column(TOPIC, topics)
        return table.replace_schema_metadata(SCHEMA.metadata)


class CsvWriter(_RowWriter):
    """Writes a line of names, then the rows; a column that a kind does not fill is empty."""

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._file = files.enter_context(pa.csv.CSVWriter(temporary, self._schema))

    def _write(self, found: list[Found], first_scan: int) -> None:
        self._file.write_table(self._table(found, first_scan))


class ParquetWriter(_RowWriter):
    """Writes the table of `lineament.features.tables`, with the frames and the number of scans.

    A row group holds a thousand scans. A log without scans gives a file without rows, with the
    same schema.
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
        frames, scans = json.dumps(list(self._frames)), str(self._written)
        self._file.add_key_value_metadata({"lineament.frame_ids": frames, "lineament.scans": scans})


class JsonLinesWriter(Writer):
    """Writes ``{"scan": i, **features.to_dict()}`` in strict JSON, with ``topic`` where known."""

    def _open(self, temporary: Path, files: ExitStack) -> None:
        # The same bytes on every system: no "\r\n".
        self._file = files.enter_context(temporary.open("w", encoding="utf-8", newline="\n"))

    def _write(self, found: list[Found], first_scan: int) -> None:
        for i, (features, _, topic) in enumerate(found, first_scan):
            record = {"scan": i} | ({"topic": topic} if topic else {}) | features.to_dict()
            self._file.write(strict_json(record) + "\n")
