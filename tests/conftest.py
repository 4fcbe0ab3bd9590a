"""What several test files share."""

from __future__ import annotations

import importlib
import json
import os
import random
import signal
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import pytest
from hypothesis import settings

from lineament import LaserScan, open_log
from lineament.cli import run
from lineament.plugins import plugins

# A program for a Python that has ROS 1.
collect_ignore = ["ros1_peer.py"]

# The same examples in every run: a failure on one machine is one on all.
settings.register_profile("lineament", derandomize=True, deadline=None)
settings.load_profile("lineament")

# A shell that runs the tests in the background has them, and what they start, ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of ROS 1 first: rospy's node cannot come back in a process.

    A worker that has done with some of them and takes others from the end of another worker's would
    need it to.
    """
    items.sort(key=lambda item: item.path.stem != "test_live_ros1")


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


def packages(*names: str) -> dict[str, ModuleType]:
    """Modules of these packages that are loaded; of both of ours, if none is named."""
    inside = tuple(f"{name}." for name in names or ("lineament", "lineament_lab"))
    return {key: module for key, module in sys.modules.items() if f"{key}.".startswith(inside)}


@pytest.fixture(scope="module")
def plain() -> Iterator[ModuleType]:
    """The package a second time, its kernels not compiled."""
    compiled, before = packages(), numba.config.DISABLE_JIT
    for name in compiled:
        del sys.modules[name]
    numba.config.DISABLE_JIT = 1
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LINEAMENT_JIT", "1")
        yield importlib.import_module("lineament")
    numba.config.DISABLE_JIT = before
    for name in packages():
        del sys.modules[name]
    sys.modules.update(compiled)


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """A small log of each format."""
    from mutations import own_samples

    return own_samples(tmp_path_factory.mktemp("samples"))


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Folder of temporary files, which must be empty when all logs are gone, after the test."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert list(folder.iterdir()) == []


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
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a command that must end with a status and one line, which is returned.

    A slow machine also has lines of the progress and of the compiler.
    """

    def line_of(command: str | Sequence[object], status: int = 1) -> str:
        capsys.readouterr()
        words = command.split() if isinstance(command, str) else [str(word) for word in command]
        assert run(words) == status
        output, errors = capsys.readouterr()
        assert output == ""
        assert "Traceback" not in errors
        (line,) = (line for line in errors.splitlines() if line.startswith("lineament"))
        return line

    return line_of


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Install a package of one module, with entry points, for a test."""

    def made(code: str, entries: str, name: str = "stranger") -> None:
        (tmp_path / f"{name}.py").write_text(code, encoding="utf-8")
        about = tmp_path / f"{name}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(entries, encoding="utf-8")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, name, raising=False)
        plugins.cache_clear()

    yield made
    sys.modules.pop("stranger", None)
    plugins.cache_clear()


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Domain of DDS that no other test uses; ports of those above 100 are lent by the system."""
    pytest.importorskip("cyclonedds", reason="no cyclonedds for this Python")
    fcntl = pytest.importorskip("fcntl", reason="no locks of files on this system")
    for name in ("CYCLONEDDS_URI", "ROS_DOMAIN_ID"):
        monkeypatch.delenv(name, raising=False)
    for number in random.SystemRandom().sample(range(1, 101), 100):
        with Path(tempfile.gettempdir(), f"dds-domain-{number}.lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield number
            return
    pytest.fail("no domain of DDS is free")


@pytest.fixture
def peer(domain: int) -> Iterator[Any]:
    """Another participant of the domain; it configures the domain for this process."""
    from dds_peer import Peer

    with closing(Peer(domain)) as peer:
        yield peer


@pytest.fixture
def started(tmp_path: Path, domain: int) -> Iterator[Callable[..., Any]]:
    """Start `lineament live` as a process, in the domain, on this machine."""
    from live_driving import LiveNode

    from lineament.tasks.warmup import warm_up

    warm_up(["optimal"])  # No process should wait for a compiler.
    with ExitStack() as stack:

        def start(*arguments: object) -> LiveNode:
            node = LiveNode(tmp_path, *arguments, "--localhost", "--domain", domain)
            stack.callback(node.kill)
            return node

        yield start


def pytest_make_parametrize_id(val):
    """Name bytes by their number: what gzip makes holds the time, and workers compare names."""
    return f"{len(val)} bytes" if isinstance(val, bytes) else None


@pytest.fixture
def approve(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Compare what an experiment reports, returns and means with what was approved."""
    from approved import NUMBER, assert_approved, figure_lines, numbers_of
    from lineament_lab.reproduce.claims import bands, claims

    from lineament.output import canvas

    drawn: list[str] = []
    monkeypatch.setattr(canvas, "figure_bytes", lambda f, *_: drawn.extend(figure_lines(f)) or b"")

    def compare(name: str, findings: Any, reports: Iterable[str] = ()) -> None:
        written = json.loads(json.dumps(findings.to_dict(), allow_nan=False))
        # Of prose only the numbers: the rest can be read in the source.
        for prose in (written, written["figures"], *written["tables"]):
            for key in {"note", "text", *written["figures"]} & prose.keys():
                prose[key] = " ".join(NUMBER.findall(str(prose[key])))
        for claim in (claim for experiment, claim in claims() if experiment == name):
            here, margins, blind = claim.judge(findings.numbers)
            written[claim.place] = [here, *map(float, (*margins, *blind))]
        steps = [report.split(": ", 1)[-1] for report in reports]
        lines = [" > ".join(steps), *numbers_of(written | bands({name: findings})), *drawn]
        assert_approved(f"experiments/{name}", lines)

    return compare
