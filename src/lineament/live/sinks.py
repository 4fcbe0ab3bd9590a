"""Where a live node publishes what it found: topics of ROS, and Foxglove."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ..output.markers import markers_of
from ..output.ros_messages import RosMessages
from ..output.scene import LASER_FRAME, WORLD_FRAME, Layer, Moment, layers_of, world_of
from .config import LiveConfig
from .configured import plan_of
from .counters import Report
from .pipeline import Frame, stamp_of
from .plan_topics import DIAGNOSTICS, PlanTopics, Status, plan_layers
from .publisher import Publisher

if TYPE_CHECKING:
    from ..output.foxglove import FoxgloveMessages


class Sink(Protocol):
    """Where frames and reports go."""

    @property
    def unsent(self) -> int:
        """Messages that could not be sent."""

    def publish(self, frame: Frame) -> None:
        """Publish what was found in a scan."""

    def diagnose(self, report: Report, time: tuple[int, int]) -> None:
        """Publish how the node is doing."""


class RosSink:
    """Publishes features as a cloud, corners as poses, and markers, on topics below the scan's.

    Messages that have no listeners are not made.

    Parameters
    ----------
    publisher : Publisher
    messages : RosMessages
        Makes the messages.
    config : LiveConfig
        Features go to ``TOPIC/features`` (a point for each), ``TOPIC/corners`` and
        ``TOPIC/markers``; where they are tracked, the motion of the sensor goes to
        ``TOPIC/odometry``, the pose of what is docked to to ``TOPIC/dock``, and without its
        covariance to ``detected_dock_pose``; with a plan there are `PlanTopics`. The scans of a
        log are published too, with their poses on ``/tf``.
    """

    def __init__(self, publisher: Publisher, messages: RosMessages, config: LiveConfig) -> None:
        self._publisher, self._make, self._config = publisher, messages, config
        self._publishes_scan = config.log is not None
        self._topic = topic = config.scan_topic
        self._docked = config.resolved("detected_dock_pose")
        self._plan = PlanTopics(publisher, messages, config) if config.has_map else None
        topics = {
            f"{topic}/features": "sensor_msgs/PointCloud2",
            f"{topic}/corners": "geometry_msgs/PoseArray",
            f"{topic}/markers": "visualization_msgs/MarkerArray",
            DIAGNOSTICS: "diagnostic_msgs/DiagnosticArray",
        }
        if config.is_tracking:
            topics[f"{topic}/odometry"] = "nav_msgs/Odometry"
        if config.is_docking:
            topics[f"{topic}/dock"] = "geometry_msgs/PoseWithCovarianceStamped"
            topics[self._docked] = "geometry_msgs/PoseStamped"
        if self._publishes_scan:
            topics |= {"/tf": "tf2_msgs/TFMessage", topic: "sensor_msgs/LaserScan"}
            topics[f"{topic}/points"] = "sensor_msgs/PointCloud2"
        for name, kind in topics.items():
            publisher.advertise(name, messages.kind(kind))

    @property
    def unsent(self) -> int:
        """Messages that could not be sent."""
        return self._publisher.unsent

    def publish(self, frame: Frame) -> None:
        """Publish what was found in a scan; the cloud first, since programs wait for it."""
        make, topic, scan, features = self._make, self._topic, frame.scan, frame.features
        # A log may name no frame, but /tf needs a name.
        moment = _moment(frame, scan.frame_id or (LASER_FRAME if self._publishes_scan else ""))
        if frame.where is not None:
            moment = moment._replace(world=self._config.odom_frame)  # which is on the plan
        offer = self._publisher.offer
        offer(f"{topic}/features", lambda to: make.cloud(to, moment, features, frame.tracks))
        offer(f"{topic}/corners", lambda to: make.corners(to, moment, features))
        offer(
            f"{topic}/markers",
            lambda to: make.features(to, moment, layers_of(markers_of(features, frame.straight))),
        )
        if (travel := frame.travel) is not None:
            offer(f"{topic}/odometry", lambda to: make.odometry(to, moment, travel))
        if (dock := frame.dock) is not None:
            offer(f"{topic}/dock", lambda to: make.placed(to, moment, dock.pose, dock.covariance))
            offer(self._docked, lambda to: make.pose(to, moment, dock.pose))
        if self._publishes_scan:
            if (seen_from := scan.pose) is not None:
                offer("/tf", lambda to: make.transform(to, moment, seen_from))
            if scan.is_regular:
                offer(topic, lambda to: make.scan(to, moment, scan))
            else:
                offer(f"{topic}/points", lambda to: make.points(to, moment, scan))
        if self._plan is not None:
            self._plan.publish(frame, moment)

    def diagnose(self, report: Report, time: tuple[int, int]) -> None:
        """Publish the report on ``/diagnostics``, and the verdict on the last pose."""
        status = Status(self._topic, report.level, str(report), report.values)
        self._publisher.publish(status.message(self._make, self._config, DIAGNOSTICS, time))
        if self._plan is not None:
            self._plan.diagnose(time, is_stale=not report.since.scans)


class FoxgloveSink:
    """Publishes scans, their poses and the layers of their features, as in a recording.

    Parameters
    ----------
    publisher : Publisher
    messages : FoxgloveMessages
        Makes the messages.
    config : LiveConfig
        Scans go to its topic, the layers of features to ``TOPIC/features``; with a plan, its walls
        to ``TOPIC/plan``, and scans are placed on it, where that is known.
    """

    def __init__(
        self, publisher: Publisher, messages: FoxgloveMessages, config: LiveConfig
    ) -> None:
        self._publisher, self._messages = publisher, messages
        self._topic = topic = config.scan_topic
        self._topics = {
            "/tf": "FrameTransform",
            topic: "LaserScan",
            f"{topic}/points": "PointCloud",  # of a scan that is irregular since it was deskewed
            f"{topic}/features": "SceneUpdate",
        }
        self._plan: tuple[Layer, ...] = ()
        if (plan := plan_of(config)) is not None:
            self._plan = plan_layers(plan)
        if config.mapping is not None or self._plan:
            self._topics[f"{topic}/plan"] = "SceneUpdate"
        for name, kind in self._topics.items():
            publisher.advertise(name, kind)

    @property
    def unsent(self) -> int:
        """Messages that could not be sent."""
        return self._publisher.unsent

    def publish(self, frame: Frame) -> None:
        """Publish the deskewed scan and its features, if anybody listens to any of the topics."""
        if frame.plan is not None:
            self._plan = plan_layers(frame.plan)
        if not any(map(self._publisher.listeners, self._topics)):
            return
        scan, where = frame.straight, frame.where
        layers = layers_of(markers_of(frame.features, scan))
        if where is not None:
            scan = scan.with_pose(where.pose if where.is_known else None)
        moment = _moment(frame, scan.frame_id or LASER_FRAME)
        for message in self._messages.messages(self._topic, moment, scan, layers):
            self._publisher.publish(message)

    def diagnose(self, report: Report, time: tuple[int, int]) -> None:  # noqa: ARG002
        """Publish the plan again, for who has come since."""
        moment, plan, make = Moment(*time, WORLD_FRAME, ""), self._plan, self._messages
        if plan:
            self._publisher.offer(f"{self._topic}/plan", lambda to: make.features(to, moment, plan))


def _moment(frame: Frame, name: str) -> Moment:
    """Make the moment of a scan, with the exact stamp of its message and this frame."""
    return Moment(*stamp_of(frame.scan.stamp_ns), name, world_of(name))
