"""A live node on a log for some minutes, its markers recorded to MCAP by another process.

Run: python benchmarks/live_recording.py LOG -o markers.mcap [options of lineament live]

What is recorded is what comes over DDS, byte by byte: it opens in Foxglove and in RViz's player.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

DOMAIN = 78
TOPICS = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/scan/points": "sensor_msgs/msg/PointCloud2",
    "/scan/markers": "visualization_msgs/msg/MarkerArray",
    "/scan/corners": "geometry_msgs/msg/PoseArray",
    "/scan/features": "sensor_msgs/msg/PointCloud2",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--minutes", type=float, default=10.0)
    given, options = parser.parse_known_args()
    command = [sys.executable, "-m", "lineament", "live", "--from", given.log, "--loop"]
    command += ["--localhost", "--domain", str(DOMAIN), *options]
    node = subprocess.Popen(command, text=True, stdout=subprocess.PIPE)
    try:
        counts, report = record(given.output, 60 * given.minutes)
    finally:
        node.send_signal(signal.SIGINT)
        print(f"the node ended with {node.wait(30)}: {node.stdout.read().strip()}")
    print(json.dumps(counts, indent=1))
    print("the last report:", json.dumps(report, indent=1))


def record(output: Path, seconds: float) -> tuple[dict[str, int], dict[str, str]]:
    """Write what comes on the topics; how many on each, and the last diagnostics."""
    import dds_types
    from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration
    from dds_peer import CONFIGURATION

    store = get_typestore(Stores.ROS2_HUMBLE)
    domain = Domain(DOMAIN, CONFIGURATION.format(lease="10s"))
    participant = DomainParticipant(DOMAIN)
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000))
    waiting, readers = WaitSet(participant), {}
    for topic, kind in TOPICS.items():
        known = getattr(dds_types, kind.rpartition("/")[2])
        known.deserialize = classmethod(kept)
        readers[topic] = DataReader(participant, Topic(participant, f"rt{topic}", known), qos)
        state = ViewState.Any | SampleState.NotRead | InstanceState.Any
        waiting.attach(ReadCondition(readers[topic], state))
    counts, report = dict.fromkeys(TOPICS, 0), b""
    with output.open("wb") as stream:
        file = Writer(stream)
        file.start("ros2")
        channels = {}
        for topic, kind in TOPICS.items():
            text, _ = store.generate_msgdef(kind, ros_version=2)
            schema = file.register_schema(kind, "ros2msg", text.encode())
            channels[topic] = file.register_channel(topic, "cdr", schema)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            waiting.wait(duration(milliseconds=200))
            for topic, reader in readers.items():
                for sample in reader.take(100):
                    if hasattr(sample, "data"):
                        now = time.time_ns()
                        file.add_message(channels[topic], now, sample.data, now)
                        counts[topic] += 1
                        report = sample.data if topic == "/diagnostics" else report
        file.finish()
    del domain
    status = store.deserialize_cdr(report, TOPICS["/diagnostics"]).status[0]
    return counts, {value.key: value.value for value in status.values}


def kept(kind: Any, data: bytes, **_: Any) -> Any:
    """Keep a message as it came."""
    message = kind.__new__(kind)
    message.data = data
    return message


if __name__ == "__main__":
    main()
