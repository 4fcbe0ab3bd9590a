"""Tables in files, a row a feature: Parquet and CSV; and JSON lines, a line a scan."""

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from ..features.tables import SCHEMA, array_of, features_table, numbers_of, texts
from ..files import strict_json
from .writer import Found, Writer

#: Topic of the scan, null where it is not known.
TOPIC = pa.field(
    "topic",
    pa.dictionary(pa.int32(), pa.string()),
    metadata={"unit": "", "description": "topic of the scan"},
)


#: Pose of the scanner in the world, the same in all rows of a scan; null where it is not known.
POSE = [
    pa.field(f"pose_{name}", pa.float64(), metadata={"unit": unit, "description": "of the scan"})
    for name, unit in (("x", "m"), ("y", "m"), ("theta", "rad"))
]

#: Columns of a file: the same, whatever log they are of.
WRITTEN = pa.schema([*SCHEMA, *POSE, TOPIC], SCHEMA.metadata)


class _RowWriter(Writer):
    """A writer of rows; its `_table` makes those of some scans."""

    chunk = 1000

    def _table(self, found: list[Found], first_scan: int) -> pa.Table:
        table = features_table([one.features for one in found], first_scan)
        scan = numbers_of(table["scan"]) - first_scan
        poses = np.array([one.pose or (np.nan,) * 3 for one in found]).reshape(-1, 3)[scan]
        for field, values in zip(POSE, poses.T, strict=True):
            table = table.append_column(field, array_of(values, np.isnan(values)))
        of_scan = [one.topic for one in found]
        topics = [*dict.fromkeys(of_scan)]
        row = np.array([*map(topics.index, of_scan)], dtype=np.int32)[scan]
        known = array_of(row, np.array([not topic for topic in topics], dtype=np.bool_)[row])
        column = pa.DictionaryArray.from_arrays(known, texts(topics))
        table = table.append_column(TOPIC, column)
        return table.replace_schema_metadata(SCHEMA.metadata)


class CsvWriter(_RowWriter):
    """Writes a line of names, then the rows; a column that a kind does not fill is empty."""

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._file = files.enter_context(pa.csv.CSVWriter(temporary, WRITTEN))

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
                WRITTEN,
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
    """Writes ``{"scan": i, **features.to_dict()}`` in strict JSON, ``topic``, ``pose`` if known."""

    def _open(self, temporary: Path, files: ExitStack) -> None:
        # The same bytes on every system: no "\r\n".
        self._file = files.enter_context(temporary.open("w", encoding="utf-8", newline="\n"))

    def _write(self, found: list[Found], first_scan: int) -> None:
        for i, (features, _, topic, pose) in enumerate(found, first_scan):
            known: dict[str, Any] = {"topic": topic} if topic else {}
            known |= {} if pose is None else {"pose": pose}
            self._file.write(strict_json({"scan": i} | known | features.to_dict()) + "\n")
