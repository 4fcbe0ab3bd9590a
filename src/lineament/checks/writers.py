"""Check of a writer: a whole file or none, of what it can take, that can be read again."""

from __future__ import annotations

import copy
import json
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..errors import LineamentError
from ..extractor import Extractor
from ..features import Features
from ..logs import open_log
from ..output import ENDINGS, Writer, open_writer
from ..scan import LaserScan
from .claims import claim, claim_raises, during, without_warnings
from .scans import plain_scans
from .sound import ends_of

#: Makes a writer of a file, as a subclass of `Writer` does.
Maker = Callable[..., Writer]
#: Reads a file: the ends of all segments in the order in which they came, (N, 4); or None, where a
#: format has others, and only that it can be read is known.
Reading = Callable[[Path], Any]

_OLD = b"what was there before"
_ENDS = ("start_x", "start_y", "end_x", "end_y")
_TOPICS = ("/front", '/re"ar, né\n')


def check_writer(
    writer: str | Maker, *, ending: str = "", read: Reading | None = None, scans: int = 1010
) -> None:
    """Check a writer: a whole file appears when its block ends, or nothing does.

    An exception or Ctrl-C within the block, also after many scans, leaves the file that was there,
    and nothing beside it; so does a target that cannot be written, by a LineamentError of one line.
    Through a link, the file behind it is replaced, and the link stays. No scans, and scans without
    features, make a file; names of files, frames and topics may have any letters. It refuses what
    it cannot take by a ValueError: a scan outside its block, or none where it needs one; and to be
    copied while it is open, by a TypeError. What is written is read again where a reader is known.
    That a writer is given a file that is read, it cannot know: commands ask
    `lineament.files.check_outputs`.

    Parameters
    ----------
    writer : str or callable
        One of `lineament.output.ENDINGS`, or what makes a writer of a path: a subclass of
        `lineament.output.Writer`.
    ending : str
        What names of such files end with, for a class.
    read : callable, optional
        For a class: a function of the path that returns the ends of all segments, shape (N, 4), in
        the order in which they came, or None if it can only see that the file is whole.
    scans : int
        How many are written before the block ends by an exception.

    Raises
    ------
    AssertionError
        If anything of this does not hold: one line that names what broke.

    Examples
    --------
    >>> check_writer(".jsonl")
    """
    if isinstance(writer, str):
        claim(writer in ENDINGS, f"{writer} is unknown, expected one of: {', '.join(ENDINGS)}")
        name, make, ending, read = writer, open_writer, writer, _READERS.get(writer)
    else:
        name, make = getattr(writer, "__name__", type(writer).__name__), writer
    found = _found()
    with during(name), without_warnings():
        for check in (
            partial(_appears_whole, read=read),
            _takes_nothing,
            partial(_leaves_what_was_there, scans=scans),
            _follows_links,
            _names_what_cannot_be,
            _refuses,
        ):
            with tempfile.TemporaryDirectory() as folder:
                check(make, Path(folder) / f"Läufe 東京{ending}", found)


Found = Sequence[tuple[Features, LaserScan]]


def _found() -> Found:
    """Return features and their scans; each scan is at the origin, so that a plan is in place."""
    extract = Extractor(noise=0.01)
    scans = [
        LaserScan(
            scan.ranges,
            scan.angle_min,
            scan.angle_increment,
            range_max=scan.range_max,
            stamp=float(k),
            frame_id=f"Läser {k}\n",
            pose=(0.0, 0.0, 0.0),
        )
        for k, scan in enumerate(plain_scans().values())
    ]
    return [(extract(scan), scan) for scan in scans]


def _write(writer: Writer, found: Found, topics: Sequence[str] = ("",)) -> None:
    for k, (features, scan) in enumerate(found):
        writer.write(features, scan, topics[k % len(topics)])


def _beside(path: Path) -> list[str]:
    return sorted(one.name for one in path.parent.iterdir())


def _appears_whole(make: Maker, path: Path, found: Found, read: Reading | None) -> None:
    for topics in ((), _TOPICS):
        with during(f"with topics {topics}" if topics else "in a block"):
            with make(path) as writer:
                is_there = path.exists() and not topics
                _write(writer, found, topics or ("",))
                claim(not is_there, "the file appears before its block ends")
            claim(_beside(path) == [path.name], f"the folder has {_beside(path)} in place of it")
            claim(path.stat().st_size > 0, "the file is empty")
        if read is not None:
            with during("read again"):
                ends = read(path)
                own = np.vstack([ends_of(features) for features, _ in found])
                same = ends is None or (len(ends) == len(own) and np.allclose(ends, own))
                claim(same, "the segments are not those that were written")


def _takes_nothing(make: Maker, path: Path, _: Found) -> None:
    scan = LaserScan([np.nan] * 3, 0.0, 0.1, pose=(0.0, 0.0, 0.0))
    empty = Extractor()(scan)
    for count, what in ((0, "no scans"), (2, "scans without features")):
        with during(what):
            with make(path) as writer:
                _write(writer, [(empty, scan)] * count)
            claim(path.exists(), "there is no file")
            path.unlink()


def _leaves_what_was_there(make: Maker, path: Path, found: Found, scans: int) -> None:
    for error in (ValueError, KeyboardInterrupt):
        for count, is_there in ((0, False), (scans, True)):
            with during(f"{error.__name__} after {count} scans"):
                path.unlink(missing_ok=True)
                if is_there:
                    path.write_bytes(_OLD)
                try:
                    with make(path) as writer:
                        _write(writer, [found[0]] * count)
                        raise error
                except error:
                    pass
                claim(_beside(path) == [path.name] * is_there, f"it leaves {_beside(path)}")
                claim(not is_there or path.read_bytes() == _OLD, "the file that was there changes")


def _follows_links(make: Maker, path: Path, found: Found) -> None:
    link = path.with_name(f"link{path.name}")
    path.write_bytes(_OLD)
    try:
        link.symlink_to(path)
    except OSError:  # Windows lets some users make none.
        return
    with during("through a link"):
        with make(link) as writer:
            _write(writer, found)
        claim(link.is_symlink(), "the link is replaced")
        claim(path.read_bytes() != _OLD, "the file behind it is not replaced")


def _names_what_cannot_be(make: Maker, path: Path, found: Found) -> None:
    (path.parent / f"folder{path.name}").mkdir()
    before = _beside(path)
    for target in (
        path.parent / f"folder{path.name}",
        path.parent / "nowhere" / path.name,
        path.with_name(250 * "a" + path.name),
    ):
        problem = f"{target.parent.name}/{target.name:.20}"
        try:
            with make(target) as writer:
                _write(writer, found)
        except LineamentError as error:
            claim(str(error).isprintable(), f"the error for {problem} is not one line")
        except Exception as error:
            claim(False, f"{problem} is a {type(error).__name__}, expected a LineamentError")
        else:
            claim(False, f"{problem} is written, expected a LineamentError")
        claim(_beside(path) == before, f"{problem} leaves {_beside(path)}")


def _refuses(make: Maker, path: Path, found: Found) -> None:
    (features, scan), topic = found[0], _TOPICS[0]
    writer = make(path)
    claim_raises(ValueError, lambda: writer.write(features, scan, topic), "a scan before its block")
    with writer:
        claim_raises(TypeError, lambda: copy.deepcopy(writer), "a copy of it while it is open")
        if writer.needs_scan:
            claim_raises(ValueError, lambda: writer.write(features, None, topic), "no scan")
        else:
            writer.write(features, None, topic)
    claim_raises(ValueError, lambda: writer.write(features, scan, topic), "a scan after its block")


# Our own formats, read again


def _table_ends(table: Any) -> Any:
    rows = [row for row in table.to_pylist() if row["kind"] == "segment"]
    return np.array([[row[name] for name in _ENDS] for row in rows])


def _read_parquet(path: Path) -> Any:
    import pyarrow.parquet

    return _table_ends(pyarrow.parquet.read_table(path))


def _read_csv(path: Path) -> Any:
    import pyarrow.csv

    lines = pyarrow.csv.ParseOptions(newlines_in_values=True)
    return _table_ends(pyarrow.csv.read_csv(path, parse_options=lines))


def _read_jsonl(path: Path) -> Any:
    rows = [json.loads(line) for line in path.read_bytes().splitlines()]
    return np.array([one["start"] + one["end"] for row in rows for one in row["segments"]])


def _read_messages(path: Path) -> None:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        found = [
            message.data for *_, message in make_reader(file, validate_crcs=True).iter_messages()
        ]
    claim(found, "there are no messages")


def _read_scans(path: Path) -> None:
    _read_messages(path)
    log = open_log(path)
    for scan, expected in zip(log, plain_scans().values(), strict=True):
        same = np.array_equal(scan.ranges, expected.ranges.astype(np.float32), equal_nan=True)
        claim(same, "the scans are not those that were written")


def _read_plan(path: Path) -> None:
    from ..mapping import LineMap

    claim(len(LineMap.read(path).walls), "there are no walls")


def _read_svg(path: Path) -> None:
    claim(list(ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}line")), "has no lines")


def _read_geojson(path: Path) -> None:
    rows = json.loads(path.read_text(encoding="utf-8"))["features"]
    claim("wall" in {row["properties"]["kind"] for row in rows}, "there are no walls")


_READERS: dict[str, Reading] = {
    ".parquet": _read_parquet,
    ".csv": _read_csv,
    ".jsonl": _read_jsonl,
    ".mcap": _read_messages,
    ".ros2.mcap": _read_scans,
    ".dxf": _read_plan,
    ".svg": _read_svg,
    ".geojson": _read_geojson,
}
