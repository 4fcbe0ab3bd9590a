"""Driving live nodes: as a process, as a thread of this one, and with peers in other processes."""

import multiprocessing
import os
import random
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from importlib import import_module
from pathlib import Path
from typing import Any, Self

import numpy as np

import lineament as ln
from lineament.live import LiveConfig, Pipeline, Received, Report, Source, run_live
from lineament.live.received import wanted

#: How long anything may take on a slow machine [s]; nothing waits so long if it goes well.
DEADLINE = 120.0


def eventually(condition: Callable[[], Any], pause: float = 0.01) -> Any:
    """Wait until a condition holds; return its value."""
    end = time.monotonic() + DEADLINE
    while not (value := condition()):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(pause)
    return value


class Remote:
    """A `Peer` of a module, in another process: its methods are called there."""

    def __init__(self, module: str, *arguments: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self._orders, there = context.Pipe()
        self.process = context.Process(target=_obey, args=(there, module, arguments), daemon=True)
        self.process.start()
        there.close()
        self._answer()

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            self._orders.send((name, arguments))
            return self._answer()

        return call

    def _answer(self) -> Any:
        assert self._orders.poll(DEADLINE), "the peer does not answer"
        return self._orders.recv()

    def signal(self, number: int) -> None:
        os.kill(self.process.pid, number)

    def close(self) -> None:
        self.process.kill()
        self.process.join(DEADLINE)


def _obey(orders: Any, module: str, arguments: tuple[Any, ...]) -> None:
    peer = import_module(module).Peer(*arguments)
    orders.send("ready")
    while True:
        name, given = orders.recv()
        orders.send(getattr(peer, name)(*given))


class LiveNode:
    """`lineament live` as a process; what it writes to standard error can be read meanwhile."""

    def __init__(self, folder: Path, *arguments: object) -> None:
        self._errors = folder / f"errors-{random.getrandbits(32):x}"
        command = [sys.executable, "-m", "lineament", "live", *map(str, arguments)]
        with self._errors.open("w") as errors:
            self.process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=errors, text=True
            )

    @property
    def lines(self) -> list[str]:
        """Lines on standard error so far."""
        return self._errors.read_text().splitlines()

    def until_it_writes(self, text: str) -> None:
        def has_written() -> bool:
            assert self.process.poll() is None, f"it has ended: {self.lines}"
            return any(text in line for line in self.lines)

        eventually(has_written)

    @property
    def memory(self) -> float:
        """Resident memory [MB]."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def stop(self, number: int = signal.SIGTERM) -> str:
        """Send a signal, and wait until it ends well; return its standard output."""
        self.process.send_signal(number)
        out, _ = self.process.communicate(timeout=DEADLINE)
        assert (self.process.returncode, "Traceback" in self._errors.read_text()) == (0, False), (
            f"{self.process.returncode}, {out!r}, {self.lines}"
        )
        return out

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(DEADLINE)
        self.process.stdout.close()


class Running:
    """A node with some options, in a thread until the block ends; `lines` is what it wrote."""

    def __init__(self, **options: Any) -> None:
        config = LiveConfig(**options)
        pipeline = Pipeline(config)
        for _ in range(2):  # Nothing that has a deadline should wait for a compiler.
            pipeline("", scan_of(scan_message(0, scene(), time_increment=1e-6)))
        self.lines: list[str] = []
        self._stopped = threading.Event()
        write, is_stopped = self.lines.append, self._stopped.is_set
        self._ended = ThreadPoolExecutor(1).submit(run_live, config, is_stopped, write=write)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> Report:
        """Stop it; return its last report."""
        self._stopped.set()
        return self.end()

    def end(self) -> Report:
        """Wait until it ends; return its last report."""
        return self._ended.result(DEADLINE)


def scan_message(stamp: int = 0, ranges: Any = (1.0, 2.0, 3.0), **fields: float) -> dict:
    """A LaserScan as a peer writes it: 1.5 rad wide, in the frame ``laser``."""
    ranges = [float(r) for r in ranges]
    increment = 1.5 / max(len(ranges) - 1, 1)
    numbers = {"angle_min": -0.75, "angle_max": 0.75, "angle_increment": increment}
    numbers |= {"scan_time": 0.125, "range_min": 0.125, "range_max": 32.0, **fields}
    header = {"stamp": {"sec": stamp, "nanosec": 500_000_001}, "frame_id": "laser"}
    # As the message holds them: in single precision.
    single = {name: float(np.float32(value)) for name, value in numbers.items()}
    return {"header": header, **single, "ranges": ranges}


def odometry_message(vx: float, stamp: int = 0) -> dict:
    turned = {"z": float(np.sin(0.25)), "w": float(np.cos(0.25))}
    return {
        "header": {"stamp": {"sec": stamp, "nanosec": 500_000_000}, "frame_id": "odom"},
        "child_frame_id": "base",
        "pose": {"pose": {"position": {"x": 1.0, "y": 2.0}, "orientation": turned}},
        "twist": {"twist": {"linear": {"x": vx, "y": -1.0}, "angular": {"z": 0.25}}},
    }


def cdr_scan(n: int = 3, order: str = "<", increment: float = 0.25) -> bytes:
    """A LaserScan of `n` beams in CDR."""
    geometry = (-0.5, 0.5, increment, 0.0, 0.1, 0.1, 30.0)
    form = f"{order}3I8s7fI{n}fI"
    return b"\0\1\0\0" + struct.pack(form, 7, 0, 6, b"laser", *geometry, n, *[1.0] * n, 0)


def garbage() -> dict[str, bytes]:
    """Messages in CDR that are no scan, by what is wrong with them."""
    good = cdr_scan()
    return {
        "empty": b"\0\1\0\0" + bytes(4),
        "noise": b"\0\1\0\0" + random.Random(0).randbytes(400),
        "cut off": good[:-12],
        "too long": good + bytes(40),
        "big-endian": b"\0\1\0\0" + cdr_scan(order=">")[4:],
        "XCDR2": b"\0\7\0\0" + good[4:],
        "too many ranges": good[:52] + struct.pack("<I", 2**32 - 1) + good[56:],
        "no beams": cdr_scan(2)[:52] + bytes(8),
        "NaN": cdr_scan(increment=float("nan")),
        "no increment": cdr_scan(increment=0.0),
        "a million beams": cdr_scan(1_000_000, increment=1e-6),
    }


def scene(n: int = 541) -> np.ndarray:
    """Ranges over 1.5 rad of a corner, 3 m ahead, and a pillar, as messages hold them."""
    bearings = np.linspace(-0.75, 0.75, n)
    c, s = np.cos(bearings), np.sin(bearings)
    walls = [3 / c, np.where(s > 0, 1.5 / np.maximum(s, 1e-9), np.inf)]
    # The pillar has a radius of 30 cm; how far each beam passes by its centre (1.6, -0.4).
    along, aside = 1.6 * c - 0.4 * s, 1.6 * s + 0.4 * c
    depth = 0.3**2 - aside**2
    pillar = np.where(depth > 0, along - np.sqrt(np.maximum(depth, 0)), np.inf)
    noise = np.random.default_rng(7).normal(0, 0.004, n)
    return (np.min([*walls, pillar], axis=0) + noise).astype(np.float32)


def scan_of(message: dict) -> ln.LaserScan:
    """What the library makes of the same message."""
    names = ("angle_min", "angle_increment", "range_min", "range_max", "scan_time")
    given = {name: message[name] for name in names}
    return ln.LaserScan(
        message["ranges"], time_increment=message.get("time_increment", 0.0), **given
    )


def points_of(cloud: dict) -> np.ndarray:
    """The features of a cloud, as `docs/live.md` reads them."""
    forms = {5: "<i4", 6: "<u4", 7: "<f4"}
    fields = [(field["name"], forms[field["datatype"]]) for field in cloud["fields"]]
    assert [field["offset"] for field in cloud["fields"]] == [4 * i for i in range(len(fields))]
    return np.frombuffer(bytes(cloud["data"]), fields)


def heard(peer: Any, topic: str, publish: Callable[[], object] = lambda: None) -> dict:
    """Return the newest message of a topic, once there is one; meanwhile publish repeatedly.

    Nobody outside can wait until the node hears and is heard, and best effort may be lost.
    """

    def newest() -> list[dict]:
        publish()
        return peer.take(topic)[-1:]

    return eventually(newest, pause=0.02)[0]


def connected(peer: Any, source: Source, topic: str, *kind: Any) -> None:
    """Let a peer publish, and wait until both sides know it."""
    before = source.publishers
    peer.publish(topic, *kind)
    eventually(lambda: peer.listeners(topic) and source.publishers > before)


def received_scan(
    publisher: str, data: bytes, encoding: str = "cdr", kind: str = "LaserScan"
) -> Received:
    """What a source gives of a serialised scan that has just arrived."""
    (scans,) = wanted(LiveConfig(type=kind))
    return scans.received(publisher, data, encoding)


def waited_for(receive: Callable[[float], list[Received]], send: Callable[[], object]) -> Any:
    """Return what is received while nothing has come yet, once it is sent."""
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(receive, DEADLINE)
        assert not wait([waiting], timeout=0.05).done
        send()
        return waiting.result(DEADLINE / 2)


def received(source: Source, n: int = 1) -> list[Received]:
    """Take the next messages, `n` at least."""
    found: list[Received] = []
    eventually(lambda: found.extend(source.receive(0.1)) or len(found) >= n, pause=0)
    return found
