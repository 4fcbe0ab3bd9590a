"""ROS 1: scans from its topics, features to its topics, through rospy where it is installed."""

from __future__ import annotations

import xmlrpc.client
from collections.abc import Callable
from functools import cache, partial
from http.client import HTTPConnection, HTTPException
from typing import Any

from ..errors import LineamentError, one_line
from ..output.scene import Message
from .config import LiveConfig
from .publisher import Publisher
from .received import SCAN, Inbox, Received, Wanted, relocation, wanted

#: How long the master may take to answer [s].
_PATIENCE = 3.0
#: A larger step of the sequence number is no loss: the publisher was started again.
_LEAP = 10_000


class Ros1Node:
    """The one node of ROS 1 that a process can be; sources and publishers share it.

    ``ROS_MASTER_URI`` names the master, ``ROS_IP`` or ``ROS_HOSTNAME`` this machine, as for any
    node; ``__name:=`` and other remappings of the command line hold. Signals are left to the
    program.
    """

    def __init__(self, name: str = "lineament") -> None:
        try:
            import rosgraph
            import rospy
        except ModuleNotFoundError as error:
            raise LineamentError(
                f"ROS 1 needs the package {error.name}, which is not installed: it comes with "
                "ROS 1 (source its setup.bash) or Debian's python3-rospy"
            ) from None
        if not rosgraph.names.is_legal_base_name(name):
            raise ValueError(f"name is {name!r}, expected letters, digits and _ for ROS 1")
        self._rospy = rospy
        self._uri: str = rosgraph.get_master_uri()
        self.ask_master("getPid")  # rospy itself would wait for ever
        rospy.init_node(name, disable_signals=True)

    @property
    def ended(self) -> bool:
        """Whether it was shut down: by `close`, by ``rosnode kill``, or by another of its name."""
        return bool(self._rospy.is_shutdown())

    def ask_master(self, method: str, *arguments: str) -> Any:
        """Call a method of the master; LineamentError if it does not answer within 3 s."""
        try:
            with xmlrpc.client.ServerProxy(self._uri, _Hasty()) as master:
                _, _, answer = getattr(master, method)("/lineament", *arguments)
        except (OSError, HTTPException, xmlrpc.client.Error, TypeError, ValueError) as error:
            raise LineamentError(
                f"the ROS master at {self._uri} does not answer ({one_line(str(error))}): "
                "start roscore, or set ROS_MASTER_URI"
            ) from None
        return answer

    def subscribe(self, topic: str, kind: str, callback: Callable[[Any], None]) -> Any:
        """Subscribe to a topic; `callback` receives each raw message."""
        return self._rospy.Subscriber(topic, _raw(kind), callback, tcp_nodelay=True)

    def advertise(self, topic: str, kind: str, depth: int, is_latched: bool) -> Any:
        """Make a rospy publisher of raw messages."""
        return self._rospy.Publisher(
            topic, _raw(kind), tcp_nodelay=True, latch=is_latched, queue_size=depth
        )

    def serve(self, service: str, kind: str, called: Callable[[], None]) -> Any:
        """Answer the calls of a service that neither takes nor returns anything."""
        from roslib.message import get_service_class

        genuine = get_service_class(kind)
        if genuine is None:
            raise _no_type(kind)

        def answer(_: Any) -> Any:
            called()
            return genuine._response_class()

        return self._rospy.Service(service, genuine, answer)

    def close(self) -> None:
        """Leave ROS, and close all topics; a process cannot come back."""
        self._rospy.signal_shutdown("closed")


class Ros1Source:
    """Scans, and odometry where it is wanted, from topics of ROS 1."""

    def __init__(self, node: Ros1Node, config: LiveConfig) -> None:
        self._node, self._inbox = node, Inbox(config.depth)
        self._numbers: dict[str, int] = {}
        self._subscribed = [
            (one, node.subscribe(one.topic, one.kind, partial(self._put, one)))
            for one in wanted(config)
        ]
        self._service = None
        if config.can_relocate:  # The service that AMCL has.
            name = config.resolved("global_localization")
            self._service = node.serve(
                name, "std_srvs/Empty", lambda: self._inbox.put(relocation())
            )

    @property
    def lost(self) -> int:
        """Scans that did not come, by gaps in sequence numbers, or were not taken in time."""
        return self._inbox.lost

    @property
    def ended(self) -> bool:
        """Whether the node was shut down."""
        return self._node.ended

    @property
    def publishers(self) -> int:
        """Number of publishers of scans that are connected."""
        scans = (subscription for one, subscription in self._subscribed if one.what == SCAN)
        return sum(int(one.get_num_connections()) for one in scans)

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds, and return all messages that came, oldest first."""
        return self._inbox.take(timeout)

    def problems(self) -> list[str]:
        """Return why topics have no publishers: another type, or the master does not answer."""
        silent = [one for one, of in self._subscribed if not of.get_num_connections()]
        if not silent or self.ended:
            return []
        try:
            published = dict(self._node.ask_master("getPublishedTopics", ""))
        except LineamentError as error:
            return [str(error)]
        return [
            f"{one.topic} is published as {published[one.topic]}, expected {one.kind}"
            for one in silent
            if published.get(one.topic, one.kind) != one.kind
        ]

    def close(self) -> None:
        """Stop listening."""
        for _, subscription in self._subscribed:
            subscription.unregister()
        if self._service is not None:
            self._service.shutdown()

    def _put(self, wanted: Wanted, message: Any) -> None:
        publisher = message._connection_header.get("callerid", "somebody")
        came = wanted.received(publisher, message.raw, "ros1")
        missing = self._missing(publisher, message.raw) if wanted.what == SCAN else 0
        self._inbox.put(came, missing)

    def _missing(self, publisher: str, data: bytes) -> int:
        """Count the scans between the last of a publisher and this one, by their numbers."""
        number = int.from_bytes(data[:4], "little")
        gap = number - self._numbers.get(publisher, number) - 1
        self._numbers[publisher] = number
        return gap if 0 < gap < _LEAP else 0


class Ros1Publisher(Publisher):
    """Publishes serialised messages of ROS 1, each under its genuine type.

    A listener that does not keep up loses all but the newest `depth` messages, and delays nobody.
    The sequence numbers of headers stay as they are: rospy's numbering is not for raw messages.
    """

    def __init__(self, node: Ros1Node, depth: int = 10) -> None:
        super().__init__()
        self._node, self._depth = node, depth

    def _open(self, topic: str, kind: str) -> Any:
        return self._node.advertise(topic, kind, self._depth, topic in self._latched)

    def _send(self, topic: Any, message: Message) -> None:
        if self._node.ended:
            return
        # rospy drops the oldest message of a full queue, and does not count it.
        self.unsent += sum(len(one._queue) >= self._depth for one in topic.impl.connections)
        topic.publish(topic.data_class(message.data))

    def _count(self, topic: Any) -> int:
        return int(topic.get_num_connections())


@cache
def _raw(kind: str) -> Any:
    """Make the class of a type's messages as bytes; its name and checksum are the genuine ones."""
    from roslib.message import get_message_class

    genuine = get_message_class(kind)
    if genuine is None:
        raise _no_type(kind)

    class Raw(genuine):  # type: ignore[misc, valid-type]
        __slots__ = ("raw",)
        _has_header = False  # else rospy would overwrite the sequence number

        def __init__(self, raw: bytes = b"") -> None:
            self.raw = raw

        def serialize(self, buffer: Any) -> None:
            buffer.write(self.raw)

        def deserialize(self, raw: bytes) -> Raw:
            self.raw = raw
            return self

    return Raw


def _no_type(kind: str) -> LineamentError:
    package = kind.partition("/")[0]
    return LineamentError(f"ROS 1 has no {kind}: its package {package} is not installed")


class _Hasty(xmlrpc.client.Transport):
    """HTTP with a time limit."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _PATIENCE
        return connection
