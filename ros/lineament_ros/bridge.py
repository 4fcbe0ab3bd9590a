"""Scans from rclpy and features to rclpy, as the bytes that ROS 2 has on the wire."""

from __future__ import annotations

from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosidl_runtime_py.utilities import get_message

from lineament.live.decoding import received_odometry, received_scan
from lineament.live.received import Received
from lineament.output.scene import Message

__all__ = ["RclpyPublisher", "RclpySource"]

ODOMETRY = "nav_msgs/msg/Odometry"


class RclpySource:
    """Scans, and odometry where it is wanted, from topics that a node subscribes raw.

    Whatever else the node has to do, such as to answer for its parameters, is done while it is
    waited for scans: there is no second thread.

    Parameters
    ----------
    node : rclpy.node.Node
    executor : rclpy.executors.Executor
        Has the node.
    topic : str
        Topic of the scans.
    kind : {"LaserScan", "MultiEchoLaserScan"}
        Type of its messages, of sensor_msgs.
    echo : {"first", "last", "strongest"}
        Which echo of the latter.
    odometry : str, optional
        Topic of a ``nav_msgs/msg/Odometry``.
    reliability : {"best-effort", "reliable"}
        Best effort matches any publisher.
    depth : int
        Messages of a topic that may wait.

    Attributes
    ----------
    lost : int
        Scans that the middleware knows to have lost.
    """

    def __init__(
        self,
        node: Node,
        executor: Executor,
        topic: str,
        kind: str = "LaserScan",
        *,
        echo: str = "first",
        odometry: str | None = None,
        reliability: str = "best-effort",
        depth: int = 10,
    ) -> None:
        self._node, self._executor, self._depth = node, executor, depth
        self._kind, self._echo = f"sensor_msgs/{kind}", echo
        self._came: list[Received] = []
        self.lost = 0
        qos = _profile(depth, reliability)
        self._kinds = {topic: f"sensor_msgs/msg/{kind}"}
        self._scans = node.create_subscription(
            get_message(self._kinds[topic]),
            topic,
            self._put_scan,
            qos,
            event_callbacks=SubscriptionEventCallbacks(message_lost=self._note_lost),
            raw=True,
        )
        self._subscriptions = [self._scans]
        if odometry is not None:
            self._kinds[odometry] = ODOMETRY
            self._subscriptions.append(
                node.create_subscription(
                    get_message(ODOMETRY), odometry, self._put_odometry, qos, raw=True
                )
            )

    @property
    def ended(self) -> bool:
        """Whether ROS was shut down."""
        return not self._node.context.ok()

    @property
    def publishers(self) -> int:
        """How many publishers of scans are matched."""
        return int(self._scans.get_publisher_count())

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds for something to do; give all that came, oldest first."""
        self._executor.spin_once(timeout_sec=timeout)
        # One call does one thing: what else waits is taken without waiting for more.
        for known in range(1, self._depth):
            if len(self._came) < known:
                break
            self._executor.spin_once(timeout_sec=0)
        came, self._came = self._came, []
        return came

    def problems(self) -> list[str]:
        """Tell of publishers of another type; rclpy itself warns of an incompatible QoS."""
        return [
            f"{topic} is published as {publisher.topic_type}, expected {kind}"
            for topic, kind in self._kinds.items()
            for publisher in self._node.get_publishers_info_by_topic(topic)
            if publisher.topic_type != kind
        ]

    def close(self) -> None:
        """End the subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _put_scan(self, data: bytes, info: Any) -> None:
        self._came.append(received_scan(_publisher(info), data, "cdr", self._kind, self._echo))

    def _put_odometry(self, data: bytes, info: Any) -> None:
        self._came.append(received_odometry(_publisher(info), data, "cdr"))

    def _note_lost(self, status: Any) -> None:
        self.lost = int(status.total_count)


class RclpyPublisher:
    """Publishes messages that are serialised already, reliably.

    Parameters
    ----------
    node : rclpy.node.Node
    depth : int
        Messages of a topic that are kept for listeners who do not keep up.
    """

    #: Messages that could not be sent: rclpy does not tell.
    unsent = 0

    def __init__(self, node: Node, depth: int = 10) -> None:
        self._node, self._depth = node, depth
        self._topics: dict[str, Any] = {}

    def advertise(self, topic: str, kind: str) -> None:
        """Make a topic known before its first message."""
        self._topics[topic] = self._node.create_publisher(
            get_message(kind), topic, _profile(self._depth, "reliable")
        )

    def publish(self, message: Message) -> None:
        """Send a message in CDR."""
        if message.topic not in self._topics:
            self.advertise(message.topic, message.kind)
        self._topics[message.topic].publish(message.data)

    def listeners(self, topic: str) -> int:
        """How many listen to a topic; 0 for one that is not advertised."""
        return self._topics[topic].get_subscription_count() if topic in self._topics else 0

    def close(self) -> None:
        """Withdraw all topics."""
        for publisher in self._topics.values():
            self._node.destroy_publisher(publisher)
        self._topics.clear()


def _profile(depth: int, reliability: str) -> QoSProfile:
    """Make a volatile profile that keeps the last messages."""
    is_reliable = reliability == "reliable"
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
    )


def _publisher(info: Any) -> str:
    """Tell publishers apart, in releases whose rclpy does."""
    identity = info.get("publisher_gid")
    return identity["data"].hex() if identity else "the publisher"
