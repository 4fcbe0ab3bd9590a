"""Driving `lineament live` as a process of its own, and reading what it tells."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from dds_driving import DEADLINE, PeerProcess, eventually

import lineament as ln

STAMP = {"sec": 1_700_000_000, "nanosec": 123_456_789}


class LiveNode:
    """The command as it runs; what it says on standard error can be read meanwhile."""

    def __init__(self, folder: Path, *arguments: object) -> None:
        self._said = folder / f"said-{random.getrandbits(32):x}"
        command = [sys.executable, "-m", "lineament", "live", *map(str, arguments)]
        others = ("CYCLONEDDS_URI", "ROS_DOMAIN_ID")
        clean = {name: value for name, value in os.environ.items() if name not in others}
        with self._said.open("w") as said:
            self.process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=said, text=True, env=clean
            )

    @property
    def said(self) -> list[str]:
        """Lines on standard error so far."""
        return self._said.read_text().splitlines()

    def until_it_says(self, text: str, times: int = 1) -> None:
        """Wait until it has told a line with this text, so many times."""

        def has_said() -> bool:
            assert self.process.poll() is None, f"it has ended: {self.said}"
            return sum(text in line for line in self.said) >= times

        eventually(has_said)

    @property
    def memory(self) -> float:
        """Memory that it holds [MB]."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def stop(self, number: int = signal.SIGTERM) -> str:
        """Send a signal; what it says on standard output."""
        self.process.send_signal(number)
        return self.end()

    def end(self) -> str:
        """Wait until it ends, well; what it says on standard output."""
        out, _ = self.process.communicate(timeout=DEADLINE)
        assert (self.process.returncode, "Traceback" in self._said.read_text()) == (0, False), (
            f"{self.process.returncode}, {out!r}, {self.said}"
        )
        return out

    def kill(self) -> None:
        """Kill it, if it still runs."""
        self.process.kill()
        self.process.wait(DEADLINE)
        self.process.stdout.close()


def scene(n: int = 541) -> np.ndarray:
    """Ranges in a room of 5 m by 4 m with a pillar, as a message holds them."""
    bearings = np.linspace(-2.25, 2.25, n)
    c, s = np.cos(bearings), np.sin(bearings)
    walls = [distance / np.maximum(side, 1e-9) for side, distance in ((c, 3), (-c, 2))]
    walls += [2 / np.maximum(np.abs(s), 1e-9)]
    # The pillar has a radius of 30 cm; how far each beam passes by its centre (1.6, 0.4).
    along, aside = 1.6 * c + 0.4 * s, 1.6 * s - 0.4 * c
    depth = 0.3**2 - aside**2
    is_hit = (depth > 0) & (along > 0)
    pillar = np.where(is_hit, along - np.sqrt(np.maximum(depth, 0)), np.inf)
    noise = np.random.default_rng(7).normal(0, 0.004, n)
    return (np.min([*walls, pillar], axis=0) + noise).astype(np.float32)


def message_of(ranges: np.ndarray, number: int = 0, **fields: float) -> dict:
    """A LaserScan as a peer takes it; its stamp is `number` seconds after `STAMP`."""
    step = 4.5 / (len(ranges) - 1)
    numbers = {"angle_min": -2.25, "angle_max": 2.25, "angle_increment": step}
    numbers |= {"time_increment": 0.0, "scan_time": 0.0, "range_min": 0.125, "range_max": 30.0}
    return {
        "header": {"stamp": {**STAMP, "sec": STAMP["sec"] + number}, "frame_id": "laser_front"},
        **{name: float(np.float32(value)) for name, value in (numbers | fields).items()},
        "ranges": [float(r) for r in ranges],
        "intensities": [],
    }


def scan_of(message: dict) -> ln.LaserScan:
    """What the library makes of the same message; its features are compared without the stamp."""
    names = ("angle_min", "angle_increment", "range_min", "range_max")
    given = {name: message[name] for name in (*names, "scan_time", "time_increment")}
    return ln.LaserScan(message["ranges"], **given)


def points_of(cloud: dict) -> np.ndarray:
    """The features of a cloud, as `docs/live.md` reads them."""
    forms = {5: "<i4", 6: "<u4", 7: "<f4"}
    fields = [(field["name"], forms[field["datatype"]]) for field in cloud["fields"]]
    assert [field["offset"] for field in cloud["fields"]] == [4 * i for i in range(len(fields))]
    return np.frombuffer(bytes(cloud["data"]), fields)


def heard(peer: PeerProcess, topic: str, publish: Callable[[], object] = lambda: None) -> dict:
    """The newest message of a topic, once there is one; meanwhile publish again and again.

    Nobody outside can wait until the node hears and is heard, and best effort may be lost.
    """
    came: list[dict] = []

    def has_come() -> bool:
        publish()
        came.extend(peer("take", topic))
        return bool(came)

    eventually(has_come, pause=0.05)
    return came[-1]


def totals(peer: PeerProcess) -> dict[str, int]:
    """What the next report of the node has counted since its start."""
    (status,) = heard(peer, "rt/diagnostics")["status"]
    ends = ((pair["key"], pair["value"]) for pair in status["values"])
    return {key.removesuffix(" in all"): int(value) for key, value in ends if "in all" in key}
