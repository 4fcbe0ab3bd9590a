"""What tables in files share: one row a feature, and a column of topics where there are several."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from ..features.tables import SCHEMA, features_table
from .writer import Found, Writer

__all__ = ["TOPIC", "RowWriter"]

#: The column that a table has besides those of `SCHEMA` where its scans come from several topics.
TOPIC = pa.field(
    "topic",
    pa.dictionary(pa.int32(), pa.string()),
    metadata={"unit": "", "description": "topic of the scan"},
)


class RowWriter(Writer):
    """A writer of rows; its `_table` makes those of some scans."""

    chunk = 1000

    @property
    def _schema(self) -> pa.Schema:
        return SCHEMA.append(TOPIC) if self.topics else SCHEMA

    def _table(self, found: Sequence[Found], first_scan: int) -> pa.Table:
        table = features_table([one.features for one in found], first_scan)
        if self.topics:
            places = {topic: k for k, topic in enumerate(self.topics)}
            of_scan = np.array([places[one.topic] for one in found], dtype=np.int32)
            codes = of_scan[table["scan"].to_numpy() - first_scan]
            table = table.append_column(
                TOPIC, pa.DictionaryArray.from_arrays(codes, pa.array(self.topics, pa.string()))
            )
        return table.replace_schema_metadata(SCHEMA.metadata)
