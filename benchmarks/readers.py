"""Scans per second that the readers of logs reach, and how others read the same bags.

Run: python benchmarks/readers.py [--recordings FOLDER]
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from lineament_lab.reproduce.machine import machine
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from lineament import LogError
from lineament.logs import open_log
from lineament.rosmsg.scans import laser_scan

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import ros_bags

KINDS = ("mcap", "mcap-lz4", "mcap-zstd", "mcap-plain", "sqlite3", "rosbag1", "rosbag1-lz4")
#: Share of a recording that is left of it where it is cut off.
CUT = 0.7


def write(folder: Path, kind: str, scans: int, beams: int, intensities: bool) -> Path:
    """Write a bag of scans that differ, with the usual size of chunks."""
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    rng = np.random.default_rng(1)
    step = 1.5 * np.pi / beams
    ranges = np.round(rng.uniform(0.5, 30.0, beams), 3)

    def items():
        for i in range(scans):
            distances = ranges + 0.001 * (i % 50)
            strengths = 100 * ranges if intensities else ()
            scan = messages.scan(i / 40, distances, strengths, angle_increment=step)
            yield "/scan", i * 25_000_000, scan

    return ros_bags.write(folder, kind, items(), kind)


# Others, with our decoder: what differs is how they find the messages.


def by_rosbags(path: Path) -> Iterator[object]:
    with AnyReader([path], default_typestore=ros_bags.store(2)) as reader:
        wanted = [c for c in reader.connections if c.msgtype == "sensor_msgs/msg/LaserScan"]
        encoding = "cdr" if path.suffix != ".bag" else "ros1"
        for _, _, data in reader.messages(connections=wanted):
            yield laser_scan(data, encoding)


def by_mcap(path: Path) -> Iterator[object]:
    with path.open("rb") as file:
        channels = {}
        for record in StreamReader(file, validate_crcs=True).records:
            name = type(record).__name__
            if name == "Channel":
                channels[record.id] = record.message_encoding
            elif name == "Message":
                yield laser_scan(record.data, channels[record.channel_id])


def rates(readers: list[Callable[[Path], object]], path: Path, repetitions: int) -> list[float]:
    """Scans per second of processor time of each reader, the fastest of several, in turn."""
    best = [0.0] * len(readers)
    for _ in range(repetitions):
        for k, reader in enumerate(readers):
            started = time.process_time()
            count = sum(1 for _ in reader(path))
            best[k] = max(best[k], count / (time.process_time() - started))
    return best


def outcome(reader: Callable[[Path], object], path: Path) -> str:
    """How many scans come out of a bag, and how it ends."""
    count = 0
    try:
        for _ in reader(path):
            count += 1
    except LogError as error:
        return f"{count} scans, then: {error.problem}"
    except Exception as error:
        return f"{count} scans, then {type(error).__name__}: {error}".partition("\n")[0]
    return f"{count} scans"


def compare(folder: Path, repetitions: int) -> None:
    """Read the recordings whole and cut off, by lineament and by rosbags."""
    bags = sorted(
        path
        for name in ("rosbag1", "rosbag2", "mcap")
        for path in (folder / name).rglob("*")
        if path.suffix in (".bag", ".db3", ".mcap")
    )
    for path in bags:
        print(f"\n{path.relative_to(folder)}")
        print(f"  lineament: {outcome(open_log, path)}\n  rosbags:   {outcome(by_rosbags, path)}")
        try:
            ours, theirs = rates([open_log, by_rosbags], path, repetitions)
            print(f"  scans/s:   {ours:.0f}, rosbags {theirs:.0f}, ratio {ours / theirs:.2f}")
        except Exception:
            print("  scans/s:   one of them does not read it")
        with tempfile.TemporaryDirectory() as scratch:
            cut = Path(scratch) / path.name
            cut.write_bytes(path.read_bytes()[: int(CUT * path.stat().st_size)])
            print(f"  cut, lineament: {outcome(open_log, cut)}")
            print(f"  cut, rosbags:   {outcome(by_rosbags, cut)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=10_000)
    parser.add_argument("--beams", type=int, default=1081)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--recordings", type=Path, help="also compare on the bags in this folder")
    given = parser.parse_args()
    ros_bags.CHUNK = 1 << 20
    print(f"{machine()}; {given.scans} scans of {given.beams} beams, fastest of")
    print(f"{given.repetitions} readings by `for scan in open_log(path)`; processor time, one core")
    print(f"\n{'scans/s':<12}{'ranges':>10}{'+ intensities':>16}{'library':>10}")
    for kind in KINDS:
        row = []
        # The library of the container: mcap, or rosbags.
        peer = by_mcap if kind.startswith("mcap") else by_rosbags
        for intensities in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                path = write(Path(folder), kind, given.scans, given.beams, intensities)
                row.append(rates([open_log, peer], path, given.repetitions))
        (ours, theirs), (both, _) = row
        print(f"{kind:<12}{ours:>10.0f}{both:>16.0f}{theirs:>10.0f}", flush=True)
    if given.recordings:
        compare(given.recordings, given.repetitions)


if __name__ == "__main__":
    main()
