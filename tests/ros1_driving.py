"""Drives ROS 1 for the tests: a master, and nodes in processes of their own."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

PEER = Path(__file__).with_name("ros1_peer.py")
#: Kernels may have to be compiled meanwhile [s].
DEADLINE = 180.0
SCAN, ECHOES = "sensor_msgs/LaserScan", "sensor_msgs/MultiEchoLaserScan"
GEOMETRY = {
    "angle_min": -0.5,
    "angle_max": 0.5,
    "angle_increment": 0.5,
    "time_increment": 0.25,
    "scan_time": 0.5,
    "range_min": 0.125,
    "range_max": 30.0,
}


def until(ask: Callable[[], object]) -> object:
    """Ask until the answer is true."""
    end = time.monotonic() + DEADLINE
    while time.monotonic() < end:
        if answer := ask():
            return answer
        time.sleep(0.02)
    raise AssertionError(f"{ask} was never true")


def is_open(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


class Peer:
    """A second process, a node of rospy alone."""

    def __init__(self, name: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, PEER, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def __getattr__(self, name: str) -> Callable:
        def ask(**arguments: object) -> object:
            print(json.dumps([name, arguments]), file=self.process.stdin, flush=True)
            return json.loads(self.process.stdout.readline())

        return ask

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


@contextmanager
def running(code: str) -> Iterator[subprocess.Popen]:
    """Run a program that is killed at the end, whatever happens."""
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def scan_of(stamp=(12, 345_678_901), ranges=(1.0, 2.5, 0.0), **others) -> dict:
    header = {"stamp": stamp, "frame_id": "laser"}
    return {"header": header, **GEOMETRY, "ranges": ranges, **others}


@contextmanager
def running_master(logs: Path) -> Iterator[None]:
    """Run a master that this process and its children find; skip where ROS 1 is missing."""
    pytest.importorskip("rospy", reason="ROS 1 is not installed: rospy cannot be imported")
    rosmaster = shutil.which("rosmaster") or pytest.skip("ROS 1 is not installed: no rosmaster")
    with pytest.MonkeyPatch.context() as patch:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        patch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
        patch.setenv("ROS_HOSTNAME", "127.0.0.1")
        patch.setenv("ROS_LOG_DIR", str(logs))
        process = subprocess.Popen([rosmaster, "--core", "-p", str(port)])
        try:
            until(lambda: is_open(port))
            yield
        finally:
            process.terminate()
            process.wait()
