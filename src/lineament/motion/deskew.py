"""`deskew`: a scan as if all of its beams had been taken at once, at its stamp."""

import math

import numpy as np
from numpy.typing import NDArray

from ..scan import Array, LaserScan
from ..scan.fields import checked_pose
from ..scan.laser_scan import no_scan
from ..scan.poses import Twist, poses_along

#: Bearings that fall on each other are set apart by so much [rad].
_APART = 1e-9
#: No sensor moves so far during a sweep [m, rad].
_FARTHEST = 1e6


def beam_times(scan: LaserScan) -> Array | None:
    """Time of each beam after the scan's stamp [s], shape (n,); None where it is not known.

    Beams follow each other by `time_increment`. Where that is 0, the mirror goes once around in
    `scan_time`: a beam whose bearing is ψ past another is taken ψ/2π of it later. The time of the
    beam `stamp_beam` is 0. Of a clockwise scanner both are negative.

    Examples
    --------
    >>> ring = LaserScan([2.0] * 4, 0.0, math.pi / 2, scan_time=0.1)
    >>> beam_times(ring).round(3).tolist()
    [0.0, 0.025, 0.05, 0.075]
    >>> beam_times(LaserScan([2.0], 0.0, 0.1)) is None
    True
    """
    if scan.time_increment != 0:
        return scan.time_increment * (np.arange(len(scan), dtype=np.float64) - scan.stamp_beam)
    if scan.scan_time != 0:
        return scan.scan_time * (scan.angles - _bearing(scan, scan.stamp_beam)) / (2 * math.pi)
    return None


def deskew(scan: LaserScan, twist: Twist | None) -> LaserScan:
    """Undo the motion of the sensor while it swept.

    The velocity is taken to be constant over the sweep. Each measurement is moved to where it lies
    as seen from the pose of the sensor at the scan's stamp, and the beams are put in the order of
    their new bearings, which are irregular. `scan_time` and `time_increment` are then 0.

    A measurement that has come to lie behind two neighbouring beams, farther than both by more than
    they differ, is hidden from that pose, and becomes NaN: else near and far beams would alternate
    along an edge. A beam without a return keeps its range, and its place between its neighbours.
    Where the beams of a full circle go more than once around, the last are put between the first.

    Parameters
    ----------
    scan : LaserScan
    twist : (v_x, v_y, omega) or None
        Velocity of the sensor in its own frame [m/s, m/s, rad/s], from two poses
        (`lineament.scan.poses.twist_between`) or of the last scans
        (`lineament.motion.Tracker.twist`). None where it is not known.

    Returns
    -------
    LaserScan
        With as many beams; the scan itself where times or twist are not known, or the twist is 0.

    Raises
    ------
    ValueError
        If the twist is not three finite numbers, or moves the sensor by a million metres or
        radians during the sweep.
    TypeError
        If it is no scan.

    Examples
    --------
    A wall 2 m ahead, to which the sensor goes at 1 m/s, a beam every 0.1 s:

    >>> scan = LaserScan([2.0, 1.9, 1.8], -0.001, 0.001, time_increment=0.1)
    >>> deskew(scan, (1.0, 0.0, 0.0)).ranges.round(5).tolist()
    [2.0, 2.0, 2.0]
    """
    if not isinstance(scan, LaserScan):
        raise no_scan(scan)
    if twist is None or not any(checked_pose(twist, "twist")):
        return scan
    times = beam_times(scan)
    if times is None or not scan.valid.any():
        return scan
    with np.errstate(over="ignore", invalid="ignore"):
        poses = poses_along(twist, times)
    if not np.abs(poses).max() < _FARTHEST:
        raise ValueError(f"twist {twist} for {np.ptp(times):g} s leads out of any world")
    bearings, ranges = _seen_from_the_stamp(scan, poses)
    order = np.argsort(bearings, kind="stable")
    ranges[_hidden(order, np.where(scan.valid, ranges, np.inf))] = np.nan
    # What lies once around or more is put between the first beams.
    if bearings[order[-1]] - bearings[order[0]] >= 2 * math.pi:
        lowest = bearings[order[0]]
        bearings = lowest + np.mod(bearings - lowest, 2 * math.pi)
        order = np.argsort(bearings, kind="stable")
    # Bearings that are the same are set apart.
    apart = _APART * np.arange(len(scan))
    still = LaserScan(
        ranges[order],
        angles=np.maximum.accumulate(bearings[order] - apart) + apart,
        range_min=scan.range_min,
        range_max=scan.range_max,
        stamp=scan.stamp,
        frame_id=scan.frame_id,
        intensities=None if scan.intensities is None else scan.intensities[order],
    )
    return still.stamped(0, scan.stamp_ns).with_pose(scan.pose, scan.pose_covariance)


def _bearing(scan: LaserScan, beam: float) -> float:
    """Bearing at an index, which may lie between beams or outside [rad]."""
    if scan.is_regular or not 0 <= beam <= len(scan) - 1:
        return scan.angle_min + beam * scan.angle_increment
    return float(np.interp(beam, np.arange(len(scan)), scan.angles))


def _seen_from_the_stamp(scan: LaserScan, poses: Array) -> tuple[Array, Array]:
    """Bearings, near the old ones, and ranges of all beams, shape (n,)."""
    x, y, theta = poses.T
    valid = scan.valid
    r = np.where(valid, scan.ranges, 1.0)
    direction = scan.angles + theta
    px, py = x + r * np.cos(direction), y + r * np.sin(direction)
    shift = np.arctan2(py, px) - scan.angles
    # Whole turns are taken off, but for those that the sensor has made.
    shift -= 2 * math.pi * np.round((shift - theta) / (2 * math.pi))
    beams = np.arange(len(scan))
    shift = np.interp(beams, beams[valid], shift[valid])
    return scan.angles + shift, np.where(valid, np.hypot(px, py), scan.ranges)


def _hidden(order: NDArray[np.intp], ranges: Array) -> NDArray[np.bool_]:
    """Whether each beam has come to lie behind the surface of two neighbours.

    Between two beams that are at different depths there may be an edge: what is not farther than
    both by more than that difference may be on the farther side of it.
    """
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    cover = np.full(len(order), np.inf)
    for i in np.flatnonzero(np.abs(np.diff(rank)) > 1):
        first, last = sorted(rank[i : i + 2].tolist())
        near, far = sorted(ranges[i : i + 2].tolist())
        if far < math.inf:
            between = cover[first + 1 : last]
            np.minimum(between, far + (far - near), out=between)
    return np.isfinite(ranges) & (ranges > cover[rank])
