"""Writers: what is written reads back the same; whole files or none."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from test_tables import random_features

from lineament import LaserScan, LineamentError, RangeNoise
from lineament.features.tables import SCHEMA, features_table
from lineament.output import ENDINGS, open_writer, written_beside
from lineament.output.page import write_page

try:
    import resource
except ModuleNotFoundError:  # Windows
    resource = None

DOCS = Path(__file__).parents[1] / "docs" / "formats.md"


#: Forty beams at a pose, for formats that draw the scan.
SCAN = LaserScan([2.0] * 40, angle_min=-1.0, angle_increment=0.05, pose=(1.0, 2.0, 0.5))


@pytest.fixture(params=ENDINGS)
def target(request, tmp_path):
    return tmp_path / f"features{request.param}"


def write(path, scans):
    with open_writer(path) as writer:
        for features in scans:
            writer.write(features, SCAN)


def test_parquet_reads_back_the_same(tmp_path):
    path = tmp_path / "features.parquet"
    scans = [random_features(i, frame_id="laser" if i else "odd") for i in range(2010)]
    write(path, scans)
    table = pq.read_table(path)
    assert table.schema.equals(SCHEMA)
    assert table.schema.field("cov_00").metadata == SCHEMA.field("cov_00").metadata
    assert table.combine_chunks().equals(features_table(scans))
    file = pq.ParquetFile(path)
    assert file.num_row_groups == 3  # memory does not grow: a thousand scans a group
    metadata = file.metadata.metadata
    assert json.loads(metadata[b"lineament.frame_ids"]) == ["odd", "laser"]
    assert metadata[b"lineament.scans"] == b"2010"
    assert file.metadata.row_group(0).column(4).compression == "ZSTD"


def test_jsonl_reads_back_the_same(tmp_path):
    path = tmp_path / "features.jsonl"
    noise = RangeNoise(0.1 + 0.2, 1 / 3)
    scans = [random_features(i, frame_id="Läser\n", noise=noise) for i in range(1005)]
    write(path, scans)
    data = path.read_bytes()
    assert data.endswith(b"\n")
    assert b"\r" not in data
    lines = data.decode("utf-8").splitlines()
    assert len(lines) == len(scans)
    for i, (line, features) in enumerate(zip(lines, scans, strict=True)):
        assert json.loads(line) == {"scan": i, **features.to_dict()}


def test_jsonl_is_strict(tmp_path):
    path = tmp_path / "features.jsonl"
    features = random_features(1)
    features.corners["covariance"] = np.inf
    features.segments["rms"] = np.nan
    write(path, [features])

    def refuse(constant):
        raise AssertionError(constant)

    record = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    assert record["corners"][0]["covariance"] == [[None, None], [None, None]]
    assert record["segments"][0]["rms"] is None
    assert record["segments"][0]["start"] == features.segments["start"][0].tolist()


def test_docs_name_every_field_of_a_line():
    text = DOCS.read_text(encoding="utf-8").split("## JSON lines")[1].split("\n## ")[0]
    rows = {line.split("|")[1].strip(" `"): line for line in text.splitlines() if "| `" in line}
    record = random_features(1, noise=RangeNoise(0.01)).to_dict()
    assert set(rows) == {"scan", "topic", *record}
    for name in ("noise", "segments", "corners", "arcs", "breakpoints"):
        fields = record[name] if name == "noise" else record[name][0]
        for field in fields:
            assert f"`{field}`" in rows[name], (name, field)


def test_log_without_scans_or_features(target):
    nothing = random_features(0, n_beams=0, counts=(0, 0, 0, 0))
    write(target, [])
    if target.suffix == ".parquet":
        assert pq.read_table(target).schema.equals(SCHEMA)
        assert pq.read_table(target).num_rows == 0
    elif target.suffix == ".jsonl":
        assert target.read_bytes() == b""
    write(target, [nothing] * 2)
    if target.suffix == ".parquet":
        assert pq.read_metadata(target).metadata[b"lineament.scans"] == b"2"
    elif target.suffix == ".jsonl":
        assert len(target.read_text(encoding="utf-8").splitlines()) == 2


@pytest.mark.parametrize("ending", sorted(set(ENDINGS) - {".dxf", ".rrd"}))
def test_same_scans_give_same_bytes(tmp_path, ending):
    target = tmp_path / f"features{ending}"
    scans = [random_features(i) for i in range(20)]
    write(target, scans)
    first = target.read_bytes()
    write(target, scans)
    assert target.read_bytes() == first


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_exception_leaves_the_old_file(target, error):
    features = random_features(1)
    target.write_text("old")
    with pytest.raises(error), open_writer(target) as writer:  # noqa: PT012
        for _ in range(1010 if target.suffix in {".parquet", ".csv"} else 110):
            writer.write(features, SCAN)
        raise error
    assert target.read_text() == "old"
    assert list(target.parent.iterdir()) == [target]


def test_failure_while_the_rest_is_written_leaves_nothing(target, monkeypatch):
    features = random_features(1)
    writer = open_writer(target)

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writer, "_write", fail)
    with pytest.raises(LineamentError, match="cannot be written: No space left") as caught, writer:
        writer.write(features, SCAN)
    assert str(target) in str(caught.value)
    assert list(target.parent.iterdir()) == []


@pytest.mark.skipif(resource is None, reason="no limits of files on this system")
@pytest.mark.parametrize("ending", [ending for ending in ENDINGS if ending != ".rrd"])
def test_full_disk_leaves_one_line_and_nothing_else(tmp_path, ending):
    target = tmp_path / f"features{ending}"
    scans = [random_features(i) for i in range(150)]
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        for size in (0, 300, 900):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
            with pytest.raises(LineamentError, match="cannot be written: ") as caught:
                write(target, scans)
            assert "\n" not in str(caught.value)
            assert list(target.parent.iterdir()) == []
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    write(target, scans)
    assert target.stat().st_size > 900


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


@pytest.mark.parametrize("name", ["a.xlsx", "a", "a.parquet.gz"])
def test_unknown_ending_is_told(tmp_path, name):
    with pytest.raises(
        LineamentError, match=r"expected one of \.parquet, \.csv, \.jsonl"
    ) as caught:
        open_writer(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert Path(name).suffix in str(caught.value)


def test_writer_must_be_open(target):
    writer = open_writer(target)
    with pytest.raises(ValueError, match="not open"):
        writer.write(random_features(1), SCAN)
    write(target, [])
    with writer:
        pass
    with pytest.raises(ValueError, match="not open"):
        writer.write(random_features(1), SCAN)


def test_formats_that_draw_the_scan_say_so(target):
    is_table = target.suffix in {".parquet", ".csv", ".jsonl"}
    with open_writer(target) as writer:
        if is_table:
            writer.write(random_features(1))
        else:
            with pytest.raises(ValueError, match=r"needs the scan: write\(features, scan\)"):
                writer.write(random_features(1))


def test_topic_must_be_one_of_those_of_the_log(target):
    with (
        pytest.raises(ValueError, match="topic is '/c', expected one of /a, /b"),
        open_writer(target, ["/a", "/b"]) as writer,
    ):
        writer.write(random_features(1), SCAN, "/c")
    assert not target.exists()


def test_targets_that_cannot_be(target):
    with pytest.raises(LineamentError, match="does not exist") as caught:
        write(target.parent / "nowhere" / target.name, [])
    assert "nowhere" in str(caught.value)
    target.mkdir()
    with pytest.raises(LineamentError, match="is a folder"):
        write(target, [])
    if hasattr(os, "geteuid") and os.geteuid() == 0 and Path("/proc/self").exists():
        with pytest.raises(LineamentError, match=r"/proc/.*: cannot be written"):
            write(Path("/proc") / target.name, [])
    else:
        target.parent.chmod(0o500)
        try:
            with pytest.raises(LineamentError, match="cannot be written: Permission denied"):
                write(target.parent / ("b" + target.suffix), [])
        finally:
            target.parent.chmod(0o700)


def test_written_beside_follows_links_and_the_umask(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    link.symlink_to(real)
    with written_beside(link) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.name.startswith(".real.txt.")
        temporary.write_text("new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    plain = tmp_path / "plain.txt"
    plain.touch()
    assert real.stat().st_mode == plain.stat().st_mode


def test_import_is_light():
    code = (
        "import sys, lineament.output, lineament.output.figures, lineament.output.page\n"
        "heavy = {'matplotlib', 'pyarrow', 'numba', 'mcap', 'ezdxf', 'rerun'} & set(sys.modules)\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


class _Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.images, self.text = [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag == "img":
            self.images.append(dict(attributes))

    def handle_data(self, data):
        self.text.append(data)


def test_page_is_one_file_with_its_images(tmp_path):
    image = tmp_path / "a.png"
    image.write_bytes(b"\x89PNG\r\n\x1a\n rest")
    page = tmp_path / "index.html"
    facts = [("scans", "331"), ('<b> & "c"', "µ")]
    write_page(page, "A <demo>", facts, [('a "room" & <more>', image)], ["Note <1>."])
    text = page.read_text(encoding="utf-8")
    parsed = _Page()
    parsed.feed(text)
    assert parsed.images[0]["src"].startswith("data:image/png;base64,iVBOR")
    assert parsed.images[0]["alt"] == 'a "room" & <more>'
    assert {"A <demo>", '<b> & "c"', "Note <1>.", "µ"} <= set(parsed.text)
    assert not {"b", "demo", "link", "script"} & set(parsed.tags)
    assert "http" not in text
    assert "prefers-color-scheme: dark" in text


def test_page_without_its_image_is_not_written(tmp_path):
    page = tmp_path / "index.html"
    with pytest.raises(LineamentError, match=r"missing\.png: cannot be read"):
        write_page(page, "A", [], [("b", tmp_path / "missing.png")], [])
    (tmp_path / "b.png").write_text("text")
    with pytest.raises(LineamentError, match=r"b\.png: is no PNG"):
        write_page(page, "A", [], [("b", tmp_path / "b.png")], [])
    assert not page.exists()
