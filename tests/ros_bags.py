"""Bags of ROS messages for tests and benchmarks, by the writers of rosbags and mcap."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lineament import LaserScan, LogError
from lineament.logs import open_log

#: Every kind of bag that `write_bag` writes, by container, compression and serialisation.
KINDS = (
    *("rosbag1", "rosbag1-bz2", "rosbag1-lz4", "sqlite3", "sqlite3-zstd"),
    *("mcap", "mcap-lz4", "mcap-zstd", "mcap-plain", "mcap-bare", "mcap-ros1"),
)
every_kind = pytest.mark.parametrize("kind", KINDS)

#: Size from which a chunk is written [bytes]; small, so that small bags have several.
CHUNK = 4096
_TRANSFORMS = "tf2_msgs/msg/TFMessage"
_ENDINGS = {"rosbag1": ".bag", "sqlite3": "", "mcap": ".mcap"}
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


class Messages:
    """Makes messages of ROS 1 or ROS 2; stamps in seconds."""

    def __init__(self, ros: int) -> None:
        self.ros = ros

    def new(self, kind: str, *values: Any) -> Any:
        """Make a message of its fields; messages in it may be tuples of theirs."""
        types = store(self.ros)
        name = kind if "/msg/" in kind else kind.replace("/", "/msg/")

        def field(form: tuple, value: Any) -> Any:
            if form[0] == Nodetype.NAME and isinstance(value, tuple):
                return self.new(form[1], *value)
            if form[0] == Nodetype.SEQUENCE and isinstance(value, list):
                return [field(form[1][0], each) for each in value]
            return value

        fields = types.get_msgdef(name).fields
        return types.types[name](
            *(field(form, value) for (_, form), value in zip(fields, values, strict=True))
        )

    def header(self, stamp: float, frame: str = "laser") -> Any:
        seconds = math.floor(stamp)
        time = seconds, round((stamp - seconds) * 1e9)
        return self.new("std_msgs/Header", *((0,) if self.ros == 1 else ()), time, frame)

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
        values = np.array(ranges, np.float32), np.array(intensities, np.float32)
        geometry = self._geometry(len(ranges), fields)
        return self.new("sensor_msgs/LaserScan", self.header(stamp, frame), *geometry, *values)

    def of(self, scan: LaserScan) -> Any:
        """Make the message of a scan: its ranges, bearings, stamp and frame."""
        fields = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
        return self.scan(scan.stamp, scan.ranges, frame=scan.frame_id, **fields)

    def echoes(
        self,
        stamp: float,
        ranges: Sequence[Sequence[float]],
        intensities: Sequence[Sequence[float]] = (),
        **fields: float,
    ) -> Any:
        beams = [[(np.array(beam, np.float32),) for beam in each] for each in (ranges, intensities)]
        geometry = self._geometry(len(ranges), fields)
        return self.new("sensor_msgs/MultiEchoLaserScan", self.header(stamp), *geometry, *beams)

    def cloud(self, stamp: float, points: np.ndarray, big_endian: bool = False) -> Any:
        """Make a cloud of a structured array of points, shape (height, width)."""
        kinds = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
        fields = [
            (name, offset, kinds[kind.str[1:]], 1)
            for name, (kind, offset) in points.dtype.fields.items()
        ]
        height, width = points.shape
        step = points.dtype.itemsize
        data = np.frombuffer(points.tobytes(), np.uint8)
        layout = fields, big_endian, step, step * width, data, True
        return self.new("sensor_msgs/PointCloud2", self.header(stamp), height, width, *layout)

    def _placed(self, x: float, y: float, theta: float) -> tuple:
        """A position or translation, and a quaternion."""
        return (x, y, 0.3), (0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2))

    def pose_stamped(self, stamp: float, *pose: float) -> Any:
        return self.new("geometry_msgs/PoseStamped", self.header(stamp, "map"), self._placed(*pose))

    def pose_with_covariance(self, stamp: float, *pose: float) -> Any:
        inner = self._placed(*pose), np.zeros(36)
        header = self.header(stamp, "map")
        return self.new("geometry_msgs/PoseWithCovarianceStamped", header, inner)

    def odometry(self, stamp: float, *pose: float) -> Any:
        twist = ((1.5, -0.5, 7.0), (7.0, 7.0, 0.25)), np.zeros(36)
        names = self.header(stamp, "odom"), "base_link"
        return self.new("nav_msgs/Odometry", *names, (self._placed(*pose), np.zeros(36)), twist)

    def transform(self, stamp: float, parent: str, child: str, *pose: float) -> Any:
        header = self.header(stamp, parent)
        return self.new("geometry_msgs/TransformStamped", header, child, self._placed(*pose))

    def mountings(self, places: Mapping[str, tuple[float, float, float]]) -> Any:
        """Say where scanners are on a robot, by their topics: frames are named as these."""
        links = (self.transform(0.0, "base_link", name[1:], *at) for name, at in places.items())
        return self.transforms(*links)

    def transforms(self, *each: Any) -> Any:
        return self.new("tf2_msgs/TFMessage", list(each))


def serialized(message: Any, ros: int) -> bytes:
    write = store(ros).serialize_ros1 if ros == 1 else store(ros).serialize_cdr
    return bytes(write(message, message.__msgtype__))


#: What is written: topic, time when it was received [ns], and the message or its type and bytes.
Item = tuple[str, int, Any]


def write(folder: Path, kind: str, items: Iterable[Item], name: str = "log") -> Path:
    """Write a bag of one of the `KINDS` into a folder, with the usual ending; sqlite3 is a folder.

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
    path = folder / f"{name}{_ENDINGS[container]}"
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
                text = store(ros).generate_msgdef(kind, ros_version=ros)[0]
                name = kind if ros == 2 else kind.replace("/msg/", "/")
                schema = writer.register_schema(name, f"ros{ros}msg", text.encode())
                encoding = "cdr" if ros == 2 else "ros1"
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], time, data, time)
        writer.finish()


# Bags of scans that can be known again, and what is read of them


def ranges_of(stamp: float) -> np.ndarray:
    """Ranges of the scan with a stamp."""
    return (1.0 + stamp + 0.01 * np.arange(40)).astype(np.float32)


def read(path: Path, **options: Any) -> tuple[list, str | None]:
    """Read scans up to the first error, which is one line: them, and what it says."""
    scans, line = [], ""
    try:
        scans.extend(open_log(path, **options))
    except LogError as error:  # Whoever keeps the error keeps the log, too.
        line, problem = str(error), error.problem
    assert line.isprintable()
    assert line.startswith(str(path)) or not line
    return scans, problem if line else None
