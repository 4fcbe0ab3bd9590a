"""The scans of several scanners to one table of features: what `lineament merge` does."""

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from ..errors import LogError
from ..extractor import Extractor, load_kernels
from ..features import TABLES, Features
from ..files import check_outputs
from ..logs import open_log
from ..mapping import merge_features
from ..motion.rig import TOGETHER, Rig, fixed, period_of
from ..progress import Track, untracked
from ..rosmsg.frames import Place
from ..scan import LaserScan, Pose
from ..scan.poses import compose, relative
from .extract import in_world, writer_of

#: So many scans of each topic show its frame, and the time from scan to scan.
_FIRST = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Merged:
    """Result of the merging of one log.

    Number of scans of the first topic; how many of these have a partner of each other topic; the
    longest time to one [s]; numbers of features of each kind; wall time [s]; faults as in
    `Extraction`; number of scans whose features are left out, as they have no pose in the world.
    """

    log: str
    output: str
    mountings: dict[str, Pose]
    scans: int
    partners: dict[str, int]
    tolerance: float
    features: dict[str, int]
    seconds: float
    unplaced: int = 0
    skipped: int = 0
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        first = next(iter(self.mountings))
        found = ", ".join(f"{count} {name}" for name, count in self.features.items())
        left = (f"{self.scans - count} without {name}" for name, count in self.partners.items())
        lines = [
            f"{self.log} -> {self.output}",
            f"  {self.scans} scans of {first}: {', '.join(left)} within {self.tolerance:.3g} s",
            f"  {found}",
            f"  {self.seconds:.2f} s, {self.skipped} faults skipped",
            *([f"  {self.unplaced} scans without a pose left out"] if self.unplaced else []),
            *(f"  skipped: {fault}" for fault in self.faults),
        ]
        return "\n".join(lines)


class Nearest:
    """The scan that is nearest to a time, of scans in the order of time; times must increase.

    Examples
    --------
    >>> nearest = Nearest(iter([LaserScan([1.0], 0.0, 0.1, stamp=t) for t in (1.0, 2.0, 3.0)]))
    >>> [nearest(stamp).stamp for stamp in (0.0, 1.4, 1.6, 9.0)]
    [1.0, 1.0, 2.0, 3.0]
    """

    def __init__(self, scans: Iterator[LaserScan]) -> None:
        self._scans = scans
        self._before: LaserScan | None = None
        self._after = next(scans, None)

    def __call__(self, stamp: float) -> LaserScan | None:
        """Return the scan that is nearest to a time [s]; None if there is none at all."""
        while self._after is not None and self._after.stamp <= stamp:
            self._before, self._after = self._after, next(self._scans, None)
        known = [scan for scan in (self._before, self._after) if scan is not None]
        return min(known, key=lambda scan: abs(scan.stamp - stamp), default=None)


class _Scanner:
    """The scans of one topic, with the poses of the robot, and what was found in the last."""

    def __init__(self, path: str | os.PathLike[str], topic: str, **reading: Any) -> None:
        # Poses stay those of the robot, of which the mountings are.
        self.log = open_log(path, topic, laser_pose=(0.0, 0.0, 0.0), **reading)
        self.topic = topic
        #: How many of its scans are merged.
        self.count = 0
        self._found: tuple[LaserScan, Features] | None = None
        first = [scan for _, scan in islice(self.log.items(), _FIRST)]
        if not first:
            raise LogError(self.log.name, f"has no scan of {topic}")
        #: Time from scan to scan [s]; 0 if that is not known.
        self.period = period_of(scan.stamp for scan in first)
        self.frame_id = first[0].frame_id
        self.nearest = Nearest(scan for _, scan in self.log.items())
        self.place = Place((0.0, 0.0, 0.0))

    def features(self, scan: LaserScan, extractor: Extractor) -> Features:
        """Find the features of a scan, which may be asked for several times in a row."""
        if self._found is None or self._found[0] is not scan:
            straight = scan.turned_over() if self.place.is_upside_down else scan
            self._found = scan, extractor(straight)
        return self._found[1]

    def pose(self, scan: LaserScan, first: LaserScan) -> Pose:
        """Return where the scanner is, from where the robot is at the time of another scan."""
        if scan.pose is None or first.pose is None:
            return self.place.pose
        return compose(relative(first.pose, scan.pose), self.place.pose)


def merge_log(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    rig: Rig,
    extractor: Extractor,
    *,
    tolerance: float | None = None,
    world: bool = False,
    track: Track = untracked,
    **reading: Any,
) -> Merged:
    r"""Merge the features of several scanners of a log into a file, in the frame of the robot.

    Each scan of the first topic is merged with those of the others that are nearest in time, by
    `lineament.mapping.merge_features`; where the log has poses, those of the robot, as if all had
    been taken at once. A scanner that has none at that time is left out.

    Parameters
    ----------
    path, output : path-like
        The log, and the file to write, as for `extract_log`.
    rig : Rig
        Topics, mountings and how well they are known; those that are not given are in
        ``/tf_static`` of the log.
    extractor : Extractor
        The method.
    tolerance : float, optional
        Longest time between two scans that are merged [s]; by default half of that from scan to
        scan of the slowest scanner, and a tenth more.
    world : bool
        Whether a table has the features in the frame of the poses, as for `extract_log`.
    track : callable
        ``track(items, name, whole)`` yields the scans and shows the progress.
    **reading
        As for `lineament.open_log`, without `topic` and `laser_pose`.

    Raises
    ------
    LineamentError
        If the log cannot be read, has no such topic, does not say where a scanner is, or a scanner
        has no scans at the times of the first; or the output cannot be written.
    ValueError
        If they are to be in the world, but the output draws scans.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> line = "LASER 3 2 2 2 0 0 0 0 0 0 {0} robot {0}"
    >>> lines = [kind + line.format(t) for t in range(5) for kind in "FR"]
    >>> _ = (folder / "two.log").write_text("\n".join(lines))
    >>> rig = Rig(("FLASER", "RLASER"), {"FLASER": (0.3, 0, 0), "RLASER": (-0.3, 0, 3.14)})
    >>> merge_log(folder / "two.log", folder / "f.csv", rig, Extractor("liu")).partners
    {'RLASER': 5}
    """
    writer = writer_of(output, world=world)  # imports its format, which is no part of the speed
    check_outputs([output], [path])
    load_kernels([extractor])
    started = time.perf_counter()
    scanners = [_Scanner(path, topic, **reading) for topic in rig.topics]
    _place(scanners, rig)
    if tolerance is None:
        tolerance = _tolerance(scanners)
    log, unplaced, found = scanners[0].log, 0, dict.fromkeys(TABLES, 0)
    with writer:
        for parts in _together(scanners, tolerance, track):
            features = _merged(parts, extractor, rig)
            scan = parts[0][1]
            if world:
                unplaced += scan.pose is None
                features = in_world(features, scan)
            writer.write(features, features.scan or scan)
            for name, count in features.counts().items():
                found[name] += count
        if unplaced and unplaced == scanners[0].count:
            raise LogError(log.name, "no scan has a pose, expected a topic of poses")
    return Merged(
        log=str(path),
        output=str(output),
        mountings={scanner.topic: scanner.place.pose for scanner in scanners},
        scans=scanners[0].count,
        partners={scanner.topic: scanner.count for scanner in scanners[1:]},
        tolerance=tolerance,
        features=found,
        seconds=time.perf_counter() - started,
        unplaced=unplaced,
        skipped=sum(scanner.log.skipped for scanner in scanners),
        faults=[fault for scanner in scanners for fault in scanner.log.faults],
    )


def _together(
    scanners: list[_Scanner], tolerance: float, track: Track
) -> Iterator[list[tuple[_Scanner, LaserScan]]]:
    """Yield each scan of the first scanner with those of the others that are near in time."""
    first, *others = scanners
    for _, scan in track(first.log.measured(), Path(first.log.name).name, first.log):
        parts = [(first, scan)]
        for other in others:
            mate = other.nearest(scan.stamp)
            if mate is not None and abs(mate.stamp - scan.stamp) <= tolerance:
                parts.append((other, mate))
        for scanner, _ in parts:
            scanner.count += 1
        yield parts
    for other in others:
        if not other.count:
            raise LogError(
                first.log.name,
                f"no scan of {other.topic} is within {tolerance:.3g} s of one of {first.topic}: "
                "have they two clocks?",
            )


def _place(scanners: list[_Scanner], rig: Rig) -> None:
    """Find where each scanner is on the robot."""
    log = scanners[0].log
    frames = fixed(log.mountings())
    for scanner in scanners:
        try:
            scanner.place = rig.place(scanner.topic, scanner.frame_id, frames)
        except LookupError as error:
            raise LogError(
                log.name,
                f"where the scanner of {scanner.topic} is on the robot is not known: {error}; "
                f"expected /tf_static, or --mounting {scanner.topic}=X,Y,DEGREES",
            ) from None


def _tolerance(scanners: list[_Scanner]) -> float:
    slowest = max(scanner.period for scanner in scanners)
    if not slowest:
        raise LogError(scanners[0].log.name, "has no time from scan to scan, expected a tolerance")
    return TOGETHER * slowest


def _merged(parts: list[tuple[_Scanner, LaserScan]], extractor: Extractor, rig: Rig) -> Features:
    """Merge the features of scans of one time; their scan has the pose of the robot."""
    first = parts[0][1]
    merged = merge_features(
        [scanner.features(scan, extractor) for scanner, scan in parts],
        [scanner.pose(scan, first) for scanner, scan in parts],
        rig.covariance,
        frame_id=rig.base_frame,
    )
    assert merged.scan is not None
    merged.scan = merged.scan.with_pose(first.pose, first.pose_covariance)
    return merged
