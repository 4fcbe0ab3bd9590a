"""A day of the node, 24 h at 40 Hz, as fast as no scan is lost: python benchmarks/day.py.

The node (``lineament live --track``) runs in its own process, over DDS on loopback. A few
publishers send it scans of 181 beams from a drive, each the next one when the features of its last
one have come: that is the fastest rate that loses none. Every second of the scans' time there is a
message of garbage; every ten minutes one more publisher comes, sends some scans, and is killed.
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
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from live import memory_of, start_node, wait_for, wait_until
from live_driving import cdr_scan, garbage

DOMAIN, RATE = 78, 40
HOUR = 3600 * RATE
#: Publishers of scans, and of garbage: of each, only the newest message is processed.
SCANNERS, GARBLERS = 4, 4
#: Scans between two deaths of a publisher, and how many each of them sends.
DEATH, LAST_WORDS = 600 * RATE, 20
#: Seconds of the stamps of a publisher that dies; how long its end is not known [s].
ELSEWHERE, LEASE = 2**30, 2
#: A scan that is not answered in this time is lost [s].
PATIENCE = 10.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="of scans at 40 Hz")
    parser.add_argument("--minutes", type=float, default=1e9, help="of work, at most")
    parser.add_argument("--die", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.die:
        die()
    else:
        print(day(round(given.hours * HOUR), 60 * given.minutes))


def messages() -> list[bytearray]:
    """Scans along a drive through a building, in CDR."""
    from lineament.output.ros_messages import RosMessages
    from lineament.output.scene import Moment
    from lineament.simulation import SENSORS, building, drive

    world, walk = building()
    scans = drive(world, walk[:3], SENSORS["lms181"], speed=1.0, rate=RATE)
    make, moment = RosMessages("cdr"), Moment(0, 0, "laser", "map")
    return [bytearray(make.scan("/scan", moment, scan).data) for scan in scans]


def stamped(message: bytearray, seconds: int, nanoseconds: int) -> bytes:
    struct.pack_into("<iI", message, 4, seconds, nanoseconds)
    return bytes(message)


def nonsense() -> Iterator[bytes]:
    """Garbage of each kind, again and again."""
    kinds = garbage() | {"a million beams": cdr_scan(70_000, increment=1e-5)}
    while True:
        yield from kinds.values()


class Ends:
    """Writers of scans, and a reader of the features: as raw bytes."""

    def __init__(self, writers: int) -> None:
        from cyclonedds.core import ReadCondition, WaitSet
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.util import duration

        from lineament.live.participant import Participant
        from lineament.live.raw_dds import ANY_STATE, RawReader, RawWriter

        participant = self._participant = Participant(DOMAIN, localhost=True)
        qos = Qos(Policy.Reliability.Reliable(duration(seconds=10)), Policy.History.KeepLast(100))
        scans = participant.topic("/scan", "sensor_msgs/msg/LaserScan")
        features = participant.topic("/scan/features", "sensor_msgs/msg/PointCloud2")
        self.writers = [RawWriter(participant.entity, scans, qos) for _ in range(writers)]
        self._reader = RawReader(participant.entity, features, qos, 64)
        self._arrivals = WaitSet(participant.entity)
        self._arrivals.attach(ReadCondition(self._reader, ANY_STATE))
        wait_until(lambda: all(writer.listeners for writer in self.writers))
        wait_until(lambda: self._reader.get_subscription_matched_status().current_count)

    def hear(self) -> list[tuple[int, int]]:
        """Wait for features; return the stamps of the scans that they are of."""
        self._arrivals.wait(100_000_000)
        return [struct.unpack_from("<iI", data, 4) for data, _ in self._reader.take_raw()]


def die() -> None:
    """Publish some scans, and be killed."""
    ends, scans = Ends(1), messages()[:LAST_WORDS]
    for k, scan in enumerate(scans):
        ends.writers[0].write_raw(stamped(scan, ELSEWHERE, k))
        while (ELSEWHERE, k) not in ends.hear():
            pass
    os.kill(os.getpid(), signal.SIGKILL)


def day(count: int, seconds: float) -> str:
    """Send so many scans, or those of some time, to a node; the table of what came of it."""
    with tempfile.TemporaryDirectory() as name:
        log = Path(name) / "node.log"
        node = start_node(log, DOMAIN, "--track", "--reliability", "reliable")
        try:
            wait_for(log, "finds features")
            found = Day(Ends(SCANNERS + GARBLERS), node.pid)
            found.run(count, seconds)
            time.sleep(2 * LEASE + 2)  # until the last that died is forgotten
        finally:
            node.send_signal(signal.SIGTERM)
            node.wait(60)
        return table(found, log.read_text().splitlines())


class Day:
    """The scans of a day, on their way through a node."""

    def __init__(self, ends: Ends, pid: int) -> None:
        self._ends, self._pid = ends, pid
        self._scans, self._nonsense = messages(), nonsense()
        self._idle = list(range(SCANNERS))
        #: Writer and time of each stamp without an answer.
        self._waiting: dict[tuple[int, int], tuple[int, float]] = {}
        self._dying: list[subprocess.Popen[bytes]] = []
        self.memory: list[float] = []
        self.sent = self.lost = self.garbled = self.strangers = self.deaths = 0
        self.seconds = 0.0

    def run(self, count: int, seconds: float) -> None:
        """Send so many scans, or those of some time."""
        begun = shown = time.monotonic()
        while self._waiting or self.sent < count:
            self.seconds = time.monotonic() - begun
            if self.seconds > seconds:
                count = min(count, self.sent)
            while self._idle and self.sent < count:
                self._send()
            self._hear()
            if self.seconds - shown > 10.0 or shown == begun:
                shown = self.seconds
                self._show()
        self.memory.append(memory_of(self._pid))
        for process in self._dying:
            while process.poll() is None:
                self._hear()
        self._hear()

    def _send(self) -> None:
        k, now = self.sent, time.monotonic()
        if k % HOUR == 0:
            self.memory.append(memory_of(self._pid))
        if k % RATE == 0:
            self._ends.writers[SCANNERS + self.garbled % GARBLERS].write_raw(next(self._nonsense))
            self.garbled += 1
        if k % DEATH == DEATH // 2:
            self._dying.append(start_dying())
            self.deaths += 1
        stamp, writer = (k // RATE, k % RATE * (1_000_000_000 // RATE)), self._idle.pop()
        assert self._ends.writers[writer].write_raw(
            stamped(self._scans[k % len(self._scans)], *stamp)
        )
        self._waiting[stamp] = writer, now
        self.sent += 1

    def _hear(self) -> None:
        for stamp in self._ends.hear():
            self.strangers += stamp[0] == ELSEWHERE
            if stamp in self._waiting:
                self._idle.append(self._waiting.pop(stamp)[0])
        late = time.monotonic() - PATIENCE
        for stamp in [stamp for stamp, (_, at) in self._waiting.items() if at < late]:
            self.lost += 1
            self._idle.append(self._waiting.pop(stamp)[0])

    def _show(self) -> None:
        speed = self.sent / max(self.seconds, 1e-9)
        text = f"{self.sent} scans, {self.sent / HOUR:.2f} h, {speed:.0f}/s, {self.lost} lost"
        print(f"{text}, {memory_of(self._pid):.1f} MB", file=sys.stderr, flush=True)


def start_dying() -> subprocess.Popen[bytes]:
    lease = f"<Discovery><LeaseDuration>{LEASE}s</LeaseDuration></Discovery>"
    environment = {"CYCLONEDDS_URI": f"<CycloneDDS><Domain>{lease}</Domain></CycloneDDS>"}
    return subprocess.Popen([sys.executable, __file__, "--die"], env=os.environ | environment)


def table(found: Day, lines: list[str]) -> str:
    seen = [line for line in lines if line.endswith(" publishers of scans")]
    more, usual = (
        sum(line.startswith(f"{SCANNERS + GARBLERS + extra} ") for line in seen) for extra in (1, 0)
    )
    rows = {
        "scans sent": f"{found.sent} ({found.sent / HOUR:.2f} h at {RATE} Hz)",
        "of these without features": found.lost,
        "messages of garbage sent": found.garbled,
        "publishers killed": f"{found.deaths}; seen to come {more}, to go {usual - 1}",
        "their scans sent, and answered": f"{LAST_WORDS * found.deaths}, {found.strangers}",
        "last line of the node": lines[-1],
        "memory at the start, each hour, at the end [MB]": " ".join(
            f"{size:.1f}" for size in found.memory
        ),
        "time": f"{found.seconds:.0f} s, {found.sent / found.seconds:.0f} scans/s",
    }
    return "\n".join(["| | |", "|---|---|", *(f"| {key} | {of} |" for key, of in rows.items())])


if __name__ == "__main__":
    main()
