"""Scenes of scans: the layers that 3-D viewers draw, and the messages that carry them."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..scan import Array, LaserScan, Pose
from ..scan.fields import NANO
from .markers import Markers

#: The seconds of a stamp in ROS 2 have 31 bits.
LAST_STAMP = 2**31 - 1
#: Frames of logs that name none; poses are in the first.
WORLD_FRAME, LASER_FRAME = "map", "laser"
#: Frame of odometry by scans: that of the first scan.
ODOMETRY_FRAME = "odom"

_NOTHING = np.zeros((0, 2))


class Layer(NamedTuple):
    """Marks of one kind that are drawn alike.

    A name; red, green, blue and opacity, 0 to 1; the width of lines or diameter of spheres [m];
    vertices that are joined by lines [m], of shape (n, 2) each, or in one array (m, n, 2) where all
    strips have as many; and centres of spheres [m], of shape (m, 2).
    """

    name: str
    color: tuple[float, float, float, float]
    size: float
    strips: Sequence[Array] | Array
    points: Array = _NOTHING

    @property
    def pairs(self) -> Array:
        """Both ends of each straight piece of the strips, one after the other, shape (2 k, 2).

        What a list of lines takes, where one message has to hold many strips.
        """
        strips = [self.strips] if isinstance(self.strips, np.ndarray) else self.strips
        pieces = [
            np.repeat(strip, 2, axis=-2)[..., 1:-1, :].reshape(-1, 2)
            for strip in strips  # each of them one, or many of as many vertices
        ]
        return np.concatenate(pieces) if pieces else _NOTHING


def layers_of(markers: Markers) -> tuple[Layer, ...]:
    """Make the layers segments, arcs, corners, edges and ellipses; those without marks too."""
    return (
        Layer("segments", (0.16, 0.47, 0.84, 1.0), 0.03, markers.segments),
        Layer("arcs", (0.51, 0.31, 0.87, 1.0), 0.03, markers.arc_strips()),
        Layer("corners", (0.82, 0.14, 0.18, 1.0), 0.08, (), markers.corners),
        Layer("edges", (0.94, 0.65, 0.67, 1.0), 0.05, (), markers.edges),
        Layer("ellipses", (0.93, 0.60, 0.20, 1.0), 0.01, markers.ellipse_strips()),
    )


class Message(NamedTuple):
    """A message as a file or a transport takes it: its topic, the name of its type, its bytes."""

    topic: str
    kind: str
    data: bytes


class Moment(NamedTuple):
    """When and where a scan was taken: its stamp in two parts, its frame, the frame of its pose.

    Seconds and nanoseconds are apart, as in the messages.
    """

    seconds: int
    nanoseconds: int
    frame: str
    world: str

    @classmethod
    def of(cls, scan: LaserScan) -> Self:
        """Make the moment of a scan; its frame is ``laser`` where it names none.

        Raises a ValueError if messages do not hold its stamp.
        """
        if not 0 <= scan.stamp <= LAST_STAMP:
            raise ValueError(
                f"has the stamp {scan.stamp:g} s, expected 0 to {LAST_STAMP} s: "
                "messages hold no other"
            )
        frame = scan.frame_id or LASER_FRAME
        return cls(*divmod(scan.stamp_ns, NANO), frame, world_of(frame))

    @property
    def time(self) -> int:
        """The stamp [ns]."""
        return self.seconds * NANO + self.nanoseconds


def world_of(frame: str) -> str:
    """Name the frame of poses: ``map``, or ``world`` where the frame of the scan is called so."""
    return "world" if frame == WORLD_FRAME else WORLD_FRAME


class SceneMessages(ABC):
    """Makes the messages of one family: those of ROS or of Foxglove."""

    #: Serialisation of the messages: ``cdr``, ``ros1`` or ``protobuf``.
    encoding: str
    #: Profile of an MCAP file with these messages: ``ros2``, ``ros1`` or "".
    profile: str
    #: Last word of the topic of what was found: that under which the live node has such messages.
    drawn: str

    def messages(
        self, topic: str, moment: Moment, scan: LaserScan, layers: tuple[Layer, ...]
    ) -> Iterator[Message]:
        """Make all messages of a scan: where it was taken, the scan, and what was found in it.

        The scan goes to its own topic, the layers of its features to `drawn` below it, the
        transform, where it has a pose, to ``/tf``. A scan with irregular bearings is no message of
        a laser scan: its valid points go to ``TOPIC/points``.
        """
        # The transform first: what comes after it can be placed at once.
        if scan.pose is not None:
            yield self.transform("/tf", moment, scan.pose)
        if scan.is_regular:
            yield self.scan(topic, moment, scan)
        else:
            yield self.points(f"{topic}/points", moment, scan)
        yield self.features(f"{topic}/{self.drawn}", moment, layers)

    @abstractmethod
    def schema(self, kind: str) -> tuple[str, str, bytes]:
        """Name, encoding and text of the schema of a type of message, by `Message.kind`."""

    @abstractmethod
    def transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """Make a message of where the frame of the scan is in the world."""

    @abstractmethod
    def scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """Make a message of a scan with regular bearings."""

    @abstractmethod
    def points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """Make a message of the valid points of a scan: x, y, z and intensity."""

    @abstractmethod
    def features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
        """Make a message of the features of a scan, which replaces the one before."""


def single(values: Array) -> NDArray[np.float32]:
    """Convert to single precision; what is too large for it becomes infinite."""
    with np.errstate(over="ignore"):
        return values.astype("<f4")


def cloud_of(scan: LaserScan) -> tuple[tuple[str, ...], NDArray[np.float32]]:
    """Return names of the fields, and the fields (m, 3 or 4), of the valid points of a scan."""
    columns = [scan.points, np.zeros((len(scan), 1))]
    if scan.intensities is not None:
        columns.append(scan.intensities[:, None])
    cloud = single(np.hstack(columns)[scan.valid])
    return ("x", "y", "z", "intensity")[: cloud.shape[1]], cloud
