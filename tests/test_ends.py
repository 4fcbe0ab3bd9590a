"""How commands end: by signals, on full disks, in closed pipes, with logs that change."""

import errno
import io
import os
import re
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import click
import pytest
from test_cli import benchmark, npz  # noqa: F401 (fixtures)
from test_output import SCAN, files_up_to, random_features, write
from text_logs import FLASER

import lineament as ln
from lineament import LogError, files
from lineament.cli import cli, run, terminating
from lineament.cli.options import Place
from lineament.live import LiveConfig, Node, Pipeline, ReplaySource
from lineament.logs import open_log, save_npz
from lineament.output import ENDINGS, open_writer
from lineament.simulation import SENSORS, drive
from lineament.simulation import room as small_room
from lineament.tasks.bulk import extract_logs
from lineament.view import ViewServer

COMMANDS = {name: cli.get_command(None, name) for name in cli.list_commands(None)}

#: Each command at work on little: with the output that it writes, where it writes one.
RUNS = {
    "extract wall.npz -m iepf -o f.csv": "f.csv",
    "extract wall.npz -m iepf -o out/ --threads 1": "out",
    "info wall.npz": "",
    "plot wall.npz -m iepf -o p.png": "p.png",
    "view wall.npz -m iepf --no-browser": "",
    "map room.npz -o plan.dxf": "plan.dxf",
    "map room.npz -o plan.svg --poses drive.tum": "drive.tum",
    "plan walls.parquet -o drawn.svg": "drawn.svg",
    "calibrate drive.npz --no-deskew -o left.png": "left.png",
    "locate room.npz --map walls.parquet -o where.csv": "where.csv",
    "live --from wall.npz --ros 0 --rate 0 -m iepf": "",
    "demo wall.npz -o demo": "demo",
    "merge two.log --topic FLASER --topic RLASER --mounting FLASER=.2,0,0 "
    "--mounting RLASER=-.2,0,180 -m iepf -o m.csv": "m.csv",
    "methods": "",
    "warmup -m iepf": "",
    "compare wall.npz -m iepf -o a.html": "a.html",
    "reproduce --only fig5 --frames 1 --seeds 1 -o rep": "rep",
    "bench ple --data bench.npz -m iepf --json a.json": "a.json",
    "simulate room --scans 2 --sensor lms181 -o a.log": "a.log",
    "simulate room --scans 2 --sensor lms181 -o a.npz": "a.npz",
}
PRINTING = [command for command in RUNS if not command.startswith(("plot", "simulate"))]
WRITING = [command for command, output in RUNS.items() if output]
posix = pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no such signals here")


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """A log of a room, and its map."""
    folder = tmp_path_factory.mktemp("plan")
    log, walls = str(folder / "room.npz"), str(folder / "walls.parquet")
    assert run(["simulate", "room", "--scans", "4", "--sensor", "lms181", "-o", log, "-q"]) == 0
    assert run(["map", log, "-o", walls, "-q"]) == 0
    way = [(-2, -1), (0.5, -1), (0.5, 0.5), (-1, 0.5)]
    line = f"LASER 181{181 * ' 2'} 0 0 0 0 0 0 {{0}} robot {{0}}\n"
    lines = (f"{kind}{line.format(t)}" for t in range(4) for kind in "FR")
    (folder / "two.log").write_text("".join(lines))
    save_npz(folder / "drive.npz", drive(small_room(), way, SENSORS["lms181"], speed=1, rate=6))
    return folder


@pytest.fixture
def work(tmp_path, monkeypatch, npz, benchmark, plan):  # noqa: ARG001, F811
    """Work in a folder with the inputs of all commands, without what takes them long."""
    shutil.copytree(plan, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LINEAMENT_DATA", "")
    monkeypatch.delenv("LINEAMENT_DATA")
    monkeypatch.setattr(ViewServer, "serve_forever", lambda _: None)
    monkeypatch.setattr("lineament.tasks.demo._draw", lambda *_: [])
    monkeypatch.setattr("lineament_lab.reproduce.report.run_experiments", lambda *_: {})
    return tmp_path


def half_files(folder):
    return [path for path in folder.rglob("*") if path.name.endswith(".part")]


def whole_files(folder):
    return {path for path in folder.rglob("*") if path.is_file()}


def test_each_command_is_here():
    assert {command.split()[0] for command in RUNS} == set(COMMANDS)


# Paths


def parameters(command, names=()):
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            yield from parameters(inner, (*names, name))
        return
    for parameter in command.params:
        if isinstance(parameter.type, click.Path):
            yield pytest.param(parameter, names, id=f"{' '.join(names)} {parameter.name}")


ALL = [one for name, command in COMMANDS.items() for one in parameters(command, (name,))]


@pytest.mark.parametrize(("parameter", "names"), ALL)
def test_an_empty_path_is_wrong_usage(parameter, names, work, refused):
    assert isinstance(parameter.type, Place)
    (given,) = [known for known in RUNS if known.startswith(" ".join(names))][:1]
    words = given.split()
    if isinstance(parameter, click.Argument):
        words = [*names, "", *words[len(names) :]]
    else:
        words += [max(parameter.opts, key=len), ""]
    before = whole_files(work)
    assert refused(words, 2).endswith("is empty, expected a path")
    assert whole_files(work) == before


def test_no_path_of_a_command_is_a_plain_text():
    """A name that says path, file, folder, log or output has the type of paths."""
    named = {parameter.values[0].name for parameter in ALL}
    assert {"log", "logs", "output", "config", "data", "museum"} <= named


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
@pytest.mark.usefixtures("work")
def test_a_pipe_is_not_replaced_by_a_file(refused):
    os.mkfifo("p.png")
    assert "p.png: is a device or a pipe" in refused("plot wall.npz -m iepf -o p.png")
    assert Path("p.png").is_fifo()


# Signals


@pytest.fixture
def no_nohup():
    """SIGHUP as where it is not ignored: what runs the tests may be started by ``nohup``."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@posix
@pytest.mark.usefixtures("no_nohup")
@pytest.mark.parametrize(
    ("command", "name"),
    [(one, "SIGTERM") for one in RUNS if not one.startswith("live")]
    + [(one, name) for one in [*RUNS][:3] for name in ("SIGINT", "SIGHUP")],
)
def test_a_signal_leaves_no_half_file(command, name, work, monkeypatch, capsys):
    """It comes when the whole output is written, and has no name yet; else before it is printed."""
    number, came = getattr(signal, name), []
    before = {n: signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGHUP)}
    there = whole_files(work)

    def interrupted(original):
        def call(*arguments, **options):
            if not came:
                came.append(half_files(work))
                signal.raise_signal(number)
            return original(*arguments, **options)

        return call

    if RUNS[command]:
        monkeypatch.setattr(os, "fsync", interrupted(os.fsync))
    elif command.startswith("view"):
        monkeypatch.setattr(ViewServer, "serve_forever", interrupted(lambda _: None))
    else:
        monkeypatch.setattr(click, "echo", interrupted(click.echo))
    assert run(command.split()) == 128 + number
    assert came
    assert came[0] or not RUNS[command]
    lines = [line for line in capsys.readouterr().err.splitlines() if line]
    assert lines[-1] == "lineament: stopped"
    assert not any(line.startswith("lineament:") for line in lines[:-1])  # Progress, perhaps.
    assert half_files(work) == []
    left = whole_files(work) - there
    assert {path.name for path in left} <= {"_manifest.jsonl", "features.parquet"}
    assert {n: signal.getsignal(n) for n in before} == before


def test_ctrl_c_while_the_command_is_imported(monkeypatch, capsys):
    class Interrupted(ModuleType):
        def __getattr__(self, _):
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "lineament.cli", Interrupted("lineament.cli"))
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("lineament", run_name="__main__")
    assert ended.value.code == 130
    assert capsys.readouterr() == ("", "lineament: stopped\n")


def lost_in_a_callback(*_, **__):
    class Callback:
        def __del__(self):
            signal.raise_signal(signal.SIGTERM)

    del (found := [Callback()])[0]
    assert not found
    signal.pause()


def cleared_by_compiled_code(*_, **__):
    for _ in range(3):
        with suppress(BaseException):  # as PyErr_Clear does
            signal.raise_signal(signal.SIGTERM)
    time.sleep(10)


@posix
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("wait", [lost_in_a_callback, cleared_by_compiled_code])
def test_a_signal_that_is_lost_comes_again(wait, capsys, monkeypatch):
    monkeypatch.setattr("lineament.methods.describe", wait)
    assert run(["methods"]) == 128 + signal.SIGTERM
    assert capsys.readouterr() == ("", "lineament: stopped\n")


@posix
def test_a_signal_that_was_lost_does_not_come_after_the_command(monkeypatch):
    def swallow(*_, **__):
        with suppress(BaseException):
            signal.raise_signal(signal.SIGTERM)
        return "found"

    monkeypatch.setattr("lineament.methods.describe", swallow)
    monkeypatch.setattr(sys.modules[terminating.__module__], "_PATIENCE", 5)
    came, threads = [], threading.active_count()
    monkeypatch.setattr(os, "kill", lambda *signal: came.append(signal))
    assert run(["methods"]) == 0
    while threading.active_count() > threads:
        time.sleep(0.01)
    assert came == []


# Full disks, closed pipes


class Unwritable(io.StringIO):
    """A standard output on a full disk, or into a pipe that nobody reads."""

    def __init__(self, number):
        super().__init__()
        self.number = number

    def write(self, _):
        raise OSError(self.number, os.strerror(self.number))


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EPIPE], ids=["full", "pipe"])
@pytest.mark.parametrize("command", PRINTING)
def test_a_standard_output_that_ends(command, number, work, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", Unwritable(number))
    assert run(command.split()) == 1
    expected = f"lineament: standard output: {os.strerror(number)}"
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == expected
    assert not any(line.startswith("lineament:") for line in lines[:-1])  # Progress, perhaps.
    assert half_files(work) == []


@pytest.mark.parametrize("command", RUNS)
def test_a_standard_error_that_ends_stops_nothing(command, work, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Unwritable(errno.ENOSPC))
    assert run(command.split()) == 0
    assert not RUNS[command] or (work / RUNS[command]).exists()
    assert run(["info", "nothing.log"]) == 1


@posix
@pytest.mark.parametrize("buffers", ["", "1"])
@pytest.mark.parametrize("end", ["full", "pipe"])
def test_a_real_standard_output_that_ends(end, buffers):
    """Python that buffers what it writes flushes it when it ends, and complains by itself."""
    if end == "full":
        if not Path("/dev/full").exists():
            pytest.skip("no such device here")
        output = os.open("/dev/full", os.O_WRONLY)
    else:
        read, output = os.pipe()
        os.close(read)
    command = [sys.executable, "-m", "lineament", "methods"]
    env = {**os.environ, "PYTHONUNBUFFERED": buffers}
    done = subprocess.run(command, stdout=output, stderr=subprocess.PIPE, text=True, env=env)
    os.close(output)
    reason = os.strerror(errno.ENOSPC if end == "full" else errno.EPIPE)
    assert (done.returncode, done.stderr) == (1, f"lineament: standard output: {reason}\n")


@posix
def test_without_a_standard_output_nothing_is_wrong():
    closed = f"{shlex.quote(sys.executable)} -m lineament methods >&-"
    done = subprocess.run(closed, shell=True, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@posix
@pytest.mark.parametrize("command", WRITING)
def test_a_full_disk_is_one_line(command, work, refused):
    before = whole_files(work)
    with files_up_to(40):
        line = refused(f"{command} -q")
    assert re.fullmatch(r"lineament: .*: cannot be written: .*File too large", line)
    assert whole_files(work) == before


# Two at once


@pytest.mark.parametrize("ending", ENDINGS)
def test_of_two_runs_onto_one_file_the_last_is_whole(ending, tmp_path):
    pytest.importorskip({".dxf": "ezdxf", ".rrd": "rerun"}.get(ending, "os"))
    (tmp_path / "alone").mkdir()
    path, alone = tmp_path / f"f{ending}", tmp_path / "alone" / f"f{ending}"
    other = [random_features(i) for i in range(5)]
    write(alone, other)
    first, second = open_writer(path), open_writer(path)
    with second:
        with first:
            first.write(random_features(7), SCAN)
            second.write(other[0], SCAN)
        assert path.exists()
        for features in other[1:]:
            second.write(features, SCAN)
    assert half_files(tmp_path) == []
    if ending not in (".rrd", ".dxf"):  # They hold the time, or numbers made by chance.
        assert path.read_bytes() == alone.read_bytes()


@posix
def test_two_runs_into_one_folder(npz, tmp_path):  # noqa: F811
    out, problems = tmp_path / "out", []

    def show(_):
        if not problems:
            with pytest.raises(ln.LineamentError, match="another run writes into this") as caught:
                extract_logs(npz, out, ln.Extractor("iepf"))
            problems.append(str(caught.value))

    assert extract_logs(npz, out, ln.Extractor("iepf"), show=show).failed == 0
    assert problems
    assert extract_logs(npz, out, ln.Extractor("iepf")).failed == 0
    with files.alone_in(tmp_path / "nowhere"):
        pass


# Clocks


def test_rates_and_waits_do_not_go_by_a_clock_that_jumps(npz, monkeypatch):  # noqa: F811
    """The clock of the day goes back by years, at each look at it."""
    jumps = iter(range(10**9, 0, -(10**7)))
    monkeypatch.setattr(time, "time", lambda: float(next(jumps)))
    monkeypatch.setattr(time, "time_ns", lambda: next(jumps) * 10**9)
    reports = []
    source = ReplaySource(npz, rate=50.0)
    node = Node(source, Pipeline(LiveConfig(method="iepf")), [], show=reports.append)
    assert node.run().total.scans + reports[-1].total.dropped == 7
    for report in reports:
        assert 0 <= report.seconds < 100
        assert 0 <= report.rate < 1e6
        assert not min(report.latency) < 0


def test_only_stamps_of_messages_are_taken_from_the_clock_of_the_day():
    root = Path(ln.__file__).parent
    clock = re.compile(r"time\.time(_ns)?\(|datetime\.now|utcnow|time\.localtime")
    users = [path for path in root.rglob("*.py") if clock.search(path.read_text("utf-8"))]
    names = sorted(path.relative_to(root).as_posix() for path in users)
    assert names == ["live/node.py", "live/plan_topics.py"]


# Logs that change


def read_while(sample, folder, change, first):
    """Read a log that changes after some scans: what was read, what the whole is, the error."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, data in sample.files.items():
        (folder / name).write_bytes(data)
    path = folder / sample.opened
    log = open_log(f"{path}/day/carmen" if b"day/carmen" in sample.files.get("log", b"") else path)
    whole, scans, problem = list(log), [], ""
    paths = [folder / name for name in sample.files]
    try:
        if first == 0:
            change(paths)
        for scan in log:
            scans.append(scan)
            if len(scans) == first:
                change(paths)
    except LogError as error:
        problem = str(error)
    return scans, whole, problem


def halve(paths):
    for path in paths:
        os.truncate(path, path.stat().st_size // 2)


def vanish(paths):
    for path in paths:
        path.unlink()


def grow(paths):
    for path in paths:
        with path.open("ab") as file:
            file.write(path.read_bytes())


@posix
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("change", [halve, vanish, grow])
def test_a_log_that_changes_while_it_is_read(samples, tmp_path, change, first):
    """What was read is right, and what is missing is reported, by one line."""
    for sample in samples:
        scans, whole, problem = read_while(sample, tmp_path / "log", change, first)
        # What was appended before reading began may be read.
        common = min(len(scans), len(whole))
        read, there = ([str(scan.ranges) for scan in each[:common]] for each in (scans, whole))
        assert read == there, sample.kind
        assert problem or len(scans) == len(whole) or (change is grow and first == 0), sample.kind
        assert problem.isprintable()
        assert problem.startswith(str(tmp_path)) or not problem


def test_a_long_text_that_becomes_shorter(tmp_path):
    """It is not taken for the end that no more can be read."""
    path = tmp_path / "a.log"
    path.write_bytes(FLASER + (b"#" * 1023 + b"\n") * 4096 + FLASER)
    scans = iter(open_log(path))
    assert next(scans).stamp == 7.5
    halve([path])
    with pytest.raises(LogError, match=r"a\.log:\d+: has become shorter while it was read"):
        next(scans)


# Others


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no such device here")
def test_a_configuration_without_an_end_is_refused(refused):
    line = "lineament: /dev/zero: is not TOML: it has more than 4194304 bytes"
    assert refused("live --config /dev/zero") == line


def test_what_is_wrong_with_a_file_is_not_a_page(tmp_path):
    error = LogError(tmp_path / ("a" * 300), "x" * 5000 + "y")
    assert str(error) == f"{tmp_path / ('a' * 300)}: {'x' * 998} …"
    assert str(error.fresh()) == str(error)
    assert "…" not in str(LogError("a", "x" * 1000))
