"""Damaged logs of every format against what every reader promises."""

import tempfile
import zlib
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from fuzz_targets import Target
from mutations import Sample, mutated, own_samples, recorded_samples

from lineament import LaserScan, LogError
from lineament.checks.logs import _problem
from lineament.logs import find_logs, open_log, summarize
from lineament.logs.base import Topic

#: Logs that are larger are not damaged further [bytes].
LARGEST = 1 << 20
#: Ways to open; what is wrong with the topic of poses must be one clear line too.
OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"echo": "strongest"},
    {"echo": "last"},
    {"ring": 0},
    {"pose_topic": "/odom"},
    {"pose_topic": "/tf:odom->base"},
)


def check(sample: Sample, folders: tuple[Path, Path], options: dict[str, Any]) -> bool:
    """Read a log in every way there is; True if a scan came out.

    `folders` are those of `scratch`: the input stays in the first one until the next, and from the
    second one temporary files must go with their logs, and not wait for the collector.
    """
    folder, temporary = folders
    for path in folder.iterdir():
        path.unlink()
    for name, data in sample.files.items():
        (folder / name).write_bytes(data)
    path = folder / sample.opened
    count = 0
    for found in one_line_or(folder, lambda: find_logs(path), default=[str(path)]):
        for keep in (False, True):
            count += one_line_or(folder, lambda f=found, k=keep: read(f, k, options), default=0)
    left = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert left == sample.files, f"files changed: {sorted(sample.files)} are {sorted(left)}"
    assert not list(temporary.iterdir()), list(temporary.iterdir())
    return count > 0


def one_line_or(folder: Path, call: Any, default: Any) -> Any:
    """Call; a LogError gives the default, if it is one line that names a file in the folder."""
    try:
        return call()
    except LogError as error:
        line = str(error)
    assert line.isprintable(), repr(line)
    assert line.startswith(str(folder)), line
    return default


def read(path: str, keep_going: bool, options: dict[str, Any]) -> int:
    """Use all that a log offers; how many scans came out."""
    log = open_log(path, keep_going=keep_going, **options)
    assert len(log) >= 0
    assert all(isinstance(topic, Topic) for topic in log.contents())
    count = 0
    for topic, scan in log.items():
        check_scan(scan)
        assert topic in log.topics
        count += 1
    assert log.skipped == 0 or keep_going
    assert all(fault.isprintable() for fault in log.faults)
    lines = summarize(log).lines()
    assert all(line.isprintable() for line in lines), lines
    return count


def check_scan(scan: LaserScan) -> None:
    """Check that a scan is one, whoever made it."""
    assert _problem(scan) == ""
    n = len(scan)
    for values in (scan.ranges, scan.angles):
        assert values.shape == (n,)
        assert values.dtype == np.float64
    assert np.isfinite([scan.scan_time, scan.time_increment]).all()
    assert 0 <= scan.range_min < scan.range_max
    assert scan.intensities is None or scan.intensities.shape == (n,)
    assert isinstance(scan.frame_id, str)
    assert scan.points.shape == (n, 2)
    assert repr(scan)


def scratch(work: Path) -> tuple[Path, Path]:
    """Make a folder for inputs, and one for temporary files, which readers then use."""
    folders = work / "input", work / "temporary"
    for folder in folders:
        folder.mkdir(exist_ok=True)
    tempfile.tempdir = str(folders[1])
    return folders


def chosen(samples: list[Sample], chance: Random) -> Sample:
    """Choose a format, then one of its samples."""
    kind = chance.choice(sorted({sample.kind for sample in samples}))
    return chance.choice([sample for sample in samples if sample.kind == kind])


class Readers(Target):
    """Damaged logs, read in every way; what runs new lines of the readers is damaged further."""

    watched = ("lineament/logs", "lineament/rosmsg")

    def __init__(self, folder: Path, recordings: Path | None = None) -> None:
        own = folder / "samples"
        own.mkdir()
        self._folders = scratch(folder)
        self.samples = own_samples(own)
        if recordings is not None:
            self.samples += recorded_samples(recordings)

    def make(self, chance: Random) -> tuple[Sample, dict[str, Any]]:
        return mutated(chosen(self.samples, chance), self.samples, chance), chance.choice(OPTIONS)

    def check(self, made: tuple[Sample, dict[str, Any]]) -> str:
        sample, options = made
        return f"{sample.kind}: {'read' if check(sample, self._folders, options) else 'refused'}"

    def keep(self, made: tuple[Sample, dict[str, Any]]) -> None:
        """Take an input into the corpus, if it is small: else each is longer than the last."""
        if sum(map(unpacked, made[0].files.values())) <= LARGEST:
            self.samples.append(made[0])


def unpacked(data: bytes) -> int:
    """How many bytes there are in those of a gzip, or in others, up to what is too large."""
    if not data.startswith(b"\x1f\x8b"):
        return len(data)
    with suppress(zlib.error):
        return len(zlib.decompressobj(31).decompress(data, LARGEST + 1))
    return len(data)
