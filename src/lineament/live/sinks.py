"""Where a live node tells what it found: topics of ROS, and Foxglove."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ..output.markers import markers_of
from ..output.ros_messages import RosMessages
from ..output.scene import LASER_FRAME, WORLD_FRAME, Message, Moment, layers_of
from ..scan import LaserScan
from .counters import Report
from .pipeline import Frame
from .received import Time

if TYPE_CHECKING:
    from ..output.foxglove import FoxgloveMessages

__all__ = ["FoxgloveSink", "Publisher", "RosSink", "Sink"]

DIAGNOSTICS = "/diagnostics"

#: Topics below that of the scans, and their types.
_BELOW = {
    "features": "sensor_msgs/PointCloud2",
    "corners": "geometry_msgs/PoseArray",
    "markers": "visualization_msgs/MarkerArray",
}


class Publisher(Protocol):
    """What carries messages: DDS, ROS 1, a WebSocket."""

    @property
    def unsent(self) -> int:
        """Messages that could not be sent."""

    def advertise(self, topic: str, kind: str) -> None:
        """Make a topic known, so that others can listen to it before there is a message."""

    def publish(self, message: Message) -> None:
        """Send a message."""

    def listeners(self, topic: str) -> int:
        """How many listen to a topic: what nobody listens to need not be made."""

    def close(self) -> None:
        """Stop."""


class Sink(Protocol):
    """Where frames and reports go."""

    @property
    def unsent(self) -> int:
        """Messages that could not be sent."""

    def tell(self, frame: Frame) -> None:
        """Tell what was found in a scan."""

    def diagnose(self, report: Report, time: Time) -> None:
        """Tell how the node is."""

    def close(self) -> None:
        """Stop."""


class RosSink:
    """Tells features as a cloud, corners as poses, and markers, each below the scan's topic.

    Parameters
    ----------
    publisher : Publisher
    messages : RosMessages
        Makes the messages.
    topic : str
        Topic of the scans: what is found goes to ``TOPIC/features`` (a point a feature),
        ``TOPIC/corners`` and ``TOPIC/markers``.
    name : str
        Name of the node, in diagnostics.
    tells_scan : bool
        Whether scans and their poses are told too, since a log has no publisher of its own.
    """

    def __init__(
        self,
        publisher: Publisher,
        messages: RosMessages,
        topic: str,
        name: str,
        *,
        tells_scan: bool = False,
    ) -> None:
        self._publisher, self._messages = publisher, messages
        self._topic, self._name, self._tells_scan = topic, name, tells_scan
        topics = {f"{topic}/{below}": kind for below, kind in _BELOW.items()}
        topics[DIAGNOSTICS] = "diagnostic_msgs/DiagnosticArray"
        if tells_scan:
            topics |= {"/tf": "tf2_msgs/TFMessage", topic: "sensor_msgs/LaserScan"}
            topics[f"{topic}/points"] = "sensor_msgs/PointCloud2"
        for name_of_topic, kind in topics.items():
            publisher.advertise(name_of_topic, messages.kind(kind))

    @property
    def unsent(self) -> int:
        """Messages that could not be sent."""
        return self._publisher.unsent

    def tell(self, frame: Frame) -> None:
        """Tell what was found in a scan; the cloud first, since programs wait for it."""
        publisher, make, topic = self._publisher, self._messages, self._topic
        # A log may name no frame; where its scans are told too, all of it is in one that has a
        # name, for /tf knows no other.
        name = frame.scan.frame_id or (LASER_FRAME if self._tells_scan else "")
        moment = _moment(frame, name)
        features = frame.features
        if publisher.listeners(f"{topic}/features"):
            publisher.publish(make.cloud(f"{topic}/features", moment, features, frame.tracks))
        if publisher.listeners(f"{topic}/corners"):
            publisher.publish(make.corners(f"{topic}/corners", moment, features))
        if publisher.listeners(f"{topic}/markers"):
            layers = layers_of(markers_of(features, frame.straight))
            publisher.publish(make.features(f"{topic}/markers", moment, layers))
        if self._tells_scan:
            self._tell_scan(moment, frame.scan)

    def _tell_scan(self, moment: Moment, scan: LaserScan) -> None:
        publisher, make, topic = self._publisher, self._messages, self._topic
        if scan.pose is not None and publisher.listeners("/tf"):
            publisher.publish(make.transform("/tf", moment, scan.pose))
        if scan.is_regular and publisher.listeners(topic):
            publisher.publish(make.scan(topic, moment, scan))
        elif not scan.is_regular and publisher.listeners(f"{topic}/points"):
            publisher.publish(make.points(f"{topic}/points", moment, scan))

    def diagnose(self, report: Report, time: Time) -> None:
        """Tell how the node is, on ``/diagnostics``."""
        moment = Moment(*time, "", "")
        self._publisher.publish(
            self._messages.diagnostics(
                DIAGNOSTICS,
                moment,
                name=f"{self._name}: {self._topic}",
                hardware_id=self._topic,
                level=report.level,
                summary=str(report),
                values=report.values,
            )
        )

    def close(self) -> None:
        """Stop."""
        self._publisher.close()


class FoxgloveSink:
    """Tells scans, their poses and the layers of their features, as a recording of them has it.

    Parameters
    ----------
    publisher : Publisher
    messages : FoxgloveMessages
        Makes the messages.
    topic : str
        Topic of the scans; the layers go to ``TOPIC/features``.
    """

    def __init__(self, publisher: Publisher, messages: FoxgloveMessages, topic: str) -> None:
        self._publisher, self._messages, self._topic = publisher, messages, topic
        self._topics = {"/tf": "FrameTransform", topic: "LaserScan"}
        # A scan that was made straight is no regular one any more.
        self._topics |= {f"{topic}/points": "PointCloud", f"{topic}/features": "SceneUpdate"}
        for name, kind in self._topics.items():
            publisher.advertise(name, kind)

    @property
    def unsent(self) -> int:
        """Messages that could not be sent."""
        return self._publisher.unsent

    def tell(self, frame: Frame) -> None:
        """Tell what was found in a scan, and the scan made straight, where somebody looks on."""
        if not any(map(self._publisher.listeners, self._topics)):
            return
        scan = frame.straight
        layers = layers_of(markers_of(frame.features, scan))
        moment = _moment(frame, scan.frame_id or LASER_FRAME)
        for message in self._messages.messages(self._topic, moment, scan, layers):
            self._publisher.publish(message)

    def diagnose(self, report: Report, time: Time) -> None:
        """Tell nothing: the picture shows it."""

    def close(self) -> None:
        """Stop."""
        self._publisher.close()


def _moment(frame: Frame, name: str) -> Moment:
    """When the scan was taken, exactly as its message says, in the frame of this name."""
    return Moment(*frame.time, name, "world" if name == WORLD_FRAME else WORLD_FRAME)
