"""What `extract` is given: a scan, or its ranges and fields, or something else."""

import math
from pathlib import Path
from typing import Any

from .laser_scan import LaserScan

#: Fields of a scan that are not those of every scan.
FIELDS = ("stamp", "scan_time", "time_increment", "frame_id", "intensities", "pose")


def scan_of(
    given: Any, bearings: tuple[Any, ...], limits: tuple[float, ...], fields: dict[str, Any]
) -> LaserScan:
    """Make a scan of ranges and its other fields; a scan stays as it is."""
    is_bare = all(bearing is None for bearing in bearings)
    if isinstance(given, LaserScan):
        if fields or not is_bare or limits != (0.0, math.inf, 1.0):
            raise TypeError("a LaserScan has its own bearings, limits and times: pass it alone")
        return given
    if is_bare or isinstance(given, str | Path):
        raise no_scan(given)
    (first, step, angles), (low, high, scale) = bearings, limits
    fields |= {"angles": angles, "range_min": low, "range_max": high, "scale": scale}
    return LaserScan(given, first, step, **fields)


def no_scan(given: Any) -> TypeError:
    """Return the error that says what to pass in place of something that is no scan."""
    kind = type(given).__name__
    if isinstance(given, str | Path):
        hint = "open_log(path).scan(0) reads one from a log"
    elif callable(getattr(given, "scan", None)):
        hint = "log[i] is one of a log"
    elif hasattr(given, "ranges"):
        hint = "LaserScan.from_message(message) makes one of a message"
    else:
        hint = (
            "extract(ranges, angle_min=..., angle_increment=...) takes ranges, "
            "LaserScan.from_points(xy) takes points"
        )
    return TypeError(f"scan is of type {kind}, expected a LaserScan: {hint}")
