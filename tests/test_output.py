"""Writers: whole files or none, tables that read back the same, recordings of rerun, pages."""

import json
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import textwrap
from collections import namedtuple
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from approved import assert_approved
from test_tables import random_features
from test_writers_mcap import FOUND

from lineament import LaserScan, LineamentError, RangeNoise
from lineament.features.tables import SCHEMA, features_table
from lineament.files import written_beside
from lineament.output import ENDINGS, open_writer, page
from lineament.output.tables import WRITTEN
from lineament.output.writer import Writer

try:
    import resource
except ModuleNotFoundError:  # Windows
    resource = None

DOCS = Path(__file__).parents[1] / "docs" / "formats.md"
#: Forty beams at a pose, for formats that draw the scan.
SCAN = LaserScan([2.0] * 40, angle_min=-1.0, angle_increment=0.05, pose=(1.0, 2.0, 0.5))
TOPICS = ("/front", '/re"ar,\n')


#: The pose of SCAN, in the columns that a file has besides.
AT = {"pose_x": 1.0, "pose_y": 2.0, "pose_theta": 0.5}


def write(path, scans, topics=()):
    with open_writer(path) as writer:
        for i, found in enumerate(scans):
            writer.write(found, SCAN, topics[i % len(topics)] if topics else "")


# What all writers share.


class Kept(Writer):
    """Keeps what it is given to write; scans do not wait, as it does not say so."""

    def _open(self, _, files):
        self.chunks = []
        files.callback(self.chunks.append, "closed")

    def _write(self, found, first_scan):
        # Tables keep no ranges.
        self.chunks.append((first_scan, [(one.features, one.scan) for one in found]))


class InThrees(Kept):
    chunk = 3


@pytest.mark.parametrize(("kind", "size"), [(Kept, 1), (InThrees, 3)])
@pytest.mark.parametrize("n", [0, 2, 3, 4, 6])
def test_scans_are_written_in_chunks_and_numbered(tmp_path, kind, size, n):
    writer, scans = kind(tmp_path / "a"), [(i, None) for i in range(n)]
    for _ in range(2):  # It can be used again.
        with writer:
            for i in range(n):
                writer.write(i, SCAN)
                assert len(writer.chunks) == (i + 1) // size
        assert writer.chunks == [*((i, scans[i : i + size]) for i in range(0, n, size)), "closed"]
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@contextmanager
def files_up_to(size):
    """No file grows beyond so many bytes, as on a disk that is full."""
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.skipif(resource is None, reason="no limits of files on this system")
@pytest.mark.parametrize("ending", [ending for ending in ENDINGS if ending != ".rrd"])
def test_full_disk_leaves_one_line_and_nothing_else(tmp_path, ending):
    target = tmp_path / f"features{ending}"
    scans = [random_features(i) for i in range(150)]
    for size in (0, 300, 900):
        with (
            files_up_to(size),
            pytest.raises(LineamentError, match="cannot be written: ") as caught,
        ):
            write(target, scans)
        assert "\n" not in str(caught.value)
        assert list(target.parent.iterdir()) == []
    write(target, scans)
    assert target.stat().st_size > 900


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".parquet", ".mcap", ".rrd", ".dxf"])
def test_killed_process_leaves_nothing_under_the_name(tmp_path, ending):
    target = tmp_path / f"features{ending}"
    script = """
        import sys, time
        from test_output import SCAN
        from test_tables import random_features
        from lineament.output import open_writer
        features = random_features(1)
        with open_writer(sys.argv[1]) as writer:
            for _ in range(1010):
                writer.write(features, SCAN)
            print("in the middle", flush=True)
            time.sleep(60)
    """
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script), str(target)],
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parent,
    )
    with process:
        assert process.stdout.readline().strip() == b"in the middle"
        os.kill(process.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    assert not target.exists()
    assert all(p.name.startswith(".") and p.suffix == ".part" for p in target.parent.iterdir())
    write(target, [random_features(1)])
    assert target.exists()


def test_endings(tmp_path):
    for name, expected in (("A.ROS2.MCAP", "Ros2Writer"), ("A.Mcap", "FoxgloveWriter")):
        assert type(open_writer(tmp_path / name)).__name__ == expected
    for name, own in (("a.xlsx", ".xlsx"), ("a", "no ending"), ("a.parquet.gz", ".gz")):
        with pytest.raises(LineamentError, match=rf"{own}.* of \.parquet, \.csv, \.jsonl.*$"):
            open_writer(tmp_path / name)


def test_what_is_written_beside_has_the_mode_of_any_file(tmp_path):
    with written_beside(tmp_path / "a.txt") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.name.startswith(".a.txt.")
        temporary.write_text("new")
    (tmp_path / "plain.txt").touch()
    modes = {(tmp_path / name).stat().st_mode for name in ("a.txt", "plain.txt")}
    assert len(modes) == 1


# Tables.


@pytest.mark.parametrize("topics", [("",), ("", TOPICS[0]), TOPICS])
def test_parquet_reads_back_the_same(tmp_path, topics):
    path = tmp_path / "features.parquet"
    scans = [random_features(i, frame_id="laser" if i else "odd") for i in range(2010)]
    write(path, scans, topics)
    table = pq.read_table(path)
    assert table.schema.equals(WRITTEN, check_metadata=True)
    assert table.schema.field("cov_00").metadata == SCHEMA.field("cov_00").metadata
    assert table.select(SCHEMA.names).combine_chunks().equals(features_table(scans))
    known = [topics[k % len(topics)] or None for k in table["scan"].to_pylist()]
    assert table["topic"].to_pylist() == known
    # Memory does not grow: a thousand scans a group.
    file = pq.ParquetFile(path)
    groups = [set(np.unique(file.read_row_group(k)["scan"]) // 1000) for k in range(3)]
    assert groups == [{0}, {1}, {2}]
    assert file.num_row_groups == 3
    metadata = file.metadata.metadata
    assert json.loads(metadata[b"lineament.frame_ids"]) == ["odd", "laser"]
    assert metadata[b"lineament.scans"] == b"2010"
    assert file.metadata.row_group(0).column(4).compression == "ZSTD"


@pytest.mark.parametrize("ending", [".parquet", ".csv", ".jsonl"])
def test_poses_are_those_of_the_scans_where_they_are_known(tmp_path, ending):
    path, poses = tmp_path / f"a{ending}", [None, (1.0, -2.0, 0.5), None, (3.0, 4.0, -0.5)]
    with open_writer(path) as writer:
        for i, pose in enumerate(poses):
            writer.write(random_features(i), SCAN.with_pose(pose))
        writer.write(random_features(4))
    if ending == ".jsonl":
        found = [json.loads(line).get("pose") for line in path.read_text().splitlines()]
        assert found == [None if pose is None else [*pose] for pose in (*poses, None)]
        return
    table = pq.read_table(path) if ending == ".parquet" else pa.csv.read_csv(path)
    for row in table.to_pylist():
        pose = (*poses, None)[row["scan"]]
        assert tuple(row[name] for name in AT) == (pose or (None, None, None))
    assert table.num_rows == sum(random_features(i).to_arrow().num_rows for i in range(5))


@pytest.mark.parametrize("topics", [(), TOPICS])
def test_csv_reads_back_the_same(tmp_path, topics):
    scans = [random_features(i) for i in range(1010)]
    scans[7].segments["rms"] = [np.nan, np.inf, -np.inf]
    write(tmp_path / "a.csv", scans, topics)
    types = pa.csv.ConvertOptions(column_types=WRITTEN, strings_can_be_null=True, null_values=[""])
    lines = pa.csv.ParseOptions(newlines_in_values=True)
    found = pa.csv.read_csv(tmp_path / "a.csv", parse_options=lines, convert_options=types)
    assert found.schema.names == WRITTEN.names
    expected = [
        row | AT | {"topic": topics[row["scan"] % 2] if topics else None}
        for row in features_table(scans).to_pylist()
    ]
    assert list(map(str, found.to_pylist())) == list(map(str, expected))  # NaN is "nan"


@pytest.mark.parametrize("topics", [(), TOPICS])
def test_jsonl_reads_back_the_same(tmp_path, topics):
    path = tmp_path / "features.jsonl"
    noise = RangeNoise(0.1 + 0.2, 1 / 3)
    scans = [random_features(i, frame_id="Läser\n", noise=noise) for i in range(105)]
    write(path, scans, topics)
    data = path.read_bytes()
    assert data.endswith(b"\n")
    assert b"\r" not in data
    for i, (line, found) in enumerate(zip(data.splitlines(), scans, strict=True)):
        known = ({"topic": topics[i % 2]} if topics else {}) | {"pose": [1.0, 2.0, 0.5]}
        assert list(json.loads(line).items())[: 1 + len(known)] == [("scan", i), *known.items()]
        assert json.loads(line) == {"scan": i, **known, **found.to_dict()}


def test_jsonl_is_strict(tmp_path):
    found = random_features(1)
    found.corners["covariance"], found.segments["rms"] = np.inf, np.nan
    write(tmp_path / "a.jsonl", [found])
    record = json.loads((tmp_path / "a.jsonl").read_text(), parse_constant=pytest.fail)
    assert record["corners"][0]["covariance"] == [[None, None], [None, None]]
    assert record["segments"][0]["rms"] is None
    assert record["segments"][0]["start"] == found.segments["start"][0].tolist()


def test_docs_name_every_field_of_a_line():
    text = DOCS.read_text(encoding="utf-8").split("## JSON lines")[1].split("\n## ")[0]
    rows = {line.split("|")[1].strip(" `"): line for line in text.splitlines() if "| `" in line}
    record = random_features(1, noise=RangeNoise(0.01)).to_dict()
    assert set(rows) == {"scan", "topic", "pose", *record}
    for name in ("noise", "segments", "corners", "arcs", "breakpoints"):
        fields = record[name] if name == "noise" else record[name][0]
        for field in fields:
            assert f"`{field}`" in rows[name], (name, field)


# Recordings of rerun.


def rerun(*arguments):
    command = [str(Path(sys.executable).with_name("rerun")), "rrd", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_recording_is_whole_and_has_everything(tmp_path):
    pytest.importorskip("rerun")
    path = tmp_path / "a.rrd"
    with open_writer(path) as writer:
        for k in range(250):
            scan = LaserScan([2.0] * 6, 0.0, 0.1, stamp=0.5 * k, pose=(k, 4.0, 0.5))
            writer.write(FOUND, scan, "/a/scan")
    rerun("verify", path)
    stats, text = rerun("stats", path), rerun("print", "-vvv", path)
    assert "num_rows = 1 750" in stats.replace("\u2009", " ")
    assert "log_time" not in stats
    assert "PT124.5S" in text  # the last stamp
    lines = []
    for part in text.split("entity_path: ")[1:]:
        rows = re.findall(r"row_\w+ *┆ (249 .*)│ │", part)
        lines += [" ".join((part.split()[0], *row.split())) for row in rows]
    assert_approved("recording", sorted(lines))


@pytest.mark.parametrize("stamp", [1e12, -1e12])
def test_stamps_that_rerun_does_not_hold(tmp_path, stamp):
    pytest.importorskip("rerun")
    scan = LaserScan([2.0] * 6, 0.0, 0.1, stamp=stamp)
    problem = r"a\.rrd: scan 0 has the stamp .*e\+12 s, which rerun does not hold$"
    with (
        pytest.raises(LineamentError, match=problem),
        open_writer(tmp_path / "a.rrd") as writer,
    ):
        writer.write(FOUND, scan)
    assert not [*tmp_path.iterdir()]


def test_full_disk_is_reported_before_rerun_meets_it(tmp_path, monkeypatch):
    pytest.importorskip("rerun")
    path, scan = tmp_path / "a.rrd", LaserScan([2.0] * 6, 0.0, 0.1)
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(1 << 40, 0, 1 << 25))
    with open_writer(path) as writer:
        writer.write(FOUND, scan)  # 32 MB are enough
    path.unlink()
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(1 << 40, 0, (1 << 25) - 1))
    with pytest.raises(LineamentError, match=r"a\.rrd: cannot be written: less than 32") as caught:
        open_writer(path).__enter__()
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_recording_that_does_not_reach_the_disk_in_time_is_an_error(tmp_path, monkeypatch):
    rerun = pytest.importorskip("rerun")

    def flush(recording, *, timeout_sec):
        assert recording is not None
        raise RuntimeError(f"nothing for {timeout_sec:g} s")

    def write():
        with open_writer(tmp_path / "a.rrd") as writer:
            writer.write(FOUND, LaserScan([2.0] * 6, 0.0, 0.1))

    monkeypatch.setattr(rerun.RecordingStream, "flush", flush)
    with pytest.raises(LineamentError, match=r"a\.rrd: .*rerun says: nothing for 10 s"):
        write()
    assert not list(tmp_path.iterdir())


# Pages.


def test_pages_are_as_was_approved(tmp_path):
    """Of every part, with and without what may be left out; texts with letters that HTML has."""
    head = struct.pack(">8s8s2I", b"PNG", b"IHDR", 1001, 499)
    table = [
        [
            page.Cell("a" * 39 + "<"),
            page.Cell("3 (2–4) (5)", "number"),
            page.Cell("holds", "verdict"),
        ],
        [page.Cell("a" * 41), page.Cell("3", "number"), page.Cell("b" * 41, "verdict", "#p<")],
    ]
    plain = [
        page.list_part([("scans", "331"), ('<b> & "c"', "µ")]),
        page.heading_part("p<", "A <part>"),
        page.contents_part([("p<", "A <part>"), ("q", "Another")]),
        page.image_part('a "room" & <more>', head),
        page.image_part("either", head, "q<1>", head + b"dark"),
        *page.text_parts(["One <1>.", "Two."]),
    ]
    tables = [
        page.table_part("T <1>", ["a&b", "n", "v"], table, "A <note>"),
        page.table_part("U", ["long", "n", "v"], [table[0], table[1][::-1]]),
    ]
    lines = []
    for parts in (plain, [*plain, *tables]):
        page.write_parts(tmp_path / "a.html", "A < B", parts)
        before, style, after = re.split("</?style>", (tmp_path / "a.html").read_text("utf-8"))
        assert style.count("{") == style.count("}") > 10
        body, *script = after.split("<script>")
        assert len(script) == (parts is not plain)
        lines += (before + body).splitlines()
    assert_approved("page", lines)
