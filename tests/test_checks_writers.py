"""check_writer: every writer passes, and what is broken in one is named in a line."""

import json

import numpy as np
import pytest

from lineament import LineamentError
from lineament.checks import check_writer
from lineament.output import ENDINGS, Writer

SLOW = pytest.param(".rrd", marks=pytest.mark.slow)


@pytest.mark.parametrize("ending", [SLOW if ending == ".rrd" else ending for ending in ENDINGS])
def test_every_writer(ending):
    check_writer(ending)


# What is broken


class Plain(Writer):
    """The ends of a segment a line; others break one of its promises each."""

    rounded = 17

    def _open(self, temporary, files):
        self._file = files.enter_context(temporary.open("w", encoding="utf-8"))
        self._file.write("ends\n")

    def _write(self, found, _):
        for one in found:
            for row in one.features.segments:
                ends = [*row["start"].tolist(), *row["end"].tolist()]
                self._file.write(json.dumps([round(x, self.rounded) for x in ends]) + "\n")


def read(path):
    return np.array([json.loads(line) for line in path.read_text().splitlines()[1:]])


class Rounds(Plain):
    rounded = 2


class InPlace(Plain):
    """It writes to the file itself."""

    def __enter__(self):
        writer = super().__enter__()
        self.path.touch()
        return writer


class Litters(Plain):
    def _close(self):
        self.path.with_name("a.tmp").touch()


class Restless(Plain):
    """What was written before an exception is kept."""

    def __exit__(self, *_):
        return super().__exit__(None)


class Unnamed(Plain):
    """What cannot be written is an OSError of the system."""

    def __enter__(self):
        if not self.path.parent.is_dir():
            raise FileNotFoundError(self.path)
        return super().__enter__()


class Empty(Plain):
    """Without features there is nothing to open."""

    def _write(self, found, first):
        if not any(len(one.features.segments) for one in found):
            raise LineamentError(f"{self.path}: no features")
        super()._write(found, first)


class Latin(Plain):
    def _write(self, found, first):
        self._file.write("".join(one.topic for one in found).encode("ascii").decode())
        super()._write(found, first)


class Copied(Plain):
    def __deepcopy__(self, _):
        return self


def test_a_writer_of_somebody():
    check_writer(Plain, ending=".plain", read=read)
    check_writer(lambda path: Plain(path))


@pytest.mark.parametrize(
    ("writer", "line"),
    [
        (Rounds, "Rounds: read again: the segments are not those that were written"),
        (InPlace, "InPlace: in a block: the file appears before its block ends"),
        (Litters, "Litters: in a block: the folder has .* in place of it"),
        (Restless, "Restless: ValueError after 0 scans: it leaves"),
        (Unnamed, "Unnamed: nowhere/.* is a FileNotFoundError, expected a LineamentError"),
        (Empty, "Empty: scans without features: raised LineamentError: "),
        (Latin, "Latin: with topics .*: raised UnicodeEncodeError: 'ascii' codec"),
        (Copied, "Copied: a copy of it while it is open is no TypeError"),
        (".xlsx", "^.xlsx is unknown, expected one of: .parquet, .csv"),
    ],
)
def test_what_is_broken_is_named(writer, line):
    with pytest.raises(AssertionError, match=line) as caught:
        check_writer(writer, ending=".plain", read=read, scans=5)
    assert str(caught.value).isprintable()
