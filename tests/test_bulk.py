"""Many logs into one data set: what is in it, what is told, and what is left as it is."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from bulk_logs import corner_log, halves, outcomes, rows_of, table_of

import lineament as ln
from lineament.tasks.bulk import MANIFEST, Threads, extract_logs
from lineament.tasks.extract import extract_log

IEPF = ln.Extractor("iepf")


@pytest.fixture
def logs(tmp_path):
    home = tmp_path / "logs"
    return [corner_log(home / f"{name}.npz", 3 + k) for k, name in enumerate("abc")]


def test_a_data_set_is_one_table_of_all_logs(logs, tmp_path):
    bulk = extract_logs(logs, tmp_path / "out", IEPF)
    assert (bulk.logs, bulk.whole, bulk.failed, bulk.scans) == (3, 0, 0, 12)
    table = table_of(tmp_path / "out")
    assert sorted(set(table["log"].to_pylist())) == ["a.npz", "b.npz", "c.npz"]
    for log in logs:
        extract_log(log, tmp_path / "alone.parquet", IEPF)
        alone = pq.read_table(tmp_path / "alone.parquet")
        part = pq.ParquetFile(tmp_path / "out" / f"log={log.name}" / "part-0.parquet").read()
        assert part.select(alone.column_names).equals(alone)


def test_the_manifest_tells_what_became_of_each_log(logs, tmp_path):
    logs[1].write_bytes(logs[1].read_bytes()[:200])
    shown = []
    bulk = extract_logs([*logs, "/none.bag"], tmp_path / "out", IEPF, show=shown.append)
    assert (bulk.failed, bulk.scans) == (2, 8)
    assert "2 done, 2 failed, 0 whole before" in str(bulk)
    rows = rows_of(tmp_path / "out")
    assert list(rows) == ["a.npz", "b.npz", "c.npz", "none.bag"]
    row = rows["c.npz"]
    assert row["log"] == str(logs[2])
    assert (row["outcome"], row["error"], row["scans"]) == ("done", "", 5)
    assert row["topics"] == ["ranges"]
    assert row["bytes"] == (tmp_path / "out" / row["output"]).stat().st_size
    assert row["log_bytes"] == logs[2].stat().st_size
    assert row["seconds"] > 0
    assert row["version"] == ln.__version__
    assert row["features"]["segments"] >= 5
    configuration = row["configuration"]
    assert (configuration["method"], configuration["noise"]) == ("iepf", None)
    assert configuration["reading"]["echo"] == "first"
    assert rows["b.npz"]["outcome"] == "failed"
    assert rows["b.npz"]["error"].startswith(f"{logs[1]}: ")
    assert rows["none.bag"]["error"] == "/none.bag: there is no such file, expected a log"
    assert not (tmp_path / "out" / "log=b.npz").exists()
    assert shown[-1].startswith("4/4 logs, 2 failed, ")


def test_neither_executor_nor_order_changes_the_table(logs, tmp_path):
    with Threads(1) as one, Threads(3) as three, ThreadPoolExecutor(2) as others:
        for name, executor in (("one", one), ("three", three), ("others", others)):
            order = logs if name == "one" else logs[::-1]
            extract_logs(order, tmp_path / name, IEPF, executor=executor)
    expected = table_of(tmp_path / "one")
    for name in ("three", "others"):
        assert table_of(tmp_path / name).equals(expected)
        assert list(rows_of(tmp_path / name)) == list(rows_of(tmp_path / "one"))


def change_time(log, _out):
    os.utime(log, ns=(1, 1))


def truncate_part(_log, out):
    part = out / "log=b.npz" / "part-0.parquet"
    part.write_bytes(part.read_bytes()[:-1])


def lose_part(_log, out):
    (out / "log=b.npz" / "part-0.parquet").unlink()


def grow(log, _out):
    corner_log(log, 9)


def of_an_older_version(_log, out):
    manifest = out / MANIFEST
    lines = manifest.read_text().splitlines(keepends=True)
    lines[1] = lines[1].replace(f'"version": "{ln.__version__}"', '"version": "0.0.1"')
    manifest.write_text("".join(lines))


def torn(_log, out):
    manifest = out / MANIFEST
    lines = manifest.read_text().splitlines(keepends=True)
    manifest.write_text(lines[0] + lines[2] + lines[1][:100])


def nothing(_log, _out):
    pass


@pytest.mark.parametrize(
    ("harm", "whole"),
    [
        (nothing, 3),
        (change_time, 2),
        (truncate_part, 2),
        (lose_part, 2),
        (grow, 2),
        (of_an_older_version, 2),
        (torn, 2),
    ],
)
def test_resume_leaves_what_is_whole_and_does_the_rest_again(harm, whole, logs, tmp_path):
    out = tmp_path / "out"
    extract_logs(logs, out, IEPF)
    harm(logs[1], out)
    kept = out / "log=a.npz" / "part-0.parquet"
    before = kept.stat()
    assert extract_logs(logs, out, IEPF, resume=True).whole == whole
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


def test_what_failed_is_tried_again(logs, tmp_path):
    whole = logs[1].read_bytes()
    logs[1].write_bytes(whole[:200])
    assert extract_logs(logs, tmp_path / "out", IEPF).failed == 1
    logs[1].write_bytes(whole)
    bulk = extract_logs(logs, tmp_path / "out", IEPF, resume=True)
    assert (bulk.whole, bulk.failed, bulk.scans) == (2, 0, 4)


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


def test_other_formats_than_parquet(logs, tmp_path):
    extract_logs(logs[:1], tmp_path / "out", IEPF, ending=".jsonl")
    part = tmp_path / "out" / "log=a.npz" / "part-0.jsonl"
    assert len(part.read_text().splitlines()) == 3
    with pytest.raises(ln.LineamentError, match=r"'\.xls' is not known"):
        extract_logs(logs, tmp_path / "none", IEPF, ending=".xls")
    assert not (tmp_path / "none").exists()


def test_an_interrupted_run_leaves_whole_files_and_tells_what_is_missing(logs, tmp_path):
    out = tmp_path / "out"

    def interrupt(about):
        if about.startswith("1/3"):
            raise KeyboardInterrupt

    with Threads(1) as one, pytest.raises(KeyboardInterrupt):
        extract_logs(logs, out, IEPF, executor=one, show=interrupt)
    assert halves(out) == []
    told = outcomes(out)
    assert len(told) == 3
    assert told["a.npz"] == "done"
    assert {name for name, outcome in told.items() if outcome == "done"} == {
        path.parent.name.removeprefix("log=") for path in out.rglob("*.parquet")
    }
    bulk = extract_logs(logs, out, IEPF, resume=True)
    assert bulk.whole == list(told.values()).count("done")
    assert set(outcomes(out).values()) == {"done"}


def test_half_files_of_a_killed_run_go_when_their_log_is_done(logs, tmp_path):
    left = tmp_path / "out" / "log=a.npz" / ".part-0.parquet.0badf00d.part"
    left.parent.mkdir(parents=True)
    left.write_bytes(b"PAR1")
    extract_logs(logs, tmp_path / "out", IEPF)
    assert halves(tmp_path / "out") == []


def test_wrong_options_are_named(logs, tmp_path):
    with pytest.raises(ValueError, match="'ehco' is unknown, expected one of: topic"):
        extract_logs(logs, tmp_path / "out", IEPF, ehco="last")
    with pytest.raises(ValueError, match="echo is 'all', expected first"):
        extract_logs(logs, tmp_path / "out", IEPF, echo="all")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ln.LineamentError, match="holds no log"):
        extract_logs(tmp_path / "empty", tmp_path / "out", IEPF)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_named(logs, tmp_path):
    with pytest.raises(ln.LineamentError, match=r"a\.npz: cannot make this folder"):
        extract_logs(logs, logs[0], IEPF)
    if Path("/proc/self").is_dir():
        with pytest.raises(ln.LineamentError, match="/proc/lineament: cannot make this folder"):
            extract_logs(logs, "/proc/lineament", IEPF)
    (tmp_path / "out" / MANIFEST).mkdir(parents=True)
    with pytest.raises(ln.LineamentError, match="_manifest"):
        extract_logs(logs, tmp_path / "out", IEPF)


def test_a_part_that_cannot_be_written_stops_no_other(logs, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "log=b.npz").write_text("in the way")
    assert extract_logs(logs, tmp_path / "out", IEPF).failed == 1
    row = rows_of(tmp_path / "out")["b.npz"]
    assert "log=b.npz: cannot make this folder: File exists" in row["error"]


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 64 KB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("a small disk can be mounted by root on Linux only")
    yield folder
    # Lazily: the file of a writer that failed may be open until its memory is collected.
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_full_disk_is_told_and_leaves_no_half_file(small_disk, tmp_path):
    few = corner_log(tmp_path / "few.npz", 2)
    many = corner_log(tmp_path / "many.npz", 3000)
    bulk = extract_logs([few, many], small_disk / "out", IEPF)
    assert bulk.failed == 1
    rows = rows_of(small_disk / "out")
    assert rows["few.npz"]["outcome"] == "done"
    assert rows["many.npz"]["error"].endswith("No space left on device")
    assert sorted(p.name for p in small_disk.rglob("*") if p.is_file()) == [
        MANIFEST,
        "part-0.parquet",
    ]
    assert pq.read_table(small_disk / "out" / "log=few.npz" / "part-0.parquet").num_rows > 0


def test_a_disk_without_room_for_the_manifest_is_one_clear_error(small_disk, logs):
    (small_disk / "all").write_bytes(b"0" * 65536)
    with pytest.raises(ln.LineamentError, match=r"_manifest\.jsonl: cannot be written: No space"):
        extract_logs(logs, small_disk, IEPF)
    assert [path.name for path in small_disk.iterdir()] == ["all"]


def test_the_package_imports_bulk_only_when_asked():
    code = "import sys, lineament; print('lineament.tasks.bulk' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
