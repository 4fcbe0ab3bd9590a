"""Messages for tests over DDS: as a peer takes them by its orders, and as bytes."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

import numpy as np
from ros_bags import Messages, store


def scan_message(stamp: int = 0, ranges: tuple[float, ...] = (1.0, 2.0, 3.0)) -> dict:
    names = ("time_increment", "scan_time", "range_min", "range_max")
    return {
        "header": {"stamp": {"sec": stamp, "nanosec": 500_000_000}, "frame_id": "laser"},
        "angle_min": -0.5,
        "angle_max": -0.5 + 0.25 * (len(ranges) - 1),
        "angle_increment": 0.25,
        **dict(zip(names, (0.0, 0.125, 0.125, 32.0), strict=True)),
        "ranges": list(ranges),
        "intensities": [],
    }


def odometry_message(vx: float) -> dict:
    point = dict.fromkeys("xyz", 0.0)
    turned = {**dict.fromkeys("xy", 0.0), "z": math.sin(0.25), "w": math.cos(0.25)}
    return {
        "header": {"stamp": {"sec": 3, "nanosec": 0}, "frame_id": "odom"},
        "child_frame_id": "base",
        "pose": {
            "pose": {"position": {**point, "x": 1.0, "y": 2.0}, "orientation": turned},
            "covariance": [0.5] * 36,
        },
        "twist": {
            "twist": {"linear": {**point, "x": vx, "y": -1.0}, "angular": {**point, "z": 0.25}},
            "covariance": [0.5] * 36,
        },
    }


def cdr_scan(n: int = 3, order: str = "<") -> bytes:
    geometry = (-0.5, 0.5, 1 / (n - 1), 0.0, 0.1, 0.1, 30.0)
    form = f"{order}3I8s7fI{n}fI"
    fields = struct.pack(form, 7, 0, 6, b"laser", *geometry, n, *[1.0] * n, 0)
    return b"\0\1\0\0" + fields


def published() -> dict[str, tuple[object, Callable[[dict], bool]]]:
    """A message of each type that is published, and what shows that it has come."""
    types, of_ros = store(2).types, Messages(2)
    header = of_ros.header(7.5)

    def make(kind: str, *values: object) -> object:
        package, name = kind.split("/")
        return types[f"{package}/msg/{name}"](*values)

    point = make("geometry_msgs/Point", 1.0, 2.0, 0.0)
    vector = make("geometry_msgs/Vector3", 1.0, 2.0, 3.0)
    turn = make("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0)
    pose = make("geometry_msgs/Pose", point, turn)
    color = make("std_msgs/ColorRGBA", 1.0, 0.5, 0.25, 1.0)
    field = make("sensor_msgs/PointField", "x", 0, 7, 1)
    nothing = np.zeros(0, np.uint8)
    marker = make(
        "visualization_msgs/Marker",
        *(header, "segments", 1, 5, 0, pose, vector, color),
        *(make("builtin_interfaces/Duration", 1, 2), False, [point, point], [color], ""),
        *(make("sensor_msgs/CompressedImage", header, "", nothing), [], "text", ""),
        *(make("visualization_msgs/MeshFile", "", nothing), True),
    )
    transform = make("geometry_msgs/Transform", vector, turn)
    status = make("diagnostic_msgs/DiagnosticStatus", 1, "n", "m", "h", [])
    status.values.append(make("diagnostic_msgs/KeyValue", "rate", "40"))
    data = np.arange(16, dtype=np.uint8)
    return {
        "geometry_msgs/msg/PoseArray": (
            make("geometry_msgs/PoseArray", header, [pose]),
            lambda m: m["poses"][0]["position"] == {"x": 1.0, "y": 2.0, "z": 0.0},
        ),
        "sensor_msgs/msg/PointCloud2": (
            make("sensor_msgs/PointCloud2", header, 1, 4, [field], False, 4, 16, data, True),
            lambda m: m["fields"][0]["name"] == "x" and bytes(m["data"]) == bytes(range(16)),
        ),
        "visualization_msgs/msg/MarkerArray": (
            make("visualization_msgs/MarkerArray", [marker]),
            lambda m: m["markers"][0]["ns"] == "segments" and m["markers"][0]["text"] == "text",
        ),
        "diagnostic_msgs/msg/DiagnosticArray": (
            make("diagnostic_msgs/DiagnosticArray", header, [status]),
            lambda m: m["status"][0]["values"] == [{"key": "rate", "value": "40"}],
        ),
        "tf2_msgs/msg/TFMessage": (
            make(
                "tf2_msgs/TFMessage",
                [make("geometry_msgs/TransformStamped", header, "base", transform)],
            ),
            lambda m: m["transforms"][0]["child_frame_id"] == "base",
        ),
    }
