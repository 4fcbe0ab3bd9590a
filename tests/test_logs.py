"""open_log: formats by content, clear errors, bounded work at import."""

from __future__ import annotations

import gzip
import os
import subprocess
import sys
import zipfile

import pytest

from lineament import LogError
from lineament.logs import lines, open_log

FLASER = b"FLASER 3 1.5 2.5 60 1 2 0.5 0 0 0 7.5 robot 0.1\n"


@pytest.mark.parametrize("name", ["a.log", "a.txt", "a.npz", "a"])
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_format_is_found_by_content(tmp_path, name, pack):
    path = tmp_path / name
    path.write_bytes(pack(b"# a comment\n" + FLASER))
    log = open_log(str(path))
    assert (log.format, len(log), log.topics, log.topic) == ("carmen", 1, ["FLASER"], None)
    assert log.path == path


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is empty"),
        (gzip.compress(b""), "is empty once decompressed"),
        (b"\x1f\x8b\x08", "gzip data ends early"),
        (b"\x1f\x8bnonsense that is no gzip", "gzip data is broken"),
        (b"hello\nworld\n", r"is no log that lineament knows: .*CARMEN \(FLASER, ROBOTLASER1\)"),
        (bytes(range(256)) * 300, "is no log that lineament knows"),
    ],
)
def test_what_is_no_log(tmp_path, content, problem):
    path = tmp_path / "thing.bin"
    path.write_bytes(content)
    with pytest.raises(LogError, match=problem) as caught:
        open_log(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_ending_helps_where_content_does_not(tmp_path):
    (tmp_path / "a.log").write_text("hello\n")
    with pytest.raises(LogError, match=r"is no log of CARMEN \(FLASER"):
        open_log(tmp_path / "a.log")
    (tmp_path / "a.npz").write_text("hello\n")
    with pytest.raises(LogError, match="is no whole npz archive"):
        open_log(tmp_path / "a.npz")


def test_missing_directory_and_odd_paths(tmp_path):
    with pytest.raises(LogError, match="there is no such file, expected a log"):
        open_log(tmp_path / "missing.log")
    with pytest.raises(LogError, match="is a directory, expected a log file"):
        open_log(tmp_path)
    with pytest.raises(LogError, match="is no path"):
        open_log("nul\0byte")
    with pytest.raises(LogError, match="is no path"):
        open_log(None)
    with pytest.raises(LogError, match="cannot be read"):
        open_log("x" * 5000)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_refused_and_does_not_block(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(LogError, match="is no regular file"):
        open_log(tmp_path / "pipe")


@pytest.mark.parametrize("error", [PermissionError(13, "denied"), OSError(5, "I/O error")])
def test_os_errors_do_not_escape(error):
    expected = r"^a\.log: (no permission|cannot be read: I/O error)"
    with pytest.raises(LogError, match=expected), lines.reading("a.log"):
        raise error


def test_a_log_that_vanishes(tmp_path):
    path = tmp_path / "a.log"
    path.write_bytes(FLASER)
    log = open_log(path)
    path.unlink()
    with pytest.raises(LogError, match="there is no such file"):
        list(log)


def test_a_zip_that_is_no_npz(tmp_path):
    for name, problem in (("a.zip", "no log that lineament knows"), ("a.npz", "expected the key")):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("readme.txt", "hello")
        with pytest.raises(LogError, match=problem):
            open_log(tmp_path / name)


def test_lines_keep_their_numbers_over_pieces_and_members(tmp_path, monkeypatch):
    monkeypatch.setattr(lines, "_PLAIN", 7)
    monkeypatch.setattr(lines, "_COMPRESSED", 5)
    expected = [(i + 1, b"line %d" % i + b"x" * (i % 13)) for i in range(60)]
    text = b"\n".join(line for _, line in expected)
    (tmp_path / "plain").write_bytes(b"\xef\xbb\xbf" + text)
    members = gzip.compress(text[:100]) + gzip.compress(text[100:]) + b"\0" * 40
    (tmp_path / "gz").write_bytes(members)
    assert list(lines.numbered_lines(tmp_path / "gz")) == expected
    monkeypatch.setattr(lines, "_COMPRESSED", 64)
    assert list(lines.numbered_lines(tmp_path / "plain")) == expected


def test_an_endless_line_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(lines, "MAX_LINE", 1 << 20)
    (tmp_path / "a").write_bytes(b"one\n" + b"x" * (1 << 22))
    with pytest.raises(LogError, match=r":2: line longer than 1 MiB"):
        list(lines.numbered_lines(tmp_path / "a"))


def test_import_is_light():
    code = (
        "import sys, lineament.logs; "
        "print([m for m in ('numba', 'pyarrow', 'matplotlib', 'lineament.logs.carmen', "
        "'lineament.logs.npz', 'lineament.logs.info') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
