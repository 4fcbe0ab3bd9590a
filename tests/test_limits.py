"""Logs that are beyond a limit end in one line, before memory or time is spent on them."""

import json
import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
from crafted import CRAFTED
from crafted_plans import PLANS

from lineament import LogError
from lineament.limits import LIMITS, Limits
from lineament.logs import open_log
from lineament.logs.opening import readers

NAMES = [limit.name for limit in fields(Limits)]
#: Bounds of a process that reads a crafted file: its memory [MB], and a guard against hanging [s].
MEMORY, SECONDS = 500, 60

#: Reads a log twice, and reports how it ended and the most memory that the process had [MB].
READ = """
import json, resource, sys
from lineament.logs import open_log
from lineament import LogError

path, seconds, options = sys.argv[1], int(sys.argv[2]), json.loads(sys.argv[3])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
ends = []
for keep_going in (False, True):
    try:
        log = open_log(path, keep_going=keep_going, **options)
        ends.append([sum(1 for _ in log), log.skipped, *log.faults[:1]])
    except LogError as error:
        ends.append([0, 0, str(error)])
with open("/proc/self/status") as status:
    memory = next(int(line.split()[1]) for line in status if line.startswith("VmHWM"))
print(json.dumps([memory / 1000, *ends]))
"""


def test_every_limit_has_a_crafted_file():
    logs, plans = ({limit for limit, *_ in crafted.values()} for crafted in (CRAFTED, PLANS))
    # The time that a server takes is tested with its like, in test_sources.py.
    assert logs | plans - {""} == {*NAMES, ""} - {"fetch"}


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no figure of memory here")
@pytest.mark.parametrize("name", CRAFTED)
def test_a_crafted_file_ends_in_one_line(name, tmp_path):
    limit, write, options = CRAFTED[name]
    path = tmp_path / name
    write(path)
    command = [sys.executable, "-c", READ, str(path), str(SECONDS), json.dumps(options)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    memory, strict, kept = json.loads(done.stdout)
    assert memory < MEMORY
    expected = "ends early|holds more rows than its"
    if limit:
        most = options.get("limits", {}).get(limit, getattr(LIMITS, limit))
        expected = rf"more than the limit of {most} \(raise it by --limit {limit}=N, in Python "
    assert re.match(rf"{re.escape(str(path))}.*({expected})", strict[2])
    assert strict[2].isprintable()
    # What is skipped is reported likewise; a bag that is copied breaks off where it was too much.
    assert kept[0] < 100
    assert kept[2] == strict[2] or name == "bag.gz"


def opened(sample, folder, **options):
    for name, data in sample.files.items():
        (folder / name).write_bytes(data)
    path = folder / sample.opened
    try:
        return open_log(path, **options)
    except LogError as error:
        if "several logs" not in str(error):
            raise
        return open_log(re.findall(r"[^ ,]+/day/carmen", str(error))[0], **options)


def test_the_beams_and_scans_of_every_reader_are_limited(samples, tmp_path):
    """Of a new reader, too: what is common to all of them checks it."""
    seen = set()
    for i, sample in enumerate(samples):
        folder = tmp_path / str(i)
        folder.mkdir()
        log = opened(sample, folder)
        seen.add(type(log))
        most = max(len(scan) for scan in log)
        n = sum(1 for _ in log)
        exact = {"beams": most, "scans": n}
        assert sum(1 for _ in opened(sample, folder, limits=exact)) == n
        for limit, value in exact.items():
            if value == 1:
                continue
            less = {limit: value - 1}
            pattern = rf"{re.escape(str(folder))}.* has {value} .*--limit {limit}=N"
            with pytest.raises(LogError, match=pattern):
                list(opened(sample, folder, limits=less))
            if log.format == "npz":  # All of it is one array.
                continue
            log = opened(sample, folder, limits=less, keep_going=True)
            assert sum(1 for _ in log) < n
            assert log.skipped >= 1
            assert f"--limit {limit}=N" in log.faults[0]
    assert seen == set(readers())


def test_limits_have_names_and_bounds():
    assert Limits.of(None) == Limits.of({}) == LIMITS
    with pytest.raises(ValueError, match="limit 'size' is unknown, expected one of beams, points"):
        Limits.of({"size": 3})
    for value in (0, -1, 2.0, True, "3"):
        with pytest.raises(ValueError, match=f"limit rows is {value!r}, expected a whole number"):
            Limits.of({"rows": value})
    for name in NAMES:
        Limits.of({name: 7}).check(name, 7)
        with pytest.raises(LookupError, match=rf"8 .*limit of 7 .*{name}=N.*\{{'{name}': N\}}"):
            Limits.of({name: 7}).check(name, 8, LookupError)


def test_what_is_unpacked_may_grow_as_text_does():
    free = 1 << 24
    for size, packed in ((free, 0), (101 * free - 1, free)):
        LIMITS.check_growth(size, packed)
        with pytest.raises(ValueError, match=r"unpacks to \d+ times its packed size"):
            LIMITS.check_growth(size + 1, packed)


def test_the_documented_table_is_the_code():
    text = (Path(__file__).parents[1] / "docs" / "logs.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| ([\d ]+) \|", text, re.MULTILINE)
    assert {name: int(value.replace(" ", "")) for name, value in rows} == {
        name: getattr(LIMITS, name) for name in NAMES
    }
