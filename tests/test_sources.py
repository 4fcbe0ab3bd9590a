"""Where logs are: folders, patterns and addresses."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import pytest
from text_logs import BEAMS, FLASER, zipped

from lineament import LogError
from lineament.logs import find_logs, open_log
from lineament.logs import sources as copies
from lineament.logs import sources as remote

# Folders and patterns


@pytest.fixture
def fleet(tmp_path):
    folder = tmp_path / "fleet"
    files = {
        "day2/b.log": FLASER,
        "day2/a.csv": BEAMS,
        "day1/z.log.gz": gzip.compress(FLASER),
        "day1/readme.txt": b"hello",
        "day1/notes.csv": b"name,age\nx,7\n",
        "day1/settings.json": b'{"a": 1}',
        "day1/.hidden.log": FLASER,
        "day1/empty.g2o": b"",
        "day1/empty.log": b"",
        "day1/broken.log.gz": b"\x1f\x8bnonsense",
        "day3/logs.zip": zipped(**{"x.log": FLASER, "y.log": FLASER}),
        "day3/one.zip": zipped(**{"x.log": FLASER}),
        "day3/none.zip": zipped(x=b"1"),
    }
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def test_folders_and_patterns(fleet, monkeypatch):
    names = ["day1/broken.log.gz", "day1/empty.g2o", "day1/z.log.gz", "day2/a.csv", "day2/b.log"]
    names += ["day3/logs.zip/x.log", "day3/logs.zip/y.log", "day3/one.zip"]
    everything = [str(fleet / name) for name in names]
    assert find_logs(fleet) == everything
    assert find_logs([fleet / "day2", fleet]) == everything[3:5] + everything[:3] + everything[5:]
    assert find_logs(fleet / "day?") == everything
    assert find_logs(f"{fleet}/**/*.log*") == [everything[i] for i in (0, 2, 4)]
    monkeypatch.chdir(fleet)
    assert find_logs("day2/*") == [str(Path("day2/a.csv")), str(Path("day2/b.log"))]


def test_what_is_named_is_taken(fleet):
    # Opening it tells what is wrong.
    for name in ("day1/readme.txt", "missing.log", "day3/none.zip"):
        assert find_logs(fleet / name) == [str(fleet / name)]
    odd = fleet / "a[1].log"
    odd.write_bytes(FLASER)
    assert find_logs(odd) == [str(odd)]


def test_nothing_found(tmp_path, fleet):
    for path in (tmp_path / "*.nothing", fleet / "day1" / "readme*"):
        with pytest.raises(LogError, match="holds no log"):
            find_logs(path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match=r"empty: holds no log"):
        find_logs(tmp_path / "empty")
    with pytest.raises(
        LogError, match=r"is a directory, expected a log file: .*broken\.log\.gz, .*, …"
    ):
        open_log(fleet)
    with pytest.raises(LogError, match=r"is a directory, expected a log file$"):
        open_log(tmp_path / "empty")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_links_and_pipes_do_not_lead_round_in_circles(fleet):
    os.mkfifo(fleet / "day1" / "pipe")
    (fleet / "day1" / "up").symlink_to(fleet, target_is_directory=True)
    assert len(find_logs(fleet)) == 8


def test_every_recording_is_found(data_dir):
    found = {Path(path).relative_to(data_dir).as_posix() for path in find_logs(data_dir)}
    assert {"graph/killian.g2o.zip", "text/lidar01.csv", "rosbag2/ld19"} <= found
    others = ("README.md", ".relations", "transforms.json", "circle1.json", ".enc", ".yaml", ".db3")
    assert not [name for name in found if name.endswith(others)]


# Addresses


@pytest.fixture
def memory():
    fsspec = pytest.importorskip("fsspec")
    system = fsspec.filesystem("memory")
    system.store.clear()
    system.pseudo_dirs[:] = [""]
    yield system
    system.store.clear()


def test_addresses(memory, temporary):
    memory.pipe("/bucket/day/a.log.gz", gzip.compress(FLASER))
    memory.pipe("/bucket/day/b.csv", BEAMS)
    memory.pipe("/bucket/readme.md", b"hello")
    memory.pipe("/bucket/c.zip", zipped(**{"x.log": FLASER}))
    log = open_log("memory://bucket/day/a.log.gz")
    assert (log.name, log.format, len(log)) == ("memory://bucket/day/a.log.gz", "carmen", 1)
    assert next(iter(log)).stamp == 7.5
    assert open_log("memory://bucket/c.zip").name == "memory://bucket/c.zip/x.log"
    day = ["memory:///bucket/day/a.log.gz", "memory:///bucket/day/b.csv"]
    everything = find_logs("memory://bucket")
    assert everything == ["memory:///bucket/c.zip", *day]
    assert find_logs("memory://bucket/day/*") == day
    assert [open_log(address).format for address in everything] == ["carmen", "carmen", "csv"]
    assert find_logs("memory://bucket/readme.md") == ["memory://bucket/readme.md"]
    del log
    assert list(temporary.iterdir()) == []


def test_what_cannot_be_fetched(memory, monkeypatch):
    with pytest.raises(LogError, match=r"^memory://no/a\.log: there is no such file"):
        open_log("memory://no/a.log")
    with pytest.raises(LogError, match=r"^nonsense://a\.log: cannot be fetched: ValueError: Prot"):
        open_log("nonsense://a.log")
    with pytest.raises(LogError, match="holds no log"):
        find_logs("memory://no/*.bag")
    memory.pipe("/a.log", FLASER)
    monkeypatch.setattr(copies, "MAX_COPY", 10)
    with pytest.raises(LogError, match="is larger than"):
        open_log("memory://a.log")


@pytest.mark.parametrize(
    ("error", "problem"),
    [
        (ModuleNotFoundError("No module", name="fsspec"), r"needs fsspec, .*'lineament\[remote\]'"),
        (ImportError("Install s3fs to access S3"), "needs a driver of fsspec: Install s3fs"),
        (PermissionError("a\nb"), "cannot be fetched: PermissionError: a b"),
    ],
)
def test_failures_on_the_way(error, problem):
    with pytest.raises(LogError, match=rf"^s3://a: {problem}"), remote._fsspec("s3://a"):
        raise error
