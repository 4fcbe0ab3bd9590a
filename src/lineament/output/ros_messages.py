"""The messages of ROS as bytes: scans and features for RViz, and features for other nodes.

Nothing of ROS is needed, and no objects are made on the way: these bytes are sent while a scanner
runs.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..rosmsg.wire import WireWriter as Packer
from ..scan import LaserScan, Pose
from .feature_points import feature_points
from .layers import Layer
from .markers import Array, is_drawn
from .scene import Message, Moment, SceneMessages, cloud_of, single

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    from ..motion import Tracks

__all__ = ["RosMessages"]

# Numbers of visualization_msgs/Marker: its types and its actions.
LINE_LIST, SPHERE_LIST = 5, 7
ADD, DELETE = 0, 2
#: Numbers of sensor_msgs/PointField.
FIELD_TYPES = {"<i4": 5, "<u4": 6, "<f4": 7}
#: Levels of diagnostic_msgs/DiagnosticStatus: OK, WARN, ERROR, STALE.
LEVELS = range(4)

#: Centroid of a segment that is not there.
_NOWHERE = np.full((1, 2), np.nan)
ORIGIN, UPRIGHT = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)


class RosMessages(SceneMessages):
    """Makes messages of ``sensor_msgs``, ``visualization_msgs``, ``tf2_msgs`` and the like.

    The definitions are those of Humble, which later ones have too, or of Noetic. Ranges are told
    as they are in the scan, invalid ones too.

    Parameters
    ----------
    encoding : str
        ``cdr``, as in ROS 2, or ``ros1``.

    Raises
    ------
    ValueError
        If the encoding is another one.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01)
    >>> message = RosMessages("cdr").cloud("/features", Moment.of(scan), ln.extract(scan))
    >>> message.kind
    'sensor_msgs/msg/PointCloud2'
    """

    def __init__(self, encoding: str = "cdr") -> None:
        Packer(encoding)  # knows which there are
        self._is_cdr = encoding == "cdr"
        self.encoding, self.profile = encoding, "ros2" if self._is_cdr else "ros1"

    def kind(self, name: str) -> str:
        """Name of a type in this ROS: ``sensor_msgs/LaserScan``, in ROS 2 with ``msg`` between."""
        return name.replace("/", "/msg/") if self._is_cdr else name

    def schema(self, kind: str) -> tuple[str, str, bytes]:
        """Name, encoding and text of the definition of a type, such as `Message.kind`."""
        version = 2 if self._is_cdr else 1
        full = kind if self._is_cdr else kind.replace("/", "/msg/")
        text, _ = _definitions(version).generate_msgdef(full, ros_version=version)
        return kind, f"ros{version}msg", text.encode()

    def transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """``tf2_msgs/TFMessage``: where the frame of the scan is in the world."""
        x, y, theta = pose
        packer = Packer(self.encoding)
        packer.count(1)
        packer.header(moment.seconds, moment.nanoseconds, moment.world)
        packer.text(moment.frame)
        packer.numbers("7d", x, y, 0.0, 0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2))
        return self._message(topic, "tf2_msgs/TFMessage", packer)

    def scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``sensor_msgs/LaserScan``."""
        geometry = (
            scan.angle_min,
            scan.angle_min + (len(scan) - 1) * scan.angle_increment,
            *(scan.angle_increment, scan.time_increment, scan.scan_time),
            *(scan.range_min, scan.range_max),
        )
        packer = self._begin(moment)
        packer.array(single(np.array(geometry)))
        packer.sequence(single(scan.ranges))
        packer.sequence(single(np.zeros(0) if scan.intensities is None else scan.intensities))
        return self._message(topic, "sensor_msgs/LaserScan", packer)

    def points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``sensor_msgs/PointCloud2`` of the valid points: x, y, z and intensity."""
        names, cloud = cloud_of(scan)
        dtype = np.dtype([(name, "<f4") for name in names])
        return self._cloud(topic, moment, cloud.ravel().view(dtype), is_dense=True)

    def features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
        """``visualization_msgs/MarkerArray``: one marker a layer."""
        packer = Packer(self.encoding)
        packer.count(len(layers))
        for layer in layers:
            self._put_marker(packer, moment, layer)
        return self._message(topic, "visualization_msgs/MarkerArray", packer)

    def corners(self, topic: str, moment: Moment, features: Features) -> Message:
        """``geometry_msgs/PoseArray`` of the corners that are finite.

        The x axis of each points to where the corner opens: halfway between its two sides. A
        corner with one segment, as an edge, looks along it; one without segments is not turned.
        """
        packer = self._begin(moment)
        packer.sequence(_corner_poses(features))
        return self._message(topic, "geometry_msgs/PoseArray", packer)

    def cloud(
        self, topic: str, moment: Moment, features: Features, tracks: Tracks | None = None
    ) -> Message:
        """``sensor_msgs/PointCloud2`` of `FEATURE_POINT`: one point a feature, all that is known.

        Raises
        ------
        ValueError
            If the tracks are those of other features.
        """
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
        """``diagnostic_msgs/DiagnosticArray`` with one status.

        Parameters
        ----------
        topic, moment
            As for all messages.
        name, hardware_id : str
            What is told of, and on which device.
        level : int
            0 for OK, 1 for a warning, 2 for an error, 3 for stale.
        summary : str
            The state in one line.
        values : dict
            Names and values of what was measured.

        Raises
        ------
        ValueError
            If there is no such level.
        """
        if level not in LEVELS:
            raise ValueError(f"level is {level!r}, expected 0 (OK), 1 (warn), 2 (error), 3 (stale)")
        packer = self._begin(moment)
        packer.count(1)
        packer.numbers("B", level)
        for text in (name, summary, hardware_id):
            packer.text(text)
        packer.count(len(values))
        for pair in values.items():
            for text in pair:
                packer.text(text)
        return self._message(topic, "diagnostic_msgs/DiagnosticArray", packer)

    def _begin(self, moment: Moment) -> Packer:
        """Begin a message with the header that says when and where the scan was taken."""
        packer = Packer(self.encoding)
        packer.header(moment.seconds, moment.nanoseconds, moment.frame)
        return packer

    def _message(self, topic: str, kind: str, packer: Packer) -> Message:
        return Message(topic, self.kind(kind), packer.data)

    def _cloud(
        self, topic: str, moment: Moment, points: NDArray[np.void], is_dense: bool
    ) -> Message:
        packer = self._begin(moment)
        packer.numbers("2I", 1, len(points))  # height, width
        packer.raw(_fields(self.encoding, points.dtype), 4)
        packer.numbers("B", False)  # not big-endian
        packer.numbers("3I", points.itemsize, points.nbytes, points.nbytes)  # a point, all, data
        packer.raw(points.tobytes())
        packer.numbers("B", is_dense)
        return self._message(topic, "sensor_msgs/PointCloud2", packer)

    def _put_marker(self, packer: Packer, moment: Moment, layer: Layer) -> None:
        """One marker a layer; it takes the place of the last, or deletes it if it is empty."""
        is_spheres = len(layer.points) > 0
        vertices = layer.points if is_spheres else layer.pairs
        points = np.zeros((len(vertices), 3))
        points[:, 0], points[:, 1] = vertices.T  # one by one: three times as fast as both
        packer.header(moment.seconds, moment.nanoseconds, moment.frame)
        packer.text(layer.name)
        packer.numbers(
            "3i", 0, SPHERE_LIST if is_spheres else LINE_LIST, ADD if len(points) else DELETE
        )
        packer.numbers("10d", *ORIGIN, *UPRIGHT, *(layer.size,) * 3)
        packer.numbers("4f", *layer.color)
        packer.numbers("2I", 0, 0)  # lifetime: until it is replaced
        packer.numbers("B", False)  # not locked to its frame
        packer.sequence(points)
        packer.raw(_marker_end(self.encoding), 4)


@cache
def _definitions(version: int) -> Typestore:
    """Load the definitions of ROS 1 (Noetic) or ROS 2 (Humble)."""
    # Here, as nothing but the text in a file needs them.
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if version == 2:
        return get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.ROS1_NOETIC)
    text = "geometry_msgs/TransformStamped[] transforms"
    store.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
    return store


@cache
def _fields(encoding: str, dtype: np.dtype[Any]) -> bytes:
    """Pack the fields of a cloud, a sequence of PointField; in CDR for a multiple of 4 bytes."""
    packer = Packer(encoding)
    n = len(packer.data)  # of what is before the first field of a message
    names = dtype.names or ()
    packer.count(len(names))
    for i, name in enumerate(names):  # all of one word
        packer.text(name)
        packer.count(4 * i)
        packer.numbers("B", FIELD_TYPES[dtype[name].str])
        packer.count(1)
    return packer.data[n:]


@cache
def _marker_end(encoding: str) -> bytes:
    """Pack what a marker has behind its points: nothing; in CDR for a multiple of 4 bytes."""
    packer = Packer(encoding)
    n = len(packer.data)
    packer.count(0)  # colors: all the same
    if encoding == "cdr":  # What Noetic does not have: a texture, and where it goes.
        packer.text("")
        packer.header(0, 0, "")
        packer.text("")
        packer.numbers("2I", 0, 0)
    packer.text("")  # no text
    packer.text("")  # no mesh, the bytes of which Noetic does not have either
    if encoding == "cdr":
        packer.text("")
        packer.count(0)
    packer.numbers("B", False)
    return packer.data[n:]


def _corner_poses(features: Features) -> Array:
    """Position and quaternion of each corner that is drawn, shape (n, 7)."""
    corners = features.corners[is_drawn(features.corners["position"])]
    yaw = _yaws(corners["position"], corners["segments"], features.segments["centroid"])
    poses = np.zeros((len(corners), 7))
    poses[:, :2] = corners["position"]
    poses[:, 5], poses[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
    return poses


@np.errstate(over="ignore", invalid="ignore")  # What is not finite has no direction.
def _yaws(positions: Array, sides: NDArray[np.int32], centroids: Array) -> Array:
    """Direction halfway between the sides of each corner that are known [rad]; 0 if none is."""
    # A side that is not known is the last of the centroids.
    arms = np.concatenate((centroids, _NOWHERE))[sides] - positions[:, None]
    lengths = np.hypot(arms[..., 0], arms[..., 1])
    unknown = ~np.isfinite(lengths)
    arms[unknown], lengths[unknown] = 0.0, 1.0  # the other arm stays as it is
    # Both arms made as long as their product: nothing is divided by a length of zero.
    x, y = (arms * lengths[:, ::-1, None]).sum(axis=1).T
    yaws: Array = np.arctan2(y, x)
    yaws[np.isnan(yaws)] = 0
    return yaws
