"""Where logs are: folders, patterns, addresses, archives and what hostile ones must not do."""

import gzip
import io
import os
import struct
import subprocess
import sys
import threading
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from text_logs import BEAMS, FLASER, check_refused, zipped

from lineament import LaserScan, LogError
from lineament.logs import find_logs, open_log, save_npz, sources

pytestmark = pytest.mark.usefixtures("temporary")

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
    assert find_logs("./day2/b.log") == ["./day2/b.log"]


def test_what_is_named_is_taken(fleet):
    # Opening it reports what is wrong.
    for name in ("day1/readme.txt", "missing.log", "day3/none.zip", "day1/empty.log"):
        assert find_logs(fleet / name) == [str(fleet / name)]
    odd = fleet / "a[1].log"
    odd.write_bytes(FLASER)
    assert find_logs(odd) == [str(odd)]


def test_nothing_found(tmp_path, fleet):
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "*.nothing", fleet / "day1" / "readme*", tmp_path / "empty"):
        with pytest.raises(LogError, match="holds no log"):
            find_logs(path)
    several = r"is a directory, expected a log file: .*broken\.log\.gz, .*, …"
    check_refused(several, fleet)
    check_refused(r"is a directory, expected a log file$", tmp_path / "empty")


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


def test_addresses(memory):
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


def test_what_cannot_be_fetched(memory):
    check_refused(r"^memory://no/a\.log: there is no such file", "memory://no/a.log")
    check_refused(r"^nonsense://a\.log: cannot be fetched: ValueError: Prot", "nonsense://a.log")
    with pytest.raises(LogError, match="holds no log"):
        find_logs("memory://no/*.bag")
    memory.pipe("/a.log", FLASER)
    assert len(open_log("memory://a.log", limits={"copy": len(FLASER)})) == 1
    limits = {"copy": len(FLASER) - 1}
    check_refused("to be copied, more than the limit", "memory://a.log", limits=limits)


@pytest.mark.parametrize("hanging", ["listing", "opening", "reading"])
def test_a_server_that_trickles_is_given_up(hanging):
    """What it sends in a second is less than a megabyte; it would go on for ever."""
    fsspec = pytest.importorskip("fsspec")
    answer = threading.Event()

    class File(io.BytesIO):
        def read(self, _=-1):
            return self.getvalue()[:1] if hanging == "reading" and answer.wait() else b""

    class Trickle(fsspec.AbstractFileSystem):
        protocol, cachable = "trickle", False

        def isdir(self, _):
            return hanging == "listing" and answer.wait()

        def _open(self, *_, **__):
            if hanging == "opening":
                answer.wait()
            return File(FLASER)

    fsspec.register_implementation("trickle", Trickle, clobber=True)
    call = find_logs if hanging == "listing" else open_log
    line = (
        r"^trickle://a\.log: takes 2 s to answer, or to send a megabyte, more than the limit of 1"
    )
    with pytest.raises(LogError, match=line):
        call("trickle://a.log", limits={"fetch": 1})
    answer.set()


@pytest.mark.parametrize(
    ("error", "problem"),
    [
        (ModuleNotFoundError("No module", name="fsspec"), r"needs fsspec, .*'lineament\[remote\]'"),
        (ImportError("Install s3fs to access S3"), "needs a driver of fsspec: Install s3fs"),
        (PermissionError("a\nb"), "cannot be fetched: PermissionError: a b"),
    ],
)
def test_failures_on_the_way(error, problem):
    with pytest.raises(LogError, match=rf"^s3://a: {problem}"), sources._fsspec("s3://a"):
        raise error


# Archives


def npz_bytes(tmp_path):
    save_npz(tmp_path / "made.npz", [LaserScan([1.0, 2.0], 0.0, 0.1, stamp=7.5)])
    return (tmp_path / "made.npz").read_bytes()


@pytest.mark.parametrize("name", ["a.zip", "a.log", "a"])
def test_a_zip_of_one_log(write, temporary, name):
    hidden = {"__MACOSX/._b.log": FLASER, ".hidden.log": FLASER, "day/readme": b"hello"}
    path = write(zipped(**{"day/b.log": FLASER + b"FLASER 9\n"}, **hidden), name)
    log = open_log(path, keep_going=True)
    assert (log.format, log.name) == ("carmen", f"{path}/day/b.log")
    assert [scan.stamp for scan in log] == [scan.stamp for scan in log] == [7.5]
    assert log.faults[0].startswith(f"{path}/day/b.log:2: FLASER has 1")
    assert len(list(temporary.iterdir())) == 1


def test_a_zip_of_several_logs(write, tmp_path):
    files = {"b.csv": BEAMS, "day/a.log.gz": gzip.compress(FLASER), "c": b"?", "d": b""}
    path = write(zipped(**files), "logs.zip")
    both = [f"{path}/b.csv", f"{path}/day/a.log.gz"]
    check_refused(rf"holds several logs, expected a log file: {both[0]}, ", path)
    assert find_logs(path) == find_logs([tmp_path]) == both
    assert [open_log(log).format for log in both] == ["csv", "carmen"]
    check_refused(r"logs\.zip/d\.log: there is no such file in the archive", path / "d.log")


def test_npz_logs_in_gzip_and_zip(write, tmp_path):
    data = npz_bytes(tmp_path)
    packed = write(data, "a.npz.gz", gzip.compress)
    for path in (packed, write(zipped(**{"inside.npz": data}), "b.zip")):
        log = open_log(path)
        assert (log.format, next(iter(log)).stamp) == ("npz", 7.5)
    made = open_log(tmp_path / "made.npz")
    assert made.path == tmp_path / "made.npz"  # Itself, no copy.
    # Cut off, it still says so.
    packed.write_bytes(gzip.compress(data)[:-200])
    for keep_going, problem in ((True, "is no whole npz"), (False, "gzip data ends early")):
        check_refused(rf"a\.npz\.gz: {problem}", packed, keep_going=keep_going)


def test_nothing_is_written_where_an_archive_says(tmp_path, temporary):
    inner = tmp_path / "inner"
    inner.mkdir()
    path = inner / "evil.zip"
    outside = tmp_path / "absolute.log"
    names = ["../outside.log", str(outside), "a/../../outside.log", "ok.log"]
    path.write_bytes(zipped(**dict.fromkeys(names, FLASER)))
    assert find_logs(path) == [str(path)]
    # Even what is asked for by such a name comes to lie in our own folder.
    logs = [open_log(path), open_log(f"{path}/../outside.log")]
    assert [next(iter(log)).stamp for log in logs] == [7.5, 7.5]
    assert all(temporary in log.path.parents for log in logs)
    assert not list(tmp_path.rglob("*.log"))


@pytest.mark.slow
@pytest.mark.parametrize("method", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2, zipfile.ZIP_DEFLATED])
def test_damaged_archives(tmp_path, write, method):
    with zipfile.ZipFile(tmp_path / "whole.zip", "w", method) as archive:
        for name in ("a.log", "b.log"):
            archive.writestr(name, FLASER * 50)
    whole = (tmp_path / "whole.zip").read_bytes()
    rng = np.random.default_rng(3)
    damaged = [whole[:cut] for cut in range(4, len(whole), 7)]
    for at in rng.integers(4, len(whole), 80):
        damaged.append(whole[:at] + bytes([whole[at] ^ 1 << rng.integers(8)]) + whole[at + 1 :])
        damaged.append(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
    for data in damaged:
        path = write(data, "a.zip")
        for source in (path, f"{path}/a.log"):
            with suppress(LogError):
                assert len(list(open_log(source))) == 50
        find_logs(path)


def test_an_encrypted_archive(write):
    data = bytearray(zipped(**{"a.log": FLASER}))
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + offset] |= 1
    path = write(bytes(data), "a.zip")
    check_refused("is no log that lineament knows", path)
    check_refused(r"is no whole zip archive: .*encrypted", path / "a.log")


def test_a_member_that_says_it_is_larger_than_the_archive(write):
    data = bytearray(zipped(**{"a.log": FLASER * 50_000}))
    struct.pack_into("<I", data, data.index(b"PK\1\2") + 20, 1 << 31)
    check_refused("is no whole zip archive: it ends early", write(bytes(data), "a.zip") / "a.log")


def test_archives_in_archives_are_not_looked_into(write):
    inner = zipped(**{"a.log": FLASER})
    for _ in range(3):
        inner = zipped(**{"inner.zip": inner})
        check_refused("is no log that lineament knows", write(inner, "a.zip"))


def test_too_many_files(write):
    path = write(zipped(a=b"1", b=b"2", c=FLASER), "a.zip")
    assert len(open_log(path, limits={"members": 3})) == 1
    check_refused("has 3 files, more than the limit of 2", path, limits={"members": 2})
    with pytest.raises(ValueError, match="limit 'x' is unknown, expected one of beams"):
        find_logs(path, limits={"x": 2})


def test_a_full_disk(monkeypatch):
    class FullDisk(io.BytesIO):
        def write(self, _):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "open", lambda *_: FullDisk())
    with pytest.raises(LogError, match=r"a\.bag: cannot be copied to .*: No space left on device"):
        sources.LocalCopy("a.bag", iter([b"data"]))


def test_readers_in_several_threads(write):
    path = write(zipped(**{"a.log": FLASER * 20}), "a.zip")
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda _: len(list(open_log(path))), range(4))) == [20] * 4


def test_copies_go_when_the_program_ends(write, temporary):
    path = write(zipped(**{"a.log": FLASER}), "a.zip")
    code = f"from lineament.logs import open_log; log = open_log({str(path)!r})"
    environment = {**os.environ, "TMPDIR": str(temporary)}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
