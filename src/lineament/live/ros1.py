"""ROS 1: scans from its topics, features to its topics, through rospy where it is installed."""

from __future__ import annotations

import xmlrpc.client
from collections.abc import Callable
from functools import cache
from http.client import HTTPConnection, HTTPException
from typing import TYPE_CHECKING, Any

from ..errors import LineamentError, one_line
from .decoding import received_odometry, received_scan
from .inbox import Inbox
from .received import Received

if TYPE_CHECKING:
    from ..output.scene import Message

__all__ = ["Ros1Node", "Ros1Publisher", "Ros1Source"]

ODOMETRY = "nav_msgs/Odometry"
#: How long the master may take to answer [s].
_PATIENCE = 3.0
#: A leap of the sequence number that is no loss: somebody else counts, or began anew.
_LEAP = 10_000


class Ros1Node:
    """The one node of ROS 1 that a process can be; sources and publishers share it.

    The master is found by ``ROS_MASTER_URI``, and this machine is found by ``ROS_IP`` or
    ``ROS_HOSTNAME``, as for any node; ``__name:=`` and other remappings of the command line hold.
    Signals are left to the program.

    Parameters
    ----------
    name : str
        Name of the node.

    Raises
    ------
    LineamentError
        If rospy is not installed, or the master does not answer.
    ValueError
        If it is no name of a node.
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
        """Ask the master, who has three seconds; LineamentError if it does not answer."""
        try:
            with xmlrpc.client.ServerProxy(self._uri, _Hasty()) as master:
                _, _, answer = getattr(master, method)("/lineament", *arguments)
        except (OSError, HTTPException, xmlrpc.client.Error, TypeError, ValueError) as error:
            raise LineamentError(
                f"the ROS master at {self._uri} does not answer ({one_line(str(error))}): "
                "start roscore, or set ROS_MASTER_URI"
            ) from None
        return answer

    def subscribe(self, topic: str, kind: str, callback: Callable[[Any, Any], None]) -> Any:
        """Subscribe a topic; `callback` is given each raw message, and `kind`."""
        return self._rospy.Subscriber(topic, _raw(kind), callback, kind, tcp_nodelay=True)

    def advertise(self, topic: str, kind: str, depth: int) -> Any:
        """Make a publisher of raw messages, which is called with bytes."""
        return self._rospy.Publisher(topic, _raw(kind), tcp_nodelay=True, queue_size=depth)

    def close(self) -> None:
        """Leave ROS; a process cannot come back."""
        self._rospy.signal_shutdown("closed")


class Ros1Source:
    """Scans of a topic of ROS 1.

    Parameters
    ----------
    node : Ros1Node
    topic : str
        Topic of the scans.
    kind : {"sensor_msgs/LaserScan", "sensor_msgs/MultiEchoLaserScan"}
        Type of its messages.
    echo : {"first", "last", "strongest"}
        Which echo of the latter.
    odometry : str, optional
        Topic of a ``nav_msgs/Odometry``.
    depth : int
        Messages of each publisher that may wait until they are taken.

    Attributes
    ----------
    lost : int
        Scans that did not come: by gaps in the sequence numbers that publishers give, which is
        also how ROS 1's own statistics tell, and by not being taken in time.
    """

    def __init__(
        self,
        node: Ros1Node,
        topic: str,
        kind: str = "sensor_msgs/LaserScan",
        *,
        echo: str = "first",
        odometry: str | None = None,
        depth: int = 10,
    ) -> None:
        self._node, self._echo = node, echo
        self._inbox = Inbox(depth)
        self._numbers: dict[str, int] = {}
        self._subscribed = {topic: (kind, node.subscribe(topic, kind, self._put_scan))}
        self._scans = self._subscribed[topic][1]
        if odometry is not None:
            subscription = node.subscribe(odometry, ODOMETRY, self._put_odometry)
            self._subscribed[odometry] = ODOMETRY, subscription

    @property
    def lost(self) -> int:
        """Scans that are known to have been lost."""
        return self._inbox.lost

    @property
    def ended(self) -> bool:
        """Whether the node was shut down."""
        return self._node.ended

    @property
    def publishers(self) -> int:
        """How many publishers of scans are connected."""
        return int(self._scans.get_num_connections())

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds, and give all that came, oldest first."""
        return self._inbox.take(timeout)

    def problems(self) -> list[str]:
        """Tell of topics without publishers whether they are of another type, or the master gone.

        Publishers that are connected stay so without a master.
        """
        unheard = {
            topic: kind
            for topic, (kind, subscription) in self._subscribed.items()
            if not subscription.get_num_connections()
        }
        if not unheard or self.ended:
            return []
        try:
            published = dict(self._node.ask_master("getPublishedTopics", ""))
        except LineamentError as error:
            return [str(error)]
        return [
            f"{topic} is published as {published[topic]}, expected {kind}"
            for topic, kind in unheard.items()
            if published.get(topic, kind) != kind
        ]

    def close(self) -> None:
        """Stop listening."""
        for _, subscription in self._subscribed.values():
            subscription.unregister()

    def _put_scan(self, message: Any, kind: str) -> None:
        publisher = _publisher(message)
        scan = received_scan(publisher, message.raw, "ros1", kind, self._echo)
        self._inbox.put(scan, self._missing(publisher, message.raw))

    def _put_odometry(self, message: Any, _: str) -> None:
        self._inbox.put(received_odometry(_publisher(message), message.raw, "ros1"))

    def _missing(self, publisher: str, data: bytes) -> int:
        """Count the scans of a publisher between its last and this one, by their numbers."""
        number = int.from_bytes(data[:4], "little")
        gap = number - self._numbers.get(publisher, number) - 1
        self._numbers[publisher] = number
        return gap if 0 < gap < _LEAP else 0


class Ros1Publisher:
    """Publishes serialised messages of ROS 1, each under the genuine type.

    A listener that does not keep up loses the oldest messages and delays nobody. The sequence
    numbers of headers stay as they are in the bytes: rospy's numbering is not for raw messages.

    Parameters
    ----------
    node : Ros1Node
    depth : int
        Messages that may wait for each listener.
    """

    def __init__(self, node: Ros1Node, depth: int = 10) -> None:
        self._node, self._depth = node, depth
        self._topics: dict[str, Any] = {}
        self._unsent = 0

    @property
    def unsent(self) -> int:
        """Messages that newer ones pushed out, since a listener did not keep up."""
        return self._unsent

    def advertise(self, topic: str, kind: str) -> None:
        """Make a topic known before its first message.

        Raises
        ------
        LineamentError
            If the package of the type is not installed.
        """
        self._topics[topic] = self._node.advertise(topic, kind, self._depth)

    def publish(self, message: Message) -> None:
        """Send a message, without waiting until it is sent.

        Raises
        ------
        LineamentError
            If the package of its type is not installed.
        """
        if self._node.ended:
            return
        topic, kind, data = message
        if topic not in self._topics:
            self.advertise(topic, kind)
        publisher = self._topics[topic]
        # A full queue gives way, and rospy counts nothing.
        self._unsent += sum(len(one._queue) >= self._depth for one in publisher.impl.connections)
        publisher.publish(_raw(kind)(data))

    def listeners(self, topic: str) -> int:
        """How many listen to a topic; 0 for one that is not advertised."""
        return self._topics[topic].get_num_connections() if topic in self._topics else 0

    def close(self) -> None:
        """Withdraw all topics."""
        for publisher in self._topics.values():
            publisher.unregister()
        self._topics.clear()


@cache
def _raw(kind: str) -> Any:
    """Make the class of a type's messages that are bytes; its name and its sum are the genuine."""
    from roslib.message import get_message_class

    genuine = get_message_class(kind)
    if genuine is None:
        package = kind.partition("/")[0]
        raise LineamentError(f"ROS 1 has no {kind}: its package {package} is not installed")

    class Raw(genuine):  # type: ignore[misc, valid-type]
        __slots__ = ("raw",)
        _has_header = False  # rospy would write a number of its own into it

        def __init__(self, raw: bytes = b"") -> None:
            self.raw = raw

        def serialize(self, buffer: Any) -> None:
            buffer.write(self.raw)

        def deserialize(self, raw: bytes) -> Raw:
            self.raw = raw
            return self

    return Raw


def _publisher(message: Any) -> str:
    """Name of the node that sent a message."""
    name: str = message._connection_header.get("callerid", "somebody")
    return name


class _Hasty(xmlrpc.client.Transport):
    """HTTP that does not wait for ever."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _PATIENCE
        return connection
