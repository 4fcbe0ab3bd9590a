"""The beams of a scan as they are given, and which of them are valid (equations 1-3)."""

from __future__ import annotations

import math
from functools import cached_property
from operator import index
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._copies import ReadOnly, locked
from .._lazy import Pictured
from .changes import in_metres, in_reverse
from .fields import (
    FARTHEST,
    FINEST,
    NANO,
    Array,
    Pose,
    beam_at_stamp,
    bearings,
    checked_pose,
    finite,
    nanoseconds,
    range_limits,
    vector,
)
from .units import warn_of_whole_numbers

_TURN, _INF = 2 * math.pi, math.inf


class Beams(ReadOnly, Pictured):
    """The fields of a `LaserScan`, and what is made of them when it is first asked for."""

    ranges: Array
    angle_min: float
    angle_increment: float
    #: True if the bearings are ``angle_min + i * angle_increment``.
    is_regular: bool
    range_min: float
    range_max: float
    stamp: float
    #: Index of the beam that was taken at the stamp; it may lie between beams.
    stamp_beam: float = 0.0
    scan_time: float
    time_increment: float
    frame_id: str
    intensities: Array | None = None
    pose: Pose | None = None
    #: Covariance (3, 3) of the pose [m, m, rad], where it is known; see `with_pose`.
    pose_covariance: Array | None = None

    def __init__(
        self,
        ranges: ArrayLike,
        angle_min: float | None = None,
        angle_increment: float | None = None,
        *,
        angles: ArrayLike | None = None,
        range_min: float = 0.0,
        range_max: float = math.inf,
        stamp: float = 0.0,
        scan_time: float = 0.0,
        time_increment: float = 0.0,
        frame_id: str = "",
        intensities: ArrayLike | None = None,
        pose: Pose | None = None,
        scale: float = 1.0,
    ) -> None:
        own = self.__dict__
        own["ranges"] = copy = vector("ranges", ranges)
        n, is_clockwise = len(copy), False
        own["is_regular"] = angles is None
        # Nearly all scans are like this; one by one, the checks take longer than the copy.
        if not (
            type(angle_min) is type(angle_increment) is type(range_min) is type(range_max) is float
            and type(stamp) is type(scan_time) is type(time_increment) is float
            and type(frame_id) is str
            and angles is None
            and angle_increment > FINEST
            and (n - 1) * angle_increment <= _TURN
            and -FARTHEST <= angle_min <= FARTHEST
            and 0.0 <= range_min < range_max
            and range_min < _INF
            and -_INF < stamp + scan_time + time_increment < _INF
        ):
            irregular, angle_min, angle_increment, is_clockwise = bearings(
                angle_min, angle_increment, angles, n
            )
            if irregular is not None:
                own["angles"] = irregular
            range_min, range_max = range_limits(range_min, range_max)
            stamp, scan_time = finite("stamp", stamp), finite("scan_time", scan_time)
            time_increment = finite("time_increment", time_increment)
            if not isinstance(frame_id, str):
                raise ValueError(f"frame_id is {frame_id!r}, expected a string")
            frame_id = str(frame_id)
        own["angle_min"], own["angle_increment"] = angle_min, angle_increment
        own["range_min"], own["range_max"] = range_min, range_max
        own["stamp"] = stamp
        own["scan_time"], own["time_increment"] = scan_time, time_increment
        own["frame_id"] = frame_id
        if intensities is not None:
            own["intensities"] = vector("intensities", intensities, n)
        if pose is not None:
            own["pose"] = checked_pose(pose)
        if is_clockwise:
            own.update(in_reverse(self))
        if scale != 1.0:
            own["ranges"] = in_metres(own["ranges"], scale, own["range_max"])
        elif type(ranges) is not np.ndarray or ranges.dtype.kind != "f":
            warn_of_whole_numbers(ranges)

    def _changed(self, **fields: Any) -> Self:
        """Return a copy with other fields, which are checked already."""
        # What is made when first asked for is of the old fields; irregular bearings were given.
        made = ("valid", "points", "angles")[: 2 + self.is_regular] if "ranges" in fields else ()
        other = self.__class__.__new__(self.__class__)
        other.__dict__.update(vars(self), **fields)
        for name in made:
            other.__dict__.pop(name, None)
        return other

    def stamped(self, beam: str | float, ns: int | None = None) -> Self:
        """Return the same scan with a stamp that is the time of another beam.

        Parameters
        ----------
        beam : str or float
            ``first``, which is what ROS means; ``middle`` or ``last``, by which some drivers stamp;
            in the order in which the beams are taken. Or its index, which may lie between beams.
        ns : int, optional
            The stamp in nanoseconds, too: as a float, a time of today is known to 0.2 µs only.

        Examples
        --------
        >>> from lineament import LaserScan
        >>> LaserScan([1.0, 1.0, 1.0], 0.0, 0.1, time_increment=0.01).stamped("last").stamp_beam
        2.0
        """
        is_clockwise = (self.time_increment or self.scan_time) < 0
        fields: dict[str, Any] = {"stamp_beam": beam_at_stamp(beam, len(self), is_clockwise)}
        if ns is not None and ns != self.stamp_ns:
            fields |= {"stamp_ns": index(ns), "stamp": ns / NANO}
        return self._changed(**fields)

    def __len__(self) -> int:
        return len(self.ranges)

    def __repr__(self) -> str:
        return (
            f"LaserScan({len(self)} beams, {int(self.valid.sum())} valid, "
            f"{math.degrees(self.angle_min):.1f}° + i·{math.degrees(self.angle_increment):.4f}°, "
            f"stamp={self.stamp:.3f})"
        )

    @cached_property
    def stamp_ns(self) -> int:
        """The stamp in nanoseconds [ns], exactly as a message has it."""
        return nanoseconds(self.stamp)

    @cached_property
    def angles(self) -> Array:
        """Bearing of each beam [rad], shape (n,)."""
        angles = self.angle_min + self.angle_increment * np.arange(len(self), dtype=np.float64)
        angles.flags.writeable = False
        return angles

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """Whether each beam returned a usable range, shape (n,)."""
        r = self.ranges
        valid = (r > 0) & (r >= self.range_min) & (r < self.range_max)
        valid.flags.writeable = False
        return valid

    @cached_property
    def points(self) -> Array:
        """X = ρ cos θ, y = ρ sin θ (equations 2, 3) [m], shape (n, 2); NaN if invalid."""
        r = np.where(self.valid, self.ranges, np.nan)
        return locked(np.column_stack((r * np.cos(self.angles), r * np.sin(self.angles))))

    @property
    def is_full_circle(self) -> bool:
        """Whether the last beam neighbours the first: n Δφ ≥ 2π - 1.5 Δφ."""
        n, step = len(self), self.angle_increment
        if n < 3:
            return False
        span = (n - 1) * step if self.is_regular else float(self.angles[-1] - self.angles[0])
        return span >= 2 * math.pi - 2.5 * step
