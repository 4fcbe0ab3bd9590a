"""`Publisher`: what carries the messages of a node to others."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from ..output.scene import Message


class Publisher(ABC):
    """What carries messages: DDS, ROS 1, a WebSocket; `unsent` counts those it could not send."""

    unsent = 0

    def __init__(self) -> None:
        self._topics: dict[str, Any] = {}
        self._latched: set[str] = set()

    def advertise(self, topic: str, kind: str, *, is_latched: bool = False) -> None:
        """Announce a topic, so that others can subscribe before there is a message.

        Who comes later gets the last message of one that is latched. Once is enough: a scan of a
        log and a pose on a plan share ``/tf``.
        """
        if topic in self._topics:
            return
        if is_latched:
            self._latched.add(topic)
        self._topics[topic] = self._open(topic, kind)

    def publish(self, message: Message) -> None:
        """Send a message, without waiting for slow listeners; its topic is advertised first."""
        if message.topic not in self._topics:
            self.advertise(message.topic, message.kind)
        self._send(self._topics[message.topic], message)

    def offer(self, topic: str, make: Callable[[str], Message]) -> None:
        """Make a message of a topic, and send it, if the topic has listeners."""
        if self.listeners(topic):
            self.publish(make(topic))

    def listeners(self, topic: str) -> int:
        """Return the number of listeners of a topic, or 1 if it has some; 0 if not advertised.

        Of a latched one they may come later: there is one at least.
        """
        if topic in self._latched:
            return 1
        return self._count(self._topics[topic]) if topic in self._topics else 0

    @abstractmethod
    def _open(self, topic: str, kind: str) -> Any: ...

    @abstractmethod
    def _send(self, topic: Any, message: Message) -> None: ...

    @abstractmethod
    def _count(self, topic: Any) -> int: ...
