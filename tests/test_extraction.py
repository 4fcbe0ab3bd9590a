"""One log into one file: topics, options of reading, what is told."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
import ros_bags
from mcap.reader import make_reader

import lineament as ln
from lineament.logs import save_npz
from lineament.tasks.bulk import extract_logs
from lineament.tasks.extract import extract_log

IEPF = ln.Extractor("iepf")


@pytest.fixture
def two_topics(tmp_path):
    messages = ros_bags.Messages(2)
    walls = np.full(101, 2.0), np.full(81, 3.0)

    def items():
        for k in range(6):
            topic = ("/front", "/rear")[k % 2]
            yield topic, k * 10**8, messages.scan(0.1 * k, walls[k % 2])

    return ros_bags.write(tmp_path, "mcap", items(), "two")


def test_all_topics_go_into_one_table_with_a_column(two_topics, tmp_path):
    found = extract_log(two_topics, tmp_path / "all.parquet", IEPF)
    assert (found.scans, found.topics) == (6, ["/front", "/rear"])
    table = pq.read_table(tmp_path / "all.parquet").to_pylist()
    assert {(row["scan"], row["topic"]) for row in table} == {
        (k, ("/front", "/rear")[k % 2]) for k in range(6)
    }
    extract_log(two_topics, tmp_path / "all.jsonl", IEPF)
    lines = [json.loads(line) for line in (tmp_path / "all.jsonl").read_text().splitlines()]
    assert [line["topic"] for line in lines] == ["/front", "/rear"] * 3


def test_one_topic_is_chosen_and_tables_need_not_tell_it(two_topics, tmp_path):
    found = extract_log(two_topics, tmp_path / "rear.parquet", IEPF, topic="/rear")
    assert (found.scans, found.topics) == (3, ["/rear"])
    table = pq.read_table(tmp_path / "rear.parquet")
    assert "topic" not in table.column_names
    assert max(table["scan"].to_pylist()) == 2
    extract_log(two_topics, tmp_path / "rear.jsonl", IEPF, topic="/rear")
    assert "topic" not in json.loads((tmp_path / "rear.jsonl").read_text().splitlines()[0])
    with pytest.raises(ln.LogError, match="on '/up'; topics there are"):
        extract_log(two_topics, tmp_path / "up.parquet", IEPF, topic="/up")
    assert not (tmp_path / "up.parquet").exists()


def test_what_draws_the_scans_names_them_after_their_topic(two_topics, tmp_path):
    extract_log(two_topics, tmp_path / "out.mcap", IEPF, topic="/rear")
    with (tmp_path / "out.mcap").open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert topics == {"/rear", "/rear/features"}


def test_a_data_set_has_one_schema_whatever_topics_its_logs_have(two_topics, tmp_path):
    save_npz(tmp_path / "a.npz", [ln.LaserScan(np.full(61, 2.0), -0.5, 1 / 60)] * 3)
    extract_logs([tmp_path / "a.npz", two_topics], tmp_path / "out", IEPF)
    rows = pq.read_table(tmp_path / "out").to_pylist()
    assert {(row["log"], row["topic"]) for row in rows} == {
        ("a.npz", "ranges"),
        ("two.mcap", "/front"),
        ("two.mcap", "/rear"),
    }
