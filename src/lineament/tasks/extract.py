"""A whole log to a table of features: what `lineament extract` does."""

import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..extractor import Extractor, load_kernels
from ..features import COUNTED
from ..logs import open_log
from ..output import open_writer
from ..progress import Track, untracked


@dataclass(frozen=True, slots=True, kw_only=True)
class Extraction:
    """Result of the extraction of one log.

    Topics of the scans; number of scans and of features of each kind; share of invalid beams; wall
    time [s] from opening the log to the finished file, without that of loading kernels; number of
    faulty lines or records that were skipped, the first of which are in `faults`.
    """

    log: str
    output: str = ""
    topics: list[str] = field(default_factory=list)
    scans: int = 0
    features: dict[str, int] = field(default_factory=dict)
    invalid: float = 0.0
    seconds: float = 0.0
    skipped: int = 0
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
            *(f"  skipped: {fault}" for fault in self.faults),
        ]
        return "\n".join(lines)


def extract_log(
    path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    extractor: Extractor,
    *,
    topic_column: bool | None = None,
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
    topic_column : bool, optional
        Whether tables have the topic of each row; by default where the log has several.
    track : callable
        ``track(items, name, total)`` yields the scans and shows the progress.
    **reading
        As for `lineament.open_log`: ``topic``, ``keep_going``, ``echo``, ``ring``, ``pose_topic``.

    Raises
    ------
    LineamentError
        If the log cannot be read or the output cannot be written; no partial file stays.

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
    load_kernels([extractor])
    started = time.perf_counter()
    log = open_log(path, **reading)
    topics = log.topics if log.topic is None else [log.topic]
    if topic_column is None:
        topic_column = len(topics) > 1
    scans, beams, valid = 0, 0, 0
    found = dict.fromkeys(COUNTED, 0)
    with open_writer(output, topics if topic_column else ()) as writer:
        for topic, scan in track(log.items(), Path(log.name).name, len(log)):
            features = extractor(scan)
            # Drawings of scans are named after the topic; tables need not repeat the only one.
            writer.write(features, scan, topic if topic_column or writer.needs_scan else "")
            scans += 1
            beams += len(scan)
            valid += int(np.count_nonzero(scan.valid))
            for name, count in features.counts().items():
                found[name] += count
    return Extraction(
        log=str(path),
        output=str(output),
        topics=topics,
        scans=scans,
        features=found,
        invalid=1 - valid / beams if beams else 0.0,
        seconds=time.perf_counter() - started,
        skipped=log.skipped,
        faults=list(log.faults),
    )
