"""Scans from rclpy and features to rclpy, as the bytes that ROS 2 has on the wire."""

from functools import partial
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosidl_runtime_py.utilities import get_message
from std_srvs.srv import Empty

from lineament.live import LiveConfig
from lineament.live.publisher import Publisher
from lineament.live.received import SCAN, Received, Wanted, relocation, wanted
from lineament.output.scene import Message

__all__ = ["RclpyPublisher", "RclpySource"]

#: The service by which nav2 has a robot looked for anew.
RELOCATION = "reinitialize_global_localization"


class RclpySource:
    """Scans, and odometry where it is wanted, from topics that a node subscribes raw.

    Whatever else the node has to do, such as to answer for its parameters, is done while it waits
    for scans: there is no second thread.

    Parameters
    ----------
    node : rclpy.node.Node
    executor : rclpy.executors.Executor
        Has the node.
    config : lineament.live.LiveConfig
        Topics, type, echo, reliability; and `depth`, the messages of a topic that may wait.

    Attributes
    ----------
    lost : int
        Scans that the middleware knows to have lost.
    """

    def __init__(self, node: Node, executor: Executor, config: LiveConfig) -> None:
        self._node, self._executor, self._config = node, executor, config
        self._came: list[Received] = []
        self.lost = 0
        self._subscribed = {one.topic: self._subscribe(one) for one in wanted(config)}
        _, self._scans = self._subscribed[config.scan_topic]
        self._service = None
        if config.can_relocate:
            self._service = node.create_service(Empty, RELOCATION, self._relocate)

    @property
    def ended(self) -> bool:
        """Whether ROS was shut down."""
        return not self._node.context.ok()

    @property
    def publishers(self) -> int:
        """Number of publishers of scans."""
        return int(self._scans.get_publisher_count())

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` seconds for something to do; return what came, oldest first."""
        self._executor.spin_once(timeout_sec=timeout)
        # One call does one thing: what else waits is taken without waiting for more.
        for known in range(1, self._config.depth):
            if len(self._came) < known:
                break
            self._executor.spin_once(timeout_sec=0)
        came, self._came = self._came, []
        return came

    def problems(self) -> list[str]:
        """Return publishers of another type; rclpy itself warns of an incompatible QoS."""
        return [
            f"{topic} is published as {publisher.topic_type}, expected {kind}"
            for topic, (kind, _) in self._subscribed.items()
            for publisher in self._node.get_publishers_info_by_topic(topic)
            if publisher.topic_type != kind
        ]

    def close(self) -> None:
        """End the subscriptions."""
        for _, subscription in self._subscribed.values():
            self._node.destroy_subscription(subscription)
        if self._service is not None:
            self._node.destroy_service(self._service)

    def _subscribe(self, wanted: Wanted) -> tuple[str, Any]:
        """Subscribe to a topic; return its type, and the subscription."""
        kind, events = wanted.kind.replace("/", "/msg/"), None
        if wanted.what == SCAN:
            events = SubscriptionEventCallbacks(message_lost=self._note_lost)
        reliability = "reliable" if wanted.is_command else self._config.reliability
        subscription = self._node.create_subscription(
            get_message(kind),
            wanted.topic,
            partial(self._put, wanted),
            _profile(self._config.depth, reliability, wanted.is_latched),
            event_callbacks=events,
            raw=True,
        )
        return kind, subscription

    def _put(self, wanted: Wanted, data: bytes, info: Any) -> None:
        self._came.append(wanted.received(_publisher(info), data, "cdr"))

    def _relocate(self, _: Any, response: Any) -> Any:
        """Answer the service: the robot is looked for on the whole plan."""
        self._came.append(relocation())
        return response

    def _note_lost(self, status: Any) -> None:
        self.lost = int(status.total_count)


class RclpyPublisher(Publisher):
    """Publishes serialised messages, reliably; rclpy does not report those that are not sent.

    Parameters
    ----------
    node : rclpy.node.Node
    depth : int
        Messages of a topic that are kept for slow listeners.
    """

    def __init__(self, node: Node, depth: int = 10) -> None:
        super().__init__()
        self._node, self._depth = node, depth

    def close(self) -> None:
        """Withdraw all topics."""
        for publisher in self._topics.values():
            self._node.destroy_publisher(publisher)
        self._topics.clear()

    def _open(self, topic: str, kind: str) -> Any:
        is_latched = topic in self._latched
        qos = _profile(1 if is_latched else self._depth, "reliable", is_latched)
        return self._node.create_publisher(get_message(kind), topic, qos)

    def _send(self, topic: Any, message: Message) -> None:
        topic.publish(message.data)

    def _count(self, topic: Any) -> int:
        return int(topic.get_subscription_count())


def _profile(depth: int, reliability: str, is_latched: bool = False) -> QoSProfile:
    """Make a profile that keeps the last messages; volatile, unless it is latched."""
    is_reliable = reliability == "reliable"
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE),
    )


def _publisher(info: Any) -> str:
    """Identity of a publisher, in releases whose rclpy has it."""
    identity = info.get("publisher_gid")
    return identity["data"].hex() if identity else "the publisher"
