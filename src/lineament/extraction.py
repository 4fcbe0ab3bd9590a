"""A whole log to a table of features: what `lineament extract` does."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .errors import LineamentError
from .extractor import Extractor
from .features import TABLES
from .logs import open_log
from .output import open_writer
from .track import Track, untracked

__all__ = ["Extraction", "extract_log", "output_paths"]


@dataclass(frozen=True, slots=True)
class Extraction:
    """What came of the extraction of one log.

    Attributes
    ----------
    log, output : str
        The files.
    scans : int
        Scans that were read.
    features : dict of str to int
        Features of each kind.
    invalid : float
        Share of the beams that are invalid.
    seconds : float
        Wall time from opening the log to the finished file.
    skipped : int
        Faulty lines or records that were left out.
    faults : list of str
        What the first of them were.
    """

    log: str
    output: str
    scans: int
    features: dict[str, int]
    invalid: float
    seconds: float
    skipped: int = 0
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        found = ", ".join(f"{count} {name}" for name, count in self.features.items())
        rate = self.scans / self.seconds if self.seconds > 0 else 0.0
        lines = [
            f"{self.log} -> {self.output}",
            f"  {self.scans} scans, {100 * self.invalid:.1f} % of beams invalid, "
            f"{self.skipped} lines skipped",
            f"  {found}",
            f"  {self.seconds:.2f} s, {rate:.0f} scans/s",
            *(f"  skipped: {fault}" for fault in self.faults),
        ]
        return "\n".join(lines)


def extract_log(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    extractor: Extractor,
    *,
    topic: str | None = None,
    keep_going: bool = False,
    track: Track = untracked,
) -> Extraction:
    """Extract the features of all scans of a log into a file.

    Memory does not grow with the log. The output appears when it is whole.

    Parameters
    ----------
    path : path-like
        The log, of any format that `lineament.open_log` reads.
    output : path-like
        A file that ends in ``.parquet`` or ``.jsonl``.
    extractor : Extractor
        The method.
    topic : str, optional
        Which scans of the log.
    keep_going : bool
        Whether to leave out what is faulty in the log, and count it.
    track : callable
        ``track(log, name, total)`` gives the scans of the log, and shows how far they are.

    Raises
    ------
    LineamentError
        If the log cannot be read or the output not be written; nothing is left of it then.

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
    writer = open_writer(output)
    started = time.perf_counter()
    log = open_log(path, topic=topic, keep_going=keep_going)
    scans, beams, valid = 0, 0, 0
    found = dict.fromkeys(TABLES, 0)
    with writer:
        for scan in track(log, log.path.name, len(log)):
            features = extractor(scan)
            writer.write(features)
            scans += 1
            beams += len(scan)
            valid += int(np.count_nonzero(scan.valid))
            for name in TABLES:
                found[name] += len(getattr(features, name))
    return Extraction(
        log=str(path),
        output=str(output),
        scans=scans,
        features=found,
        invalid=1 - valid / beams if beams else 0.0,
        seconds=time.perf_counter() - started,
        skipped=log.skipped,
        faults=list(log.faults),
    )


def output_paths(
    logs: Iterable[str | os.PathLike[str]], output: str | os.PathLike[str]
) -> list[Path]:
    """Name the output of each log: the file that is given, or one a log in the folder given.

    Raises
    ------
    LineamentError
        If there are several logs and the output is no folder, or two of them have one name.

    Examples
    --------
    >>> str(output_paths(["a.log.gz"], "features.jsonl")[0])
    'features.jsonl'
    """
    sources = [Path(log) for log in logs]
    target = Path(output)
    if not target.is_dir():
        if len(sources) > 1:
            raise LineamentError(f"{target}: is no folder, expected one for {len(sources)} logs")
        return [target]
    paths = [target / f"{log.name.split('.')[0]}.parquet" for log in sources]
    for k, path in enumerate(paths):
        if path in paths[:k]:
            raise LineamentError(
                f"{path}: would hold both {sources[paths.index(path)]} and {sources[k]}; "
                "extract them into different folders"
            )
    return paths
