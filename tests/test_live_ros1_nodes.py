"""Nodes of ROS 1 in processes of their own: how they end, and one as a whole."""

from __future__ import annotations

import math
import signal
import subprocess
from collections.abc import Iterator

import pytest
from ros1_driving import DEADLINE, SCAN, Peer, running, running_master, scan_of, until

#: A node in a process of its own: it waits for a listener, or to be ended, and then for its input.
NODE = """
import sys, time
from lineament.live.ros1 import Ros1Node, Ros1Publisher, Ros1Source
from lineament.output.scene import Message
node = Ros1Node("another")
source, publisher = Ros1Source(node, "/nothing"), Ros1Publisher(node)
publisher.advertise("/out", "std_msgs/String")
print("up", flush=True)
while not publisher.listeners("/out") and not source.ended:
    time.sleep(0.05)
print("ended" if source.ended else "heard", flush=True)
sys.stdin.readline()
for _ in range(20):
    publisher.publish(Message("/out", "std_msgs/String", b"\\0\\0\\x10\\0" + b"x" * 0x100000))
print(*source.problems(), flush=True)
source.close(), publisher.close(), node.close()
print("closed", flush=True)
"""


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with running_master(tmp_path_factory.mktemp("ros")):
        yield


@pytest.fixture
def peer(master: None) -> Iterator[Peer]:  # noqa: ARG001
    peer = Peer("scanner")
    yield peer
    peer.close()


@pytest.fixture
def other_node(master: None) -> Iterator[subprocess.Popen]:  # noqa: ARG001
    with running(NODE) as process:
        assert process.stdout.readline() == "up\n"
        yield process


def test_node_that_is_replaced_ends(other_node):
    replacing = Peer("another")
    replacing.advertise(topic="/replaced", kind=SCAN)
    output, _ = other_node.communicate(timeout=DEADLINE)
    assert output.endswith("ended\n\nclosed\n")
    assert other_node.returncode == 0
    replacing.close()


def test_node_ends_though_a_listener_stands_still(other_node, peer):
    peer.listen(topic="/out", kind="std_msgs/String")
    assert other_node.stdout.readline() == "heard\n"
    peer.process.send_signal(signal.SIGSTOP)
    output, _ = other_node.communicate(timeout=DEADLINE)
    assert output.endswith("closed\n")
    assert other_node.returncode == 0


#: The whole node, as it is configured.
LIVE = """
from lineament.live import LiveConfig, run_live
from lineament.live.stopping import stopping
config = LiveConfig(ros=1, topic="/whole/scan")
with stopping() as is_stopped:
    report = run_live(config, is_stopped, tell=lambda line: print(line, flush=True))
print("ended after", report.total_scans, flush=True)
"""


def test_whole_node_from_scan_to_features(peer):
    with running(LIVE) as live:
        below = {"features": "sensor_msgs/PointCloud2", "markers": "visualization_msgs/MarkerArray"}
        for name, kind in below.items():
            peer.listen(topic=f"/whole/scan/{name}", kind=kind)
        peer.listen(topic="/diagnostics", kind="diagnostic_msgs/DiagnosticArray")
        peer.advertise(topic="/whole/scan", kind=SCAN)
        wall = scan_of(ranges=[2 / math.cos(bearing) for bearing in (-0.5, 0.0, 0.5)])
        found: dict[str, dict] = {}

        def is_told() -> bool:
            # Scans are sent until listeners are connected, which nobody can wait for from outside.
            peer.publish(topic="/whole/scan", messages=[wall])
            for name in below:
                for message in peer.take(topic=f"/whole/scan/{name}"):
                    found[name] = message
            return len(found) == len(below)

        until(is_told)
        for message in (found["features"], found["markers"]["markers"][0]):
            assert message["header"]["stamp"] == [12, 345_678_901]
            assert message["header"]["frame_id"] == "laser"
        status = until(lambda: peer.take(topic="/diagnostics"))[0]["status"][0]
        assert status["name"] == "lineament: /whole/scan"
        live.send_signal(signal.SIGTERM)
        output, _ = live.communicate(timeout=DEADLINE)
    assert live.returncode == 0
    assert "ended after" in output
    assert "1 publisher of scans" in output
