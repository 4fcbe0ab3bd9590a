"""One sweep of a 2-D laser scanner, as it is given."""

from __future__ import annotations

import math
from operator import index
from typing import Any, Self, SupportsIndex, overload

from numpy import nan, ndarray, where
from numpy.typing import ArrayLike

from .beams import Beams
from .changes import Mask, checked_mask, in_mask, in_metres, in_reverse, part_of
from .fields import (
    FARTHEST,
    FINEST,
    NANO,
    Pose,
    beam_at_stamp,
    beams_to,
    bearings,
    checked_pose,
    covariance_of_pose,
    finite,
    message_fields,
    range_limits,
    vector,
)
from .units import warn_of_whole_numbers

_TURN, _INF = 2 * math.pi, math.inf


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
        elif type(ranges) is not ndarray or ranges.dtype.kind != "f":
            warn_of_whole_numbers(ranges)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"LaserScan is read-only: {name} cannot be set")

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

    def _changed(self, **fields: Any) -> Self:
        """Return a copy with other fields, which are checked already."""
        # What is made when first asked for is of the old fields; irregular bearings were given.
        made = ("valid", "points", "angles")[: 2 + self.is_regular] if "ranges" in fields else ()
        other = self.__class__.__new__(self.__class__)
        other.__dict__.update(vars(self), **fields)
        for name in made:
            other.__dict__.pop(name, None)
        return other

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
        >>> LaserScan([1.0, 1.0, 1.0], 0.0, 0.1, time_increment=0.01).stamped("last").stamp_beam
        2.0
        """
        is_clockwise = (self.time_increment or self.scan_time) < 0
        fields: dict[str, Any] = {"stamp_beam": beam_at_stamp(beam, len(self), is_clockwise)}
        if ns is not None and ns != self.stamp_ns:
            fields |= {"stamp_ns": index(ns), "stamp": ns / NANO}
        return self._changed(**fields)

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
