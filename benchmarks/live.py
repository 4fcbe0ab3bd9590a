"""What a live node keeps up with, over loopback. Run: python benchmarks/live.py.

Three processes: one that publishes scans of 1081 beams, the node (``lineament live``), and one that
listens to its topics. The first and the last know nothing of the node but what is on the wire.
Latency is from just before a scan is published until its features have come, by one clock.
"""

from __future__ import annotations

import argparse
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

DOMAIN = 77
BEAMS = 1081


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the run at 40 Hz")
    parser.add_argument("--step", type=float, default=10.0, help="of each rate that is tried")
    parser.add_argument("--minutes", type=float, default=10.0, help="of the run at 400 Hz")
    parser.add_argument("--role", choices=["publish", "listen"], help=argparse.SUPPRESS)
    parser.add_argument("--rate", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--count", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--topics", help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.role == "publish":
        publish(given.rate, given.count, given.out)
    elif given.role == "listen":
        listen(given.topics.split(","), given.out)
    else:
        measure(given.seconds, given.step, given.minutes)


def measure(seconds: float, step: float, minutes: float) -> None:
    from lineament_lab.reproduce.machine import machine

    print(f"{machine()}; scans of {BEAMS} beams, method optimal\n", flush=True)
    print(f"cold start, kernels cached, to first features: {cold_start():.2f} s\n", flush=True)
    print(
        "| rate | listening to | scans | features | dropped | lost | p50 | p99 | largest "
        "| CPU of node |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for rate, duration, topics in (
        (40, seconds, "features"),
        (40, seconds, "features,corners,markers"),
        *((rate, step, "features") for rate in (100, 200, 400, 800, 1200, 1600)),
        *((rate, step, "features,corners,markers") for rate in (200, 400)),
    ):
        print(row(run(rate, duration, topics), rate, topics), flush=True)
    if minutes:
        found = run(400, 60 * minutes, "features,corners,markers", samples=20)
        sizes = " ".join(f"{size:.0f}" for size in found["memory"])
        print(f"\n{minutes:g} minutes at 400 Hz: {row(found, 400, 'all')}\nmemory [MB]: {sizes}")


def row(found: dict[str, Any], rate: float, topics: str) -> str:
    p50, p99, worst = (f"{1e3 * value:.2f} ms" for value in found["latency"])
    return (
        f"| {rate} Hz | {topics} | {found['published']} | {found['features']} | {found['dropped']} "
        f"| {found['lost']} | {p50} | {p99} | {worst} | {100 * found['cpu']:.0f} % |"
    )


def start_node(log: Path, domain: int, *options: str) -> subprocess.Popen[str]:
    """Start a node whose output goes to a file."""
    command = [sys.executable, "-m", "lineament", "live", "--localhost", "--domain", str(domain)]
    with log.open("w") as out:
        return subprocess.Popen(
            [*command, *options], stdout=out, stderr=subprocess.STDOUT, text=True
        )


def start_role(role: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, __file__, "--role", role, *arguments], text=True)


def run(rate: float, seconds: float, topics: str, samples: int = 0) -> dict[str, Any]:
    """Publish at a rate for some time; what came of it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        node = start_node(folder / "node.log", DOMAIN)
        wait_for(folder / "node.log", "finds features")
        listener = start_role("listen", "--topics", topics, "--out", str(folder / "heard.npy"))
        count = int(rate * seconds)
        publisher = start_role(
            "publish", "--rate", str(rate), "--count", str(count), "--out", str(folder / "sent.npy")
        )
        wait_until((folder / "sent.npy.begun").exists)
        used, begun, memory = cpu_time(node.pid), time.monotonic(), [memory_of(node.pid)]
        while publisher.poll() is None:
            time.sleep(seconds / samples if samples else 0.1)
            memory.append(memory_of(node.pid))
        share = (cpu_time(node.pid) - used) / (time.monotonic() - begun)
        time.sleep(1.0)
        for process in (listener, node):
            process.send_signal(signal.SIGTERM)
            process.wait(30)
        sent, heard = np.load(folder / "sent.npy"), np.load(folder / "heard.npy")
        totals = (folder / "node.log").read_text().splitlines()[-1]

    def told(what: str) -> int:
        """What the node's last line says was dropped or lost."""
        return int(totals.partition(f" {what}")[0].split()[-1])

    index, arrived = heard[:, 0].astype(int), heard[:, 1]
    latencies = (arrived - sent[index]) * 1e-9
    return {
        "published": len(sent),
        "features": len(index),
        "dropped": told("dropped"),
        "lost": told("lost"),
        "latency": (*np.quantile(latencies, (0.5, 0.99)), latencies.max()),
        "cpu": share,
        "memory": memory,
    }


def cold_start() -> float:
    """Seconds from the start of the node's process until its first features have come."""
    times = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for i in range(4):
            heard = folder / f"heard{i}.npy"
            listener = start_role("listen", "--topics", "features", "--out", str(heard))
            sent = folder / f"sent{i}.npy"
            publisher = start_role("publish", "--rate", "40", "--count", "400", "--out", str(sent))
            wait_until((folder / f"sent{i}.npy.ready").exists)
            time.sleep(1.0)
            begun = time.monotonic_ns()
            node = start_node(folder / "node.log", DOMAIN)
            publisher.wait()
            for process in (listener, node):
                process.send_signal(signal.SIGTERM)
                process.wait(30)
            times.append((np.load(heard)[0, 1] - begun) * 1e-9)
    return float(np.median(times[1:]))  # the first one may compile


def wait_for(path: Path, text: str) -> None:
    wait_until(lambda: path.exists() and text in path.read_text())


def wait_until(is_so: Any, seconds: float = 120.0) -> None:
    deadline = time.monotonic() + seconds
    while not is_so():
        if time.monotonic() > deadline:
            raise SystemExit("nothing came: is the node running?")
        time.sleep(0.05)


def cpu_time(pid: int) -> float:
    """Seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_of(pid: int) -> float:
    """Resident memory of a process [MB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def publish(rate: float, count: int, out: Path) -> None:
    """Publish simulated scans, as soon as somebody listens; keep when each was sent."""
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.topic import Topic
    from listening import idl, take_part

    kind = idl("sensor_msgs/msg/LaserScan")
    scans = [bytearray(scan.serialize()) for scan in simulated(kind)]
    # They are serialised already: only the stamp changes.
    kind.serialize = lambda self, **_: self.data
    domain, entity = take_part(DOMAIN)
    qos = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
    writer = DataWriter(entity, Topic(entity, "rt/scan", kind), qos)
    out.with_name(out.name + ".ready").touch()
    wait_until(lambda: writer.get_publication_matched_status().current_count > 0)
    sent = np.zeros(count, np.int64)
    message = kind.__new__(kind)
    out.with_name(out.name + ".begun").touch()
    begun = time.monotonic()
    for i in range(count):
        pause = begun + i / rate - time.monotonic()
        if pause > 0:
            time.sleep(pause)
        scan = scans[i % len(scans)]
        scan[4:12] = np.array([i // 1000, 1_000_000 * (i % 1000)], "<u4").tobytes()
        message.data = bytes(scan)
        sent[i] = time.monotonic_ns()
        writer.write(message)
    time.sleep(0.5)
    np.save(out, sent)
    del domain


def simulated(kind: Any) -> list[Any]:
    """Scans along a drive through a building."""
    from listening import made

    from lineament.simulation import SENSORS, building, drive

    scans = []
    world, walk = building()
    for scan in drive(world, walk[:3], SENSORS["utm30lx"], speed=1.0, rate=40.0):
        message = {"angle_min": scan.angle_min, "angle_max": -scan.angle_min, "scan_time": 0.025}
        message |= {"angle_increment": scan.angle_increment, "range_min": 0.1, "range_max": 30.0}
        ranges = np.where(np.isfinite(scan.ranges), scan.ranges, np.inf).tolist()
        header = {"frame_id": "laser"}
        scans.append(made(kind, {**message, "header": header, "ranges": ranges}))
    assert len(scans[0].ranges) == BEAMS
    return scans


def listen(topics: list[str], out: Path) -> None:
    """Listen to topics of the node; keep when the features of each scan came."""
    from listening import Listener

    kinds = {"features": "PointCloud2", "corners": "PoseArray", "markers": "MarkerArray"}
    listener = Listener(DOMAIN, {f"/scan/{topic}": kinds[topic] for topic in topics})
    stopped: list[int] = []
    signal.signal(signal.SIGTERM, lambda *_: stopped.append(1))
    heard = []
    while not stopped:
        messages, now = listener.hear(), time.monotonic_ns()
        for topic, data in messages:
            if topic == f"/scan/{topics[0]}":
                seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
                heard.append((1000 * seconds + nanoseconds // 1_000_000, now))
    np.save(out, np.array(heard, np.int64).reshape(-1, 2))


if __name__ == "__main__":
    main()
