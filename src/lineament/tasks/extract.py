"""A whole log to a table of features: what `lineament extract` does."""

import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LogError, NothingFoundError, one_line, warn
from ..extractor import Extractor, load_kernels
from ..features import TABLES, Features, make_records
from ..files import check_outputs
from ..logs import open_log
from ..methods import Method
from ..output import Writer, open_writer
from ..progress import Track, untracked
from ..scan import LaserScan


@dataclass(frozen=True, slots=True, kw_only=True)
class Extraction:
    """Result of the extraction of one log.

    Topics of the scans; number of scans and of features of each kind; share of invalid beams; wall
    time [s] from opening the log to the finished file, without that of loading code; number of
    faulty lines or records that were skipped, the first of which are in `faults`; number of scans
    whose features are left out, since they are to be in the world and the scan has no pose.
    """

    log: str
    output: str = ""
    topics: list[str] = field(default_factory=list)
    scans: int = 0
    features: dict[str, int] = field(default_factory=dict)
    invalid: float = 0.0
    seconds: float = 0.0
    skipped: int = 0
    unplaced: int = 0
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        found = ", ".join(f"{count} {name}" for name, count in self.features.items())
        rate = self.scans / self.seconds if self.seconds > 0 else 0.0
        lines = [
            f"{self.log} -> {self.output}",
            f"  {self.scans} scans, {100 * self.invalid:.1f} % of beams invalid, "
            f"{self.skipped} faults skipped",
            f"  {found}",
            f"  {self.seconds:.2f} s, {rate:.0f} scans/s",
            *([f"  {self.unplaced} scans without a pose left out"] if self.unplaced else []),
            *(f"  skipped: {fault}" for fault in self.faults),
        ]
        return "\n".join(lines)


def extract_log(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    extractor: Extractor,
    *,
    world: bool = False,
    track: Track = untracked,
    **reading: Any,
) -> Extraction:
    """Extract the features of all scans of a log into a file.

    Memory does not grow with the log. The output appears when it is complete.

    Parameters
    ----------
    path : path-like
        The log, of any format that `lineament.open_log` reads.
    output : path-like
        A file of any ending that `lineament.output.open_writer` knows.
    extractor : Extractor
        The method.
    world : bool
        Whether a table has the features in the frame of the poses, ``map``, with covariances that
        are turned and, where it is known, have the covariance of the pose in them. A scan without a
        pose has no features then.
    track : callable
        ``track(items, name, whole)`` yields the scans and shows the progress.
    **reading
        As for `lineament.open_log`.

    Raises
    ------
    LineamentError
        If the log cannot be read, the output cannot be written or is the log; no partial file
        stays. And if they are to be in the world, but no scan has a pose.
    ValueError
        If they are to be in the world, but the output draws scans, which it does there anyway.

    Examples
    --------
    >>> import tempfile
    >>> from lineament import LaserScan
    >>> from lineament.logs import save_npz
    >>> folder = Path(tempfile.mkdtemp())
    >>> save_npz(folder / "log.npz", [LaserScan([2.0, 2.0, 2.0], 0.0, 0.01)] * 5)
    >>> extract_log(folder / "log.npz", folder / "features.parquet", Extractor("liu")).scans
    5
    """
    writer = writer_of(output, world=world)  # imports its format, which is no part of the speed
    check_outputs([output], [path])
    started = time.perf_counter()
    log = open_log(path, **reading)
    opened = time.perf_counter()
    load_kernels([extractor])
    started += time.perf_counter() - opened
    topics: dict[str, None] = {}
    scans, beams, valid, unplaced = 0, 0, 0, 0
    found = dict.fromkeys(TABLES, 0)
    with writer:
        for topic, scan in track(log.measured(), Path(log.name).name, log):
            features = extractor(scan)
            unplaced += scan.pose is None
            if world:
                features = in_world(features, scan)
            writer.write(features, scan, topic)
            topics[topic] = None
            scans += 1
            beams += len(scan)
            valid += int(np.count_nonzero(scan.valid))
            for name, count in features.counts().items():
                found[name] += count
        if world and unplaced and unplaced == scans:
            raise LogError(log.name, "no scan has a pose, expected poses: of a bag, by their topic")
    if any(reading.get("laser_pose") or ()) and unplaced == scans > 0:
        warn(one_line(f"{log.name}: no scan has a pose: laser_pose moves none"))
    return Extraction(
        log=str(path),
        output=str(output),
        topics=[*topics],
        scans=scans,
        features=found,
        invalid=1 - valid / beams if beams else 0.0,
        seconds=time.perf_counter() - started,
        skipped=log.skipped,
        unplaced=unplaced if world else 0,
        faults=list(log.faults),
    )


def writer_of(output: str | os.PathLike[str], *, world: bool) -> Writer:
    """Make the writer of a file; a ValueError if it draws scans, and features are in the world."""
    writer = open_writer(output)
    if world and writer.needs_scan:
        raise ValueError(f"world is for tables; {output} has scans at their poses in any case")
    return writer


def check_found(name: str, scans: int, features: Mapping[str, int], method: Method) -> None:
    """Raise a NothingFoundError if no scan has a feature; breakpoints count for `pdbs` alone."""
    found = {kind for kind, count in features.items() if count}
    if not found - ({"breakpoints"} if method.name != "pdbs" else set()):
        raise NothingFoundError(f"{name}: no feature in {scans} scans, expected some")


def in_world(features: Features, scan: LaserScan) -> Features:
    """Move the features of a scan to the frame of its pose; without a pose, none are left."""
    from ..output.scene import WORLD_FRAME

    if scan.pose is not None:
        return features.transform(*scan.pose, scan.pose_covariance, frame_id=WORLD_FRAME)
    empty: dict[str, Any] = {name: make_records(name, []) for name in TABLES}
    nothing = np.full(len(scan), -1, np.int32)
    return replace(features, **empty, clusters=nothing, frame_id=WORLD_FRAME)
