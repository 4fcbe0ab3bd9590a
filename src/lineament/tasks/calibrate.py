"""Where a scanner is on its robot, and its wheels: what `lineament calibrate` does."""

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LogError
from ..extractor import Extractor, load_kernels
from ..features import Features
from ..files import check_outputs
from ..logs import Log, open_log
from ..logs.drives import one_scanner
from ..motion import Calibration, Tracker, beam_times, calibrate, deskew
from ..motion.calibration import FEWEST, joined
from ..motion.steps import Carried, Steps, shared_walls, steps_of
from ..output.calibrations import plot_calibration
from ..output.canvas import check_ending
from ..progress import Track, untracked
from ..scan import LaserScan, Pose

#: Units of those that are no factors.
_UNITS = {"x": " m", "y": " m", "theta": " rad", "track": " m", "drift": " rad/m"}
_LABELS = {
    "way": "ways, times",
    "turn": "turns, times",
    "drift": "turns too much",
    "left": "left wheel, times",
    "right": "right wheel, times",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibrated:
    """What was found in a log.

    Numbers of scans, of steps, of those at whose ends another scanner sees the same walls; way of
    the scanner [m], its turns [rad].
    """

    log: str
    scans: int
    steps: int
    shared: int
    way: float
    turns: float
    found: Calibration

    @property
    def laser_pose(self) -> str:
        """The option that gives the mounting to other commands; "" if it is not known."""
        pose = self.found.mounting
        return "" if pose is None else "--laser-pose " + " ".join(f"{part:.4f}" for part in pose)

    def __str__(self) -> str:
        found, slips = self.found, int(self.found.is_slip.sum())
        left_out = f", {slips} left out as slips" if slips else ""
        shared = f", {self.shared} times the same walls" if self.shared else ""
        lines = [
            f"{self.log}: {self.scans} scans, {self.steps} steps{left_out}, {self.way:.0f} m, "
            f"{math.degrees(self.turns):.0f}° of turns{shared}"
        ]
        for name in found.names:
            label = _LABELS.get(name, name)
            if name in found.unknown:
                lines.append(f"  {label:<18} not known: {found.unknown[name]}")
                continue
            value, deviation = found.values[name], found.deviations[name]
            text = f"  {label:<18} {value:8.4f} ± {deviation:.4f}{_UNITS.get(name, '')}"
            degrees = f"  ({math.degrees(value):.2f}° ± {math.degrees(deviation):.2f}°)"
            lines.append(text + (degrees if name == "theta" else ""))
        return "\n".join([*lines, *([f"  {self.laser_pose}"] if self.laser_pose else [])])

    def as_dict(self) -> dict[str, Any]:
        """Return all that is known, as JSON has it."""
        found = self.found
        return {
            "log": self.log,
            "scans": self.scans,
            "steps": self.steps,
            "shared": self.shared,
            "slips": int(found.is_slip.sum()),
            "way": self.way,
            "turns": self.turns,
            "values": found.values,
            "deviations": found.deviations,
            "covariance": found.covariance.tolist(),
            "unknown": found.unknown,
            "laser_pose": found.mounting,
        }


def calibrate_log(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    extractor: Extractor | None = None,
    *,
    against: str | None = None,
    track_width: float = 0.0,
    deskewed: bool = True,
    roughness: float = 0.01,
    track: Track = untracked,
    **reading: Any,
) -> Calibrated:
    """Find where the scanner of a log is on its robot, and what is wrong with its wheels.

    Or, with `against`, where it is in the frame of another scanner.

    Parameters
    ----------
    path : path-like
        The log, with odometry, of any format that `lineament.open_log` reads. A mounting that it
        has is left aside.
    output : path-like, optional
        A picture of what is left of each step.
    extractor : Extractor, optional
        The method.
    against : str, optional
        Topic of another scanner of the same robot: its motions, by its own scans, are taken in
        place of odometry, and of the log's poses none.
    track_width : float
        Distance between the wheels by which the odometry was computed [m]; 0 if it is not known.
    deskewed : bool
        Whether scans are deskewed that say how long their sweep takes.
    roughness : float
        How far walls are from straight [m]; 0 in a simulation.
    track : callable
        ``track(items, name, whole)`` yields the scans and shows the progress.
    **reading
        As for `lineament.open_log`, without `laser_pose`.

    Raises
    ------
    LineamentError
        If the log cannot be read, has no odometry, hardly moves, or its odometry does not go with
        its scans; or the output cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from lineament.logs import save_npz
    >>> from lineament.simulation import SENSORS, drive, room
    >>> way = [(-2, -1), (2, -1), (2, 1), (-2, 1), (-2, -0.5), (1.5, -0.5)]
    >>> log = Path(tempfile.mkdtemp()) / "log.npz"
    >>> save_npz(log, drive(room(), way, SENSORS["lms181"], speed=1, rate=10))
    >>> found = calibrate_log(log, deskewed=False).found
    >>> all(abs(found.values[name]) < 0.01 for name in ("x", "y", "theta"))
    True
    """
    if output is not None:
        check_ending(output)
        check_outputs([output], [path])
    log, scans = _read(path, reading, deskewed=deskewed)
    extractor = Extractor() if extractor is None else extractor
    load_kernels([extractor])
    poses = [scan.pose for scan in scans]
    if against is not None:
        if against == log.topic:
            raise LogError(log.name, f"--against {against} is the scanner itself")
        _, others = _read(path, {**reading, "topic": against}, deskewed=deskewed)
        others.sort(key=lambda scan: scan.stamp)  # Times are looked up among theirs.
        other_features = _features(others, extractor, deskewed=deskewed)
        carried = Carried.of(other_features, roughness)
        poses = [carried.at(scan.stamp) for scan in scans]
        if not any(poses):
            raise LogError(log.name, f"{against} has no scans around those of {log.topic}")
    elif not any(pose is not None for pose in poses):
        raise LogError(log.name, "has no poses, expected odometry (--odometry names its topic)")
    shown = track(scans, Path(log.name).name, scans)
    features = _features(shown, extractor, deskewed=deskewed)
    try:
        steps, found = _calibrated(
            features, poses, roughness, track=track_width, wheels=against is None
        )
    except ValueError as error:
        raise LogError(log.name, str(error)) from None
    shared = 0
    if against is not None and found.mounting is not None:
        ends = [features[last] for _, last in steps.ends]
        sights = shared_walls(other_features, carried, ends, found.mounting, roughness)
        found, shared = joined(found, sights)
    if output is not None:
        stamps = np.array([scans[last].stamp for _, last in steps.ends])
        plot_calibration(found, stamps, output, title=Path(log.name).name)
    return Calibrated(
        log=log.name,
        scans=len(scans),
        steps=len(steps),
        shared=shared,
        way=sum(math.hypot(motion.x, motion.y) for motion in steps.motions),
        turns=sum(abs(motion.theta) for motion in steps.motions),
        found=found,
    )


def _read(
    path: str | os.PathLike[str], reading: dict[str, Any], *, deskewed: bool
) -> tuple[Log, list[LaserScan]]:
    """Read the scans of a topic in the order of the log, with poses as it has them."""
    log = open_log(path, **reading, laser_pose=(0.0, 0.0, 0.0))
    scans = list(one_scanner(log, odometry=False, deskewed=deskewed))
    if len(scans) > 1 and len({scan.stamp for scan in scans}) == 1:
        stamp = scans[0].stamp
        raise LogError(log.name, f"all stamps are {stamp}, expected stamps that increase")
    return log, scans


def _features(
    scans: Iterable[LaserScan], extractor: Extractor, *, deskewed: bool
) -> list[Features]:
    """Extract the features of each scan, as if all beams had been taken at once."""
    tracker, found = Tracker(), []
    for scan in scans:
        straight = deskew(scan, tracker.twist) if deskewed else scan
        found.append(extractor(straight))
        if deskewed and beam_times(scan) is not None:
            tracker(found[-1])
    return found


def _calibrated(
    features: list[Features], odometry: list[Pose | None], roughness: float, **given: Any
) -> tuple[Steps, Calibration]:
    """Find the mounting by the scans alone; then again, looking for the walls by odometry."""
    steps = steps_of(features, odometry, None, roughness)
    if len(steps) < FEWEST:
        raise ValueError(
            f"the scanner moves too little: {len(steps)} steps of 0.3 m or 20°, expected {FEWEST}"
        )
    found = calibrate(steps.odometry, steps.motions, **given)
    if found.mounting is not None:
        again = steps_of(features, odometry, found.mounting, roughness)
        if len(again) >= len(steps) // 2:
            steps = again
            found = calibrate(steps.odometry, steps.motions, **given)
    return steps, found
