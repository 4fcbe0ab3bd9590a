"""Messages of a scan, of its pose and of what is found in it: what files and live topics share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scan import LaserScan, Pose
from .layers import Layer

__all__ = ["LAST_STAMP", "Message", "Moment", "SceneMessages", "cloud_of", "single"]

NANO = 1_000_000_000
#: The seconds of a stamp in ROS 2 have 31 bits.
LAST_STAMP = 2**31 - 1
#: Frames of logs that name none; poses are told in the first.
WORLD_FRAME, LASER_FRAME = "map", "laser"


class Message(NamedTuple):
    """A message as a file or a transport takes it: its topic, the name of its type, its bytes."""

    topic: str
    kind: str
    data: bytes


class Moment(NamedTuple):
    """When and where a scan was taken: its stamp in two parts, its frame, the frame of its pose.

    Seconds and nanoseconds are apart, as in the messages: a stamp of today in one float is known
    to 0.2 µs only.
    """

    seconds: int
    nanoseconds: int
    frame: str
    world: str

    @classmethod
    def of(cls, scan: LaserScan) -> Moment:
        """Make the moment of a scan; its frame is ``laser`` where it names none.

        Raises
        ------
        ValueError
            If messages do not hold its stamp.

        Examples
        --------
        >>> Moment.of(LaserScan([1.0], 0.0, 0.1, stamp=7.5))
        Moment(seconds=7, nanoseconds=500000000, frame='laser', world='map')
        """
        if not 0 <= scan.stamp <= LAST_STAMP:
            raise ValueError(
                f"has the stamp {scan.stamp:g} s, expected 0 to {LAST_STAMP} s: "
                "messages hold no other"
            )
        frame = scan.frame_id or LASER_FRAME
        world = "world" if frame == WORLD_FRAME else WORLD_FRAME
        return cls(*divmod(round(scan.stamp * NANO), NANO), frame, world)

    @property
    def time(self) -> int:
        """The stamp [ns]."""
        return self.seconds * NANO + self.nanoseconds


class SceneMessages(ABC):
    """Makes the messages of one family: one subclass each for those of ROS and of Foxglove.

    Attributes
    ----------
    encoding : str
        How the bytes of the messages are to be read: ``cdr``, ``ros1`` or ``protobuf``.
    profile : str
        What an MCAP file with these messages is called: ``ros2``, ``ros1`` or nothing.
    """

    encoding: str
    profile: str

    def messages(
        self, topic: str, moment: Moment, scan: LaserScan, layers: tuple[Layer, ...]
    ) -> Iterator[Message]:
        """Make all messages of a scan: where it was taken, the scan, and what was found in it.

        The scan goes to its own topic, the layers of its features to ``TOPIC/features``, the
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
        yield self.features(f"{topic}/features", moment, layers)

    @abstractmethod
    def schema(self, kind: str) -> tuple[str, str, bytes]:
        """Name, encoding and text of the schema of a type of message, by `Message.kind`."""

    @abstractmethod
    def transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """Tell where the frame of the scan is in the world."""

    @abstractmethod
    def scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """Tell a scan with regular bearings."""

    @abstractmethod
    def points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """Tell a scan by its points."""

    @abstractmethod
    def features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
        """Tell the features of a scan, in place of those that were told before."""


def single(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Make single precision of double; what is too large for it is infinite."""
    with np.errstate(over="ignore"):
        return values.astype("<f4")


def cloud_of(scan: LaserScan) -> tuple[tuple[str, ...], NDArray[np.float32]]:
    """Names of the fields, and the fields (m, 3 or 4), of the valid points of a scan."""
    columns = [scan.points, np.zeros((len(scan), 1))]
    if scan.intensities is not None:
        columns.append(scan.intensities[:, None])
    cloud = single(np.hstack(columns)[scan.valid])
    return ("x", "y", "z", "intensity")[: cloud.shape[1]], cloud
