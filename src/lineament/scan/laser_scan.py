"""One sweep of a 2-D laser scanner: what it is made of, and what it becomes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Self, SupportsIndex, overload

from numpy import nan, where
from numpy.typing import ArrayLike

from .beams import Beams
from .changes import Mask, checked_mask, in_mask, in_metres, in_reverse, part_of
from .fields import (
    Pose,
    beams_to,
    checked_pose,
    covariance_of_pose,
    message_fields,
    range_limits,
    vector,
)


class LaserScan(Beams):
    """One sweep of a 2-D laser scanner, with the fields of ``sensor_msgs/LaserScan``.

    A beam is *valid* when its range is finite, positive, at least `range_min` and below
    `range_max`. Invalid beams (NaN, ±inf, 0, too near, no return) stay where they are and are
    never filled. Arrays are float64 copies and read-only, and so is the scan. What is masked or
    null is NaN.

    Beams that are given clockwise (a negative `angle_increment`, or `angles` that decrease) are
    reversed: beams of the scan, and of all features, count from the last that was given.
    `stamp_beam`, and times of the other sign, say when they were taken.

    Parameters
    ----------
    ranges : array_like, shape (n,)
        Measured distances [m].
    angle_min, angle_increment : float
        Bearing of the first beam and step between beams [rad], counter-clockwise from the
        x axis of the sensor (equation 1).
    angles : array_like, shape (n,), optional
        Bearings [rad] of irregular beams, strictly increasing or decreasing, instead of `angle_min`
        and `angle_increment` (which are then the first bearing and the median step).
    range_min, range_max : float
        Limits of valid ranges [m]: ``range_min <= r < range_max``.
    stamp : float
        Time of the first beam [s], or of another, see `stamped`: features are where it is then.
    scan_time, time_increment : float
        Time of a turn of the mirror, and between beams [s]; 0 if unknown, negative if the mirror
        turns clockwise: the last beam is then taken first.
    frame_id : str
        Name of the sensor's frame.
    intensities : array_like, shape (n,), optional
        Strength of each return, in the sensor's unit.
    pose : (x, y, theta), optional
        Pose of the sensor in the world frame of its log [m, m, rad].
    scale : float
        What `ranges` are multiplied by to be in metres: 0.001 if they are in millimetres. Limits
        are in metres; of a message that has all in millimetres, see `scaled`.

    Raises
    ------
    ValueError
        If the fields make no sense together. The message names the field and its value.

    Examples
    --------
    >>> scan = LaserScan([1.0, float("nan"), 2.0], angle_min=0.0, angle_increment=0.1)
    >>> len(scan), scan.valid.tolist()
    (3, [True, False, True])
    >>> scan.points[2].round(3).tolist()
    [1.96, 0.397]
    """

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"LaserScan is read-only: {name} cannot be set")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"LaserScan is read-only: {name} cannot be deleted")

    @overload
    def __getitem__(self, index: SupportsIndex) -> tuple[float, float]: ...

    @overload
    def __getitem__(self, index: slice) -> Self: ...

    def __getitem__(self, index: SupportsIndex | slice) -> tuple[float, float] | Self:
        """Return bearing and range of a beam [rad, m]; or a scan of the beams of a slice."""
        if not isinstance(index, slice):
            i = range(len(self))[index]
            return float(self.angles[i]), float(self.ranges[i])
        kept = range(len(self))[index]
        if kept.step < 0:
            raise ValueError(f"step is {kept.step}, expected > 0: beams run counter-clockwise")
        return self._changed(**part_of(self, kept))

    def with_pose(self, pose: Pose | None, covariance: ArrayLike | None = None) -> Self:
        """Return the same scan with another pose [m, m, rad]; they share their arrays.

        `covariance` is that of the pose, shape (3, 3), where it is known.

        Examples
        --------
        >>> LaserScan([1.0, 2.0], 0.0, 0.1).with_pose((3, 4, 0)).pose
        (3.0, 4.0, 0.0)
        """
        return self._changed(
            pose=None if pose is None else checked_pose(pose),
            pose_covariance=None if covariance is None else covariance_of_pose(covariance),
        )

    def turned_over(self) -> Self:
        """Return the same scan in the frame of its sensor turned about the x axis.

        Bearings change their sign: what hangs upside down is then in a frame with z upwards.
        """
        own = in_reverse(self)
        own["angle_min"] = -float(self.angles[-1]) if len(self) else 0.0
        if not self.is_regular:
            own["angles"] = vector("angles", -self.angles[::-1])
        return self._changed(**own)

    def scaled(self, scale: float) -> Self:
        """Return the same scan with ranges and their limits times a number.

        Of a message in millimetres, ``from_message(message).scaled(0.001)``. The pose stays.

        Examples
        --------
        >>> LaserScan([1500.0], 0.0, 0.1, range_max=5600.0).scaled(0.001).ranges.tolist()
        [1.5]
        """
        ranges = in_metres(self.ranges, scale)
        low, high = range_limits(self.range_min * scale, self.range_max * scale)
        return self._changed(ranges=ranges, range_min=low, range_max=high)

    def masked(self, mask: Mask) -> Self:
        """Return the same scan without the ranges of some sectors, which are NaN.

        Parameters
        ----------
        mask : sequence of (from, to)
            Bearings [rad]: a sector goes counter-clockwise from the first to the second, both
            included, such as that in which the scanner sees its own robot.

        Raises
        ------
        ValueError
            If a sector is no pair of bearings.

        Examples
        --------
        >>> LaserScan([1.0, 2.0, 3.0], -0.1, 0.1).masked([(0.1, -0.1)]).ranges.tolist()
        [nan, 2.0, nan]
        """
        ranges = where(in_mask(self.angles, checked_mask(mask)), nan, self.ranges)
        return self._changed(ranges=vector("ranges", ranges))

    @classmethod
    def from_points(cls, points: ArrayLike, **fields: Any) -> Self:
        """Make the scan that a sensor at the origin would have of some points, in any order.

        Beams are sorted by bearing, from the widest gap on; where more than one and a half median
        steps lie between two, there are beams without a return. Points that are not finite or at
        the origin are left out; of points with one bearing the nearest stays.

        Parameters
        ----------
        points : array_like, shape (n, 2)
            x and y in the frame of the sensor [m].
        **fields
            ``stamp``, ``frame_id``, ``pose`` and limits, as in `LaserScan`.

        Raises
        ------
        ValueError
            If the points have another shape.

        Examples
        --------
        >>> LaserScan.from_points([(0.0, 2.0), (1.0, 0.0)]).ranges.tolist()
        [1.0, 2.0]
        """
        ranges, angles = beams_to(points)
        return cls(ranges, angles=angles, **fields)

    @classmethod
    def from_message(cls, message: Any, *, pose: Pose | None = None, stamp: str = "first") -> Self:
        """Convert any ``sensor_msgs/LaserScan`` (rospy, rclpy, rosbags, DDS), by its fields.

        Parameters
        ----------
        message : object
            ``header`` and ``intensities`` may be missing or empty.
        pose : (x, y, theta), optional
            Pose of the sensor, from elsewhere.
        stamp : str
            Which beam is taken at the time of the header: see `stamped`.

        Raises
        ------
        ValueError
            If a field is missing or the fields make no sense together.

        Examples
        --------
        >>> from types import SimpleNamespace as Message
        >>> header = Message(stamp=Message(sec=7, nanosec=500_000_000), frame_id="laser")
        >>> LaserScan.from_message(Message(
        ...     header=header, ranges=[1.0, 1.1], angle_min=0.0, angle_increment=0.1,
        ...     range_min=0.1, range_max=30.0, scan_time=0.1, time_increment=0.0)).stamp
        7.5
        """
        try:
            fields, ns = message_fields(message)
        except AttributeError as error:
            raise ValueError(f"message is no sensor_msgs/LaserScan: {error}") from None
        scan = cls(**fields, pose=pose)
        scan = scan.stamped(scan.stamp_beam, ns)
        return scan.stamped(stamp) if stamp != "first" else scan


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
