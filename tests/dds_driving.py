"""Driving another process on the same topics of DDS, and waiting for what it does."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from lineament.live.dds import DdsSource

#: How long anything may take on a slow machine [s]; nothing waits so long if it goes well.
DEADLINE = 60.0


class PeerProcess:
    """The other process; its orders are those of `dds_peer.Peer`."""

    def __init__(self, domain: int, lease: str = "10s") -> None:
        command = [sys.executable, Path(__file__).with_name("dds_peer.py"), str(domain), lease]
        clean = {k: v for k, v in os.environ.items() if k != "CYCLONEDDS_URI"}
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=clean
        )
        self._answer()

    def __call__(self, order: str, *arguments: object) -> object:
        self.begin(order, *arguments)
        return self._answer()

    def begin(self, order: str, *arguments: object) -> None:
        """Give an order whose answer is not waited for."""
        self.process.stdin.write(json.dumps([order, *arguments]) + "\n")
        self.process.stdin.flush()

    def _answer(self) -> object:
        line = self.process.stdout.readline()
        assert line, "the peer has failed"
        return json.loads(line)

    def close(self) -> None:
        self.process.stdin.close()
        self.process.wait(DEADLINE)
        self.process.stdout.close()

    def kill(self) -> None:
        self.process.kill()
        self.close()


def eventually(condition: Callable[[], bool], pause: float = 0.01) -> None:
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(pause)


def receive(source: DdsSource, n: int = 1) -> list:
    """The next messages, n at least."""
    received, end = [], time.monotonic() + DEADLINE
    while len(received) < n:
        assert time.monotonic() < end, f"{len(received)} of {n} messages have come"
        received += source.receive(0.1)
    return received


def connected(peer: PeerProcess, source: DdsSource, kind: str, topic: str = "rt/scan") -> None:
    """Have the peer publish, and both sides know it."""

    def matched() -> int:
        readers = [subscription.reader for subscription in source._topics]
        return sum(r.get_subscription_matched_status().current_count for r in readers)

    before = matched()
    peer("publish", topic, kind)
    eventually(lambda: peer("listeners", topic) == 1 and matched() > before)
