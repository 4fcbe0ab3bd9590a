"""Small logs of every format, by the project's own writers, and ways to damage them."""

import gzip
import io
import struct
import zipfile
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import numpy as np
import ros_bags
from text_logs import scan_texts, zipped

from lineament import LaserScan
from lineament.logs import save_log

#: How much of a recording is taken.
HEAD = 1 << 15
#: From here on an input does not grow any more.
LARGEST = 1 << 16


@dataclass(frozen=True)
class Sample:
    """A log: its files, and which of them is opened; "." is their folder."""

    kind: str
    files: dict[str, bytes]
    opened: str


def own_samples(folder: Path) -> list[Sample]:
    """Make a log of every format, in an empty folder."""
    samples = [_single(kind, text.encode()) for kind, text in scan_texts().items()]
    transforms = b'{"dev1": {"dev0": [[1, 0, 2], [0, 1, 3], [0, 0, 1]]}}'
    units = next(sample for sample in samples if sample.kind == "rplidar")
    samples.append(replace(units, files={**units.files, "transforms.json": transforms}))
    for number, scans in enumerate((_scans(False), _scans(True))):
        save_log(folder / f"{number}.npz", scans)
        samples.append(_single("npz", (folder / f"{number}.npz").read_bytes()))
    save_log(folder / "carmen.log.gz", _scans(False))
    carmen = (folder / "carmen.log.gz").read_bytes()
    samples.append(_single("gzip", carmen))
    samples.append(_single("zip", zipped(**{"a.log.gz": carmen})))
    texts = {f"day/{kind}": text for kind, text in scan_texts().items()}
    samples.append(_single("zip", zipped(**texts)))
    return samples + [_bag(folder, kind) for kind in ros_bags.KINDS]


def recorded_samples(folder: Path) -> list[Sample]:
    """Take the beginning of each recording in a folder."""
    samples = []
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix not in (".md", ".enc"):
            with path.open("rb") as file:
                samples.append(_single("recordings", file.read(HEAD)))
    return samples


def _single(kind: str, data: bytes) -> Sample:
    return Sample(kind, {"log": data}, "log")


def _scans(irregular: bool) -> list[LaserScan]:
    fields = {"angles": [-0.5, 0.0, 0.1, 0.4]} if irregular else {}
    bearings = () if irregular else (-0.5, 0.25)
    return [
        LaserScan(
            [1.0, 2.0 + i, np.nan, 3.0],
            *bearings,
            **fields,
            range_max=20.0 + i,
            intensities=[1, 2, 3, i],
            stamp=float(i),
            pose=(i, 1.0, 0.5),
            frame_id="laser",
        )
        for i in range(8)
    ]


def _bag(folder: Path, kind: str) -> Sample:
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    points = np.zeros((1, 12), [("x", "f4"), ("y", "f4"), ("intensity", "f4"), ("ring", "u2")])
    points["x"], points["y"], points["ring"] = 1.0, np.arange(12), np.arange(12) % 2
    items = []
    for i in range(8):
        strengths = np.arange(16.0) if i % 2 else ()
        link = messages.transform(i, "odom", "base", i, 2.0, 0.5)
        for topic, message in (
            ("/scan", messages.scan(i, 1.0 + np.arange(16.0), strengths)),
            ("/echoes", messages.echoes(i, [[1.0, 2.0], [], [3.0]], [[5.0, 6.0], [], [7.0]])),
            ("/cloud", messages.cloud(i, points)),
            ("/odom", messages.odometry(i, 1.0, i, 0.5)),
            ("/tf", messages.transforms(link)),
        ):
            items.append((topic, i, message))
    path = ros_bags.write(folder, kind, items, kind)
    if not path.is_dir():
        return _single(kind, path.read_bytes())
    return Sample(kind, {file.name: file.read_bytes() for file in path.iterdir()}, ".")


# Ways to damage

#: What a length, a number or a place in a file must not be believed to be; the last ones are
#: numbers that are none, to the processor.
_WORDS = (0, 1, 2, 127, 255, 2**15, 2**16 - 1, 2**28, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)
_FLOATS = (0x7F800000, 0x7F800001, 0x7FC00000, 0x7F7FFFFF, 0xFF7FFFFF, 0x7FF0000000000001)
_NUMBERS = b"nan inf -1 0 1e308 -1e308 1e-320 1e999 999999999 1_0 0x1 null [] {} 1e 9".split()
_NUMBERS += [b"[" * 3000, b"", b"\x1b[31m", b"\xd9\xa3", b'"', b"1" * 400, b"9" * 5000]


def _moved(data: bytes, chance: Random, other: bytes) -> bytes:
    """Cut off, drop, repeat, or put a piece of another log in, or all of it from some place on."""
    at, from_ = chance.randrange(len(data)), chance.randrange(len(other) + 1)
    before, behind = data[:at], data[at:]
    size = chance.choice((1, 4, 8, 40, 400, 4000))
    return chance.choice(
        (
            before,
            before + behind[size:],
            before + behind[:size] * chance.choice((2, 10, 1000)) + behind,
            before + other[from_ : from_ + size] + behind,
            before + other[from_:],
        )
    )


def _flip(data: bytes, chance: Random, _: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 8))):
        changed[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def _overwrite(data: bytes, chance: Random, _: bytes) -> bytes:
    """Blow up a length, or make a number none."""
    form = chance.choice("BHIIIQQ")
    word = chance.choice((*_WORDS, *_FLOATS)) & (256 ** struct.calcsize(form) - 1)
    piece = struct.pack(chance.choice("<<<>") + form, word)
    at = chance.randrange(len(data))
    return data[:at] + piece + data[at + len(piece) :]


def sizes(data: bytes) -> list[tuple[int, str]]:
    """Return where whole numbers stand that may be lengths, counts, offsets or indices in a file.

    They are those, of 2 to 8 bytes in either order, which are at most its size; (place, format)s.
    """
    found = []
    for size, form in ((8, "<Q"), (4, "<I"), (4, ">I"), (2, "<H"), (2, ">H")):
        for start in range(size):
            words = np.frombuffer(data, form, (len(data) - start) // size, start)
            places = start + size * np.flatnonzero((words > 0) & (words <= len(data)))
            found += [(place, form) for place in places.tolist()]
    return found


def _size(data: bytes, chance: Random, _: bytes) -> bytes:
    """Make a length, a count, an offset or an index another one, near or far."""
    if len(data) < 8 or not (places := sizes(data)):
        return data
    wide = [place for place in places if place[1] != "<H" and place[1] != ">H"] or places
    at, form = chance.choice(chance.choice((wide, places)))
    (word,) = struct.unpack_from(form, data, at)
    near = (word - 1, word + 1, 2 * word, word // 2, len(data) - at, len(data), 0, at)
    changed = bytearray(data)
    most = 256 ** struct.calcsize(form) - 1
    struct.pack_into(form, changed, at, chance.choice((*near, *_WORDS)) & most)
    return bytes(changed)


def _number(data: bytes, chance: Random, _: bytes) -> bytes:
    """Write another number, or none, over a word of a text."""
    at = chance.randrange(len(data))
    signs = b"0123456789.-+e"
    start = end = at
    while start and data[start - 1] in signs:
        start -= 1
    while end < len(data) and data[end] in signs:
        end += 1
    return data[:start] + chance.choice(_NUMBERS) + data[end:]


def _pack(data: bytes, chance: Random, other: bytes) -> bytes:
    """Put into an archive, alone or with another, perhaps under a name that leads out of it."""
    name = chance.choice(("a.log", "../a.log", "/a", "a/b.npz", "a\n.log", "ranges.npy", "a.b"))
    files = {name: data, "b": other} if chance.random() < 0.3 else {name: data}
    return gzip.compress(data, 1) if chance.random() < 0.5 else zipped(**files)


_WAYS = (*(_moved,) * 5, *(_flip, _overwrite, _number) * 2, *(_size,) * 4, _pack)


def damaged(data: bytes, chance: Random, other: bytes) -> bytes:
    """Damage a file in one to three ways; a packed one often behind its checksums."""
    if chance.random() < 0.6:
        with suppress(Exception):  # It may be broken already, in a dozen ways.
            if data.startswith(b"\x1f\x8b"):
                return gzip.compress(damaged(gzip.decompress(data), chance, other), 1)
            if data.startswith(b"PK"):
                return _damaged_member(data, chance, other)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        if data:
            data = chance.choice(_WAYS)(data, chance, other)[:LARGEST]
    return data


def _damaged_member(data: bytes, chance: Random, other: bytes) -> bytes:
    made = io.BytesIO()
    methods = (zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        chosen = chance.choice(archive.infolist()).filename
        with zipfile.ZipFile(made, "w", chance.choice(methods)) as target:
            for name in archive.namelist():
                inside = archive.read(name)
                is_chosen = name == chosen
                target.writestr(name, damaged(inside, chance, other) if is_chosen else inside)
    return made.getvalue()


def mutated(sample: Sample, others: list[Sample], chance: Random) -> Sample:
    """Damage one file of a log; `others` lend pieces."""
    name = chance.choice(sorted(sample.files))
    other = chance.choice(others)
    piece = other.files[chance.choice(sorted(other.files))]
    data = damaged(sample.files[name], chance, piece)
    return replace(sample, files={**sample.files, name: data})
