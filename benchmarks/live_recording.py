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

from listening import Listener
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

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
    store = get_typestore(Stores.ROS2_HUMBLE)
    listener = Listener(DOMAIN, TOPICS)
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
            for topic, data in listener.hear():
                now = time.time_ns()
                file.add_message(channels[topic], now, data, now)
                counts[topic] += 1
                report = data if topic == "/diagnostics" else report
        file.finish()
    status = store.deserialize_cdr(report, TOPICS["/diagnostics"]).status[0]
    return counts, {value.key: value.value for value in status.values}


if __name__ == "__main__":
    main()
