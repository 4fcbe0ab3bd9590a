"""What stands before and behind a node in tests: messages that are there already, and are kept."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from lineament.live.publisher import Publisher
from lineament.live.received import Received
from lineament.output.scene import Message


class Given:
    """A source of given batches of messages; a callable makes one when it is received."""

    lost, publishers = 0, 1

    def __init__(self, *batches: list[Received] | Callable[[], list[Received]]) -> None:
        self.batches = list(batches)
        self.lines: list[str] = []

    @property
    def ended(self) -> bool:
        return not self.batches

    def receive(self, timeout: float) -> list[Received]:
        assert 0 < timeout <= 0.1
        batch = self.batches.pop(0)
        return batch() if callable(batch) else batch

    def problems(self) -> list[str]:
        return self.lines


class Kept:
    """A sink that keeps what it is given."""

    unsent = 0

    def __init__(self) -> None:
        self.frames: list[Any] = []
        self.reports: list[Any] = []

    def publish(self, frame: Any) -> None:
        self.frames.append(frame)

    def diagnose(self, report: Any, time: Any) -> None:
        self.reports.append((report, time))


class Taken(Publisher):
    """Takes messages as a transport does; topics that are `heard` have listeners, all if None."""

    def __init__(self, heard: Collection[str] | None = None) -> None:
        super().__init__()
        self.kinds: dict[str, str] = {}
        self.messages: list[Message] = []
        self.heard = heard

    def data(self, topic: str) -> list[bytes]:
        return [message.data for message in self.messages if message.topic == topic]

    def _open(self, topic: str, kind: str) -> str:
        assert topic.startswith("/")
        assert kind
        self.kinds[topic] = kind
        return topic

    def _send(self, topic: str, message: Message) -> None:
        assert topic == message.topic
        assert isinstance(message.data, bytes)
        self.messages.append(message)

    def _count(self, topic: str) -> int:
        return int(self.heard is None or topic in self.heard)
