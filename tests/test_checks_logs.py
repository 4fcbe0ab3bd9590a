"""check_log: every reader passes, and what is broken in one is named in a line."""

import gzip
from typing import ClassVar

import numpy as np
import pytest
import ros_bags
from mutations import own_samples
from text_logs import scan_texts

from lineament import LaserScan, LogError, open_log
from lineament.checks import check_log
from lineament.logs import save_npz
from lineament.logs.base import Log
from lineament.logs.opening import readers

KINDS = (*scan_texts(), "npz", "gzip", *ros_bags.KINDS)

#: One object, or scan, of all; or an index at its end.
WHOLE = ("rplidar", "csv_beams", "npz")


def claims(kind):
    return {"streams": kind not in WHOLE, "marked": kind not in scan_texts()}


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    """A log of each kind, in a folder; of the last of a kind."""
    folder, opened = tmp_path_factory.mktemp("samples"), {}
    (folder / "made").mkdir()
    for sample in own_samples(folder / "made"):
        place = folder / sample.kind
        place.mkdir(exist_ok=True)
        for name, data in sample.files.items():
            (place / name).write_bytes(data)
        opened[sample.kind] = place / sample.opened
    return opened


@pytest.mark.parametrize("tries", [12, pytest.param(300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", KINDS)
def test_every_reader(samples, kind, tries):
    check_log(open_log, samples[kind], **claims(kind), tries=tries)


@pytest.mark.slow
@pytest.mark.parametrize("kind", scan_texts())
def test_every_text_packed(write, kind):
    path = write(scan_texts()[kind], "log.gz", gzip.compress)
    check_log(open_log, path, streams=kind not in WHOLE, marked=True, tries=100)


def test_each_reader_has_a_sample(samples):
    logs = [open_log(path) for kind, path in samples.items() if kind != "zip"]
    assert {type(log) for log in logs} == set(readers())


# What is broken


class Plain(Log):
    """A stamp and three ranges a line; others break one of its promises each."""

    format, description, endings = "plain", "plain", (".plain",)

    @classmethod
    def recognises(cls, _):
        return True

    def _lines(self):
        return self.path.read_bytes().split(b"\n")[:-1]

    def __len__(self):
        return len(self._lines())

    def _scan(self, words):
        return LaserScan(words[1:4], 0.0, 0.1, stamp=words[0])

    def _items(self):
        for k, line in enumerate(self._lines(), 1):
            try:
                words = [float(word) for word in line.split()]
                if len(words) != 4 or not all(map(np.isfinite, words)):
                    raise ValueError(f"has {len(words)} numbers, expected 4")
                scan = self._scan(words)
            except ValueError as error:
                self._fault(LogError(self.name, str(error), k))
                continue
            yield "scan", scan


class Miscounts(Plain):
    def __len__(self):
        return super().__len__() + 1


class Once(Plain):
    """What was read is gone."""

    gone: ClassVar[set] = set()

    def _items(self):
        if self.path not in self.gone:
            self.gone.add(self.path)
            yield from super()._items()


class Elsewhere(Plain):
    def _items(self):
        return (("other", scan) for _, scan in super()._items())


class Raises(Plain):
    def _scan(self, words):
        if words[0] != round(words[0]):
            raise KeyError("a stamp with a fraction")
        return super()._scan(words)

    def _items(self):
        for line in self._lines():
            yield "scan", self._scan([float(word) for word in line.split()])


class Silent(Plain):
    def _fault(self, error):
        if not self.keep_going:
            raise error


class Several(Plain):
    def _fault(self, error):
        raise LogError("a file", str(error))


class MakesUp(Plain):
    """What is missing at the end is made up."""

    def _lines(self):
        lines = self.path.read_bytes().split(b"\n")
        return [*lines[:-1], *([b"9 9 9 9", b"8 8 8 8"] if lines[-1] else [])]


@pytest.fixture
def plain(tmp_path):
    path = tmp_path / "six.plain"
    path.write_text("".join(f"{k} {k}.5 2 3.25\n" for k in range(6)))
    return path


def test_a_reader_of_somebody(plain):
    check_log(Plain, plain)


@pytest.mark.parametrize(
    ("reader", "line"),
    [
        (Miscounts, "a whole log: len is 7, and 6 scans come"),
        (Once, "a second reading: gives other scans"),
        (Elsewhere, "a whole log: scan 0 is of topic 'other', which topics has not"),
        (Raises, "with bytes .* changed: raised ValueError: could not convert string to float"),
        (Silent, "keep_going counts no fault, and without it: .*six.plain:"),
        (Several, "the error does not begin with the path: a file: "),
        (Plain, "cut off after .* of 78 bytes: . of 6 scans, and no error"),
        (MakesUp, "cut off after .* of 78 bytes: scan . is not that of the whole log"),
        (lambda path, **_: open_log(path), "raised LogError: .*six.plain: is no log"),
    ],
)
def test_what_is_broken_is_named(plain, reader, line):
    with pytest.raises(AssertionError, match=rf"^six.plain: .*{line}") as caught:
        check_log(reader, plain, marked=reader is Plain)
    assert str(caught.value).isprintable()


def test_nothing_is_no_sample(tmp_path):
    save_npz(tmp_path / "a.npz", [LaserScan([1.0, 2.0], 0.0, 0.1)])
    check_log(open_log, tmp_path / "a.npz", streams=False, tries=3)
    (tmp_path / "b.plain").touch()
    with pytest.raises(AssertionError, match="has no scans: they are few to check"):
        check_log(Plain, tmp_path / "b.plain")
