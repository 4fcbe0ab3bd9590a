"""That kernels are compiled is said, once, to who looks; and how far long runs are."""

import io
import os
import subprocess
import sys
from contextlib import nullcontext
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from numba import config, njit

import lineament as ln
from lineament import cli, progress
from lineament.cli import progress as cli_progress
from lineament.cli.options import complain
from lineament.live import LiveConfig, Pipeline, run_live
from lineament.progress import compiling, compiling_now, compiling_said
from lineament.tasks import extract as extraction
from lineament.tasks.bulk import extract_logs
from lineament.tasks.demo import run_demo

BEGIN = "compiling kernels (it is a test): once, for up to some minutes"
END = "compiled kernels in {} s; they are cached for the next run"


@pytest.fixture
def clock(monkeypatch):
    """The time of the module, which tests set."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock.now)
    return clock


@pytest.fixture
def lines(monkeypatch):
    """What a new follower of the compiler says; it is in the place of the module's own."""
    lines = []
    compiler = progress._Compiler()
    compiler.say, compiler.reason = lines.append, "it is a test"
    monkeypatch.setattr(progress, "_compiler", compiler)
    return lines


def compile_all(clock, count):
    for _ in range(count):
        progress._compiler.start()
        clock.now += 1
        progress._compiler.end()


def test_one_piece_of_work_is_two_lines(lines, clock):
    with compiling():
        progress._compiler.start()
        assert (lines, compiling_now()) == ([], "")  # until it has taken half a second
        compile_all(clock, 4)
        assert (lines, compiling_now()) == ([BEGIN], BEGIN)
        clock.now += 2
        progress._compiler.end()
        compile_all(clock, 1)
        assert lines == [BEGIN]
    assert (lines, compiling_now()) == ([BEGIN, END.format(7)], "")


def test_kernels_from_the_cache_are_not_waited_for(lines):
    with compiling():
        pass
    assert lines == []


def test_kernels_outside_of_a_piece_of_work_are_one_each(lines, clock):
    compile_all(clock, 2)
    assert lines == 2 * [BEGIN, END.format(1)]


def test_what_takes_no_time_or_is_hidden_is_not_said(lines, clock):
    clock.now = 10.0
    progress._compiler.start()
    clock.now = 10.49
    progress._compiler.end()
    with compiling_said(None):
        progress._compiler.start()
        clock.now += 1
        compile_all(clock, 1)
        assert compiling_now() == BEGIN
        progress._compiler.end()
    assert (lines, compiling_now()) == ([], "")
    compile_all(clock, 1)
    assert lines == [BEGIN, END.format(1)]


@pytest.mark.usefixtures("lines")
def test_nobody_to_say_it_to_does_not_end_the_work(clock):
    def say(_):
        raise BrokenPipeError

    with compiling_said(say):
        compile_all(clock, 1)
    assert compiling_now() == ""


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="numba compiles nothing")
def test_numba_reports_what_it_compiles(lines, monkeypatch):
    monkeypatch.setattr(progress, "_PATIENCE", 0.0)
    # The follower of this test hears numba, whether the kernels are compiled or not.
    progress._compiler.hear("it is a test")
    source = "def inner(x):\n    return x + 1\n\ndef outer(x):\n    return named_inner(x) * 2\n"
    exec(source, names := {})
    names["named_inner"] = njit(names["inner"])
    outer = njit(names["outer"])
    assert outer(1) == 4
    assert outer(1) == 4
    assert lines == [BEGIN, END.format(0)] or (lines[0] == BEGIN and len(lines) == 2)


def on_terminal(monkeypatch, is_terminal=True):
    stream = io.StringIO()
    stream.isatty = lambda: is_terminal
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_a_library_says_it_on_a_terminal_and_in_a_notebook_alone(monkeypatch):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    terminal = on_terminal(monkeypatch)
    progress.say_to_person(BEGIN)
    assert terminal.getvalue() == f"{BEGIN}\n"
    script = on_terminal(monkeypatch, is_terminal=False)
    progress.say_to_person(BEGIN)
    assert script.getvalue() == ""
    monkeypatch.setitem(sys.modules, "ipykernel", ModuleType("ipykernel"))
    progress.say_to_person(BEGIN)
    assert script.getvalue() == f"{BEGIN}\n"
    monkeypatch.setattr(sys, "stderr", None)
    progress.say_to_person(BEGIN)


def test_bars_and_spinners_do_not_hide_it(monkeypatch):
    terminal = on_terminal(monkeypatch)
    for _ in cli_progress.tracker(quiet=False)(range(2), "reading", 2):
        complain(BEGIN)
    with cli_progress.status(quiet=False) as show:
        show("working")
        complain(BEGIN)
    assert terminal.getvalue().count(BEGIN) == 3


def test_the_first_run_of_an_extractor_is_one_piece_of_work(monkeypatch):
    pieces = []
    monkeypatch.setattr(
        "lineament.extractor.compiling", lambda: pieces.append(None) or nullcontext()
    )
    scan = ln.LaserScan([2.0] * 9, 0.0, 0.01)
    extractor, other = ln.Extractor("pdbs"), ln.Extractor("liu")
    extractor(scan)
    extractor(scan)
    other.batch(np.full((3, 9), 2.0), angle_min=0.0, angle_increment=0.01)
    other(scan)
    assert len(pieces) == 2


def test_kernels_of_a_demo_of_many_logs_and_of_a_node_are_loaded_first(tmp_path, monkeypatch):
    class LoadedError(Exception):
        """Ends what begins with it."""

    def load(extractors):
        raise LoadedError([extractor.method.name for extractor in extractors])

    for module in ("tasks.demo", "tasks.bulk.run"):
        monkeypatch.setattr(f"lineament.{module}.load_kernels", load)
    with pytest.raises(LoadedError, match=r"\['optimal', 'liu', 'liu'\]"):
        run_demo(tmp_path)
    ln.logs.save_npz(tmp_path / "a.npz", [ln.LaserScan([2.0] * 9, 0.0, 0.01)] * 3)
    with pytest.raises(LoadedError, match="pdbs"):
        extract_logs([tmp_path / "a.npz"], tmp_path / "out", ln.Extractor("pdbs"))

    seen = []
    call = Pipeline.__call__
    monkeypatch.setattr(Pipeline, "__call__", lambda *a: (seen.append(a[1]), call(*a))[1])
    config = LiveConfig(log=str(tmp_path / "a.npz"), rate=0, ros=0, track=True, method="pdbs")
    run_live(config, write=seen.append)
    # Twice, as the motion of tracks is estimated from the second scan on.
    assert seen[:3] == ["", "", "lineament finds features on /scan by pdbs"]


def test_extraction_is_timed_without_it(tmp_path, monkeypatch, clock):
    monkeypatch.setattr(extraction, "load_kernels", lambda _: setattr(clock, "now", 140))
    ln.logs.save_npz(tmp_path / "a.npz", [ln.LaserScan([2.0] * 9, 0.0, 0.01)])
    found = extraction.extract_log(tmp_path / "a.npz", tmp_path / "a.csv", ln.Extractor("liu"))
    assert found.seconds == 0


def test_quiet_commands_hide_it_and_all_leave_it_as_it_was(tmp_path, monkeypatch):
    before, used = progress._compiler.say, []
    record = lambda *_, **__: used.append(progress._compiler.say)  # noqa: E731
    monkeypatch.setattr("lineament.simulation.simulate_log", record)
    monkeypatch.setattr("lineament.output.figures.plot_scan", record)
    ln.logs.save_npz(tmp_path / "a.npz", [ln.LaserScan([2.0] * 9, 0.0, 0.01)])
    picture = str(tmp_path / "a.png")
    for arguments in (["simulate", "room"], ["plot", str(tmp_path / "a.npz"), "-m", "liu"]):
        for option, expected in (("-o", complain), ("-qo", None)):
            assert cli.run([*arguments, option, picture]) == 0
            assert used.pop() is expected
            assert progress._compiler.say is before


@pytest.mark.slow
@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="numba compiles nothing")
def test_first_use_is_never_silent_and_the_second_is(tmp_path):
    ln.logs.save_npz(tmp_path / "a.npz", [ln.LaserScan([2.0] * 9, 0.0, 0.01)])
    command = [sys.executable, "-m", "lineament", "extract", "a.npz", "-o", "a.csv", "-m", "pdbs"]

    def complaints():
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        environment["LINEAMENT_JIT"] = "1"
        ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert ran.returncode == 0
        return ran.stderr.splitlines()

    first, last = complaints()
    assert first.startswith("compiling kernels (LINEAMENT_JIT is set): once")
    assert last.startswith("compiled kernels in ")
    assert complaints() == []
