"""MCAP with the messages of ROS 2, in CDR: for RViz, ``ros2 bag play`` and Foxglove."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from ..scan import LaserScan, Pose
from .layers import Layer
from .mcap import McapWriter, Message, Moment, cloud_of, single

__all__ = ["Ros2Writer"]

SCAN, CLOUD = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"
MARKERS, TRANSFORMS = "visualization_msgs/msg/MarkerArray", "tf2_msgs/msg/TFMessage"

_STORE = get_typestore(Stores.ROS2_HUMBLE)
_TYPES: dict[str, Any] = {name.rpartition("/")[2]: kind for name, kind in _STORE.types.items()}


class Ros2Writer(McapWriter):
    """Writes ``sensor_msgs/LaserScan``, ``visualization_msgs/MarkerArray`` and ``tf2_msgs``.

    The definitions are those of Humble; later ones have the same. Ranges are told as they are in
    the scan, invalid ones too.
    """

    profile, encoding = "ros2", "cdr"

    def _schema(self, kind: str) -> tuple[str, str, bytes]:
        text, _ = _STORE.generate_msgdef(kind, ros_version=2)
        return kind, "ros2msg", text.encode()

    def _transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        x, y, theta = pose
        transform = _make(
            "TransformStamped",
            header=_header(moment, moment.world),
            child_frame_id=moment.frame,
            transform=_make(
                "Transform",
                translation=_make("Vector3", x=x, y=y, z=0.0),
                rotation=_rotation(theta),
            ),
        )
        return _message(topic, TRANSFORMS, _make("TFMessage", transforms=[transform]))

    def _scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        return _message(
            topic,
            SCAN,
            _make(
                "LaserScan",
                header=_header(moment, moment.frame),
                angle_min=scan.angle_min,
                angle_max=scan.angle_min + (len(scan) - 1) * scan.angle_increment,
                angle_increment=scan.angle_increment,
                time_increment=scan.time_increment,
                scan_time=scan.scan_time,
                range_min=scan.range_min,
                range_max=scan.range_max,
                ranges=single(scan.ranges),
                intensities=single(np.zeros(0) if scan.intensities is None else scan.intensities),
            ),
        )

    def _points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        names, cloud = cloud_of(scan)
        number = _TYPES["PointField"].FLOAT32
        fields = [
            _make("PointField", name=name, offset=4 * k, datatype=number, count=1)
            for k, name in enumerate(names)
        ]
        data = np.frombuffer(cloud.tobytes(), np.uint8)
        return _message(
            topic,
            CLOUD,
            _make(
                "PointCloud2",
                header=_header(moment, moment.frame),
                height=1,
                width=len(cloud),
                fields=fields,
                is_bigendian=False,
                point_step=4 * len(names),
                row_step=len(data),
                data=data,
                is_dense=True,
            ),
        )

    def _features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
        markers = [_marker(moment, layer) for layer in layers]
        return _message(topic, MARKERS, _make("MarkerArray", markers=markers))


def _make(kind: str, /, **fields: Any) -> Any:
    return _TYPES[kind](**fields)


def _message(topic: str, kind: str, message: Any) -> Message:
    return Message(topic, kind, bytes(_STORE.serialize_cdr(message, kind)))


def _header(moment: Moment, frame: str) -> Any:
    stamp = _make("Time", sec=moment.seconds, nanosec=moment.nanoseconds)
    return _make("Header", stamp=stamp, frame_id=frame)


def _rotation(theta: float) -> Any:
    return _make("Quaternion", x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2))


def _point(point: tuple[float, float]) -> Any:
    return _make("Point", x=point[0], y=point[1], z=0.0)


def _marker(moment: Moment, layer: Layer) -> Any:
    """One marker a layer; it takes the place of the last, or deletes it where nothing is drawn."""
    kind = _TYPES["Marker"]
    is_spheres = len(layer.points) > 0
    points = layer.points if is_spheres else layer.pairs
    r, g, b, a = layer.color
    return kind(
        header=_header(moment, moment.frame),
        ns=layer.name,
        id=0,
        type=kind.SPHERE_LIST if is_spheres else kind.LINE_LIST,
        action=kind.ADD if len(points) else kind.DELETE,
        pose=_make("Pose", position=_point((0.0, 0.0)), orientation=_rotation(0.0)),
        scale=_make("Vector3", **dict.fromkeys("xyz", layer.size)),
        color=_make("ColorRGBA", r=r, g=g, b=b, a=a),
        lifetime=_make("Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=[_point(point) for point in points.tolist()],
        colors=[],
        texture_resource="",
        texture=_no_texture(moment),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=_make("MeshFile", filename="", data=np.zeros(0, np.uint8)),
        mesh_use_embedded_materials=False,
    )


def _no_texture(moment: Moment) -> Any:
    return _make(
        "CompressedImage",
        header=_header(moment, ""),
        format="",
        data=np.zeros(0, np.uint8),
    )
