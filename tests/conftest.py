"""What several test files share."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from lineament import LaserScan, open_log

# A program of its own, for a Python that has ROS 1.
collect_ignore = ["ros1_peer.py"]

# Numba caches a kernel by its own file, and does not see changes in those that it calls: a folder
# for each state of all kernels, which the commands that the tests start share.
_ROOT = Path(__file__).parents[1]
_SOURCES = [
    _ROOT / "src/lineament/features/records.py",
    *(_ROOT / "src/lineament/kernels").rglob("*.py"),
]
_STATE = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(_SOURCES))).hexdigest()[:16]
os.environ.setdefault("NUMBA_CACHE_DIR", str(_ROOT / "build" / "numba" / _STATE))

# The same examples in every run: a failure on one machine is one on all.
settings.register_profile("lineament", derandomize=True, deadline=None)
settings.load_profile("lineament")

# A shell that runs the tests in the background has them, and what they start, ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the recordings, which are not part of the project."""
    default = Path(__file__).parents[1] / ".." / "shared" / "data"
    folder = Path(os.environ.get("LINEAMENT_DATA", default)).resolve()
    if not (folder / "carmen").is_dir():
        pytest.skip(f"no recordings in {folder}: set LINEAMENT_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def recorded_scans(data_dir: Path) -> list[LaserScan]:
    """Every sixtieth scan of a recording of offices and corridors."""
    log = open_log(data_dir / "carmen" / "intel-corrected.log.gz")
    return list(islice(log, 0, None, 60))


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of temporary files, which must be empty when all logs are gone."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a text as a log, packed by a function of its bytes."""

    def write_log(
        text: str | bytes, name: str = "a.txt", pack: Callable[[bytes], bytes] = bytes
    ) -> Path:
        path = tmp_path / name
        path.write_bytes(pack(text.encode() if isinstance(text, str) else text))
        return path

    return write_log


@pytest.fixture
def domain() -> int:
    """Domain of DDS; those above have ports that the system lends to others."""
    return random.SystemRandom().randint(1, 100)


@pytest.fixture(scope="session")
def compiled() -> None:
    """Compile the kernels that processes load, of which none should wait for a compiler."""
    from lineament.tasks.warmup import warm_up

    warm_up(["iepf", "optimal"])


@pytest.fixture
def started(tmp_path: Path, domain: int, compiled: None) -> Iterator[Callable[..., Any]]:  # noqa: ARG001
    """Start `lineament live` with some arguments, in the domain, on this machine."""
    from live_driving import LiveNode

    with ExitStack() as stack:

        def start(*arguments: object) -> LiveNode:
            node = LiveNode(tmp_path, *arguments, "--localhost", "--domain", domain)
            stack.callback(node.kill)
            return node

        yield start


@pytest.fixture
def joined(domain: int) -> Iterator[Callable[..., Any]]:
    """Start another program in the domain."""
    from dds_driving import PeerProcess

    with ExitStack() as stack:
        yield lambda *given: stack.enter_context(closing(PeerProcess(domain, *given)))


@pytest.fixture
def peer(joined: Callable[..., Any]) -> Any:
    """Another program in the domain, that is there from the beginning."""
    return joined()
