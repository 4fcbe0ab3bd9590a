"""`Inbox`: where the threads of a transport put what came, until the node takes it."""

from __future__ import annotations

from collections import deque
from threading import Condition

from .received import Received

__all__ = ["Inbox"]

#: Publishers that have room: more are no robot, but somebody making up names.
_MOST_PUBLISHERS = 64


class Inbox:
    """What came and was not yet taken: the newest few messages of each publisher.

    A publisher that sends more than is taken pushes out its own messages, never those of another.

    Parameters
    ----------
    depth : int
        Messages of a publisher that may wait.

    Attributes
    ----------
    lost : int
        Scans that are known to have been lost: on the way, or pushed out here.

    Examples
    --------
    >>> inbox = Inbox(depth=1)
    >>> for arrived in (1.0, 2.0):
    ...     inbox.put(Received("scanner", lambda: None, arrived))
    >>> [received.arrived for received in inbox.take(timeout=0)], inbox.lost
    ([2.0], 1)
    """

    def __init__(self, depth: int) -> None:
        self.lost = 0
        self._depth = depth
        self._waiting: dict[tuple[str, bool], deque[Received]] = {}
        self._changed = Condition()

    def put(self, received: Received, missing: int = 0) -> None:
        """Let a message wait; `missing` scans are known to have been lost just before it."""
        key = received.publisher, received.is_odometry
        with self._changed:
            if key not in self._waiting and len(self._waiting) < _MOST_PUBLISHERS:
                self._waiting[key] = deque(maxlen=self._depth)
            queue = self._waiting.get(key)
            is_full = queue is None or len(queue) == self._depth
            self.lost += missing + (is_full and not received.is_odometry)
            if queue is not None:
                queue.append(received)
                self._changed.notify()

    def take(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds for a message; give all that wait, oldest first."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting, timeout)
            queues = list(self._waiting.values())
            self._waiting.clear()
        return sorted((one for queue in queues for one in queue), key=lambda one: one.arrived)
