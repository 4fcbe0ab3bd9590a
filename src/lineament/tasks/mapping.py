"""A whole log to a map of its walls: what `lineament map` does."""

import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import LineamentError, LogError, needed_by, one_line, warn
from ..extractor import Extractor, load_kernels
from ..files import check_outputs, naming_errors, written_beside
from ..logs import open_log
from ..logs.drives import one_scanner
from ..mapping import LineMap
from ..mapping.drive_map import Drive
from ..mapping.grids import GRID_ENDINGS, all_files
from ..mapping.making import make_map
from ..mapping.sessions import Merged, merge_onto, onto_plan, placements
from ..mapping.wheels import with_twists
from ..output import open_writer
from ..output.canvas import count
from ..output.figures import plot_walls
from ..progress import Track, untracked
from ..scan import Pose

#: Stretches that are not sure and are named, the longest ones.
_NAMED = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Mapping:
    """A map that was made of a log.

    Numbers of scans, of key frames, of those that were lost, and of loops, closed and left out;
    the map; wall time [s]. `ways` are those of the parts that hang together, and `known` how badly
    places of them are known at most [m]. `unsure` has the first and last scan of each stretch on
    which the poses are not sure, and its way [m]. `located` are the parts that were found on a
    plan, where there is one; `merged` has what became of its walls, where it is one map with them.
    """

    log: str
    output: str
    scans: int
    frames: int
    lost: int
    loops: int
    refused: int
    ways: list[float]
    known: list[float]
    unsure: list[tuple[int, int, float]]
    map: LineMap
    seconds: float
    located: tuple[int, ...] = ()
    merged: Merged | None = None

    def __str__(self) -> str:
        lost = f", {times(self.lost)} lost" if self.lost else ""
        refused = f", {self.refused} refused" if self.refused else ""
        known = ", ".join(f"{deviation:.2g} m" for deviation in self.known)
        merged = "" if self.merged is None else f"  {self.merged}\n"
        each = " in each part" if len(self.known) > 1 else ""
        return (
            f"{self.log} -> {self.output}\n"
            f"  {count(self.scans, 'scan')}, {count(self.frames, 'key frame')}, "
            f"{sum(self.ways):.0f} m{lost}\n"
            f"  {count(self.loops, 'loop')}{refused}\n"
            f"  by its covariances, places are known to {known}{each} from the start\n"
            f"{self._unsure()}"
            f"{merged}"
            f"  {self.map}\n"
            f"  {self.seconds:.1f} s, {self.scans / self.seconds:.0f} scans/s"
        )

    @property
    def warning(self) -> str:
        """What is wrong with the map as a whole, on one line; empty if it is whole."""
        count, rest = len(self.ways), [k for k in range(len(self.ways)) if k not in self.located]
        if not rest or count == 1:
            return ""
        ways = ", ".join(f"{self.ways[k]:.0f} m" for k in rest)
        if self.located:
            where = "are left out" if self.merged else "lie beside it"
            return f"parts of the drive are not found on the plan, and {where}: {ways} of way"
        return (
            f"the map is in {count} parts, drawn beside each other, of {ways} of way: "
            "nothing shows where they are to each other"
        )

    def _unsure(self) -> str:
        """Where poses are not sure: the longest stretches by their scans."""
        if not self.unsure:
            return ""
        longest = sorted(self.unsure, key=lambda stretch: -stretch[2])[:_NAMED]
        scans = ", ".join(f"{first} to {last}" for first, last, _ in sorted(longest))
        rest = len(self.unsure) - len(longest)
        more = f" and {rest} more" if rest else ""
        way = sum(way for *_, way in self.unsure)
        return f"  not sure on {way:.1f} m of the way: of scans {scans}{more}\n"


def map_log(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    extractor: Extractor | None = None,
    *,
    poses: str | os.PathLike[str] | None = None,
    onto: str | os.PathLike[str] | None = None,
    merge: bool = False,
    picture: str | os.PathLike[str] | None = None,
    odometry: bool = True,
    deskewed: bool = True,
    track: Track = untracked,
    **reading: Any,
) -> Mapping:
    """Make a map of the walls of a log.

    Parameters
    ----------
    path : path-like
        The log, of any format that `lineament.open_log` reads.
    output : path-like
        The map: ``.dxf``, ``.svg`` or ``.parquet``; or ``.yaml``, an occupancy grid with its image
        ``.pgm`` beside it, in which the walls are occupied, and free is what beams passed through.
    extractor : Extractor, optional
        The method.
    poses : path-like, optional
        Where to write the pose of each scan: ``stamp x y z qx qy qz qw`` [s, m], a line a scan.
    onto : path-like, optional
        A plan in whose frame the map is to be; without, it is that of the first scan.
    merge : bool
        Whether the map has the walls of that plan too, those that are one as one wall.
    picture : path-like, optional
        Where to draw the walls and the way, ``.png``, ``.svg`` or ``.pdf``: red if not sure.
    odometry : bool
        Whether the poses of the log are taken as odometry, where it has them.
    deskewed : bool
        Whether scans are deskewed that say how long their sweep takes.
    track : callable
        ``track(items, name, whole)`` yields the scans, and what is looked at then, and shows the
        progress.
    **reading
        As for `lineament.open_log`.

    Raises
    ------
    LineamentError
        If the log cannot be read, has no scans or those of several topics, no walls are found, the
        drive is not on the plan, or an output cannot be written or is one of the files read.
    ValueError
        If it is to be merged, and there is no plan.

    Examples
    --------
    >>> import tempfile
    >>> from lineament.simulation import SENSORS, simulate_log
    >>> folder = Path(tempfile.mkdtemp())
    >>> simulate_log(folder / "log.npz", "building", SENSORS["lms181"], scans=60, rate=2)
    >>> made = map_log(folder / "log.npz", folder / "map.parquet", odometry=False)
    >>> made.scans, len(made.map.walls) > 10
    (60, True)
    """
    if merge and onto is None:
        raise ValueError("merge is for a plan, which `onto` names")
    extractor = Extractor() if extractor is None else extractor
    if Path(output).suffix.lower() not in GRID_ENDINGS:
        open_writer(output)
    with needed_by("map"):  # now, not when the drive is followed
        import_module("scipy")
    onto_files = [] if onto is None else all_files(onto, is_read=True)
    written = [*all_files(output), *(path for path in (poses, picture) if path is not None)]
    check_outputs(written, [path, *onto_files])
    plan = None if onto is None else LineMap.read(onto, limits=reading.get("limits"))
    started = time.perf_counter()
    log = open_log(path, **reading)
    scans = one_scanner(log, odometry=odometry, deskewed=deskewed)
    opened = time.perf_counter()
    load_kernels([extractor])
    started += time.perf_counter() - opened
    drive, stamps = Drive(), []
    # In the order of the log: a clock that is set back, or none, does not change where it was.
    for scan, twist in with_twists(track(scans, Path(log.name).name, log), odometry):
        straight = drive.straight(scan, twist) if deskewed else scan
        drive.add(straight, extractor(straight), scan.pose if odometry else None)
        stamps.append(scan.stamp)
    if not stamps:
        raise LogError(log.name, "has no scans, expected a drive")
    merged = None
    try:
        made = make_map(drive.frames, drive.scans, track)
        if plan is not None:
            found = placements(made, plan)
            merged = merge_onto(made, plan, found) if merge else None
            made = onto_plan(made, plan, found) if merged is None else merged.made
    except LineamentError as error:
        raise type(error)(one_line(f"{log.name}: {error}")) from None
    placed = nullcontext() if poses is None else tum_written(poses, stamps, made.poses)
    with placed:  # All files, or none.
        made.write(output)
        if picture is not None:
            ways = dict(zip(("way", "not sure"), made.way, strict=True))
            title = Path(log.name).name
            plot_walls(made.map.ends, made.map.columns, picture, title=title, ways=ways)
    return Mapping(
        log=str(path),
        output=str(output),
        scans=len(stamps),
        frames=len(drive.frames),
        lost=sum(frame.is_lost for frame in drive.frames),
        loops=len(made.loops),
        refused=len(made.refused),
        ways=made.ways,
        known=made.parts.deviations.tolist(),
        unsure=made.unsure,
        map=made.map,
        seconds=time.perf_counter() - started,
        located=made.located,
        merged=merged,
    )


def times(number: int) -> str:
    """Write how often: once, 2 times."""
    return "once" if number == 1 else f"{number} times"


@contextmanager
def tum_written(
    path: str | os.PathLike[str], stamps: list[float], poses: list[Pose]
) -> Iterator[None]:
    """Write stamps [s] and poses as lines of ``stamp x y z qx qy qz qw``, whole or not at all.

    The file gets its name when the block ends; if it ends by an exception, none appears. Several
    rows that all have one stamp are a `LineamentWarning`.
    """
    if len(stamps) > 1 and len({*stamps}) == 1:
        warn(f"{path}: all rows have the stamp {stamps[0]:g}, as the scans of the log have")
    lines = []
    for stamp, (x, y, theta) in zip(stamps, poses, strict=True):
        z, w = math.sin(theta / 2), math.cos(theta / 2)
        lines.append(f"{stamp:.6f} {x:.6f} {y:.6f} 0 0 0 {z:.9f} {w:.9f}\n")
    with written_beside(path) as temporary:
        with naming_errors(path):
            temporary.write_text("".join(lines))
        yield
