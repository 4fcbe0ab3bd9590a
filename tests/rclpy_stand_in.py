"""As much of rclpy as the node of `ros/` touches, by its documentation: it carries no messages.

It shows that the node can be imported, configured, run and ended; what rclpy does it cannot show.
"""

from __future__ import annotations

import types
from collections.abc import Callable


class Topic:
    """A publisher and a subscription of rclpy: what is published is kept, what is put is heard."""

    def __init__(self, name: str, callback: Callable | None = None) -> None:
        self.name, self.callback = name, callback
        self.published: list[bytes] = []

    def publish(self, data: bytes) -> None:
        assert isinstance(data, bytes)
        self.published.append(data)

    def get_subscription_count(self) -> int:
        return 1

    def get_publisher_count(self) -> int:
        return 1


class Node:
    """A node with the parameters that it was started with."""

    overrides: dict[str, object] = {}  # noqa: RUF012

    def __init__(self, name: str, *, automatically_declare_parameters_from_overrides: bool) -> None:
        assert automatically_declare_parameters_from_overrides
        self.name, self.parameters = name, dict(self.overrides)
        self.subscriptions: dict[str, Topic] = {}
        self.publishers: dict[str, Topic] = {}
        self.types: dict[str, str] = {}
        self.context = types.SimpleNamespace(ok=lambda: True)
        self.log: list[str] = []

    def get_name(self) -> str:
        return self.name

    def get_logger(self) -> types.SimpleNamespace:
        return types.SimpleNamespace(info=self.log.append)

    def has_parameter(self, name: str) -> bool:
        return name in self.parameters

    def declare_parameter(self, name: str, value: object) -> None:
        assert name not in self.parameters
        self.parameters[name] = value

    def get_parameter(self, name: str) -> types.SimpleNamespace:
        return types.SimpleNamespace(value=self.parameters[name])

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, object]:
        start = f"{prefix}." if prefix else ""
        found = self.parameters.items()
        return {name.removeprefix(start): value for name, value in found if name.startswith(start)}

    def resolve_topic_name(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"/{topic}"

    def get_publishers_info_by_topic(self, topic: str) -> list[types.SimpleNamespace]:
        return [types.SimpleNamespace(topic_type=self.types[topic])] if topic in self.types else []

    def create_subscription(
        self, kind: str, topic: str, callback: Callable, qos: object, *, raw: bool, **_: object
    ) -> Topic:
        assert raw
        assert qos
        self.types[topic] = kind
        self.subscriptions[topic] = Topic(topic, callback)
        return self.subscriptions[topic]

    def create_publisher(self, kind: str, topic: str, qos: object) -> Topic:
        assert kind
        assert qos
        self.publishers[topic] = Topic(topic)
        return self.publishers[topic]

    def destroy_subscription(self, subscription: Topic) -> None:
        del self.subscriptions[subscription.name]

    def destroy_publisher(self, publisher: Topic) -> None:
        assert self.publishers[publisher.name] is publisher

    def destroy_node(self) -> None:
        assert not self.subscriptions


class Executor:
    """Does one of the things that wait: puts a message where it belongs, or calls."""

    def __init__(self) -> None:
        self.waiting: list[Callable[[], None]] = []

    def add_node(self, node: Node) -> None:
        self.node = node

    def put(self, topic: str, data: bytes, info: dict | None = None) -> None:
        self.waiting.append(lambda: self.node.subscriptions[topic].callback(data, info or {}))

    def spin_once(self, timeout_sec: float) -> None:  # noqa: ARG002
        if self.waiting:
            self.waiting.pop(0)()

    def shutdown(self) -> None:
        self.waiting.clear()


def modules() -> dict[str, types.ModuleType]:
    """Make modules that can be imported in place of the real ones."""
    named = types.SimpleNamespace
    contents = {
        "rclpy": {
            "init": lambda *, signal_handler_options: None,  # noqa: ARG005
            "try_shutdown": lambda: None,
            "create_node": Node,
        },
        "rclpy.event_handler": {"SubscriptionEventCallbacks": named},
        "rclpy.executors": {"Executor": Executor, "SingleThreadedExecutor": Executor},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {
            "QoSProfile": named,
            "ReliabilityPolicy": named(RELIABLE=1, BEST_EFFORT=2),
        },
        "rclpy.signals": {"SignalHandlerOptions": named(NO=0)},
        "rosidl_runtime_py": {},
        "rosidl_runtime_py.utilities": {"get_message": lambda kind: kind},
    }
    made = {}
    for name, content in contents.items():
        made[name] = types.ModuleType(name)
        vars(made[name]).update(content)
    return made
