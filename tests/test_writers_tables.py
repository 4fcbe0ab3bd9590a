"""Tables in files: CSV reads back the same, and a log of several topics has a column of them."""

from __future__ import annotations

import csv
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_tables import random_features

from lineament.features.tables import SCHEMA, features_table
from lineament.output import open_writer
from lineament.output.rows import TOPIC

TOPICS = ("/front", '/re"ar,\n')


def write(path, scans, topics=()):
    with open_writer(path, topics) as writer:
        for i, features in enumerate(scans):
            writer.write(features, topic=topics[i % len(topics)] if topics else "")


def value_of(text, field):
    """Read a value of CSV as the type that the schema tells."""
    if text == "":
        return None
    if pa.types.is_boolean(field.type):
        return {"true": True, "false": False}[text]
    if pa.types.is_dictionary(field.type):
        return text
    return float(text) if pa.types.is_floating(field.type) else int(text)


@pytest.mark.parametrize("topics", [(), TOPICS])
def test_csv_reads_back_the_same(tmp_path, topics):
    scans = [random_features(i) for i in range(1010)]
    write(tmp_path / "a.csv", scans, topics)
    schema = SCHEMA.append(TOPIC) if topics else SCHEMA
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        lines = csv.reader(file)
        assert next(lines) == schema.names
        rows = [
            {f.name: value_of(text, f) for f, text in zip(schema, line, strict=True)}
            for line in lines
        ]
    expected = features_table(scans).to_pylist()
    if topics:
        expected = [row | {"topic": topics[row["scan"] % 2]} for row in expected]
    assert rows == expected


def test_csv_tells_what_is_not_finite(tmp_path):
    features = random_features(1)
    features.segments["rms"] = [np.nan, np.inf, -np.inf]
    write(tmp_path / "a.csv", [features])
    with (tmp_path / "a.csv").open(newline="") as file:
        texts = [row["rms"] for row in csv.DictReader(file) if row["kind"] == "segment"]
    assert [float(text) for text in texts] == pytest.approx([np.nan, np.inf, -np.inf], nan_ok=True)


def test_parquet_has_a_column_of_topics_where_they_are_told(tmp_path):
    scans = [random_features(i) for i in range(1005)]
    write(tmp_path / "none.parquet", scans[:3])
    assert pq.read_schema(tmp_path / "none.parquet").equals(SCHEMA)
    write(tmp_path / "one.parquet", scans[:3], TOPICS[:1])
    assert set(pq.read_table(tmp_path / "one.parquet")["topic"].to_pylist()) == {TOPICS[0]}
    write(tmp_path / "two.parquet", scans, TOPICS)
    table = pq.read_table(tmp_path / "two.parquet")
    assert table.schema.names == [*SCHEMA.names, "topic"]
    # The other columns are what they are without it.
    assert table.schema.metadata[b"lineament.schema"] == b"2"
    assert table.drop_columns("topic").combine_chunks().equals(features_table(scans))
    told = np.array(TOPICS)[table["scan"].to_numpy() % 2]
    assert table["topic"].to_pylist() == told.tolist()


def test_jsonl_tells_the_topic_after_the_scan(tmp_path):
    scans = [random_features(i) for i in range(3)]
    write(tmp_path / "a.jsonl", scans, TOPICS)
    lines = [json.loads(line) for line in (tmp_path / "a.jsonl").read_text().splitlines()]
    assert [line.pop("topic") for line in lines] == [TOPICS[0], TOPICS[1], TOPICS[0]]
    assert lines == [{"scan": i, **f.to_dict()} for i, f in enumerate(scans)]


def test_tables_keep_no_scan(tmp_path):
    with open_writer(tmp_path / "a.parquet") as writer:
        writer.write(random_features(1), object())
        assert writer._waiting[0].scan is None
