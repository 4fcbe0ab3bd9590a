"""A log on a plan: what `lineament locate` does."""

import math
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LogError, one_line
from ..extractor import Extractor, load_kernels
from ..files import ending_of, naming_errors, written_beside
from ..logs import open_log
from ..mapping import VERDICTS, LineMap
from ..mapping.following import Whereabouts, follow
from ..progress import Track, untracked
from .mapping import write_tum

#: Formats of the poses.
ENDINGS = (".tum", ".csv", ".parquet")
#: A plan smaller or larger than this is hardly a building [m].
_SMALL, _LARGE = 3.0, 500.0
_SPREAD = ("xx", "xy", "xtheta", "yy", "ytheta", "thetatheta")


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """Where a log is on a plan.

    Number of scans, and of those with each verdict; time until the first was located [s], NaN if
    none was; how often the sensor was lost after that; wall time [s]. `warning` is a line about the
    plan, or "".
    """

    log: str
    plan: str
    output: str
    scans: int
    verdicts: dict[str, int]
    first: float
    lost: int
    warning: str
    seconds: float

    def __str__(self) -> str:
        shares = (f"{100 * n / self.scans:.1f} % {name}" for name, n in self.verdicts.items())
        first = f"located first after {self.first:.1f} s, lost {self.lost} times since"
        return (
            f"{self.log} on {self.plan} -> {self.output}\n"
            f"  {self.scans} scans: {', '.join(shares)}\n"
            f"  {'never located' if math.isnan(self.first) else first}\n"
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
    track : callable
        ``track(items, name, total)`` yields the scans and shows the progress.
    **reading
        As for `lineament.open_log`.

    Raises
    ------
    LineamentError
        If the log or the plan cannot be read, or the log has no scans, or those of several topics.

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
    extractor = Extractor() if extractor is None else extractor
    drawn = LineMap.read(plan, layers, units=units, limits=reading.get("limits"))
    load_kernels([extractor])
    started = time.perf_counter()
    log = open_log(path, **reading)
    if log.topic is None and len(log.topics) > 1:
        raise LogError(log.name, f"has scans of {', '.join(log.topics)}, expected one of them")
    scans = track((scan for _, scan in log.items()), Path(log.name).name, len(log))
    followed = follow(scans, drawn, extractor, odometry=odometry, deskewed=deskewed)
    found = [(scan.stamp, where) for scan, where in followed]
    if not found:
        raise LogError(log.name, "has no scans, expected some")
    if ending == ".tum":
        placed = [(stamp, where.pose) for stamp, where in found if where]
        write_tum(output, [stamp for stamp, _ in placed], [pose for _, pose in placed])
    else:
        _write_table(output, found, is_csv=ending == ".csv")
    stamps = [stamp for stamp, _ in found]
    known = [bool(where) for _, where in found]
    return Located(
        log=str(path),
        plan=str(plan),
        output=str(output),
        scans=len(found),
        verdicts={name: sum(w.verdict == name for _, w in found) for name in VERDICTS},
        first=stamps[known.index(True)] - stamps[0] if any(known) else math.nan,
        lost=sum(was and not now for was, now in pairwise(known)),
        warning=plan_warning(drawn, plan),
        seconds=time.perf_counter() - started,
    )


def plan_warning(plan: LineMap, name: object) -> str:
    """Return a line about a plan of a size that no building has, or of which parts are left out."""
    (wide, deep), said = plan.size, []
    if plan.left_out:
        said.append(f"{plan.left_out} walls or columns have impossible numbers, left out")
    if not _SMALL <= max(wide, deep) <= _LARGE:
        said.append(f"is {wide:.4g} m x {deep:.4g} m: is it drawn in other units? (--units)")
    return one_line(f"{name}: {'; '.join(said)}") if said else ""


def _write_table(
    path: str | os.PathLike[str], found: list[tuple[float, Whereabouts]], *, is_csv: bool
) -> None:
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    places = [where for _, where in found]
    known = np.array([where.is_known for where in places])
    columns: dict[str, Any] = {
        "scan": np.arange(len(found)),
        "stamp": [stamp for stamp, _ in found],
        "verdict": [where.verdict for where in places],
    }
    poses = np.array([where.pose for where in places])
    for name, values in zip(("x", "y", "theta"), poses.T, strict=True):
        columns[name] = pa.array(values, mask=~known)
    upper = np.array([where.covariance[np.triu_indices(3)] for where in places])
    for name, values in zip(_SPREAD, upper.T, strict=True):
        columns[f"cov_{name}"] = pa.array(values, mask=~known)
    for name in ("explained", "short", "contradicted", "log_odds"):
        columns[name] = [getattr(where.evidence, name) for where in places]
    table = pa.table(columns)
    with naming_errors(path), written_beside(path) as temporary:
        if is_csv:
            pyarrow.csv.write_csv(table, temporary)
        else:
            pq.write_table(table, temporary)
