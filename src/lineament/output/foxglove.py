"""Foxglove's own messages, in Protobuf: its 3D panel draws them as they are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from foxglove import messages as fg

from ..scan import LaserScan, Pose
from .layers import Layer
from .scene import LAST_STAMP, Message, Moment, SceneMessages, cloud_of

__all__ = ["FoxgloveMessages"]


class FoxgloveMessages(SceneMessages):
    """Makes ``foxglove.LaserScan``, ``PointCloud``, ``SceneUpdate`` and ``FrameTransform``.

    Beams that are not valid are NaN: the message has no limits of the range to tell them by.
    """

    encoding, profile = "protobuf", ""

    def schema(self, kind: str) -> tuple[str, str, bytes]:
        """Name, encoding and text of the schema of a message, by its name."""
        schema = getattr(fg, kind).get_schema()
        return schema.name, schema.encoding, schema.data

    def transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """``FrameTransform``: where the frame of the scan is in the world."""
        x, y, theta = pose
        return _message(
            topic,
            fg.FrameTransform(
                timestamp=_time(moment),
                parent_frame_id=moment.world,
                child_frame_id=moment.frame,
                translation=fg.Vector3(x=x, y=y),
                rotation=fg.Quaternion(z=math.sin(theta / 2), w=math.cos(theta / 2)),
            ),
        )

    def scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``LaserScan``; invalid beams are NaN."""
        intensities = scan.intensities
        return _message(
            topic,
            fg.LaserScan(
                timestamp=_time(moment),
                frame_id=moment.frame,
                pose=_ORIGIN,
                start_angle=scan.angle_min,
                end_angle=scan.angle_min + (len(scan) - 1) * scan.angle_increment,
                ranges=np.where(scan.valid, scan.ranges, np.nan).tolist(),
                intensities=None if intensities is None else intensities.tolist(),
            ),
        )

    def points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """``PointCloud`` of the valid points: x, y, z and intensity."""
        names, cloud = cloud_of(scan)
        number = fg.PackedElementFieldNumericType.Float32
        return _message(
            topic,
            fg.PointCloud(
                timestamp=_time(moment),
                frame_id=moment.frame,
                pose=_ORIGIN,
                point_stride=4 * len(names),
                fields=[
                    fg.PackedElementField(name=name, offset=4 * k, type=number)
                    for k, name in enumerate(names)
                ],
                data=cloud.tobytes(),
            ),
        )

    def features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
        """``SceneUpdate``: one entity a layer."""
        # An entity takes the place of the one that had its name: nothing has to be deleted.
        entities = [
            fg.SceneEntity(
                timestamp=_time(moment),
                frame_id=moment.frame,
                id=layer.name,
                lines=[_line(layer, strip) for strip in layer.strips],
                spheres=[_sphere(layer, point) for point in layer.points.tolist()],
            )
            for layer in layers
        ]
        return _message(topic, fg.SceneUpdate(entities=entities))


_UPRIGHT = fg.Quaternion(w=1.0)
_ORIGIN = fg.Pose(position=fg.Vector3(), orientation=_UPRIGHT)


def _message(topic: str, message: Any) -> Message:
    return Message(topic, type(message).__name__, message.encode())


def _time(moment: Moment) -> fg.Timestamp:
    # What comes live may have a stamp that is none: it is shown as the first or the last.
    seconds = min(max(moment.seconds, 0), LAST_STAMP)
    return fg.Timestamp(sec=seconds, nsec=moment.nanoseconds)


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


def _sphere(layer: Layer, point: list[float]) -> fg.SpherePrimitive:
    x, y = point
    return fg.SpherePrimitive(
        pose=fg.Pose(position=fg.Vector3(x=x, y=y), orientation=_UPRIGHT),
        size=fg.Vector3(x=layer.size, y=layer.size, z=layer.size),
        color=_color(layer),
    )
