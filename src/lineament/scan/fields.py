"""The fields of a scan and of its noise, as they are given: checked, and copied."""

import math
from datetime import UTC, datetime
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
#: Beams that a stamp may be the time of, in the order in which they are taken.
STAMPS = ("first", "middle", "last")
_FLOAT64, _FLOAT32 = np.dtype(np.float64), np.dtype(np.float32)
_OF_MESSAGE: tuple[str, ...] = ("ranges", "angle_min", "angle_increment", "range_min", "range_max")
_OF_MESSAGE += ("scan_time", "time_increment")
#: x, y [m], and heading [rad].
Pose = tuple[float, float, float]
#: Beams to points: a gap of more steps is where the scan begins, and a turn has so many at most.
_WIDE, _MOST_BEAMS = 10.0, 20_000
#: Bearings that differ by more are different floats, wherever they are [rad].
FINEST = 1e-9
#: A scan that goes around from behind has bearings up to three half turns; none has so many [rad].
FARTHEST = 4 * math.pi
#: What is likely where bearings are too large.
DEGREES = ": are they in degrees? (numpy.radians)"
#: No robot that carries a 2-D scanner is longer [m]; a mounting of 5 cm in millimetres is not less.
LONGEST = 50.0
#: Nanoseconds of a second.
NANO = 1_000_000_000
#: Stamps between these are seconds since 1970, and make a date (1990 to 2100).
_LONG_AGO, _FAR_OFF = 631_152_000.0, 4_102_444_800.0


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


def at_least_0(name: str, value: object) -> float:
    """Convert a finite number that is not negative to a float."""
    given = finite(name, value)
    if given < 0:
        raise ValueError(f"{name} is {given:g}, expected ≥ 0")
    return given


def is_whole(value: object) -> bool:
    """Whether a value is a whole number, of Python or NumPy."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def vector(name: str, values: ArrayLike, length: int | None = None) -> Array:
    """Copy `values` into a read-only float64 vector; what is masked or null is NaN."""
    if type(values) is np.ndarray and values.dtype is _FLOAT64:
        copy = values.copy()
    elif type(values) is np.ndarray and values.dtype is _FLOAT32:  # as messages have them
        copy = _widened(values)
    else:
        copy = np.array(numbers(name, values))
    if copy.ndim != 1:
        raise ValueError(f"{name} has shape {copy.shape}, expected one dimension")
    if length is not None and len(copy) != length:
        raise ValueError(f"{name} has {len(copy)} values, expected {length}, one for each range")
    copy.setflags(write=False)
    return copy


@np.errstate(invalid="ignore")  # A signalling NaN, as in `numbers`.
def _widened(values: NDArray[np.float32]) -> Array:
    return values.astype(np.float64, "C")


# A damaged file may hold a signalling NaN: it becomes a NaN like any other, without a warning.
@np.errstate(invalid="ignore")
def numbers(name: str, values: ArrayLike) -> Array:
    """Make a float64 array of numbers, of any shape; what is masked or null is NaN.

    ValueError for truth values, dates, texts and complex numbers, which NumPy would convert.
    """
    try:
        given = np.asarray(values)
        if given.dtype.kind == "O":
            given = np.array([*map(_number_or_nan, given.flat)]).reshape(given.shape)
        if given.dtype.kind not in "fiu" and given.size:
            raise TypeError
        made = given.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError):
        shown = " ".join(f"{values!r:.60}".split())
        raise ValueError(f"{name} is {shown}, expected numbers in an array") from None
    mask = np.ma.getmask(values)
    return made if mask is np.ma.nomask else np.where(mask, np.nan, made)


def _number_or_nan(value: Any) -> float:
    # Tables have None or their own null (pandas.NA) where there is no number.
    if value is None or type(value).__name__ == "NAType":
        return math.nan
    if isinstance(value, bool | np.bool_ | str | bytes):
        raise TypeError
    return float(value)


def regular_bearings(first: object, step: object, n: int) -> tuple[float, float, bool]:
    """First bearing and step of `n` beams [rad], which must go round once at most.

    And whether they are those of the beams in reverse, since these run clockwise.
    """
    if first is None or step is None:
        raise ValueError("angle_min and angle_increment, or angles, must be given")
    first, step = finite("angle_min", first), finite("angle_increment", step)
    is_clockwise = step < 0 and n > 1
    if is_clockwise:
        first, step = first + (n - 1) * step, -step
    if n > 1 and not first + 0.5 * step > first:
        if step == 0:
            raise ValueError("angle_increment is 0, expected a step from beam to beam")
        raise ValueError(f"angle_increment is {step}, too small for bearings from {first}")
    last = first + (n - 1) * step
    if last - first > 2 * math.pi:  # Rare, and the check proper takes longer.
        _check_turn("angle_increment", first, last, step)
    if not -FARTHEST <= first <= FARTHEST:
        raise ValueError(_no_bearing("angle_min", first))
    return first, step, is_clockwise


def bearings(
    first: object, step: object, angles: ArrayLike | None, n: int
) -> tuple[Array | None, float, float, bool]:
    """Bearings of irregular beams, the first and the (median) step; whether they are reversed."""
    if angles is None:
        return None, *regular_bearings(first, step, n)
    if first is not None or step is not None:
        raise ValueError("angles are given together with angle_min or angle_increment")
    copy = vector("angles", angles, n)
    if np.ma.getmask(angles).any():
        raise ValueError("angles are masked, expected a bearing of each beam")
    is_clockwise = n > 1 and copy[0] > copy[-1] and bool((np.diff(copy) < 0).all())
    copy = copy[::-1] if is_clockwise else copy
    return copy, *irregular_bearings(copy), is_clockwise


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
            f"angles[{i}] is {angles[i]} after {angles[i - 1]}, expected bearings that increase, "
            "or that all decrease"
        )
    if len(angles) == 0:
        return 0.0, 0.0
    step = float(np.median(steps)) if len(steps) else 0.0
    _check_turn("angles", angles[0], angles[-1], step)
    if not -FARTHEST <= angles[0] <= FARTHEST:
        raise ValueError(_no_bearing("angles[0]", angles[0]))
    return float(angles[0]), step


def _check_turn(name: str, first: float, last: float, step: float) -> None:
    # Some drivers repeat the first bearing at the end of the turn, and round their increment.
    if last - first > 2 * math.pi + min(1.5 * step, 0.1):
        raise ValueError(
            f"{name}: beams from {first:.6g} to {last:.6g} rad go more than once around"
            f"{DEGREES if last - first > 4 * math.pi else ''}"
        )


def _no_bearing(name: str, value: float) -> str:
    return f"{name} is {value:.6g} rad, more than two turns from the x axis{DEGREES}"


def beams_to(points: ArrayLike) -> tuple[Array, Array]:
    """Ranges and increasing bearings of beams to points (n, 2), and of beams to nothing between."""
    xy = numbers("points", points)
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


def beam_at_stamp(beam: str | float, n: int, is_clockwise: bool) -> float:
    """Index of the beam that a stamp is the time of; it may be given as one of `STAMPS`."""
    if isinstance(beam, str):
        if beam not in STAMPS:
            raise ValueError(f"stamp is {beam!r}, expected {', '.join(STAMPS)}")
        share = STAMPS.index(beam) / 2
        return (1 - share if is_clockwise else share) * (n - 1)
    return finite("stamp_beam", beam)


def checked_pose(pose: Any, name: str = "pose") -> Pose:
    """Three finite numbers."""
    try:
        x, y, theta = pose
        return finite(name, x), finite(name, y), finite(name, theta)
    except TypeError:
        raise ValueError(f"{name} is {pose!r}, expected (x, y, theta)") from None
    except ValueError:
        raise ValueError(f"{name} is {pose!r}, expected three finite numbers") from None


def checked_place(place: Any, name: str) -> Pose:
    """Place that somebody wrote down: three finite numbers, the last an angle."""
    pose = checked_pose(place, name)
    if abs(pose[2]) > 2 * math.pi:
        raise ValueError(f"{name} has theta = {pose[2]:g} rad, more than a turn{DEGREES}")
    return pose


def checked_mounting(laser_pose: Any, name: str = "laser_pose") -> Pose:
    """Pose of the scanner on what poses are of: a place within `LONGEST`."""
    x, y, theta = checked_place(laser_pose, name)
    if math.hypot(x, y) > LONGEST:
        raise ValueError(
            f"{name} is {math.hypot(x, y):g} m from the robot's origin, "
            f"expected {LONGEST:g} m at most: is it in millimetres?"
        )
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


def date_of(stamp: float) -> str:
    """Write a stamp [s] as a date, if it makes one from 1990 to 2100; else it is ""."""
    if not _LONG_AGO <= stamp < _FAR_OFF:
        return ""
    return f"{datetime.fromtimestamp(stamp, UTC):%Y-%m-%d %H:%M:%S} UTC"


def message_fields(message: Any) -> tuple[dict[str, Any], int | None]:
    """Fields of a scan for a ``sensor_msgs/LaserScan``, and its stamp [ns].

    AttributeError if the message is something else.
    """
    intensities = getattr(message, "intensities", None)
    fields = {name: getattr(message, name) for name in _OF_MESSAGE}
    fields["intensities"] = intensities if intensities is not None and len(intensities) else None
    header, ns = getattr(message, "header", None), None
    if header is not None:
        fields["frame_id"], stamp = header.frame_id, header.stamp
        if hasattr(stamp, "sec"):  # of ROS 2; and of ROS 1
            ns = int(stamp.sec) * NANO + int(stamp.nanosec)
        elif hasattr(stamp, "secs"):
            ns = int(stamp.secs) * NANO + int(stamp.nsecs)
        else:
            fields["stamp"] = float(stamp)
    return fields, ns
