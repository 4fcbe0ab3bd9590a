"""The fields of a scan and of its noise, as they are given: checked, and copied."""

import math
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
_FLOAT64 = np.dtype(np.float64)
#: x, y [m], and heading [rad].
Pose = tuple[float, float, float]
#: Beams to points: a gap of more steps is where the scan begins, and a turn has so many at most.
_WIDE, _MOST_BEAMS = 10.0, 20_000
#: Nanoseconds of a second.
NANO = 1_000_000_000


def number(name: str, value: object) -> float:
    """Convert a real number to a float; ValueError names the field."""
    if type(value) is float:
        return value  # An isinstance of an abstract class takes a microsecond.
    if isinstance(value, Real) and not isinstance(value, bool):
        return float(value)
    raise ValueError(f"{name} is {value!r}, expected a number")


def finite(name: str, value: object) -> float:
    """Convert a finite number to a float."""
    given = value if type(value) is float else number(name, value)
    if not math.isfinite(given):
        raise ValueError(f"{name} is {given}, expected a finite number")
    return given


def vector(name: str, values: ArrayLike, length: int | None = None) -> Array:
    """Copy `values` into a read-only float64 vector."""
    try:
        given = np.asarray(values)
        if given.dtype.kind == "c":
            raise TypeError
        # To set what happens at a signalling NaN costs a microsecond.
        copy = given.copy() if given.dtype is _FLOAT64 else _as_float64(given)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {values!r:.60}, expected a vector of numbers") from None
    if copy.ndim != 1:
        raise ValueError(f"{name} has shape {copy.shape}, expected one dimension")
    if length is not None and len(copy) != length:
        raise ValueError(f"{name} has {len(copy)} values, expected {length}, one for each range")
    copy.setflags(write=False)
    return copy


# A damaged file may hold a signalling NaN: it becomes a NaN like any other, without a warning.
@np.errstate(invalid="ignore")
def _as_float64(values: NDArray[Any]) -> Array:
    return values.astype(np.float64)


def regular_bearings(first: object, step: object, n: int) -> tuple[float, float]:
    """First bearing and step of `n` beams [rad], which must go round once at most."""
    if first is None or step is None:
        raise ValueError("angle_min and angle_increment, or angles, must be given")
    first, step = finite("angle_min", first), finite("angle_increment", step)
    if n > 1 and not first + 0.5 * step > first:
        if step > 0:
            raise ValueError(f"angle_increment is {step}, too small for bearings from {first}")
        raise ValueError(f"angle_increment is {step}, expected > 0: beams run counter-clockwise")
    last = first + (n - 1) * step
    if last - first > 2 * math.pi:  # Rare, and the check proper takes longer.
        _check_turn("angle_increment", first, last, step)
    return first, step


@np.errstate(over="ignore")  # Steps between absurd bearings, which go more than once around.
def irregular_bearings(angles: Array) -> tuple[float, float]:
    """First bearing and median step [rad] of bearings that increase, and go round once at most."""
    bad = np.flatnonzero(~np.isfinite(angles))
    if len(bad):
        raise ValueError(f"angles[{bad[0]}] is {angles[bad[0]]}, expected a finite bearing")
    steps = np.diff(angles)
    bad = np.flatnonzero(steps <= 0)
    if len(bad):
        i = int(bad[0]) + 1
        raise ValueError(
            f"angles[{i}] is {angles[i]} after {angles[i - 1]}, expected bearings that increase"
        )
    if len(angles) == 0:
        return 0.0, 0.0
    step = float(np.median(steps)) if len(steps) else 0.0
    _check_turn("angles", angles[0], angles[-1], step)
    return float(angles[0]), step


def _check_turn(name: str, first: float, last: float, step: float) -> None:
    # Some drivers repeat the first bearing at the end of the turn, and round their increment.
    if last - first > 2 * math.pi + min(1.5 * step, 0.1):
        raise ValueError(
            f"{name}: beams from {first:.6g} to {last:.6g} rad go more than once around"
        )


def beams_to(points: ArrayLike) -> tuple[Array, Array]:
    """Ranges and increasing bearings of beams to points (n, 2), and of beams to nothing between."""
    try:
        xy = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"points is {points!r:.60}, expected numbers of shape (n, 2)") from None
    xy = xy.reshape(-1, 2) if xy.size == 0 else xy
    if xy.ndim != 2 or xy.shape[1] != 2:
        raise ValueError(f"points has shape {xy.shape}, expected (n, 2): x and y of each")
    xy = xy[np.isfinite(xy).all(axis=1)]
    ranges, angles = np.hypot(*xy.T), np.arctan2(xy[:, 1], xy[:, 0])
    order = np.lexsort((ranges, angles))
    order = order[ranges[order] > 0]
    ranges, angles = ranges[order], angles[order]
    is_nearest = np.diff(angles, prepend=-np.inf) > 0
    ranges, angles = ranges[is_nearest], angles[is_nearest]
    if len(ranges) < 2:
        return ranges, angles
    gaps = np.diff(angles, append=angles[0] + 2 * math.pi)
    step = max(float(np.median(gaps)), 2 * math.pi / _MOST_BEAMS)
    if gaps.max() > _WIDE * step:  # else a full circle, which stays cut at the back
        begin = int(gaps.argmax()) + 1
        ranges, angles = np.roll(ranges, -begin), np.unwrap(np.roll(angles, -begin))
        gaps = np.roll(gaps, -begin)
    gaps[-1] = 0.0  # nothing is behind the last
    beams = np.maximum(np.floor(gaps / step + 0.5).astype(np.int64), 1)
    last = np.repeat(np.arange(len(beams)), beams)
    ahead = np.arange(len(last)) - np.repeat(np.cumsum(beams) - beams, beams)
    return (
        np.where(ahead == 0, ranges[last], np.nan),
        angles[last] + ahead * (gaps / beams)[last],
    )


def range_limits(low: object, high: object) -> tuple[float, float]:
    """Limits of valid ranges [m], in order."""
    range_min, range_max = number("range_min", low), number("range_max", high)
    if not 0 <= range_min < math.inf:
        raise ValueError(f"range_min is {range_min}, expected a finite number ≥ 0")
    if not range_max > range_min:
        raise ValueError(f"range_max is {range_max}, expected more than range_min = {range_min}")
    return range_min, range_max


def checked_pose(pose: Any) -> Pose:
    """Three finite numbers."""
    try:
        x, y, theta = (finite("pose", value) for value in pose)
    except TypeError:
        raise ValueError(f"pose is {pose!r}, expected (x, y, theta)") from None
    except ValueError:
        raise ValueError(f"pose is {pose!r}, expected three finite numbers") from None
    return x, y, theta


def covariance_of_pose(covariance: ArrayLike) -> Array:
    """Covariance (3, 3) of x, y, theta: symmetric, and of no direction below 0; read-only."""
    matrix = np.array(covariance, dtype=np.float64)
    is_matrix = matrix.shape == (3, 3) and bool(np.isfinite(matrix).all())
    if is_matrix:
        least = -1e-9 * np.abs(matrix).max()
        is_matrix = np.abs(matrix - matrix.T).max() <= -least
        is_matrix = is_matrix and np.linalg.eigvalsh(matrix)[0] >= least
    if not is_matrix:
        raise ValueError(
            f"covariance of the pose is {matrix.tolist()}, expected (3, 3), symmetric, "
            "positive semidefinite"
        )
    matrix.flags.writeable = False
    return matrix


def nanoseconds(stamp: float) -> int:
    """Nanoseconds of a stamp [s], without the rounding of a product."""
    seconds = math.floor(stamp)
    return seconds * NANO + round((stamp - seconds) * NANO)


def counter_clockwise(
    ranges: Any, intensities: Any, angle_min: float, increment: float, **times: float
) -> tuple[dict[str, Any], int]:
    """Fields of a scan whose beams may run clockwise, and the index of its first beam in time.

    `times` are `time_increment` and `scan_time`.
    """
    n, first = len(ranges), 0
    if increment < 0 and n > 1:
        ranges, first = ranges[::-1], n - 1
        intensities = None if intensities is None else intensities[::-1]
        angle_min, increment = angle_min + first * increment, -increment
        times = {name: -time for name, time in times.items()}
    angles = {"angle_min": angle_min, "angle_increment": increment}
    return {"ranges": ranges, "intensities": intensities, **angles, **times}, first


def message_fields(message: Any) -> tuple[dict[str, Any], int, int | None]:
    """Fields of a scan for a ``sensor_msgs/LaserScan``, its first beam, and its stamp [ns].

    AttributeError if the message is something else.
    """
    intensities = getattr(message, "intensities", None)
    fields, first = counter_clockwise(
        message.ranges,
        None if intensities is None or not len(intensities) else intensities,
        message.angle_min,
        number("angle_increment", message.angle_increment),
        scan_time=number("scan_time", message.scan_time),
        time_increment=number("time_increment", message.time_increment),
    )
    fields |= {"range_min": message.range_min, "range_max": message.range_max}
    header, ns = getattr(message, "header", None), None
    if header is not None:
        fields["frame_id"], stamp = header.frame_id, header.stamp
        if hasattr(stamp, "sec"):  # of ROS 2; and of ROS 1
            ns = int(stamp.sec) * NANO + int(stamp.nanosec)
        elif hasattr(stamp, "secs"):
            ns = int(stamp.secs) * NANO + int(stamp.nsecs)
        else:
            fields["stamp"] = float(stamp)
    return fields, first, ns
