"""Logs of text that are cut off, damaged, endless or growing: bounded, and one clear line."""

from __future__ import annotations

import gzip
import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from text_logs import FLASER, scan_texts

from lineament import LogError
from lineament.logs import lines, open_log


@pytest.mark.parametrize("name", scan_texts())
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_cut_off_anywhere(tmp_path, name, pack):
    path = tmp_path / "cut.txt"
    data = pack(scan_texts()[name].encode())
    path.write_bytes(data)
    whole = [scan.ranges.tolist() for scan in open_log(path)]
    counts = []
    for cut in np.linspace(1, len(data) - 1, 100).astype(int):
        path.write_bytes(data[:cut])
        counts.append(len(read_what_is_there(path)))
        read_what_is_there(path, keep_going=False)
    assert max(counts) <= len(whole)
    if name not in ("rplidar", "csv_beams"):  # One object, and one scan, of all.
        assert counts[-1] >= len(whole) - 2
        assert all(b >= a for a, b in pairwise(counts))


@pytest.mark.parametrize("name", scan_texts())
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_flipped_bits(tmp_path, name, pack):
    path = tmp_path / "flipped.txt"
    whole = pack(scan_texts()[name].encode())
    rng = np.random.default_rng(5)
    for _ in range(60):
        data = bytearray(whole)
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        read_what_is_there(path)
        read_what_is_there(path, keep_going=False)


def read_what_is_there(path, keep_going=True):
    """Read a damaged log: every failure must be one line that names the file."""
    try:
        log = open_log(path, keep_going=keep_going)
        scans = list(log)
        n = len(log)
    except LogError as error:
        problem = str(error)
        assert problem.startswith(str(path)), problem
        assert "\n" not in problem
        return []
    assert n >= len(scans)
    return scans


def test_a_csv_of_one_endless_line(tmp_path):
    path = tmp_path / "long.csv"
    with path.open("wb") as file:
        file.truncate(1 << 30)  # A hole: a gigabyte that takes no space.
        file.write(b"0.1,")
    tracemalloc.start()
    try:
        with pytest.raises(LogError, match=":1: line longer than 16 MiB, expected text"):
            open_log(path)
        assert tracemalloc.get_traced_memory()[1] < 100 << 20
    finally:
        tracemalloc.stop()


def test_json_of_gigabytes_is_streamed(tmp_path):
    path = tmp_path / "long.json"
    with path.open("wb") as file:
        file.write(b'{"readings": [')
        file.truncate(1 << 30)
    tracemalloc.start()
    try:
        with pytest.raises(LogError, match="JSON"):
            open_log(path)
        assert tracemalloc.get_traced_memory()[1] < 100 << 20
    finally:
        tracemalloc.stop()


def test_a_log_that_grows_while_it_is_read(tmp_path):
    path = tmp_path / "growing.log"
    path.write_bytes(FLASER * 3)
    log = open_log(path)
    scans = []
    for scan in log:
        # Would never end if what is new were read too.
        with path.open("ab") as file:
            file.write(FLASER * 2)
        scans.append(scan)
    assert len(scans) == 3
    assert len(list(log)) == 9


def test_pieces_of_gzip_do_not_pile_up(tmp_path):
    path = tmp_path / "bomb.log.gz"
    path.write_bytes(gzip.compress(FLASER + (b" " * 4095 + b"\n") * (1 << 12)))
    tracemalloc.start()
    try:
        assert sum(len(piece) for piece in lines.chunks(path)) == len(FLASER) + (1 << 24)
        assert len(list(open_log(path))) == 1
        assert tracemalloc.get_traced_memory()[1] < 10 << 20
    finally:
        tracemalloc.stop()
