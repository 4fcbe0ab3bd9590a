"""Logs in archives: what is copied, where to, and what hostile archives must not do."""

from __future__ import annotations

import gzip
import io
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from text_logs import BEAMS, FLASER, zipped

from lineament import LaserScan, LogError
from lineament.logs import find_logs, open_log, save_npz
from lineament.logs import sources as archives
from lineament.logs import sources as copies


def npz_bytes(tmp_path):
    save_npz(tmp_path / "made.npz", [LaserScan([1.0, 2.0], 0.0, 0.1, stamp=7.5)])
    return (tmp_path / "made.npz").read_bytes()


@pytest.mark.parametrize("name", ["a.zip", "a.log", "a"])
def test_a_zip_of_one_log(tmp_path, temporary, name):
    path = tmp_path / name
    hidden = {"__MACOSX/._b.log": FLASER, ".hidden.log": FLASER, "day/readme": b"hello"}
    path.write_bytes(zipped(**{"day/b.log": FLASER}, **hidden))
    log = open_log(path)
    assert (log.format, log.name) == ("carmen", f"{path}/day/b.log")
    assert [scan.stamp for scan in log] == [scan.stamp for scan in log] == [7.5]
    assert len(list(temporary.iterdir())) == 1
    del log
    assert list(temporary.iterdir()) == []


def test_a_zip_of_several_logs(tmp_path, temporary):
    path = tmp_path / "logs.zip"
    path.write_bytes(zipped(**{"b.csv": BEAMS, "day/a.log.gz": gzip.compress(FLASER), "c": b"?"}))
    both = [f"{path}/b.csv", f"{path}/day/a.log.gz"]
    with pytest.raises(LogError, match=rf"holds several logs, expected a log file: {both[0]}, "):
        open_log(path)
    assert find_logs(path) == find_logs([tmp_path]) == both
    assert [open_log(log).format for log in both] == ["csv", "carmen"]
    with pytest.raises(LogError, match=r"logs\.zip/d\.log: there is no such file in the archive"):
        open_log(path / "d.log")
    assert list(temporary.iterdir()) == []


def test_npz_logs_in_gzip_and_zip(tmp_path, temporary):
    data = npz_bytes(tmp_path)
    (tmp_path / "a.npz.gz").write_bytes(gzip.compress(data))
    (tmp_path / "b.zip").write_bytes(zipped(**{"inside.npz": data}))
    for name in ("a.npz.gz", "b.zip"):
        log = open_log(tmp_path / name)
        assert (log.format, next(iter(log)).stamp) == ("npz", 7.5)
    # Cut off, it still says so.
    (tmp_path / "a.npz.gz").write_bytes(gzip.compress(data)[:-200])
    for keep_going in (True, False):
        with pytest.raises(LogError, match=r"a\.npz\.gz: (is no whole npz|gzip data ends early)"):
            open_log(tmp_path / "a.npz.gz", keep_going=keep_going)
    del log
    assert list(temporary.iterdir()) == []


def test_errors_name_the_member(tmp_path):
    path = tmp_path / "a.zip"
    path.write_bytes(zipped(**{"b.log": FLASER + b"FLASER 9 0 0 0 0 0 0 0 0 0\n"}))
    with pytest.raises(LogError, match=r"a\.zip/b\.log:2: FLASER says 9"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    assert len(list(log)) == 1
    assert log.faults[0].startswith(f"{path}/b.log:2: ")


def test_nothing_is_written_where_an_archive_says(tmp_path, temporary):
    inner = tmp_path / "inner"
    inner.mkdir()
    path = inner / "evil.zip"
    names = ["../outside.log", "/tmp/lineament-outside.log", "a/../../outside.log", "ok.log"]
    path.write_bytes(zipped(**dict.fromkeys(names, FLASER)))
    assert find_logs(path) == [str(path)]
    # Even what is asked for by such a name comes to lie in our own folder.
    logs = [open_log(path), open_log(f"{path}/../outside.log")]
    assert [next(iter(log)).stamp for log in logs] == [7.5, 7.5]
    assert all(temporary in log.path.parents for log in logs)
    made = {p.name for p in tmp_path.rglob("*.log")}
    assert made == set()
    assert not Path("/tmp/lineament-outside.log").exists()


def test_damaged_archives(tmp_path, temporary):
    whole = zipped(**{"a.log": FLASER * 50, "b.log": FLASER * 50})
    path = tmp_path / "a.zip"
    rng = np.random.default_rng(3)
    damaged = [whole[:cut] for cut in range(4, len(whole), 3)]
    for _ in range(150):
        data = bytearray(whole)
        data[rng.integers(4, len(data))] ^= 1 << int(rng.integers(8))
        damaged.append(bytes(data))
    for data in damaged:
        path.write_bytes(data)
        for source in (path, f"{path}/a.log"):
            try:
                scans = list(open_log(source))
            except LogError as error:
                problem = str(error)
                assert problem.startswith(str(path))
                assert "\n" not in problem
            else:
                assert len(scans) == 50
        find_logs(path)
    assert list(temporary.iterdir()) == []


def test_an_encrypted_archive(tmp_path):
    data = bytearray(zipped(**{"a.log": FLASER}))
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + offset] |= 1
    (tmp_path / "a.zip").write_bytes(data)
    with pytest.raises(LogError, match="is no log that lineament knows"):
        open_log(tmp_path / "a.zip")
    with pytest.raises(LogError, match=r"is no whole zip archive: .*encrypted"):
        open_log(tmp_path / "a.zip" / "a.log")


@pytest.mark.parametrize("kind", ["zip", "npz.gz"])
def test_a_bomb_is_refused(tmp_path, temporary, monkeypatch, kind):
    monkeypatch.setattr(copies, "SMALL_COPY", 1 << 20)
    zeros = FLASER + bytes(1 << 24)
    if kind == "zip":
        data = zipped(**{"a.log": zeros})
    else:
        data = gzip.compress(npz_bytes(tmp_path) + zeros)
    path = tmp_path / f"bomb.{kind}"
    path.write_bytes(data)
    with pytest.raises(LogError, match="unpacks to more than 300 times its size"):
        open_log(path)
    assert list(temporary.iterdir()) == []
    monkeypatch.setattr(copies, "MAX_COPY", 1 << 10)
    with pytest.raises(LogError, match="is larger than 0 GiB unpacked"):
        open_log(path)
    assert list(temporary.iterdir()) == []


def test_too_many_files(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "MAX_MEMBERS", 2)
    (tmp_path / "a.zip").write_bytes(zipped(a=b"1", b=b"2", c=b"3"))
    with pytest.raises(LogError, match="holds 3 files, expected at most 2"):
        open_log(tmp_path / "a.zip")


def test_a_full_disk(temporary, monkeypatch):
    class FullDisk(io.BytesIO):
        def write(self, _):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "open", lambda *_: FullDisk())
    with pytest.raises(LogError, match=r"a\.bag: cannot be copied to .*: No space left on device"):
        copies.LocalCopy("a.bag", iter([b"data"]))
    assert list(temporary.iterdir()) == []


def test_readers_in_several_threads(tmp_path, temporary):
    (tmp_path / "a.zip").write_bytes(zipped(**{"a.log": FLASER * 20}))
    counts = []
    threads = [
        threading.Thread(target=lambda: counts.append(len(list(open_log(tmp_path / "a.zip")))))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert counts == [20] * 4
    assert list(temporary.iterdir()) == []


def test_copies_go_when_the_program_ends(tmp_path, temporary):
    (tmp_path / "a.zip").write_bytes(zipped(**{"a.log": FLASER}))
    code = f"from lineament.logs import open_log; log = open_log({str(tmp_path / 'a.zip')!r})"
    environment = {**os.environ, "TMPDIR": str(temporary)}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
    assert list(temporary.iterdir()) == []
