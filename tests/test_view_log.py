"""How `view` keeps a log: every scan at once, whatever breaks; and the command itself."""

from __future__ import annotations

import http.client
import json
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing

import numpy as np
import pytest
from view_scans import walls

from lineament import Extractor, LaserScan
from lineament.cli import run
from lineament.logs import save_npz
from lineament.view import Session
from lineament.view.store import ScanStore


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "wall.npz"
    save_npz(path, walls(9))
    return path


def assert_scans_equal(scan, other):
    for name in ("ranges", "angles"):
        np.testing.assert_array_equal(getattr(scan, name), getattr(other, name))
    fields = "is_regular angle_min angle_increment range_min range_max stamp scan_time"
    for name in (*fields.split(), "time_increment", "frame_id", "pose"):
        assert getattr(scan, name) == getattr(other, name), name


def flaser(count, stamp):
    return f"FLASER {count} {' '.join(['2.0'] * 181)} 0 0 0 0 0 0 {stamp} robot {stamp}\n"


def test_a_log_that_breaks_off_is_shown_as_far_as_it_goes(tmp_path):
    path = tmp_path / "broken.log"
    path.write_text(flaser(181, 1) + flaser(181, 2) + flaser(190, 3) + flaser(181, 4))
    with Session(path, {"pdbs": Extractor("pdbs")}) as session:
        assert session.wait(30)
        facts = session.facts()
        assert facts["scans"] == 2
        assert "broken.log:3: " in facts["error"]
        assert session.scan(1, "pdbs")["stamp"] == 2
    with Session(path, {"pdbs": Extractor("pdbs")}, keep_going=True) as session:
        assert session.wait(30)
        facts = session.facts()
        assert (facts["scans"], facts["error"], facts["skipped"]) == (3, "", 1)
        assert session.scan(2, "pdbs")["stamp"] == 4


def any_scans():
    yield from walls(3)
    bearings = np.array([0.0, 0.1, 0.3])
    yield LaserScan([1.0, np.nan, 1 / 3], angles=bearings, range_min=0.1, pose=(1.0, 2.0, 0.1))
    yield LaserScan([], 0.0, 0.1, scan_time=0.1, time_increment=1e-5, stamp=1e9 + 1e-6)
    yield LaserScan([5.0], 0.0, 0.0, frame_id="läser", range_max=np.inf)
    yield LaserScan([1e300, -np.inf], angles=[0.0, 1e-9])


@pytest.mark.parametrize("capacity", [0, 2000, 1 << 20])
def test_a_store_gives_every_scan_whatever_room_there_is(capacity):
    scans = list(any_scans())
    items = [(f"scan{k}", scan) for k, scan in enumerate(scans)]
    with ScanStore(lambda: items, capacity=capacity) as kept:
        kept.fill(items)
        assert len(kept) == len(scans)
        for index in (0, 5, 2, 2, 3, 1, 0, 6, 4):
            topic, scan = kept.item(index)
            assert topic == f"scan{index}"
            assert_scans_equal(scan, scans[index])
        assert (len(kept._starts), -1 in kept._starts) == (len(scans), capacity < 1 << 20)
        assert kept._end <= capacity
        for index in (-1, len(scans)):
            with pytest.raises(IndexError):
                kept.item(index)
        assert kept.stamps(2, 99) == [scan.stamp for scan in scans[2:]]


def test_a_full_disk_is_less_room_and_no_failure(monkeypatch):
    items = [("scan", scan) for scan in walls(4)]
    with ScanStore(lambda: items) as kept:
        kept.fill(items[:2])

        class Full:
            def __init__(self, file):
                self.file = file

            def __getattr__(self, name):
                return getattr(self.file, name)

            def write(self, _):
                raise OSError(28, "No space left on device")

        monkeypatch.setattr(kept, "_file", Full(kept._file))
        kept.fill(items[2:])
        for index, (_, scan) in enumerate(items):
            assert_scans_equal(kept.item(index)[1], scan)


def test_a_closed_store_ends_its_reading():
    kept = ScanStore(lambda: ())

    def endless():
        while True:
            yield "scan", next(walls(1))

    reader = threading.Thread(target=kept.fill, args=(endless(),))
    reader.start()
    while len(kept) < 3:
        time.sleep(0.001)
    kept.close()
    reader.join(30)
    assert not reader.is_alive()


# The command.


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["{log}x", "--no-browser"], 1, "there is no such"),
        (["{log}", "-m", "lui"], 2, "method 'lui' is unknown"),
        (["{log}", "--set", "a=1"], 2, "'a'"),
        (["{log}", "--port", "70000"], 2, "70000"),
        (["{log}", "-m", "pdbs", "--no-browser", "--host", "256.1.1.1"], 1, "cannot listen there"),
        (["{log}", "-m", "pdbs", "--topic", "scan"], 1, "has no topic 'scan'"),
    ],
)
def test_what_is_wrong_is_one_line(log, arguments, status, words, capfd):
    assert run(["view", *(text.format(log=log) for text in arguments)]) == status
    out, err = capfd.readouterr()
    assert out == ""
    assert words in err
    assert err.count("\n") == 1


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a child there")
@pytest.mark.slow
def test_the_command_writes_its_address_and_ends_quietly(log):
    command = [sys.executable, "-m", "lineament", "view", str(log), "-m", "pdbs", "--no-browser"]
    with subprocess.Popen(
        [*command, "--host", "0.0.0.0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        line = process.stdout.readline()
        port = int(line.split("http://localhost:")[1].split("/")[0])
        with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
            connection.request("GET", "/api/log")
            assert json.loads(connection.getresponse().read())["name"] == "wall.npz"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert out == ""
    lines = [line for line in err.splitlines() if line]
    assert lines[0].startswith("lineament: 0.0.0.0 is not loopback")
    assert lines[1:] == ["lineament: stopped"]
