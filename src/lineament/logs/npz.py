"""Logs as NumPy archives: one array of ranges, a row a scan, and what belongs to it."""

import os
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..limits import Limits
from ..scan import LaserScan
from .base import Head, Log
from .lines import reading
from .sources import ZIP

#: One number for the log, or one for each scan.
SCALARS = ("range_min", "range_max", "scan_time", "time_increment")
#: The arrays of a log, and their shapes for n scans of m beams.
SHAPES = {
    "ranges": ("nm",),
    "angle_min": ("",),
    "angle_increment": ("",),
    "angles": ("m",),
    "stamps": ("n",),
    "stamps_ns": ("n",),
    "poses": ("n3",),
    "pose_covariances": ("n33",),
    "intensities": ("nm",),
    **dict.fromkeys((*SCALARS, "stamp_beam", "frame_id"), ("", "n")),
}


class NpzLog(Log):
    """A NumPy archive of scans that share their bearings.

    Keys: ``ranges`` (N, M) m, NaN where nothing returned; ``angle_min`` and
    ``angle_increment`` rad, or ``angles`` (M,); optional ``range_min``, ``range_max`` m,
    ``scan_time``, ``time_increment`` s, ``frame_id`` (one, or N of them), ``stamps`` (N,) s,
    ``stamps_ns`` (N,) ns where seconds do not hold them, ``stamp_beam`` (see `LaserScan`),
    ``poses`` (N, 3) m, m, rad and ``pose_covariances`` (N, 3, 3), not finite where unknown,
    ``intensities`` (N, M). Other keys are left alone. Arrays stay as stored; rows become float64 as
    they are read.
    """

    format = "npz"
    description = "npz (ranges, angle_min, angle_increment)"
    is_held = True
    endings = (".npz",)
    needs_seek = True
    only_topic = "ranges"

    def _open(self) -> None:
        self._check_topic()
        self._arrays = _load(self.source, self.limits)
        self._n = len(self._arrays["ranges"])

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it is a zip archive whose first member is an array."""
        # The name stands in the member's header, so that a cut-off archive is recognised too.
        length = int.from_bytes(head.data[26:28], "little")
        return head.data.startswith(ZIP) and head.data[30 : 30 + length].endswith(b".npy")

    def __len__(self) -> int:
        return self._n

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        for i in range(self._n):
            yield from self._made(self.only_topic, f"scan {i}: ", self._scan, i)

    def _scan(self, i: int) -> LaserScan:
        arrays = self._arrays
        fields: dict[str, Any] = {k: float(_at(arrays[k], i)) for k in SCALARS if k in arrays}
        if "angles" in arrays:
            fields["angles"] = arrays["angles"]
        else:
            fields |= {key: float(arrays[key]) for key in ("angle_min", "angle_increment")}
        if "stamps" in arrays:
            fields["stamp"] = float(arrays["stamps"][i])
        if "frame_id" in arrays:
            fields["frame_id"] = str(_at(arrays["frame_id"], i))
        if "intensities" in arrays:
            fields["intensities"] = arrays["intensities"][i]
        if "poses" in arrays and np.isfinite(arrays["poses"][i]).all():
            fields["pose"] = tuple(arrays["poses"][i].tolist())
        scan = LaserScan(arrays["ranges"][i], **fields)
        if "pose_covariances" in arrays and np.isfinite(arrays["pose_covariances"][i]).all():
            scan = scan.with_pose(scan.pose, arrays["pose_covariances"][i])
        beam = scan.stamp_beam
        if "stamp_beam" in arrays:  # Of beams as they are stored, which may be clockwise.
            stored = float(_at(arrays["stamp_beam"], i))
            beam = beam - stored if beam else stored
        ns = int(arrays["stamps_ns"][i]) if "stamps_ns" in arrays else None
        return scan.stamped(beam, ns) if beam or ns is not None else scan


def _at(values: NDArray[Any], i: int) -> Any:
    return values[i] if values.ndim else values[()]


def _load(path: str | os.PathLike[str], limits: Limits) -> dict[str, NDArray[Any]]:
    error = partial(LogError, path)
    with reading(path), Path(path).open("rb") as file:
        begin = file.read(4)
        if begin[:2] != ZIP[:2]:  # NumPy would suggest to unpickle it.
            raise error(f"is no whole npz archive: begins with {begin!r}, expected {ZIP!r}")
        file.seek(0)
        try:
            with np.load(file, allow_pickle=False) as archive:
                found = list(archive.files)
                size = sum(member.file_size for member in archive.zip.infolist())
                limits.check_growth(size, Path(path).stat().st_size, error)
                if "ranges" in found:
                    for limit, n in zip(("scans", "beams"), _shape(archive), strict=False):
                        limits.check(limit, n, error)
                arrays = {key: np.asarray(archive[key]) for key in SHAPES if key in found}
        except LogError:
            raise
        # A damaged archive fails in a dozen ways, in zipfile, zlib, struct and numpy's parser.
        except Exception as broken:
            problem = f"is no whole npz archive: {type(broken).__name__}: {broken}"
            raise LogError(path, problem.replace("\n", " ")) from None
    try:
        _check(arrays, found)
    except ValueError as wrong:
        raise error(str(wrong)) from None
    return arrays


def _shape(archive: Any) -> tuple[int, ...]:
    """Return the shape of the ranges, before memory is taken for them."""
    with archive.zip.open("ranges.npy") as member:
        if not member.peek(6).startswith(np.lib.format.MAGIC_PREFIX):
            return ()
        version = np.lib.format.read_magic(member)
        read = getattr(np.lib.format, f"read_array_header_{version[0]}_0")
        shape: tuple[int, ...] = read(member)[0]
    return shape


def _check(arrays: dict[str, NDArray[Any]], found: list[str]) -> None:
    """Check that the keys are there and fit the ranges; ValueError if not."""
    has_bearings = "angles" in arrays or {"angle_min", "angle_increment"} <= arrays.keys()
    if "ranges" not in arrays or not has_bearings:
        raise ValueError(
            "expected the keys ranges, and angle_min with angle_increment or angles; "
            f"found {', '.join(found) or 'none'}"
        )
    shape = arrays["ranges"].shape
    if len(shape) != 2:
        raise ValueError(f"ranges has shape {shape}, expected (scans, beams)")
    n, m = shape
    if n == 0:
        raise ValueError("ranges has no scans, expected at least one row")
    if m == 0:  # Any number of scans would fit into no space.
        raise ValueError("ranges has no beams, expected at least one column")
    sizes = {"n": n, "m": m, "3": 3}
    for key, array in arrays.items():
        expected = [tuple(sizes[axis] for axis in shape) for shape in SHAPES[key]]
        if array.shape not in expected:
            wanted = " or ".join(map(str, expected))
            raise ValueError(f"{key} has shape {array.shape}, expected {wanted}")
        kinds = "U" if key == "frame_id" else "fiu"
        if array.dtype.kind not in kinds:
            wanted = "text" if key == "frame_id" else "numbers"
            raise ValueError(f"{key} has type {array.dtype}, expected {wanted}")
        if key == "frame_id" and not _is_text(array):
            raise ValueError("frame_id has letters that do not exist, expected text")


def _is_text(array: NDArray[Any]) -> bool:
    """Whether its letters exist: NumPy makes strings of others, which break Python."""
    letters = np.frombuffer(array.tobytes(), f"{array.dtype.byteorder}u4")
    return bool(letters.max(initial=0) <= sys.maxunicode)
