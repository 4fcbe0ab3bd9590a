"""The node: `lineament live`, configured by parameters of ROS, as a lifecycle node."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import replace
from typing import Any

import rclpy
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions

from lineament import LineamentError
from lineament.live import LiveConfig, Node, Pipeline, RosSink, make_pipeline
from lineament.output.ros_messages import RosMessages
from lineament.tasks.warmup import warm_up

from .bridge import RclpyPublisher, RclpySource
from .parameters import DESCRIPTIONS, FIELDS, config_of

__all__ = ["Scanner", "main"]

#: Whether the node configures and activates itself; a manager does so otherwise.
AUTOSTART = "autostart"
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
        scanner = Scanner()
        try:
            scanner.spin(stopped.is_set)
        finally:
            scanner.destroy_node()
    except LineamentError as error:
        print(f"lineament: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


class Scanner(LifecycleNode):
    """A lifecycle node that finds features while it is active.

    Its parameters are read when it is configured: method and plan are loaded then. It subscribes
    and publishes while it is active. Parameters of `lineament.live.pipeline.CHANGEABLE` may be set
    while it is; others are refused until it is cleaned up.
    """

    def __init__(self) -> None:
        super().__init__(
            "lineament",
            automatically_declare_parameters_from_overrides=True,
            # Those of the method have names that depend on the method.
            allow_undeclared_parameters=True,
        )
        self._config: LiveConfig | None = None
        self._pipeline: Pipeline | None = None
        self._is_active = False
        self._why = ""
        for name, field in FIELDS.items():
            about = ParameterDescriptor(description=DESCRIPTIONS[name], dynamic_typing=True)
            if self.has_parameter(name):
                # What was given at the start would keep its type: 1, and never 1.5.
                self.set_descriptor(name, about)
            else:
                # An empty list has no type in ROS.
                self.declare_parameter(name, None if field.default == () else field.default, about)
        if not self.has_parameter(AUTOSTART):
            self.declare_parameter(AUTOSTART, True)
        self.add_on_set_parameters_callback(self.on_set)

    def spin(self, is_stopped: Callable[[], bool]) -> None:
        """Do what is asked for, and find features while active, until it is stopped.

        LineamentError if the node is to start by itself and cannot.
        """
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        try:
            if self.get_parameter(AUTOSTART).value:
                done = self.trigger_configure() == TransitionCallbackReturn.SUCCESS
                if not done:
                    raise LineamentError(self._why)
                self.trigger_activate()
            while not is_stopped() and self.context.ok():
                if self._is_active:
                    self._work(executor, lambda: is_stopped() or not self._is_active)
                else:
                    executor.spin_once(timeout_sec=0.1)
        finally:
            self._finish()
            executor.shutdown()

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Read the parameters, and load the method and the plan."""
        try:
            self._config = self._asked()
            self._pipeline = make_pipeline(self._config)
            # The first scan must not wait for kernels.
            warm_up([self._config.method])
        except (ValueError, LineamentError) as error:
            self._why = str(error)
            self.get_logger().error(self._why)
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Begin to listen."""
        self._is_active = True
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """End listening; tracks and the place on the plan stay known."""
        self._is_active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Write the map that was made, if any, and forget all that was seen."""
        self._finish()
        return super().on_cleanup(state)

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """End listening for good."""
        self._is_active = False
        self._finish()
        return super().on_shutdown(state)

    def on_set(self, changed: Iterable[Any]) -> SetParametersResult:
        """Take changed parameters over, or say in one line why not."""
        try:
            config = self._asked({one.name: one.value for one in changed})
            if self._pipeline is not None:
                self._pipeline.change(config)
                self._config = config
        except (ValueError, LineamentError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _asked(self, changed: dict[str, Any] | None = None) -> LiveConfig:
        """Return the configuration by the parameters as they are, or will be."""
        names = self.get_parameters_by_prefix("")
        given = {name: self.get_parameter(name).value for name in names} | (changed or {})
        others = (*OF_ROS, AUTOSTART)
        own = {name: v for name, v in given.items() if name.partition(".")[0] not in others}
        return config_of(own, name=self.get_name())

    def _finish(self) -> None:
        """Write the map that was made, if any, and end what runs beside the pipeline."""
        pipeline, self._pipeline, self._config = self._pipeline, None, None
        if pipeline is None:
            return
        with closing(pipeline):
            try:
                line = pipeline.save()
            except LineamentError as error:
                self.get_logger().error(str(error))
                return
        if line:
            self.get_logger().info(line)

    def _work(self, executor: SingleThreadedExecutor, is_stopped: Callable[[], bool]) -> None:
        """Find features until it is stopped."""
        assert self._config is not None
        assert self._pipeline is not None
        config = self._config
        # Names as ROS resolves them: with remappings and the namespace of the node.
        topics = {"topic": self.resolve_topic_name(config.topic)}
        topics["merge"] = tuple(map(self.resolve_topic_name, config.merge))
        for name in ("deskew", "odometry"):
            topic = str(getattr(config, name))
            if config.resolved(topic) == config.odometry_topic:
                topics[name] = self.resolve_topic_name(topic)
        resolved = replace(config, namespace=self.get_namespace(), **topics)
        with (
            closing(RclpySource(self, executor, resolved)) as source,
            closing(RclpyPublisher(self, config.depth)) as publisher,
        ):
            sink = RosSink(publisher, RosMessages("cdr"), resolved)
            Node(source, self._pipeline, [sink], write=self.get_logger().info).run(is_stopped)
