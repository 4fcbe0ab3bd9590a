"""Faults that damaged and hostile logs once brought to light, the smallest input of each."""

from __future__ import annotations

import gc
import gzip
import json
import math
import os
import struct
import tempfile
import zipfile
from contextlib import suppress

import numpy as np
import pytest
from text_logs import FLASER, csm_scan, zipped

from lineament import LaserScan, LogError
from lineament.logs import json_stream as objects
from lineament.logs import open_log, save_npz, summarize


@pytest.fixture
def write(tmp_path):
    def write(data, name="log"):
        (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
        return tmp_path / name

    return write


# Text: what is shown, and numbers without measure


def test_what_a_file_holds_does_not_break_lines_or_steer_terminals(write):
    with pytest.raises(LogError, match=r"range 1 of 3 is '\\x1b\[31m', expected a number$"):
        list(open_log(write(FLASER.replace(b"1.5", b"\x1b[31m"))))
    log = open_log(write("angle_min,angle_increment,frame_id,r0\n0,1,\x1b[1m\x85,1\n"))
    assert summarize(log).lines()[-1] == r"frames   \x1b[1m\x85"
    with pytest.raises(LogError, match=r"a\\nb: there is no such file"):
        open_log("a\nb")


@pytest.mark.parametrize(
    "text",
    [
        "angle_deg,range\n-1e308,1\n1e308,2\n1,2\n",
        "angle_min,angle_increment,r0,r1\n1e308,0.1,1,2\n",
        "angle_min,angle_increment,r0,r1\n0.5,1e-320,1,2\n",
        json.dumps(csm_scan(theta=[-1e308, 0, 1e308])),
        json.dumps(csm_scan(theta=None, min_theta=-1e308, max_theta=1e308)),
        '{"a": [[1, -1e308], [1, 1e308]]}',
    ],
)
def test_bearings_without_measure_are_refused(write, text):
    with pytest.raises(LogError, match=r"once around|too small|expected a finite bearing"):
        list(open_log(write(text)))


def test_ranges_and_stamps_without_measure_are_summarized(write):
    header = "stamp,x,y,theta,angle_min,angle_increment,r0,r1\n"
    rows = [f"{stamp},{stamp},0,0,0,0.1,1,1e307\n" for stamp in (-1.7e308, 1.7e308, 0, 1.7e308)]
    (topic,) = summarize(open_log(write(header + "".join(rows)))).topics
    assert topic.ranges == (1.0, 500.5, 1e307)
    assert topic.travelled == math.inf


def test_an_object_without_units(write):
    """What is left of two faults, of the first object and of the checksum behind it."""
    data = gzip.compress(b'{"a": [[1, 2],\n{}\n')[:-1] + b"?"
    with pytest.raises(LogError, match="is no RPLIDAR JSON"):
        open_log(write(data))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_beside_a_log_is_not_waited_for(write, tmp_path):
    os.mkfifo(tmp_path / "transforms.json")
    assert len(list(open_log(write('{"a": [[1, 2]]}', "a.json")))) == 1


def test_json_nested_deep_behind_a_beginning_that_is_right(write):
    with pytest.raises(LogError, match="nested too deep"):
        open_log(write('{"a": [[1, 2]], "b": ' + "[" * 10_000 + "]" * 10_000 + "}"))
    with pytest.raises(LogError, match="unit b: expected a list of pairs"):
        list(open_log(write('{"a": [[1, 2]], "b": ' + "[" * 100 + "]" * 100 + "}")))
    write("[" * 10_000, "transforms.json")
    (scan,) = open_log(write('{"a": [[1, 2]]}'))
    assert scan.pose is None


@pytest.mark.parametrize(
    ("broken", "most"),
    [
        ('{"a":[' + "1," * 500 + "\n", 10),
        ("{\n" * 1000, 2000),
        ('{"a":[1,\n' + '{"a":[]},\n' * 99, 500),
    ],
)
def test_json_that_is_broken_all_over_ends(write, monkeypatch, broken, most):
    """Each place is read up to its fault, and these nest: without an end it would take hours."""
    monkeypatch.setattr(objects, "SPARE", 1 << 20)
    good = json.dumps(csm_scan()) + "\n"
    log = open_log(write(good + broken * 300, "a.csm"), keep_going=True)
    assert len(list(log)) == 1
    assert 1 < log.skipped < most


def test_json_of_which_half_is_cut_off_is_read(write, monkeypatch):
    monkeypatch.setattr(objects, "SPARE", 0)
    good = json.dumps(csm_scan(readings=[1.0] * 300, valid=None, theta=None))
    text = "".join(f"{good}\n{good[: 9 * i]}\n" for i in range(1, 100))
    log = open_log(write(text, "a.csm"), keep_going=True)
    assert len(list(log)) > 90
    assert log.skipped > 90


# Archives


def test_a_member_that_is_no_array(write, tmp_path):
    save_npz(tmp_path / "a.npz", [LaserScan([1.0], 0.0, 0.1)])
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with pytest.raises(LogError, match=r"ranges has shape \(\), expected \(scans, beams\)"):
        open_log(write(zipped(**{**files, "ranges.npy": b"hello"})))


def test_letters_that_do_not_exist(tmp_path):
    arrays = {"ranges": np.ones((1, 2)), "angle_min": 0.0, "angle_increment": 0.1}
    frame = np.array([0x110000], ">u4").view(">U1")
    np.savez(tmp_path / "a.npz", **arrays, frame_id=frame)
    with pytest.raises(LogError, match="frame_id has letters that do not exist"):
        open_log(tmp_path / "a.npz")


def test_any_number_of_scans_in_no_space(tmp_path):
    arrays = {"angle_min": 0.0, "angle_increment": 0.1}
    np.savez(tmp_path / "a.npz", **arrays, ranges=np.zeros((10**18, 0)))
    with pytest.raises(LogError, match="ranges has no beams"):
        open_log(tmp_path / "a.npz")
    with pytest.raises(ValueError, match="scan 0 has no beams"):
        save_npz(tmp_path / "b.npz", [LaserScan([], 0.0, 0.1)])


@pytest.mark.parametrize("method", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2, zipfile.ZIP_DEFLATED])
def test_damage_in_each_way_of_packing(write, tmp_path, method):
    with zipfile.ZipFile(tmp_path / "a.zip", "w", method) as archive:
        archive.writestr("a.log", FLASER * 50)
    whole = (tmp_path / "a.zip").read_bytes()
    for at in range(30, whole.index(b"PK\1\2"), 3):
        path = write(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :], "b.zip")
        for source in (path, path / "a.log"):
            try:
                assert len(list(open_log(source))) == 50
            except LogError as error:
                assert str(error).startswith(str(path))  # noqa: PT017


def test_a_member_that_says_it_is_larger_than_the_archive(write):
    data = bytearray(zipped(**{"a.log": FLASER * 50_000}))
    struct.pack_into("<I", data, data.index(b"PK\1\2") + 20, 1 << 31)
    with pytest.raises(LogError, match="is no whole zip archive: it ends early"):
        open_log(write(bytes(data), "a.zip") / "a.log")


def test_archives_in_archives_are_not_looked_into(write):
    inner = zipped(**{"a.log": FLASER})
    for _ in range(3):
        inner = zipped(**{"inner.zip": inner})
        with pytest.raises(LogError, match="is no log that lineament knows"):
            open_log(write(inner, "a.zip"))


@pytest.mark.parametrize(
    "member",
    [
        FLASER + b"FLASER 9\n",
        b'{"a": [[1, 2]',
        gzip.compress(b'{"a": [[1, 2],' + b"[3, 4]," * 99 + b"[5, 6]]}")[:-9],
        gzip.compress(FLASER)[:-1],
        b"#ROSBAG V2.0\n",
    ],
)
def test_temporary_copies_do_not_wait_for_the_collector(write, tmp_path, monkeypatch, member):
    """An error that is kept and raised again refers to itself by its traceback."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    path = write(zipped(member=member), "a.zip")
    gc.disable()
    try:
        for keep_going in (False, True):
            with suppress(LogError):
                list(open_log(path / "member", keep_going=keep_going))
        assert list(folder.iterdir()) == []
    finally:
        gc.enable()
