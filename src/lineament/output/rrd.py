"""Rerun recordings: the scans and what is found in them, where they were taken, over time."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .markers import markers_of
from .scene import Layer, layers_of
from .writer import Found, Writer

__all__ = ["RerunWriter"]

# rerun's own log would tell of a full disk in several lines. It is set up by the import.
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

    rerun keeps single precision.
    """

    needs_scan = True
    chunk = 100

    def _open(self, temporary: Path, files: ExitStack) -> None:
        self._temporary = temporary
        self._check_room()
        self._recording = rr.RecordingStream(
            "lineament", recording_id="lineament", send_properties=False
        )
        # Neither the time nor the order of writing is any of a reader's business.
        self._recording.set_log_time_enabled(False)
        self._recording.set_log_tick_enabled(False)
        with _told_as_os_error():
            self._recording.save(temporary)
        files.callback(self._recording.disconnect)

    def _write(self, found: list[Found], first_scan: int) -> None:
        self._check_room()
        for i, one in enumerate(found, first_scan):
            self._log(one, i)
        self._flush_recording()

    def _close(self) -> None:
        self._flush_recording()
        self._recording.disconnect()
        # The last bytes are written without a word about failure.
        with self._temporary.open("rb") as file:
            file.seek(-min(TAIL, self._temporary.stat().st_size), os.SEEK_END)
            if FOOTER not in file.read():
                raise OSError(errno.EIO, "rerun could not finish it")

    def _check_room(self) -> None:
        if shutil.disk_usage(self._temporary.parent).free < SPARE:
            told = f"less than {SPARE >> 20} MB are left on the disk, and rerun needs them"
            raise OSError(errno.ENOSPC, told)

    def _flush_recording(self) -> None:
        with _told_as_os_error():
            self._recording.flush(timeout_sec=PATIENCE)

    def _log(self, found: Found, index: int) -> None:
        features, scan, topic = found
        assert scan is not None  # `write` has seen to it
        recording, place = self._recording, f"world/{(topic or 'scan').strip('/')}"
        recording.set_time(SCAN, sequence=index)
        recording.set_time(STAMP, duration=scan.stamp)
        if scan.pose is not None:
            x, y, theta = scan.pose
            turn = rr.RotationAxisAngle(axis=[0.0, 0.0, 1.0], radians=theta)
            recording.log(place, rr.Transform3D(translation=[x, y, 0.0], rotation=turn))
        points = _flat(scan.points[scan.valid])
        recording.log(f"{place}/points", rr.Points3D(points, radii=0.015, colors=(120, 128, 136)))
        for layer in layers_of(markers_of(features, scan)):
            recording.log(f"{place}/{layer.name}", _marks(layer))


@contextmanager
def _told_as_os_error() -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:
        raise OSError(errno.EIO, f"rerun says: {error}") from None


def _marks(layer: Layer) -> Any:
    color = [round(255 * part) for part in layer.color]
    if layer.name in {"corners", "edges"}:
        return rr.Points3D(_flat(layer.points), radii=layer.size / 2, colors=color)
    return rr.LineStrips3D(
        [_flat(strip) for strip in layer.strips], radii=layer.size / 2, colors=color
    )


def _flat(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack((points, np.zeros(len(points))))
