"""The node: `lineament live`, configured by parameters of ROS."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import ExitStack, closing
from dataclasses import fields, replace
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from lineament import LineamentError
from lineament.live import LiveConfig, Node, Pipeline, RosSink
from lineament.output.ros_messages import RosMessages
from lineament.tasks.warmup import warm_up

from .bridge import RclpyPublisher, RclpySource

__all__ = ["config_of", "main"]

#: Parameters of `LiveConfig`; names, domain and namespace are those of ROS.
KNOWN = (
    "topic",
    "type",
    "echo",
    "stamp",
    "reliability",
    "depth",
    "method",
    "noise",
    "deskew",
    "laser_pose",
    "upside_down",
    "track",
    "dock",
    "dock_track",
    "dock_shape",
    "map",
    "layers",
    "units",
    "odometry",
    "map_frame",
    "odom_frame",
    "base_frame",
    "transform_tolerance",
    "broadcast",
    "judge",
)
#: Below this are the parameters of the method: parameters.evidence.
OF_METHOD = "parameters"
#: What any node of rclpy may have.
OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")


def main() -> int:
    """Run the node until SIGINT, SIGTERM or a shutdown of ROS."""
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    # Otherwise ROS would be gone before the last report.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        with ExitStack() as stack:
            _node(stack).run(stopped.is_set)
    except LineamentError as error:
        print(f"lineament: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


def _node(stack: ExitStack) -> Node:
    """Make the node from its parameters; `stack` closes all of it."""
    node = rclpy.create_node("lineament", automatically_declare_parameters_from_overrides=True)
    stack.callback(node.destroy_node)
    try:
        config = config_of(node)
        pipeline = Pipeline(config)
        # The first scan must not wait for kernels.
        warm_up([config.method])
    except ValueError as error:
        raise LineamentError(str(error)) from None
    executor = SingleThreadedExecutor()
    stack.callback(executor.shutdown)
    executor.add_node(node)
    # Names as ROS resolves them: with remappings and the namespace of the node.
    topics = {"topic": node.resolve_topic_name(config.topic)}
    for name in ("deskew", "odometry"):
        topic = str(getattr(config, name))
        if config.resolved(topic) == config.odometry_topic:
            topics[name] = node.resolve_topic_name(topic)
    resolved = replace(config, namespace=node.get_namespace(), **topics)
    source = stack.enter_context(closing(RclpySource(node, executor, resolved)))
    publisher = stack.enter_context(closing(RclpyPublisher(node, config.depth)))
    sink = RosSink(publisher, RosMessages("cdr"), resolved)
    return Node(source, pipeline, [sink], write=node.get_logger().info)


def config_of(node: rclpy.node.Node) -> LiveConfig:
    """Make a configuration from the parameters of a node, and declare those that were not given.

    Raises
    ------
    LineamentError
        If a parameter is not known.
    ValueError
        If a value is out of bounds.
    """
    for name in node.get_parameters_by_prefix(""):
        if name.partition(".")[0] not in (*KNOWN, OF_METHOD, *OF_ROS):
            raise LineamentError(
                f"parameter {name} is not known, expected one of "
                f"{', '.join(KNOWN)}, {OF_METHOD}.NAME"
            )
    for known in fields(LiveConfig):
        is_given = known.name not in KNOWN or node.has_parameter(known.name)
        if not is_given and known.default is not None:
            node.declare_parameter(known.name, known.default)
    given = {name: _value(node, name) for name in KNOWN if node.has_parameter(name)}
    of_method = {
        name: _value(node, f"{OF_METHOD}.{name}")
        for name in node.get_parameters_by_prefix(OF_METHOD)
    }
    return LiveConfig(name=node.get_name(), parameters=of_method, **given)


def _value(node: rclpy.node.Node, name: str) -> Any:
    value = node.get_parameter(name).value
    if name == "deskew" and value is False:
        return "off"  # so YAML reads it
    return value if isinstance(value, bool | int | float | str) else tuple(value)
