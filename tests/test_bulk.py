"""Many logs into one data set: what is in it, what is reported, and what is left as it is."""

import json
import os
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import ros_bags
from bulk_logs import corner_log, halves, outcomes, rows_of, table_of
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from test_output import files_up_to, resource

import lineament as ln
from lineament.tasks.bulk import MANIFEST, Bulk, Manifest, Row, Threads, extract_logs
from lineament.tasks.bulk.manifest import names_of, part_path
from lineament.tasks.bulk.parts import log_state
from lineament.tasks.bulk.run import _duration, _Progress
from lineament.tasks.extract import Extraction, extract_log

IEPF = ln.Extractor("iepf")


@pytest.fixture
def logs(tmp_path):
    home = tmp_path / "logs"
    return [corner_log(home / f"{name}.npz", 3 + k) for k, name in enumerate("abc")]


def test_a_data_set_is_one_table_of_all_logs_without_the_halves_of_a_killed_run(logs, tmp_path):
    out = tmp_path / "out"
    left = out / "log=a.npz" / ".part-0.parquet.0badf00d.part"
    left.parent.mkdir(parents=True)
    left.write_bytes(b"PAR1")
    bulk = extract_logs(logs, out, IEPF)
    assert (bulk.logs, bulk.whole, bulk.failed, bulk.scans) == (3, 0, 0, 12)
    assert halves(out) == []
    assert set(table_of(out)["log"].to_pylist()) == {"a.npz", "b.npz", "c.npz"}
    for log in logs:
        extract_log(log, tmp_path / "alone.parquet", IEPF)
        alone = pq.read_table(tmp_path / "alone.parquet")
        part = pq.ParquetFile(out / f"log={log.name}" / "part-0.parquet").read()
        assert part.select(alone.column_names).equals(alone)


def test_the_manifest_says_what_became_of_each_log_and_what_failed_is_tried_again(logs, tmp_path):
    out, shown, whole = tmp_path / "out", [], logs[1].read_bytes()
    logs[1].write_bytes(whole[:200])
    bulk = extract_logs([*logs, "/none.bag"], out, IEPF, show=shown.append)
    assert (bulk.failed, bulk.scans) == (2, 8)
    assert "2 done, 2 failed, 0 whole before" in str(bulk)
    assert shown[-1].startswith("4/4 logs, 2 failed, ")
    rows = rows_of(out)
    assert list(rows) == ["a.npz", "b.npz", "c.npz", "none.bag"]
    row, output = rows["c.npz"], "log=c.npz/part-0.parquet"
    expected = {
        "log": str(logs[2]),
        "outcome": "done",
        "error": "",
        "output": output,
        "bytes": (out / output).stat().st_size,
        "topics": ["ranges"],
        "scans": 5,
        "log_bytes": logs[2].stat().st_size,
        "version": ln.__version__,
    }
    assert expected.items() <= row.items()
    assert row["seconds"] > 0
    assert row["features"]["segments"] >= 5
    configuration = row["configuration"]
    assert (configuration["method"], configuration["noise"]) == ("iepf", None)
    assert configuration["reading"]["echo"] == "first"
    assert {"outcome": "failed", "bytes": 0, "scans": 0}.items() <= rows["b.npz"].items()
    assert rows["b.npz"]["error"].startswith(f"{logs[1]}: ")
    assert rows["none.bag"]["error"] == "/none.bag: there is no such file, expected a log"
    assert not (out / "log=b.npz").exists()
    logs[1].write_bytes(whole)
    bulk = extract_logs(logs, out, IEPF, resume=True)
    assert (bulk.whole, bulk.failed, bulk.scans) == (2, 0, 4)


def test_neither_executor_nor_order_changes_the_table(logs, tmp_path):
    with Threads(1) as one, Threads(3) as three, ThreadPoolExecutor(2) as others:
        for name, executor in (("one", one), ("three", three), ("others", others)):
            order = logs if name == "one" else logs[::-1]
            extract_logs(order, tmp_path / name, IEPF, executor=executor)
    expected = table_of(tmp_path / "one")
    for name in ("three", "others"):
        assert table_of(tmp_path / name).equals(expected)
        assert list(rows_of(tmp_path / name)) == list(rows_of(tmp_path / "one"))


def with_lines(path, change):
    path.write_text("".join(change(*path.read_text().splitlines(keepends=True))))


def of_older_version(line):
    return line.replace(f'"version": "{ln.__version__}"', '"version": "0.0.1"')


LOG, PART, ROWS = "logs/b.npz", "out/log=b.npz/part-0.parquet", f"out/{MANIFEST}"
HARMS = [
    (LOG, lambda log: os.utime(log, ns=(1, 1))),
    (LOG, lambda log: corner_log(log, 9)),
    (PART, lambda part: part.write_bytes(part.read_bytes()[:-1])),
    (PART, Path.unlink),
    (ROWS, lambda rows: with_lines(rows, lambda a, b, c: [a, of_older_version(b), c])),
    (ROWS, lambda rows: with_lines(rows, lambda a, b, c: [a, c, b[:100]])),
]


@pytest.mark.parametrize(("file", "harm"), HARMS)
def test_resume_leaves_what_is_whole_and_does_the_rest_again(file, harm, logs, tmp_path):
    out = tmp_path / "out"
    extract_logs(logs, out, IEPF)
    harm(tmp_path / file)
    kept = out / "log=a.npz" / "part-0.parquet"
    before = kept.stat()
    assert extract_logs(logs, out, IEPF, resume=True).whole == 2
    assert kept.stat() == before
    assert set(outcomes(out).values()) == {"done"}
    fresh = tmp_path / "fresh"
    extract_logs(logs, fresh, IEPF)
    assert table_of(out).equals(table_of(fresh))
    assert extract_logs(logs, out, IEPF, resume=True).whole == 3


def test_resume_does_all_again_with_another_configuration(logs, tmp_path):
    out = tmp_path / "out"
    extract_logs(logs, out, IEPF)
    noisy = ln.Extractor("iepf", noise=ln.RangeNoise(sigma=0.02))
    for extractor, reading in ((noisy, {}), (IEPF, {"keep_going": True})):
        assert extract_logs(logs, out, extractor, resume=True, **reading).whole == 0
        assert extract_logs(logs, out, extractor, resume=True, **reading).whole == 3
    assert extract_logs(logs, out, IEPF, keep_going=True).whole == 0


def test_a_log_has_one_file_whatever_format_it_had_before(logs, tmp_path):
    out = tmp_path / "out"
    extract_logs(logs, out, IEPF)
    other = [path for path in logs if path.stem != "a"]
    (out / "log=b.npz" / "part-0.txt").write_text("a note of somebody's")
    extract_logs(other, out, IEPF, ending=".csv", resume=True)
    assert {path.name for path in (out / "log=a.npz").iterdir()} == {"part-0.parquet"}
    assert {path.name for path in (out / "log=b.npz").iterdir()} == {"part-0.csv", "part-0.txt"}


def test_logs_of_one_name_stay_apart_and_keep_their_names(tmp_path):
    days = [corner_log(tmp_path / day / "scan.npz", 3 + k) for k, day in enumerate(("mon", "tue"))]
    out = tmp_path / "out"
    extract_logs(days[:1], out, IEPF)
    extract_logs(days, out, IEPF, resume=True)
    rows = rows_of(out)
    assert {name: row["scans"] for name, row in rows.items()} == {"scan.npz": 3, "tue/scan.npz": 4}
    assert rows["tue/scan.npz"]["output"] == "log=tue%2Fscan.npz/part-0.parquet"
    assert set(table_of(out)["log"].to_pylist()) == {"scan.npz", "tue/scan.npz"}


def test_logs_in_folders_patterns_and_archives(tmp_path):
    logs = [corner_log(tmp_path / "logs" / "day" / f"{name}.npz") for name in "ab"]
    with zipfile.ZipFile(tmp_path / "logs" / "more.zip", "w") as archive:
        archive.write(logs[0], "x/c.npz")
        archive.write(logs[1], "x/d.npz")
    out = tmp_path / "out"
    assert extract_logs(tmp_path / "logs", out, IEPF).logs == 4
    assert list(rows_of(out)) == ["a.npz", "b.npz", "c.npz", "d.npz"]
    assert extract_logs(str(tmp_path / "logs" / "**" / "*.npz"), out, IEPF, resume=True).whole == 2
    assert extract_logs(tmp_path / "logs" / "more.zip", out, IEPF, resume=True).whole == 2


def test_an_interrupted_run_leaves_whole_files_and_reports_what_is_missing(logs, tmp_path):
    out = tmp_path / "out"

    def interrupt(about):
        if about.startswith("1/3"):
            raise KeyboardInterrupt

    with Threads(1) as one, pytest.raises(KeyboardInterrupt):
        extract_logs(logs, out, IEPF, executor=one, show=interrupt)
    assert halves(out) == []
    found = outcomes(out)
    assert len(found) == 3
    assert found["a.npz"] == "done"
    assert {name for name, outcome in found.items() if outcome == "done"} == {
        path.parent.name.removeprefix("log=") for path in out.rglob("*.parquet")
    }
    bulk = extract_logs(logs, out, IEPF, resume=True)
    assert bulk.whole == list(found.values()).count("done")
    assert set(outcomes(out).values()) == {"done"}


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"ehco": "last"}, "'ehco' is unknown, expected one of: topic"),
        ({"echo": "second"}, "echo is 'second', expected first or last or strongest"),
        ({"ring": -1}, "ring is -1, expected a whole number"),
        ({"ring": True}, "ring is True"),
        ({"pose_topic": ""}, "pose_topic is ''"),
    ],
)
def test_wrong_options_are_named(options, problem, logs, tmp_path):
    with pytest.raises(ValueError, match=problem):
        extract_logs(logs, tmp_path / "out", IEPF, **options)
    (tmp_path / "empty").mkdir()
    with pytest.raises(ln.LineamentError, match="holds no log"):
        extract_logs(tmp_path / "empty", tmp_path / "out", IEPF)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_named(logs, tmp_path):
    with pytest.raises(ln.LineamentError, match=r"a\.npz: cannot make this folder"):
        extract_logs(logs, logs[0], IEPF)
    (tmp_path / "out" / MANIFEST).mkdir(parents=True)
    with pytest.raises(ln.LineamentError, match="_manifest"):
        extract_logs(logs, tmp_path / "out", IEPF)


def test_a_part_that_cannot_be_written_stops_no_other(logs, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "log=b.npz").write_text("in the way")
    assert extract_logs(logs, tmp_path / "out", IEPF).failed == 1
    row = rows_of(tmp_path / "out")["b.npz"]
    assert "log=b.npz: cannot make this folder: File exists" in row["error"]


@pytest.mark.skipif(resource is None, reason="no limits of files on this system")
def test_a_full_disk_is_reported_and_leaves_no_half_file(logs, tmp_path):
    out = tmp_path / "out"
    many = corner_log(tmp_path / "many.npz", 3000)
    with files_up_to(60_000):
        extract_logs([logs[0], many], out, IEPF)
    assert outcomes(out) == {"a.npz": "done", "many.npz": "failed"}
    error = rows_of(out)["many.npz"]["error"]
    assert "part-0.parquet: cannot be written: " in error
    assert error.endswith("File too large")
    assert {path.name for path in out.rglob("*.*")} == {MANIFEST, "log=a.npz", "part-0.parquet"}
    other, problem = tmp_path / "other", r"_manifest\.jsonl: cannot be written: File too"
    with files_up_to(100), pytest.raises(ln.LineamentError, match=problem):
        extract_logs(logs, other, IEPF)
    assert list(other.iterdir()) == []


# Topics.


@pytest.mark.parametrize(("seconds", "rate"), [(0.0, 0), (0.5, 20)])
def test_rates_of_a_run(seconds, rate):
    extraction = Extraction(log="a", scans=10, seconds=seconds)
    for found in (extraction, Bulk("out", "rows", 1, 0, 0, 10, {}, seconds, [])):
        assert str(found).endswith(f"  {seconds:.2f} s, {rate} scans/s")


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


def test_one_topic_is_chosen(two_topics, tmp_path):
    found = extract_log(two_topics, tmp_path / "rear.parquet", IEPF, topic="/rear")
    assert (found.scans, found.topics) == (3, ["/rear"])
    table = pq.read_table(tmp_path / "rear.parquet")
    assert set(table["topic"].to_pylist()) == {"/rear"}
    assert max(table["scan"].to_pylist()) == 2
    extract_log(two_topics, tmp_path / "rear.jsonl", IEPF, topic="/rear")
    assert json.loads((tmp_path / "rear.jsonl").read_text().splitlines()[0])["topic"] == "/rear"
    with pytest.raises(ln.LogError, match="on '/up'; topics there are"):
        extract_log(two_topics, tmp_path / "up.parquet", IEPF, topic="/up")
    assert not (tmp_path / "up.parquet").exists()


def test_what_draws_the_scans_names_them_after_their_topic(two_topics, tmp_path):
    extract_log(two_topics, tmp_path / "out.mcap", IEPF, topic="/rear")
    with (tmp_path / "out.mcap").open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert topics == {"/rear", "/rear/features"}


def test_a_data_set_has_one_schema_whatever_topics_its_logs_have(two_topics, tmp_path):
    extract_logs([corner_log(tmp_path / "a.npz"), two_topics], tmp_path / "out", IEPF)
    rows = pq.read_table(tmp_path / "out").to_pylist()
    found = {(row["log"], row["topic"]) for row in rows}
    assert found == {("a.npz", "ranges"), ("two.mcap", "/front"), ("two.mcap", "/rear")}


# Manifest and progress.

PATHS = st.lists(st.lists(st.sampled_from("aAbé=%"), min_size=1, max_size=4), max_size=9)


@given(PATHS, PATHS)
def test_names_are_unique_whatever_the_paths_and_stay(first, second):
    names = names_of(["/" + "/".join(path) for path in first], {})
    later = names_of(["/" + "/".join(path) for path in second], names)
    together = names | later
    assert all(later.get(log, name) == name for log, name in names.items())
    parts = {part_path(name, ".csv").casefold() for name in together.values()}
    assert len(parts) == len(together)
    assert all(part.count("/") == 1 and part.startswith("log=") for part in parts)


def test_a_name_is_as_short_as_it_can_be():
    logs = ["/r1/mon/a.bag", "/r2/mon/a.bag", "/r1/tue/a.bag", "s3://store/b.bag", "/x/B.bag"]
    assert list(names_of(logs, {}).values()) == [
        *("r1/mon/a.bag", "r2/mon/a.bag", "tue/a.bag", "store/b.bag", "x/B.bag")
    ]
    assert names_of(["/A", "/a"], {}) == {"/A": "A~1", "/a": "a~2"}


def test_the_manifest_survives_what_is_no_row(tmp_path):
    first = Row(log="/a", name="a", outcome="done", scans=3)
    lines = [
        "[" * 100_000,
        "7",
        '{"log": 5, "name": "x", "outcome": "done", "output": ""}',
        '{"log": "/x"}',
        first.to_json().strip(),
        json.dumps({**json.loads(first.to_json()), "scans": 4, "of a later version": 1}),
        "\0\xff",
        Row(log="/b", name="b").to_json()[:40],
    ]
    (tmp_path / MANIFEST).write_bytes("\n".join(lines).encode("latin-1"))
    manifest = Manifest(tmp_path)
    assert {log: row.scans for log, row in manifest.rows.items()} == {"/a": 4}
    with manifest.recording() as record:
        record(Row(log="/b", name="b", outcome="done"))
        # On the disk at once, after all that was good before.
        assert outcomes(tmp_path) == {"a": "done", "b": "done"}
    assert len((tmp_path / MANIFEST).read_text().splitlines()) == 2


def test_the_state_of_what_is_at_an_address_is_known(tmp_path):
    fsspec = pytest.importorskip("fsspec")
    system = fsspec.filesystem("memory")
    try:
        log = corner_log(tmp_path / "a.npz")
        system.pipe("/bulk/a.npz", log.read_bytes())
        size, state = log_state("memory://bulk/a.npz")
        assert size == log.stat().st_size
        assert state
        assert log_state("memory://bulk/a.npz") == (size, state)
        assert log_state("memory://bulk/b.npz") == log_state("nonsense://a") == (None, "")
    finally:
        system.rm("/bulk", recursive=True)


def test_progress_has_a_throughput_and_the_time_left(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("lineament.tasks.bulk.run.time.monotonic", lambda: clock[0])
    sizes = {"a": (3000, "1"), "b": (1000, "1"), "c": (None, "")}
    monkeypatch.setattr("lineament.tasks.bulk.run.log_state", sizes.__getitem__)
    progress = _Progress(["a", "b", "c"])
    assert str(progress) == "0/3 logs, 0 scans/s"
    clock[0] += 10.0
    progress.report("a", 500, 1000)  # half of three of six parts
    assert str(progress) == "0/3 logs, 50 scans/s, 0:30 left"
    progress.finish(Row(log="a", name="a", outcome="done", scans=1000))
    assert str(progress) == "1/3 logs, 100 scans/s, 0:10 left"
    progress.finish(Row(log="b", name="b", outcome="failed"))
    progress.report("c", 1, 0)  # of a length that is not known
    assert str(progress) == "2/3 logs, 1 failed, 100 scans/s, 0:00 left"
    progress.finish(Row(log="c", name="c", outcome="done", scans=10))
    assert str(progress) == "3/3 logs, 1 failed, 101 scans/s, 0:00 left"
    assert [_duration(seconds) for seconds in (75.4, 3660)] == ["1:15", "1:01:00"]
