"""MCAP files: the scans, what is found in them, and where they were taken, by topic."""

import os
from contextlib import ExitStack
from pathlib import Path

from mcap.writer import Writer as File

from .._version import __version__
from ..errors import LineamentError
from .markers import markers_of
from .scene import Message, Moment, SceneMessages, layers_of
from .writer import Found, Writer

#: Topic of scans whose log names none.
SCAN_TOPIC = "/scan"


class McapWriter(Writer):
    """Writes the messages of each scan, as a `SceneMessages` makes them."""

    needs_scan = True

    def __init__(self, path: str | os.PathLike[str], scene: SceneMessages) -> None:
        super().__init__(path)
        self._scene = scene

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._file = File(files.enter_context(temporary.open("wb")))
        self._file.start(self._scene.profile, library=f"lineament {__version__}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def _write(self, found: list[Found], first_scan: int) -> None:
        for i, (features, scan, topic, _) in enumerate(found, first_scan):
            assert scan is not None  # `write` has checked it
            try:
                moment = Moment.of(scan)
            except ValueError as error:
                raise LineamentError(f"{self.path}: scan {i} {error}") from None
            layers = layers_of(markers_of(features, scan))
            for message in self._scene.messages(topic or SCAN_TOPIC, moment, scan, layers):
                channel, time = self._channel(message), moment.time
                self._file.add_message(channel, time, message.data, time, sequence=i)

    def _close(self) -> None:
        self._file.finish()  # type: ignore[no-untyped-call]

    def _channel(self, message: Message) -> int:
        topic, kind, _ = message
        if topic not in self._channels:
            if kind not in self._schemas:
                name, encoding, data = self._scene.schema(kind)
                self._schemas[kind] = self._file.register_schema(name, encoding, data)
            self._channels[topic] = self._file.register_channel(
                topic, self._scene.encoding, self._schemas[kind]
            )
        return self._channels[topic]


class FoxgloveWriter(McapWriter):
    """Writes Foxglove's own messages: the file opens in its 3D panel as it is."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        from .foxglove import FoxgloveMessages

        super().__init__(path, FoxgloveMessages())


class Ros2Writer(McapWriter):
    """Writes the messages of ROS 2, in CDR: for RViz, ``ros2 bag play`` and Foxglove."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        from .ros_messages import RosMessages

        super().__init__(path, RosMessages("cdr"))
