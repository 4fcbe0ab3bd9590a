"""Rerun recordings: the scans and what is found in them, where they were taken, over time."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from .markers import markers_of
from .scene import layers_of
from .writer import Found, Writer

# Rerun's log, which the import sets up, would report a full disk in several lines.
_LOGGED = os.environ.get("RUST_LOG")
os.environ.setdefault("RUST_LOG", "off")
import rerun as rr  # noqa: E402

if _LOGGED is None:
    del os.environ["RUST_LOG"]

#: The timelines: the stamp of the scan, and its index in the log.
STAMP, SCAN = "stamp", "scan"
#: What a whole file has within so many bytes of its end.
FOOTER, TAIL = b"RRF2FOOT", 64
#: Space that must be left on the disk before a hundred scans are written [byte]: rerun itself may
#: wait for ever for a disk that is full. So long it may take for them otherwise [s].
SPARE, PATIENCE = 1 << 25, 10.0


class RerunWriter(Writer):
    """Writes ``world/TOPIC`` with the pose of each scan, and below it points and layers.

    Rerun keeps single precision.
    """

    needs_scan = True
    chunk = 100

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._temporary = temporary
        self._check_room()
        self._recording = rr.RecordingStream(
            "lineament", recording_id="lineament", send_properties=False
        )
        # When and in which order the file was written is of no use to a reader.
        self._recording.set_log_time_enabled(False)
        self._recording.set_log_tick_enabled(False)
        with _as_os_error():
            self._recording.save(temporary)
        files.callback(self._recording.disconnect)

    def _write(self, found: list[Found], first_scan: int) -> None:
        self._check_room()
        for i, one in enumerate(found, first_scan):
            self._log(one, i)
        with _as_os_error():
            self._recording.flush(timeout_sec=PATIENCE)

    def _close(self) -> None:
        self._recording.disconnect()
        # The last bytes are written without a word about failure.
        with self._temporary.open("rb") as file:
            file.seek(-min(TAIL, self._temporary.stat().st_size), os.SEEK_END)
            if FOOTER not in file.read():
                raise OSError(errno.EIO, "rerun could not finish it")

    def _check_room(self) -> None:
        if shutil.disk_usage(self._temporary.parent).free < SPARE:
            problem = f"less than {SPARE >> 20} MB are left on the disk, and rerun needs them"
            raise OSError(errno.ENOSPC, problem)

    def _log(self, found: Found, index: int) -> None:
        features, scan, topic, _ = found
        assert scan is not None  # `needs_scan`
        recording, place = self._recording, f"world/{(topic or 'scan').strip('/')}"
        recording.set_time(SCAN, sequence=index)
        try:
            recording.set_time(STAMP, duration=np.timedelta64(scan.stamp_ns, "ns"))
        except OverflowError:
            problem = f"scan {index} has the stamp {scan.stamp:g} s, which rerun does not hold"
            raise LineamentError(f"{self.path}: {problem}") from None
        if scan.pose is not None:
            x, y, theta = scan.pose
            turn = rr.RotationAxisAngle(axis=[0.0, 0.0, 1.0], radians=theta)
            recording.log(place, rr.Transform3D(translation=[x, y, 0.0], rotation=turn))
        points = _flat(scan.points[scan.valid])
        recording.log(f"{place}/points", rr.Points3D(points, radii=0.015, colors=(120, 128, 136)))
        for layer in layers_of(markers_of(features, scan)):
            color, radius = [round(255 * part) for part in layer.color], layer.size / 2
            marks = (
                rr.Points3D(_flat(layer.points), radii=radius, colors=color)
                if layer.name in {"corners", "edges"}
                else rr.LineStrips3D(list(map(_flat, layer.strips)), radii=radius, colors=color)
            )
            recording.log(f"{place}/{layer.name}", marks)


@contextmanager
def _as_os_error() -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:
        raise OSError(errno.EIO, f"rerun says: {error}") from None


def _flat(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack((points, np.zeros(len(points))))
