"""Logs as NumPy archives: one array of ranges, a row a scan, and what belongs to it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import LogError
from ..files import naming_errors, written_beside
from ..scan import LaserScan
from .base import Head, Log
from .copies import check_growth
from .lines import reading

__all__ = ["NpzLog", "save_npz"]

_TOPIC = "ranges"
_ZIP = b"PK\x03\x04"
#: One number for the log, or one for each scan.
_SCALARS = ("range_min", "range_max", "scan_time", "time_increment")
_KEYS = (
    *("ranges", "angle_min", "angle_increment", "angles", "stamps", "poses", "frame_id"),
    *("intensities", *_SCALARS),
)


class NpzLog(Log):
    """A NumPy archive of scans that share their bearings.

    Keys: ``ranges`` (N, M) m, NaN where nothing returned; ``angle_min`` and
    ``angle_increment`` rad, or ``angles`` (M,); optional ``range_min``, ``range_max`` m,
    ``scan_time``, ``time_increment`` s, ``frame_id`` (one, or N of them), ``stamps`` (N,) s,
    ``poses`` (N, 3) m, m, rad (not finite where unknown), ``intensities`` (N, M). Other keys
    are left alone. Arrays stay as stored; rows become float64 as they are read.

    Raises
    ------
    LogError
        If the file is no such archive, is cut off, or a key is missing or has a wrong shape.
    """

    format = "npz"
    description = "npz (ranges, angle_min, angle_increment)"
    endings = (".npz",)
    needs_seek = True

    def _open(self) -> None:
        if self.topic not in (None, _TOPIC):
            raise self._no_such_topic(self.topics)
        self._arrays = _load(self.source)
        self._n, self._m = self._arrays[_TOPIC].shape

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it is a zip archive whose first member is an array."""
        # The name stands in the member's header, so that a cut-off archive is recognised too.
        length = int.from_bytes(head.data[26:28], "little")
        return head.data.startswith(_ZIP) and head.data[30 : 30 + length].endswith(b".npy")

    @property
    def topics(self) -> list[str]:
        """The one kind of scans there is: ``ranges``."""
        return [_TOPIC]

    def __len__(self) -> int:
        return int(self._n)

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        for i in range(self._n):
            try:
                scan = self._scan(i)
            except ValueError as error:
                self._fault(LogError(self.name, f"scan {i}: {error}"))
            else:
                yield _TOPIC, scan

    def _scan(self, i: int) -> LaserScan:
        arrays = self._arrays
        fields: dict[str, Any] = {k: float(_at(arrays[k], i)) for k in _SCALARS if k in arrays}
        if "angles" in arrays:
            fields["angles"] = arrays["angles"]
        else:
            fields["angle_min"] = float(arrays["angle_min"])
            fields["angle_increment"] = float(arrays["angle_increment"])
        if "stamps" in arrays:
            fields["stamp"] = float(arrays["stamps"][i])
        if "frame_id" in arrays:
            fields["frame_id"] = str(_at(arrays["frame_id"], i))
        if "intensities" in arrays:
            fields["intensities"] = arrays["intensities"][i]
        if "poses" in arrays and np.isfinite(arrays["poses"][i]).all():
            fields["pose"] = tuple(arrays["poses"][i].tolist())
        return LaserScan(arrays["ranges"][i], **fields)


def _at(values: NDArray[Any], i: int) -> Any:
    return values[i] if values.ndim else values[()]


def _load(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    with reading(path), Path(path).open("rb") as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                found = list(archive.files)
                size = sum(member.file_size for member in archive.zip.infolist())
                check_growth(path, size, Path(path).stat().st_size)
                arrays = {key: np.asarray(archive[key]) for key in _KEYS if key in found}
        except LogError:
            raise
        # A damaged archive fails in a dozen ways, in zipfile, zlib, struct and numpy's parser.
        except Exception as error:
            problem = f"is no whole npz archive: {type(error).__name__}: {error}"
            raise LogError(path, problem.replace("\n", " ")) from None
    try:
        _check(arrays, found)
    except ValueError as error:
        raise LogError(path, str(error)) from None
    return arrays


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
    expected: dict[str, tuple[tuple[int, ...], ...]] = {
        "ranges": ((n, m),),
        "angle_min": ((),),
        "angle_increment": ((),),
        "angles": ((m,),),
        "stamps": ((n,),),
        "poses": ((n, 3),),
        "intensities": ((n, m),),
        **dict.fromkeys((*_SCALARS, "frame_id"), ((), (n,))),
    }
    for key, array in arrays.items():
        if array.shape not in expected[key]:
            wanted = " or ".join(map(str, expected[key]))
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


def save_npz(path: str | os.PathLike[str], scans: Iterable[LaserScan], **extra: ArrayLike) -> None:
    """Write scans that share their bearings as an npz log, beside `path` and then renamed.

    Parameters
    ----------
    path : path-like
        The file; one that exists is replaced.
    scans : iterable of LaserScan
        At least one; all are held in memory until written.
    **extra : array_like
        Further keys, such as ``source`` or ``licence``.

    Raises
    ------
    ValueError
        If there are no scans or no beams, bearings differ, only some scans have intensities, or
        an extra key is one of the log's own or holds objects.
    LineamentError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lineament.logs import open_log
    >>> path = pathlib.Path(tempfile.mkdtemp(), "two.npz")
    >>> save_npz(path, [LaserScan([1.0, 2.0], 0.0, 0.1, stamp=t) for t in (7.0, 7.5)])
    >>> [scan.stamp for scan in open_log(path)]
    [7.0, 7.5]
    """
    arrays = _pack(list(scans))
    for key, value in extra.items():
        if key in _KEYS:
            raise ValueError(f"extra key {key} is one of the log's own")
        arrays[key] = np.asarray(value)
        if arrays[key].dtype.hasobject:
            raise ValueError(f"extra key {key} holds objects, expected numbers or text")
    with written_beside(path) as temporary, naming_errors(path), temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _pack(scans: list[LaserScan]) -> dict[str, NDArray[Any]]:
    if not scans:
        raise ValueError("there are no scans to write")
    first = scans[0]
    if not len(first):
        raise ValueError("scan 0 has no beams, expected at least one")
    for i, scan in enumerate(scans):
        if scan.is_regular != first.is_regular or not np.array_equal(scan.angles, first.angles):
            raise ValueError(f"scan {i} has other bearings than scan 0, expected the same for all")
        if (scan.intensities is None) != (first.intensities is None):
            raise ValueError(f"scan {i} and scan 0: only one of them has intensities")
    arrays = {"ranges": _lossless(np.stack([scan.ranges for scan in scans]))}
    if first.is_regular:
        arrays["angle_min"] = np.array(first.angle_min)
        arrays["angle_increment"] = np.array(first.angle_increment)
    else:
        arrays["angles"] = first.angles
    arrays["stamps"] = np.array([scan.stamp for scan in scans])
    for key in (*_SCALARS, "frame_id"):
        values = np.array([getattr(scan, key) for scan in scans])
        arrays[key] = values[0] if (values == values[0]).all() else values
    intensities = [scan.intensities for scan in scans if scan.intensities is not None]
    if intensities:
        arrays["intensities"] = _lossless(np.stack(intensities))
    if any(scan.pose is not None for scan in scans):
        unknown = (np.nan, np.nan, np.nan)
        arrays["poses"] = np.array([scan.pose or unknown for scan in scans])
    return arrays


def _lossless(values: NDArray[np.float64]) -> NDArray[Any]:
    """Return the values as float32 where none changes, as most sensors report them."""
    with np.errstate(over="ignore"):
        small = values.astype(np.float32)
    return small if np.array_equal(small, values, equal_nan=True) else values
