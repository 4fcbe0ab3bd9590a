"""Foxglove's own messages, in Protobuf: its 3D panel draws them as they are."""

import math
from typing import Any

import numpy as np
from foxglove import messages as fg

from ..scan import LaserScan, Pose
from .scene import LAST_STAMP, Layer, Message, Moment, SceneMessages, cloud_of

_UPRIGHT = fg.Quaternion(w=1.0)
_ORIGIN = fg.Pose(position=fg.Vector3(), orientation=_UPRIGHT)


class FoxgloveMessages(SceneMessages):
    """Makes ``foxglove.LaserScan``, ``PointCloud``, ``SceneUpdate`` and ``FrameTransform``.

    Beams that are not valid are NaN: the message has no limits of the range to exclude them.
    """

    encoding, profile, drawn = "protobuf", "", "features"

    def schema(self, kind: str) -> tuple[str, str, bytes]:
        """Name, encoding and text of the schema of a message, by its name."""
        schema = getattr(fg, kind).get_schema()
        return schema.name, schema.encoding, schema.data

    def transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """``FrameTransform``: where the frame of the scan is in the world."""
        x, y, theta = pose
        transform = fg.FrameTransform(
            timestamp=_time(moment),
            parent_frame_id=moment.world,
            child_frame_id=moment.frame,
            translation=fg.Vector3(x=x, y=y),
            rotation=fg.Quaternion(z=math.sin(theta / 2), w=math.cos(theta / 2)),
        )
        return _message(topic, transform)

    def scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``LaserScan``; invalid beams are NaN."""
        intensities = scan.intensities
        laser_scan = fg.LaserScan(
            **_placed(moment),
            pose=_ORIGIN,
            start_angle=scan.angle_min,
            end_angle=scan.angle_min + (len(scan) - 1) * scan.angle_increment,
            ranges=np.where(scan.valid, scan.ranges, np.nan).tolist(),
            intensities=None if intensities is None else intensities.tolist(),
        )
        return _message(topic, laser_scan)

    def points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``PointCloud`` of the valid points: x, y, z and intensity."""
        names, cloud = cloud_of(scan)
        number = fg.PackedElementFieldNumericType.Float32
        point_cloud = fg.PointCloud(
            **_placed(moment),
            pose=_ORIGIN,
            point_stride=4 * len(names),
            fields=[
                fg.PackedElementField(name=name, offset=4 * k, type=number)
                for k, name in enumerate(names)
            ],
            data=cloud.tobytes(),
        )
        return _message(topic, point_cloud)

    def features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
        """``SceneUpdate``: one entity a layer."""
        # An entity takes the place of the one that had its name: nothing has to be deleted.
        entities = [
            fg.SceneEntity(
                **_placed(moment),
                id=layer.name,
                lines=[_line(layer, strip) for strip in layer.strips],
                spheres=[_sphere(layer, x, y) for x, y in layer.points.tolist()],
            )
            for layer in layers
        ]
        return _message(topic, fg.SceneUpdate(entities=entities))


def _message(topic: str, message: Any) -> Message:
    return Message(topic, type(message).__name__, message.encode())


def _time(moment: Moment) -> fg.Timestamp:
    # What comes live may have an impossible stamp: it is shown as the first or the last.
    seconds = min(max(moment.seconds, 0), LAST_STAMP)
    return fg.Timestamp(sec=seconds, nsec=moment.nanoseconds)


def _placed(moment: Moment) -> dict[str, Any]:
    return {"timestamp": _time(moment), "frame_id": moment.frame}


def _color(layer: Layer) -> fg.Color:
    r, g, b, a = layer.color
    return fg.Color(r=r, g=g, b=b, a=a)


def _line(layer: Layer, strip: Any) -> fg.LinePrimitive:
    return fg.LinePrimitive(
        type=fg.LinePrimitiveLineType.LineStrip,
        pose=_ORIGIN,
        thickness=layer.size,
        points=[fg.Point3(x=x, y=y) for x, y in strip.tolist()],
        color=_color(layer),
    )


def _sphere(layer: Layer, x: float, y: float) -> fg.SpherePrimitive:
    return fg.SpherePrimitive(
        pose=fg.Pose(position=fg.Vector3(x=x, y=y), orientation=_UPRIGHT),
        size=fg.Vector3(x=layer.size, y=layer.size, z=layer.size),
        color=_color(layer),
    )
