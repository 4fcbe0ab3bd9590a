"""A log on a plan: what `lineament locate` does."""

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..drawings import NAMES as UNITS
from ..errors import LineamentError, LogError, NothingFoundError, heard, one_line
from ..extractor import Extractor, load_kernels
from ..files import check_outputs, ending_of, naming_errors, written_beside
from ..logs import open_log
from ..logs.drives import one_scanner
from ..mapping import VERDICTS, LineMap
from ..mapping.following import Whereabouts, follow
from ..mapping.grids import all_files
from ..mapping.locate import LOCATED, UNOBSERVED
from ..mapping.plans import is_a_building
from ..output.canvas import count
from ..output.figures import plot_walls
from ..progress import Track, untracked
from ..scan import LaserScan
from .mapping import times, tum_written

#: Formats of the poses.
ENDINGS = (".tum", ".csv", ".parquet")
#: Where a smaller share of the scans is located, the plan may be in other units: so many are tried.
_HARDLY, _TRIED = 0.1, 300
_SPREAD = ("xx", "xy", "xtheta", "yy", "ytheta", "thetatheta")


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """Where a log is on a plan.

    Number of scans, and of those with each verdict; index of the first that was located, None if
    none was, and the time until then [s], NaN; how often the sensor was lost after that; wall time
    [s]. A clock that is set back takes no time. `warning` is a line about why hardly a scan is
    located, or "".
    """

    log: str
    plan: str
    output: str
    scans: int
    verdicts: dict[str, int]
    first_scan: int | None
    first: float
    lost: int
    warning: str
    seconds: float

    def check_found(self) -> None:
        """Raise a NothingFoundError if no scan is located."""
        is_dxf = Path(self.plan).suffix.lower() == ".dxf"
        other = ", or in other units (--units)" if is_dxf else ""
        usual = f"{self.plan}: is it another building{other}?"
        if self.first_scan is None:
            raise NothingFoundError(f"{self.log}: never located: {self.warning or usual}")

    def __str__(self) -> str:
        first = f"located first in scan {self.first_scan}, after {self.first:.1f} s"
        placed = f"{first}, lost {times(self.lost)} since"
        return (
            f"{self.log} on {self.plan} -> {self.output}\n"
            f"  {_shares(self.verdicts)}\n"
            f"  {'never located' if self.first_scan is None else placed}\n"
            f"  {self.seconds:.2f} s, {self.scans / max(self.seconds, 1e-9):.0f} scans/s"
        )


def locate_log(
    path: str | os.PathLike[str],
    plan: str | os.PathLike[str],
    output: str | os.PathLike[str],
    extractor: Extractor | None = None,
    *,
    layers: Sequence[str] | None = None,
    units: str | None = None,
    odometry: bool = True,
    deskewed: bool = True,
    picture: str | os.PathLike[str] | None = None,
    track: Track = untracked,
    **reading: Any,
) -> Located:
    """Find where each scan of a log was taken on a plan, without a first guess.

    Parameters
    ----------
    path : path-like
        The log, of any format that `lineament.open_log` reads.
    plan : path-like
        As for `LineMap.read`.
    output : path-like
        The poses: ``.tum`` has ``stamp x y z qx qy qz qw`` of the scans that are located; ``.csv``
        and ``.parquet`` have all scans, with verdict, covariance and evidence.
    extractor : Extractor, optional
        The method.
    layers, units : optional
        As for `LineMap.read`.
    odometry : bool
        Whether the poses of the log are taken as odometry, where it has them.
    deskewed : bool
        Whether scans are deskewed that say how long their sweep takes.
    picture : path-like, optional
        Where to draw the plan and the way on it, ``.png``, ``.svg`` or ``.pdf``.
    track : callable
        ``track(items, name, whole)`` yields the scans and shows the progress.
    **reading
        As for `lineament.open_log`.

    Raises
    ------
    LineamentError
        If the log or the plan cannot be read, the output cannot be written or is one of them, or
        the log has no scans, or those of several topics.

    Examples
    --------
    >>> import tempfile
    >>> from lineament.logs import save_npz
    >>> from lineament.simulation import SENSORS, drive, room
    >>> folder = Path(tempfile.mkdtemp())
    >>> scans = drive(room(), [(-2, 0), (-1, 0)], SENSORS["utm30lx"], speed=1, rate=10)
    >>> save_npz(folder / "log.npz", scans)
    >>> LineMap.from_lines(room().segments).write(folder / "plan.dxf")
    >>> found = locate_log(folder / "log.npz", folder / "plan.dxf", folder / "poses.tum")
    >>> found.verdicts["located"], found.first
    (11, 0.0)
    """
    ending = ending_of(output, ENDINGS)
    outputs = [output] if picture is None else [output, picture]
    check_outputs(outputs, [path, *all_files(plan, is_read=True)])
    extractor = Extractor() if extractor is None else extractor
    read = partial(LineMap.read, plan, layers, limits=reading.get("limits"))
    drawn = read(units=units)
    started = time.perf_counter()
    log = open_log(path, **reading)
    scans = one_scanner(log, odometry=odometry, deskewed=deskewed)
    opened = time.perf_counter()
    load_kernels([extractor])
    started += time.perf_counter() - opened

    def followed(
        scans: Iterable[LaserScan], on: LineMap
    ) -> Iterator[tuple[LaserScan, Whereabouts]]:
        return follow(scans, on, extractor, odometry=odometry, deskewed=deskewed)

    def located(on: LineMap) -> float:
        tried = [bool(where) for _, where in followed(islice(log, _TRIED), on)]
        return sum(tried) / len(tried)

    shown = track(scans, Path(log.name).name, log)
    found = [(scan.stamp, where) for scan, where in followed(shown, drawn)]
    if not found:
        raise LogError(log.name, "has no scans, expected some")
    verdicts = {name: sum(w.verdict == name for _, w in found) for name in VERDICTS}
    if ending == ".tum":
        placed = [(stamp, where.pose) for stamp, where in found if where]
        written = tum_written(output, [stamp for stamp, _ in placed], [pose for _, pose in placed])
    else:
        written = _table_written(output, found, is_csv=ending == ".csv")
    with written:  # Both files, or none.
        if picture is not None:
            title = f"{Path(log.name).name} on {Path(plan).name}"
            draw([w for _, w in found], drawn, picture, title, _shares(verdicts))
    known = [bool(where) for _, where in found]
    first_scan = known.index(True) if any(known) else None
    stamps = [stamp for stamp, _ in found[: (first_scan or 0) + 1]]
    seconds, warning = time.perf_counter() - started, ""
    is_doubtful = sum(known) < _HARDLY * len(known) and Path(plan).suffix.lower() == ".dxf"
    if is_doubtful and (best := _units_that_fit(read, drawn, located)):
        hint = f"shows where the scans were if it is drawn in {best}: --units {best}"
        warning = one_line(f"{plan}: {hint}")
    return Located(
        log=str(path),
        plan=str(plan),
        output=str(output),
        scans=len(found),
        verdicts=verdicts,
        first_scan=first_scan,
        first=math.nan if first_scan is None else _passed(stamps),
        lost=sum(was and not now for was, now in pairwise(known)),
        warning=warning,
        seconds=seconds,
    )


def _units_that_fit(
    read: Callable[..., LineMap], drawn: LineMap, located: Callable[[LineMap], float]
) -> str:
    """Return the units in which the most of the first scans are located on a plan, or "".

    `read` reads the plan in some `units`; `located` returns the share of scans that are located.
    """
    best, most = "", _HARDLY
    for name in UNITS:
        with suppress(LineamentError):  # Larger than any building, say.
            with heard():  # What is only tried is not warned of.
                other = read(units=name)
            is_same = math.isclose(max(other.size), max(drawn.size))
            if not is_same and is_a_building(max(other.size)) and (share := located(other)) > most:
                best, most = name, share
    return best


def _passed(stamps: list[float]) -> float:
    """Return the time from the first to the last [s]; a clock that is set back takes none."""
    return sum((max(after - before, 0.0) for before, after in pairwise(stamps)), start=0.0)


def _shares(verdicts: dict[str, int]) -> str:
    """Write how many scans there are, and the share of those with each verdict."""
    scans = sum(verdicts.values())
    shares = (f"{100 * n / scans:.1f} % {name}" for name, n in verdicts.items())
    return f"{count(scans, 'scan')}: {', '.join(shares)}"


def draw(
    places: list[Whereabouts],
    plan: LineMap,
    picture: str | os.PathLike[str],
    title: str,
    about: str,
) -> None:
    """Draw the way on a plan; where it is not known, a dotted line leads to where it is again."""
    known = [(k, where) for k, where in enumerate(places) if where.is_known]
    ways: dict[str, list[tuple[Any, Any]]] = {"located": [], UNOBSERVED: [], "not located": []}
    for (i, before), (k, where) in pairwise(known):
        both = LOCATED if before and where else UNOBSERVED
        ways[both if k == i + 1 else "not located"].append((before.pose[:2], where.pose[:2]))
    located = [np.array(where.pose[:2]) for where in places if where]
    plot_walls(
        plan.ends,
        plan.columns,
        picture,
        title=title,
        about=about,
        ways={name: np.reshape(steps, (-1, 2, 2)) for name, steps in ways.items()},
        spots={"located first": located[0], "located last": located[-1]} if located else {},
    )


@contextmanager
def _table_written(
    path: str | os.PathLike[str], found: list[tuple[float, Whereabouts]], *, is_csv: bool
) -> Iterator[None]:
    """Write all scans as a table, as `tum_written` does."""
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    from ..features.tables import array_of, texts

    places = [where for _, where in found]
    known = np.array([where.is_known for where in places])
    columns: dict[str, Any] = {
        "scan": array_of(np.arange(len(found))),
        "stamp": array_of([stamp for stamp, _ in found]),
        "verdict": texts([where.verdict for where in places]),
    }
    poses = np.array([where.pose for where in places])
    for name, values in zip(("x", "y", "theta"), poses.T, strict=True):
        columns[name] = array_of(values, ~known)
    upper = np.array([where.covariance[np.triu_indices(3)] for where in places])
    for name, values in zip(_SPREAD, upper.T, strict=True):
        columns[f"cov_{name}"] = array_of(values, ~known)
    for name in ("explained", "short", "contradicted", "log_odds"):
        columns[name] = array_of([getattr(where.evidence, name) for where in places])
    table = pa.table(columns)
    with written_beside(path) as temporary:
        with naming_errors(path):
            if is_csv:
                pyarrow.csv.write_csv(table, temporary)
            else:
                pq.write_table(table, temporary)
        yield
