"""Commands that are killed at random moments: python tests/killing.py --kills 1000.

Every writer, every file of a log, and the data set of many logs. What stands under the name of an
output is whole: what a run that nobody kills writes. Of a data set, `--resume` repairs all.
"""

import argparse
import hashlib
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random

from lineament.cli import run
from lineament.extractor import Extractor, load_kernels
from lineament.logs import save_log
from lineament.output import ENDINGS
from lineament.simulation import SENSORS, drive, room


def forked(call: Callable[[], object], after: float | None) -> float:
    """Call in a process of its own, killed after a time [s]; return how long it took."""
    started = time.monotonic()
    child = os.fork()
    if not child:
        with suppress(OSError):
            os.setpgid(0, 0)  # what it starts is killed with it
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        try:
            call()
        finally:
            os._exit(0)
    with suppress(OSError):  # whoever is first
        os.setpgid(child, child)
    if after is not None:
        time.sleep(after)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return time.monotonic() - started


#: What differs in two drawings of the same: identifiers, and times of writing.
_OWN = re.compile(rb"\{[0-9A-F-]{36}\}|\b24\d{5}\.\d+|@ \S+")


def contents(folder: Path) -> dict[str, str]:
    """Return the digest of each file in a folder that has a name to be found by."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(_OWN.sub(b"", path.read_bytes())).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.startswith((".", "_"))
    }


class Killed:
    """One command, its output, and what it writes when nobody kills it."""

    def __init__(self, folder: Path, arguments: list[str]) -> None:
        self.name = folder.name.removeprefix("out-")
        self.arguments, self._folder = arguments, folder
        self.expected: dict[str, str] = {}
        durations = []
        for _ in range(2):  # the first loads code from the disk
            self.clear()
            durations.append(forked(self.call, None))
        self.expected = contents(folder)
        assert self.expected, arguments
        self.seconds = durations[-1]

    def clear(self) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir()

    def call(self) -> None:
        run([str(argument) for argument in self.arguments])

    def kill(self, chance: Random, again: bool) -> str:
        """Kill a run, over a whole output or over none, and look at what it left."""
        if not again:
            self.clear()
        before = contents(self._folder)
        forked(self.call, chance.uniform(0, 1.1 * self.seconds))
        found = contents(self._folder)
        wrong = {name for name, digest in found.items() if self.expected.get(name) != digest}
        assert not wrong, (self.arguments, wrong)
        assert before.keys() <= found.keys(), self.arguments
        return "whole" if found == self.expected else "in part" if found else "nothing"

    def repair(self) -> None:
        """Run again to the end: everything is there, and nothing else."""
        forked(self.call, None)
        assert contents(self._folder) == self.expected, self.arguments
        left = list(self._folder.rglob(".*.part"))
        assert "--resume" not in self.arguments or not left, left


def commands(folder: Path) -> list[Killed]:
    """Make a command for each ending, and the others that write."""
    log, many = folder / "log.npz", folder / "logs"
    many.mkdir()
    scans = list(drive(room(), [(-2, 0), (1, 0), (1, 1)], SENSORS["paper"], rate=20))
    save_log(log, scans)
    for k in range(6):
        save_log(many / f"{k}.npz", scans[k:60])
    outputs = [f"features{ending}" for ending in ENDINGS if ending not in (".rrd", ".mcap")]
    made = [
        Killed(folder / f"out-{name}", ["extract", log, "-o", folder / f"out-{name}" / name])
        for name in outputs
    ]
    for name, command in (
        ("picture.png", ["plot", log, "--scan", "1"]),
        ("drive.log.gz", ["simulate", "room", "--scans", "50"]),
    ):
        out = folder / f"out-{name}"
        made.append(Killed(out, [*command, "-o", out / name]))
    out = folder / "out-set"
    made.append(
        Killed(out, ["extract", many, "-o", f"{out / 'set'}/", "--resume", "--processes", "2"])
    )
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    load_kernels([Extractor("optimal")])
    counts: Counter[str] = Counter()
    chance = Random(given.seed)
    with tempfile.TemporaryDirectory() as own:
        targets = commands(Path(own))
        for number in range(given.kills):
            target = targets[number % len(targets)]
            outcome = target.kill(chance, again=chance.random() < 0.4)
            counts[f"{target.name}: {outcome}"] += 1
            if chance.random() < 0.3:
                target.repair()
            print(f"\r{number + 1} of {given.kills} kills", end="", file=sys.stderr)
        for target in targets:
            target.repair()
    print()
    for outcome, count in sorted(counts.items()):
        print(f"{outcome:<40}{count:>6}")
    print(f"{given.kills} kills, no half file, all repaired")


if __name__ == "__main__":
    main()
