"""What many logs cost, and gain by threads and processes. Run: python benchmarks/bulk.py."""

from __future__ import annotations

import argparse
import io
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import islice
from pathlib import Path

import numba
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from lineament_lab.reproduce.machine import machine
from recordings import DATA
from speed import arithmetic, in_turns

import lineament as ln
from lineament.logs import open_log
from lineament.simulation import SENSORS, building, drive
from lineament.tasks.bulk import Processes, Threads, extract_logs
from lineament.tasks.extract import extract_log

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import ros_bags

RECORDINGS = (
    "carmen/intel-corrected.log.gz",
    "graph/intel-lab.log.gz",
    "rosbag1/scans_demo.bag",
    "rosbag2/ld19",
    "mcap/scans_demo.mcap",
)

#: Peak memory of a worker process [MB], told by a process that waited for it.
PEAK = """
import resource, sys, lineament as ln
from lineament.tasks.bulk import Processes, extract_logs
if __name__ == "__main__":
    with Processes(1) as executor:
        extract_logs(sys.argv[1:-1], sys.argv[-1], ln.Extractor(), executor=executor)
    print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)
"""


def scans_of_a_drive(count: int) -> list[ln.LaserScan]:
    world, waypoints = building()
    return list(islice(drive(world, waypoints, SENSORS["utm30lx"], rate=40.0, seed=5), count))


def write(path: Path, scans: list[ln.LaserScan], repeat: int) -> Path:
    """Write a bag as ROS 2 records it by default."""
    messages = ros_bags.Messages(ros_bags.ros_of("mcap"))

    def items():
        for i in range(repeat * len(scans)):
            scan = scans[i % len(scans)]
            step = scan.angle_increment
            message = messages.scan(i / 40, scan.ranges, (), angle_increment=step)
            yield "/scan", i * 25_000_000, message

    return ros_bags.write(path.parent, "mcap", items(), path.stem)


def gain(logs: list[Path], folder: Path, scans: int, rounds: int) -> None:
    compiled = numba.njit(nogil=True)(arithmetic)
    compiled(1)
    with (
        ThreadPoolExecutor(2) as pool,
        Threads(1) as one,
        Threads(2) as threads,
        Processes(2) as processes,
    ):
        bulk = partial(extract_logs, logs, folder, ln.Extractor())
        calls = {
            "arithmetic, one": lambda: compiled(300_000_000),
            "arithmetic, two": lambda: list(pool.map(compiled, [150_000_000] * 2)),
            "one worker": lambda: bulk(executor=one),
            "two threads": lambda: bulk(executor=threads),
            "two processes": lambda: bulk(executor=processes),
        }
        in_turns(calls, 1)  # processes have started, kernels are compiled
        times = {name: statistics.median(t) for name, t in in_turns(calls, rounds).items()}
    here = times["arithmetic, one"] / times["arithmetic, two"]
    print(f"\nlogs over two workers, median of {rounds} rounds in turns")
    print(f"{'':<16}{'scans/s':>10}{'gain':>8}")
    for name in ("one worker", "two threads", "two processes"):
        print(f"{name:<16}{scans / times[name]:>10.0f}{times['one worker'] / times[name]:>8.2f}")
    print(f"{'pure arithmetic':<16}{'':>10}{here:>8.2f}   what the machine gives now")


def peak(logs: list[Path], folder: Path) -> int:
    script = folder / "peak.py"
    script.write_text(PEAK)
    arguments = [sys.executable, script, *logs, folder / "peaks"]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    return int(done.stdout)


def processor_seconds(call: Callable[[], object], repetitions: int = 3) -> float:
    times = []
    for _ in range(repetitions):
        started = time.process_time()
        call()
        times.append(time.process_time() - started)
    return min(times)


def cost(log: Path, method: str, folder: Path) -> dict[str, float]:
    """Microseconds of processor time and bytes of a scan, on one core."""
    scans = list(open_log(log))
    extractor, count = ln.Extractor(method), len(scans)
    table = folder / "features.parquet"
    extract_log(log, table, extractor)
    calls = {
        "reading": lambda: sum(1 for _ in open_log(log)),
        "features": lambda: [extractor(scan) for scan in scans],
        "all": lambda: extract_log(log, table, extractor),
    }
    costs = {name: 1e6 * processor_seconds(call) / count for name, call in calls.items()}
    files = list(log.iterdir()) if log.is_dir() else [log]
    costs["of the log"] = sum(path.stat().st_size for path in files) / count
    costs["Parquet"] = table.stat().st_size / count
    return costs


def show_costs(logs: dict[str, tuple[Path, str]], folder: Path) -> None:
    print("\na scan on one core")
    for k, (name, (log, method)) in enumerate(logs.items()):
        costs = cost(log, method, folder)
        if k == 0:
            print(f"{'':<40}{'µs':>6}{'µs':>10}{'µs':>8}{'B':>12}{'B':>10}")
            print(f"{'':<36}" + "".join(f"{title:>10}" for title in costs))
        beams = len(open_log(log).scan(0))
        print(
            f"{name:<28}{beams:>5} b  " + "".join(f"{value:>10.0f}" for value in costs.values()),
            flush=True,
        )


def show_sizes(table: Path, scans: int) -> None:
    """Bytes of a scan, were less written."""
    rows = pq.read_table(table)
    kinds = pa.array(["segment", "corner", "edge", "arc"])
    single = [
        field.with_type(pa.float32())
        if pa.types.is_floating(field.type) and field.name != "stamp"
        else field
        for field in rows.schema
    ]
    tables = {
        "as it is": rows,
        "without breakpoints and clusters": rows.filter(
            pc.is_in(rows["kind"].cast(pa.string()), kinds)
        ),
        "in single precision": rows.cast(pa.schema(single)),
    }
    print("\nbytes of a scan in Parquet, method optimal")
    for name, some in tables.items():
        size = io.BytesIO()
        pq.write_table(some, size, compression="zstd", use_dictionary=["kind", "breakpoint"])
        print(f"{name:<34}{size.tell() / scans:>6.0f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=2000, help="distinct scans")
    parser.add_argument("--logs", type=int, default=8)
    parser.add_argument("--rounds", type=int, default=7)
    given = parser.parse_args()
    ros_bags.CHUNK = 1 << 20
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scans = scans_of_a_drive(given.scans)
        logs = [write(folder / f"{k}.mcap", scans, 1) for k in range(given.logs)]
        long = write(folder / "long.mcap", scans, 4)
        recorded = {name: (DATA / name, "optimal") for name in RECORDINGS if DATA.is_dir()}
        simulated = {f"drive.mcap, {name}": (logs[0], name) for name in ("liu", "optimal")}
        show_costs(recorded | simulated, folder)
        show_sizes(folder / "features.parquet", given.scans)
        print("\npeak memory of a worker process")
        for of, some in (("a log", logs[:1]), ("one of four times", [long]), ("all logs", logs)):
            print(f"{of:<18}{peak(some, folder):>6} MB")
        gain(logs, folder / "out", given.logs * len(scans), given.rounds)


if __name__ == "__main__":
    main()
