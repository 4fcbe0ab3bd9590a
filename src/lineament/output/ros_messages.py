"""The messages of ROS as bytes: scans and features for RViz, and features for other nodes.

No objects are made on the way: these bytes are sent while a scanner runs.
"""

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..rosmsg.definitions import definition
from ..rosmsg.poses import IN_PLANE
from ..rosmsg.scans import CLOUD, POINT_TYPES
from ..rosmsg.wire import WireWriter
from ..scan import Array, LaserScan, Pose
from .feature_points import feature_points
from .markers import is_drawn
from .scene import ODOMETRY_FRAME, Layer, Message, Moment, SceneMessages, cloud_of, single

if TYPE_CHECKING:
    from ..motion import Tracks, Travel

# Numbers of visualization_msgs/Marker: its types and its actions.
LINE_LIST, SPHERE_LIST = 5, 7
ADD, DELETE = 0, 2
#: Position and orientation of a marker: those of its frame.
_AT_ORIGIN = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
#: Centroid of a segment that is not known.
_NOWHERE = np.full((1, 2), np.nan)


class RosMessages(SceneMessages):
    """Makes messages of ``sensor_msgs``, ``visualization_msgs``, ``tf2_msgs`` and the like.

    The encoding is ``cdr``, with the definitions of Humble, which later ones have too, or ``ros1``,
    with those of Noetic. Ranges are those of the scan, invalid ones too.
    """

    drawn = "markers"

    def __init__(self, encoding: str = "cdr") -> None:
        WireWriter(encoding)  # raises if there is no such encoding
        self._version = 2 if encoding == "cdr" else 1
        self.encoding, self.profile = encoding, f"ros{self._version}"

    def kind(self, name: str) -> str:
        """Name of a type in this ROS: ``sensor_msgs/LaserScan``, in ROS 2 with ``msg`` between."""
        return name.replace("/", "/msg/") if self._version == 2 else name

    def schema(self, kind: str) -> tuple[str, str, bytes]:
        """Name, encoding and text of the definition of a type, such as `Message.kind`."""
        text = definition(kind.replace("/msg/", "/"), self._version)
        return kind, f"ros{self._version}msg", text.encode()

    def transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """``tf2_msgs/TFMessage``: where the frame of the scan is in the world."""
        writer = WireWriter(self.encoding)
        writer.count(1)
        writer.header(moment.seconds, moment.nanoseconds, moment.world)
        writer.text(moment.frame)
        writer.numbers("7d", *_pose(pose))
        return self._message(topic, "tf2_msgs/TFMessage", writer)

    def odometry(self, topic: str, moment: Moment, travel: "Travel") -> Message:
        """``nav_msgs/Odometry``: pose in ``odom``, the frame of the first scan, and twist."""
        writer = self._begin(moment._replace(frame=ODOMETRY_FRAME))
        writer.text(moment.frame)
        writer.numbers("7d", *_pose(travel.pose))
        writer.array(_six(travel.covariance))
        vx, vy, turn_rate = travel.twist
        writer.numbers("6d", vx, vy, 0.0, 0.0, 0.0, turn_rate)
        writer.array(_six(travel.twist_covariance))
        return self._message(topic, "nav_msgs/Odometry", writer)

    def pose(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """``geometry_msgs/PoseStamped``, in the frame of the moment."""
        writer = self._begin(moment)
        writer.numbers("7d", *_pose(pose))
        return self._message(topic, "geometry_msgs/PoseStamped", writer)

    def placed(self, topic: str, moment: Moment, pose: Pose, covariance: Array) -> Message:
        """``geometry_msgs/PoseWithCovarianceStamped``, in the frame of the moment."""
        writer = self._begin(moment)
        writer.numbers("7d", *_pose(pose))
        writer.array(_six(covariance))
        return self._message(topic, "geometry_msgs/PoseWithCovarianceStamped", writer)

    def scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``sensor_msgs/LaserScan``; the end that is nearer to the stamp comes first."""
        last = scan.angle_min + (len(scan) - 1) * scan.angle_increment
        steps = np.array((scan.angle_increment, scan.time_increment, scan.scan_time))
        bearings, order = (scan.angle_min, last), 1
        if 2 * scan.stamp_beam > len(scan) - 1:
            bearings, order = (last, scan.angle_min), -1
        limits = scan.range_min, scan.range_max
        intensities = np.zeros(0) if scan.intensities is None else scan.intensities
        writer = self._begin(moment)
        writer.array(single(np.array((*bearings, *(order * steps), *limits))))
        writer.sequence(single(scan.ranges[::order]))
        writer.sequence(single(intensities[::order]))
        return self._message(topic, "sensor_msgs/LaserScan", writer)

    def points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``sensor_msgs/PointCloud2`` of the valid points: x, y, z and intensity."""
        names, cloud = cloud_of(scan)
        dtype = np.dtype([(name, "<f4") for name in names])
        return self._cloud(topic, moment, cloud.ravel().view(dtype), is_dense=True)

    def features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
        """``visualization_msgs/MarkerArray``: one marker a layer.

        It takes the place of the last one, or deletes it if it is empty.
        """
        writer = WireWriter(self.encoding)
        writer.count(len(layers))
        for layer in layers:
            is_spheres = len(layer.points) > 0
            vertices = layer.points if is_spheres else layer.pairs
            points = np.zeros((len(vertices), 3))
            points[:, 0], points[:, 1] = vertices.T  # one by one: three times as fast as both
            writer.header(moment.seconds, moment.nanoseconds, moment.frame)
            writer.text(layer.name)
            kind, action = SPHERE_LIST if is_spheres else LINE_LIST, ADD if len(points) else DELETE
            writer.numbers("3i", 0, kind, action)
            writer.numbers("10d", *_AT_ORIGIN, *(layer.size,) * 3)
            writer.numbers("4f", *layer.color)
            writer.numbers("2I", 0, 0)  # lifetime: until it is replaced
            writer.numbers("B", False)  # not locked to its frame
            writer.sequence(points)
            writer.raw(_marker_end(self.encoding), 4)
        return self._message(topic, "visualization_msgs/MarkerArray", writer)

    def corners(self, topic: str, moment: Moment, features: Features) -> Message:
        """``geometry_msgs/PoseArray`` of the corners that are finite.

        The x axis of each points to where the corner opens: halfway between its two sides. A
        corner with one segment looks along it; one without segments is not turned.
        """
        corners = features.corners[is_drawn(features.corners["position"])]
        yaw = _yaws(corners["position"], corners["segments"], features.segments["centroid"])
        poses = np.zeros((len(corners), 7))  # positions and quaternions
        poses[:, :2] = corners["position"]
        poses[:, 5], poses[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
        writer = self._begin(moment)
        writer.sequence(poses)
        return self._message(topic, "geometry_msgs/PoseArray", writer)

    def cloud(
        self, topic: str, moment: Moment, features: Features, tracks: "Tracks | None" = None
    ) -> Message:
        """``sensor_msgs/PointCloud2`` of `FEATURE_POINT`: one point a feature."""
        points = feature_points(features, tracks)
        # They are few: numpy would take longer.
        is_dense = all(map(math.isfinite, points["x"].tolist() + points["y"].tolist()))
        return self._cloud(topic, moment, points, is_dense)

    def diagnostics(
        self,
        topic: str,
        moment: Moment,
        name: str,
        hardware_id: str,
        level: int,
        summary: str,
        values: dict[str, str],
    ) -> Message:
        """``diagnostic_msgs/DiagnosticArray`` with one status: of what, and on which device.

        The level is 0 (OK), 1 (warning), 2 (error) or 3 (stale), else a ValueError; the summary is
        one line; the values have names.
        """
        if level not in range(4):
            raise ValueError(f"level is {level!r}, expected 0 (OK), 1 (warn), 2 (error), 3 (stale)")
        writer = self._begin(moment)
        writer.count(1)
        writer.numbers("B", level)
        for text in (name, summary, hardware_id):
            writer.text(text)
        writer.count(len(values))
        for key, value in values.items():
            writer.text(key)
            writer.text(value)
        return self._message(topic, "diagnostic_msgs/DiagnosticArray", writer)

    def _begin(self, moment: Moment) -> WireWriter:
        """Begin a message with the header that says when and where the scan was taken."""
        writer = WireWriter(self.encoding)
        writer.header(moment.seconds, moment.nanoseconds, moment.frame)
        return writer

    def _message(self, topic: str, kind: str, writer: WireWriter) -> Message:
        return Message(topic, self.kind(kind), writer.data)

    def _cloud(
        self, topic: str, moment: Moment, points: NDArray[np.void], is_dense: bool
    ) -> Message:
        writer = self._begin(moment)
        writer.numbers("2I", 1, len(points))  # height, width
        writer.raw(_fields(self.encoding, points.dtype), 4)
        writer.numbers("B", False)  # not big-endian
        writer.numbers("3I", points.itemsize, points.nbytes, points.nbytes)  # a point, all, data
        writer.raw(points.tobytes())
        writer.numbers("B", is_dense)
        return self._message(topic, CLOUD, writer)


def _pose(pose: Pose) -> tuple[float, ...]:
    """Position and quaternion of a pose in the plane."""
    x, y, theta = pose
    return x, y, 0.0, 0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2)


def _six(covariance: Array) -> Array:
    """Covariance of x, y, z and the turns about them, by that of (x, y, theta); else 0."""
    six = np.zeros((6, 6))
    six[IN_PLANE] = covariance
    return six


@cache
def _fields(encoding: str, dtype: np.dtype[Any]) -> bytes:
    """Pack the fields of a cloud, a sequence of PointField; in CDR for a multiple of 4 bytes."""
    writer = WireWriter(encoding)
    names = dtype.names or ()
    writer.count(len(names))
    for i, name in enumerate(names):  # each of them has 4 bytes
        writer.text(name)
        writer.count(4 * i)
        writer.numbers("B", 1 + POINT_TYPES.index(dtype[name].str[1:]))
        writer.count(1)
    return writer.body


@cache
def _marker_end(encoding: str) -> bytes:
    """Pack the empty fields of a marker behind its points; in CDR for a multiple of 4 bytes."""
    writer = WireWriter(encoding)
    writer.count(0)  # colors: all the same
    if encoding == "cdr":  # What Noetic does not have: a texture, and where it goes.
        writer.text("")
        writer.header(0, 0, "")
        writer.text("")
        writer.numbers("2I", 0, 0)
    writer.text("")  # no text
    writer.text("")  # no mesh, the bytes of which Noetic does not have either
    if encoding == "cdr":
        writer.text("")
        writer.count(0)
    writer.numbers("B", False)
    return writer.body


@np.errstate(over="ignore", invalid="ignore")  # What is not finite has no direction.
def _yaws(positions: Array, sides: NDArray[np.int32], centroids: Array) -> Array:
    """Direction halfway between the sides of each corner that are known [rad]; 0 if none is."""
    # A side that is not known is the last of the centroids.
    arms = np.concatenate((centroids, _NOWHERE))[sides] - positions[:, None]
    lengths = np.hypot(arms[..., 0], arms[..., 1])
    unknown = ~np.isfinite(lengths)
    arms[unknown], lengths[unknown] = 0.0, 1.0  # the other arm stays as it is
    # Both arms become as long as their product: nothing is divided by a length of zero.
    x, y = (arms * lengths[:, ::-1, None]).sum(axis=1).T
    yaws: Array = np.arctan2(y, x)
    yaws[np.isnan(yaws)] = 0
    return yaws
