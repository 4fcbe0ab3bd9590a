"""The beams of a scan, and which of them are valid (equations 1-3)."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .._copies import ReadOnly, locked
from .._lazy import Pictured
from .fields import Array, Pose, nanoseconds


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
