"""Small logs of text, written by hand, that several test files share."""

import io
import json
import re
import tracemalloc
import zipfile
from contextlib import contextmanager

import pytest

from lineament import LogError
from lineament.logs import open_log

FLASER = b"FLASER 3 1.5 2.5 60 1 2 0.5 0 0 0 7.5 robot 0.1\n"
BEAMS = b"0.1,2\n0.2,3\n"


def flaser(ranges, name="FLASER", stamp=7.5, pose=(1, 2, 0.5)):
    words = [name, len(ranges), *ranges, *pose, 9, 9, 9, stamp, "robot", 0.1]
    return " ".join(map(str, words)) + "\n"


def robotlaser(
    ranges=(1, 2, 3), remissions=(), laser=(4, 5, 0.25), robot=(9, 9, 9), stamp=12.5,
    step=1.570796, largest="50.000000",
):  # fmt: skip
    header = ["ROBOTLASER1", 0, -1.570796, 3.141593, step, largest, 0.1, 0]
    lists = [len(ranges), *ranges, len(remissions), *remissions]
    words = [*header, *lists, *laser, *robot, 0, 0, 0, 0, 0, stamp, "robot", 0.1]
    return " ".join(map(str, words)) + "\n"


def csm_scan(stamp=7, **changes):
    return {
        "nrays": 3,
        "min_theta": -1.570796,
        "max_theta": 1.570796,
        "theta": [-1.570796, 0.0, 1.570796],
        "readings": [1.5, None, 2.5],
        "valid": [1, 0, 1],
        "odometry": [1, 2, 0.5],
        "estimate": [None, None, None],
        "timestamp": [stamp, 250000],
        **changes,
    }


def player_line(stamp, interface, message):
    return f"{stamp:014.3f} 16777343 6665 {interface} 00 001 {message} \n"


def player_scan(stamp, pairs, pose=""):
    beams = " ".join(f"{distance:.3f} {intensity:2d}" for distance, intensity in pairs)
    header = f"{'002' if pose else '001'} 0007 {pose} -01.5708 +01.5708 +0.00872665 +08.0000"
    return player_line(stamp, "laser", f"{header} {len(pairs):04d} {beams}")


def tinyslam_line(stamp, ranges=range(500, 1182)):
    return " ".join(map(str, [stamp, *range(24), *ranges])) + " \n"


def scan_texts():
    """One small log of each format, as text."""
    poses = [(i, 0, 0) for i in range(9)]
    units = {f"dev{k}": [[1.0 + k, 0.1 * i] for i in range(9)] for k in range(4)}
    header = "stamp,angle_min,angle_increment,r0,r1,r2\n"
    return {
        "carmen": "".join(flaser([1.5, 2.5, 60], stamp=i) for i in range(12)),
        "graph": "".join(
            f"VERTEX2 {i} {i} 2 0.5\n" + robotlaser(laser=pose, robot=pose, stamp=i)
            for i, pose in enumerate(poses)
        ),
        "player": "".join(player_scan(i, [(1.5, 0), (2.5, 1), (8, 0)]) for i in range(9)),
        "dpslam": "".join(f"Odometry {i}.25 2.0 0.5 \nLaser 3 1.5 2.5 8.191\n" for i in range(12)),
        "csm": "\n".join(json.dumps(csm_scan(stamp=i)) for i in range(9)),
        "rplidar": json.dumps(units, indent=1),
        "tinyslam": "".join(tinyslam_line(1000 + i) for i in range(3)),
        "csv": header + "".join(f"{i},-0.5,0.25,1.5,,{i}.125\n" for i in range(15)),
        "csv_beams": "".join(f"{0.01 * i:.2f},{2 + i / 64}\n" for i in range(40)),
    }


def zipped(**files):
    """Return a zip archive of these files."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return data.getvalue()


def check_refused(problem, *path_and_topic, **options):
    """Check that opening a log is an error."""
    with pytest.raises(LogError, match=problem):
        open_log(*path_and_topic, **options)


def check_fault(path, problem, good, skipped=1):
    """Return the scans around faults: the first is an error, all are skipped when asked for."""
    with pytest.raises(LogError, match=f"^{re.escape(str(path))}{problem}"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    for _ in range(2):
        scans = list(log)
        assert (len(scans), log.skipped, len(log.faults)) == (good, skipped, skipped)
    return scans


@contextmanager
def at_most(megabytes):
    """Memory that is allocated inside stays below a bound."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < megabytes << 20
    finally:
        tracemalloc.stop()
