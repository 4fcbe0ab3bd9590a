"""Bags of ROS messages for tests and benchmarks, by the writers of rosbags and mcap."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

#: Every kind of bag that `write_bag` writes, by container, compression and serialisation.
KINDS = (
    *("rosbag1", "rosbag1-bz2", "rosbag1-lz4", "sqlite3", "sqlite3-zstd"),
    *("mcap", "mcap-lz4", "mcap-zstd", "mcap-plain", "mcap-bare", "mcap-ros1"),
)

#: Size from which a chunk is written [bytes]; small, so that small bags have several.
CHUNK = 4096
_TRANSFORMS = "tf2_msgs/msg/TFMessage"
_CODECS = {"lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}


@cache
def store(ros: int) -> Any:
    types = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    if _TRANSFORMS not in types.types:
        text = "geometry_msgs/TransformStamped[] transforms"
        types.register(get_types_from_msg(text, _TRANSFORMS))
    return types


def ros_of(kind: str) -> int:
    return 1 if "1" in kind else 2


def ending(kind: str) -> str:
    return {"rosbag1": ".bag", "sqlite3": "", "mcap": ".mcap"}[kind.partition("-")[0]]


class Messages:
    """Makes messages of ROS 1 or ROS 2; stamps in seconds."""

    def __init__(self, ros: int) -> None:
        self.ros = ros
        self._types = store(ros).types

    def _new(self, kind: str, *values: Any) -> Any:
        package, name = kind.split("/")
        return self._types[f"{package}/msg/{name}"](*values)

    def header(self, stamp: float, frame: str = "laser") -> Any:
        seconds = math.floor(stamp)
        time = self._new("builtin_interfaces/Time", seconds, round((stamp - seconds) * 1e9))
        return self._new("std_msgs/Header", *((0,) if self.ros == 1 else ()), time, frame)

    def _geometry(self, n: int, fields: dict[str, float]) -> list[float]:
        step = fields.get("angle_increment", 0.01)
        first = fields.get("angle_min", -0.5)
        return [
            *(first, first + (n - 1) * step, step),
            *(fields.get("time_increment", 0.0), fields.get("scan_time", 0.025)),
            *(fields.get("range_min", 0.1), fields.get("range_max", 30.0)),
        ]

    def scan(
        self,
        stamp: float,
        ranges: Sequence[float],
        intensities: Sequence[float] = (),
        frame: str = "laser",
        **fields: float,
    ) -> Any:
        return self._new(
            "sensor_msgs/LaserScan",
            self.header(stamp, frame),
            *self._geometry(len(ranges), fields),
            np.array(ranges, np.float32),
            np.array(intensities, np.float32),
        )

    def echoes(
        self,
        stamp: float,
        ranges: Sequence[Sequence[float]],
        intensities: Sequence[Sequence[float]] = (),
        **fields: float,
    ) -> Any:
        beams = [
            [self._new("sensor_msgs/LaserEcho", np.array(beam, np.float32)) for beam in beams]
            for beams in (ranges, intensities)
        ]
        geometry = self._geometry(len(ranges), fields)
        return self._new("sensor_msgs/MultiEchoLaserScan", self.header(stamp), *geometry, *beams)

    def cloud(self, stamp: float, points: np.ndarray, big_endian: bool = False) -> Any:
        """Make a cloud of a structured array of points, shape (height, width)."""
        kinds = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
        fields = [
            self._new("sensor_msgs/PointField", name, offset, kinds[kind.str[1:]], 1)
            for name, (kind, offset) in points.dtype.fields.items()
        ]
        height, width = points.shape
        step = points.dtype.itemsize
        data = np.frombuffer(points.tobytes(), np.uint8)
        return self._new(
            "sensor_msgs/PointCloud2",
            *(self.header(stamp), height, width, fields, big_endian, step, step * width),
            *(data, True),
        )

    def pose(self, x: float, y: float, theta: float) -> Any:
        return self._new(
            "geometry_msgs/Pose", self._new("geometry_msgs/Point", x, y, 0.3), self.turn(theta)
        )

    def turn(self, theta: float) -> Any:
        half = (0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2))
        return self._new("geometry_msgs/Quaternion", *half)

    def pose_stamped(self, stamp: float, *pose: float) -> Any:
        return self._new("geometry_msgs/PoseStamped", self.header(stamp, "map"), self.pose(*pose))

    def pose_with_covariance(self, stamp: float, *pose: float) -> Any:
        inner = self._new(
            "geometry_msgs/PoseWithCovariance", self.pose(*pose), np.zeros(36, np.float64)
        )
        header = self.header(stamp, "map")
        return self._new("geometry_msgs/PoseWithCovarianceStamped", header, inner)

    def odometry(self, stamp: float, *pose: float) -> Any:
        none = np.zeros(36, np.float64)
        zero = self._new("geometry_msgs/Vector3", 0.0, 0.0, 0.0)
        twist = self._new("geometry_msgs/Twist", zero, zero)
        return self._new(
            "nav_msgs/Odometry",
            *(self.header(stamp, "odom"), "base_link"),
            self._new("geometry_msgs/PoseWithCovariance", self.pose(*pose), none),
            self._new("geometry_msgs/TwistWithCovariance", twist, none),
        )

    def transform(self, stamp: float, parent: str, child: str, *pose: float) -> Any:
        x, y, theta = pose
        moved = self._new("geometry_msgs/Vector3", x, y, 0.3)
        inner = self._new("geometry_msgs/Transform", moved, self.turn(theta))
        header = self.header(stamp, parent)
        return self._new("geometry_msgs/TransformStamped", header, child, inner)

    def transforms(self, *each: Any) -> Any:
        return self._new("tf2_msgs/TFMessage", list(each))


def serialized(message: Any, ros: int) -> bytes:
    write = store(ros).serialize_ros1 if ros == 1 else store(ros).serialize_cdr
    return bytes(write(message, message.__msgtype__))


#: What is written: topic, time when it was received [ns], and the message or its type and bytes.
Item = tuple[str, int, Any]


def write_bag(path: Path, kind: str, items: Iterable[Item]) -> Path:
    """Write a bag of one of the `KINDS`; a folder for sqlite3. Messages come as the kind asks.

    An item's message may also be a pair of a type's name and bytes.
    """
    ros = ros_of(kind)
    packed = (
        (topic, time, *message)
        if isinstance(message, tuple)
        else (topic, time, message.__msgtype__, serialized(message, ros))
        for topic, time, message in items
    )
    container, _, codec = kind.partition("-")
    if container == "mcap":
        _write_mcap(path, codec, ros, packed)
    else:
        _write_rosbags(path, container, codec, ros, packed)
    return path


def _write_rosbags(path: Path, container: str, codec: str, ros: int, items: Any) -> None:
    if container == "rosbag1":
        writer = rosbag1.Writer(path)
        if codec:
            writer.set_compression(rosbag1.Writer.CompressionFormat[codec.upper()])
        writer.chunk_threshold = CHUNK
    else:
        writer = rosbag2.Writer(path, version=8)
        if codec:
            mode, form = rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD
            writer.set_compression(mode, form)
    connections: dict[str, Any] = {}
    with writer:
        for topic, time, kind, data in items:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store(ros))
            writer.write(connections[topic], time, data)


def _write_mcap(path: Path, codec: str, ros: int, items: Any) -> None:
    with path.open("wb") as file:
        writer = Writer(
            file,
            chunk_size=CHUNK,
            compression=_CODECS.get(codec, CompressionType.NONE),
            use_chunking=codec not in ("plain", "bare"),
            use_statistics=codec != "bare",
        )
        writer.start(f"ros{ros}")
        channels: dict[str, int] = {}
        for topic, time, kind, data in items:
            if topic not in channels:
                definition = store(ros).generate_msgdef(kind, ros_version=ros)[0]
                schema = writer.register_schema(
                    kind if ros == 2 else kind.replace("/msg/", "/"),
                    f"ros{ros}msg",
                    definition.encode(),
                )
                encoding = "cdr" if ros == 2 else "ros1"
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], time, data, time)
        writer.finish()
