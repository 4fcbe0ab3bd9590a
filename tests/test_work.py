"""The count of work that `make bench-check` compares with what is stored."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
#: Of groups of half the size more are opened.
SLOWER = """
import sys
import work
from lineament.kernels.optimal import partition
partition.GROUP = 16
work.STORED = {("optimal", "noisy"): work.STORED["optimal", "noisy"]}
sys.exit(work.main())
"""


def run(*arguments):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT / "benchmarks",
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_work_is_what_is_stored():
    done = run("work.py")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_more_work_is_seen():
    done = run("-c", SLOWER)
    assert done.returncode == 1
    assert "optimal, noisy: groups opened" in done.stdout
