"""MCAP files: the scans, what is found in them, and where they were taken, by topic."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from mcap.writer import Writer as File
from numpy.typing import NDArray

from .. import __version__
from ..errors import LineamentError
from ..scan import LaserScan, Pose
from .layers import Layer, layers_of
from .markers import markers_of
from .writer import Found, Writer

__all__ = ["McapWriter", "Message", "Moment", "cloud_of", "single"]

NANO = 1_000_000_000
#: The seconds of a stamp in ROS 2 have 31 bits.
LAST_STAMP = 2**31 - 1
#: Frames of logs that name none; poses are told in the first.
WORLD_FRAME, LASER_FRAME = "map", "laser"
#: Topic of scans whose log names none.
SCAN_TOPIC = "/scan"


class Message(NamedTuple):
    """A message as a file takes it: its topic, the name of its type, its bytes."""

    topic: str
    kind: str
    data: bytes


class Moment(NamedTuple):
    """When and where a scan was taken: its stamp in two parts, its frame, the frame of its pose."""

    seconds: int
    nanoseconds: int
    frame: str
    world: str


class McapWriter(Writer):
    """Writes each scan, the layers of its features and, where it has a pose, a transform.

    The scan goes to its own topic, the layers to ``TOPIC/features``, the transform to ``/tf``. A
    scan with irregular bearings is no message of a laser scan: its valid points go to
    ``TOPIC/points``. A subclass makes the messages.
    """

    needs_scan = True
    #: The profile of the file, and how its messages are encoded.
    profile: ClassVar[str]
    encoding: ClassVar[str]

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._file = File(files.enter_context(temporary.open("wb")))
        self._file.start(self.profile, library=f"lineament {__version__}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def _write(self, found: list[Found], first_scan: int) -> None:
        for i, (features, scan, topic) in enumerate(found, first_scan):
            assert scan is not None  # `write` has seen to it
            time, moment = self._moment(scan, i)
            layers = layers_of(markers_of(features, scan))
            for message in self._messages(topic or SCAN_TOPIC, moment, scan, layers):
                channel = self._channel(message)
                self._file.add_message(channel, time, message.data, time, sequence=i)

    def _close(self) -> None:
        self._file.finish()  # type: ignore[no-untyped-call]

    def _moment(self, scan: LaserScan, index: int) -> tuple[int, Moment]:
        """Time of a scan [ns], and its moment."""
        if not 0 <= scan.stamp <= LAST_STAMP:
            raise LineamentError(
                f"{self.path}: scan {index} has the stamp {scan.stamp:g} s, "
                f"expected 0 to {LAST_STAMP} s: messages hold no other"
            )
        time = round(scan.stamp * NANO)
        frame = scan.frame_id or LASER_FRAME
        return time, Moment(*divmod(time, NANO), frame, "world" if frame == "map" else WORLD_FRAME)

    def _channel(self, message: Message) -> int:
        topic, kind, _ = message
        if topic not in self._channels:
            if kind not in self._schemas:
                name, encoding, data = self._schema(kind)
                self._schemas[kind] = self._file.register_schema(name, encoding, data)
            self._channels[topic] = self._file.register_channel(
                topic, self.encoding, self._schemas[kind]
            )
        return self._channels[topic]

    def _messages(
        self, topic: str, moment: Moment, scan: LaserScan, layers: tuple[Layer, ...]
    ) -> Iterator[Message]:
        # The transform first: what comes after it can be placed at once.
        if scan.pose is not None:
            yield self._transform("/tf", moment, scan.pose)
        if scan.is_regular:
            yield self._scan(topic, moment, scan)
        else:
            yield self._points(f"{topic}/points", moment, scan)
        yield self._features(f"{topic}/features", moment, layers)

    @abstractmethod
    def _schema(self, kind: str) -> tuple[str, str, bytes]:
        """Name, encoding and text of the schema of a type of message."""

    @abstractmethod
    def _transform(self, topic: str, moment: Moment, pose: Pose) -> Message:
        """Tell where the frame of the scan is in the world."""

    @abstractmethod
    def _scan(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """Tell a scan with regular bearings."""

    @abstractmethod
    def _points(self, topic: str, moment: Moment, scan: LaserScan) -> Message:
        """Tell a scan by its points."""

    @abstractmethod
    def _features(self, topic: str, moment: Moment, layers: tuple[Layer, ...]) -> Message:
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
