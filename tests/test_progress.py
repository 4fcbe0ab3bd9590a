"""The compilation of kernels is shown, once, to who looks, and is counted into no speed."""

import io
import os
import re
import subprocess
import sys
from contextlib import nullcontext
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from numba import config, njit
from rich.progress import Progress
from rich.status import Status

import lineament as ln
from lineament import cli, progress
from lineament.cli import progress as cli_progress
from lineament.live import LiveConfig, Pipeline, run_live
from lineament.progress import (
    Compiling,
    compiled_seconds,
    compiling,
    compiling_now,
    compiling_shown,
)
from lineament.tasks import extract as extraction
from lineament.tasks.bulk import extract_logs
from lineament.tasks.demo import run_demo


@pytest.fixture
def clock(monkeypatch):
    """The time of the module, which tests set."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock.now)
    return clock


@pytest.fixture
def states(monkeypatch):
    """What a new follower of the compiler shows; it is in the place of the module's own."""
    states = []
    compiler = progress._Compiler()
    compiler.show = states.append
    monkeypatch.setattr(progress, "_compiler", compiler)
    return states


def compile_all(clock, count):
    for _ in range(count):
        progress._compiler.start()
        clock.now += 1
        progress._compiler.end()


def test_one_piece_of_work_is_shown_from_its_first_function_to_its_end(states, clock):
    progress._compiler.reason = "it is a test"
    with compiling():
        progress._compiler.start()
        assert states == []  # until it has taken half a second
        compile_all(clock, 4)
        clock.now += 2
        progress._compiler.end()
        compile_all(clock, 1)
        assert not any(state.is_last for state in states)
    assert [state.is_first for state in states] == [True] + [False] * (len(states) - 1)
    assert [state.is_last for state in states] == [False] * (len(states) - 1) + [True]
    assert [state.done for state in states] == sorted(state.done for state in states)
    assert (states[0].done, states[0].seconds, states[-1].done) == (1, 1.0, 6)
    assert compiled_seconds() == 7  # what is compiled within another is not counted twice
    assert str(states[0]) == "compiling kernels (it is a test): 1 done in 1 s"
    assert str(states[-1]) == "compiled kernels in 7 s; they are cached for the next run"


def test_kernels_from_the_cache_are_not_waited_for(states):
    with compiling():
        pass
    assert states == []


def test_kernels_outside_of_a_piece_of_work_are_one_each(states, clock):
    compile_all(clock, 2)
    assert [(state.done, state.seconds) for state in states if state.is_last] == [(1, 1), (1, 1)]


def test_what_takes_no_time_or_is_hidden_is_not_shown(states, clock):
    clock.now = 10.0
    progress._compiler.start()
    clock.now = 10.49
    progress._compiler.end()
    with compiling_shown(None):
        progress._compiler.start()
        clock.now += 1
        compile_all(clock, 1)
        assert compiling_now() == "compiling kernels (): 1 done in 2 s"
        progress._compiler.end()
    assert states == []
    assert compiling_now() == ""
    compile_all(clock, 1)
    assert states[-1].is_last


@pytest.mark.usefixtures("states")
def test_nobody_to_show_it_to_does_not_end_the_work(clock):
    def show(_):
        raise BrokenPipeError

    with compiling_shown(show):
        compile_all(clock, 1)
    assert compiled_seconds() == 1


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="numba compiles nothing")
def test_numba_reports_what_it_compiles(monkeypatch):
    monkeypatch.setattr(progress, "_PATIENCE", 0.0)
    # The follower of this test hears numba, whether the kernels are compiled or not.
    compiler, states = progress._Compiler(), []
    monkeypatch.setattr(progress, "_compiler", compiler)
    compiler.hear("it is a test")
    source = "def inner(x):\n    return x + 1\n\ndef outer(x):\n    return named_inner(x) * 2\n"
    exec(source, names := {})
    names["named_inner"] = njit(names["inner"])
    outer = njit(names["outer"])
    with compiling_shown(states.append):
        assert outer(1) == 4
        count = len(states)
        assert outer(1) == 4
    assert len(states) == count
    assert (states[0].done, states[-1].done) == (0, 2)
    assert states[0].is_first
    assert states[-1].is_last
    assert compiled_seconds() > 0


FIRST, NEXT, LAST = (
    Compiling("it is a test", done, 9.7 + done, done == 1, done == 40) for done in (1, 2, 40)
)


def on_terminal(monkeypatch, is_terminal=True):
    stream = io.StringIO()
    stream.isatty = lambda: is_terminal
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_a_library_shows_it_on_a_terminal_alone(monkeypatch):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    terminal = on_terminal(monkeypatch)
    for state in (FIRST, LAST):
        progress.show_to_person(state)
    assert terminal.getvalue() == f"\r\033[K{FIRST}\r\033[K{LAST}\n"
    script = on_terminal(monkeypatch, is_terminal=False)
    progress.show_to_person(FIRST)
    assert script.getvalue() == ""
    monkeypatch.setattr(sys, "stderr", None)
    progress.show_to_person(FIRST)


def test_a_notebook_shows_it_in_one_place_of_the_cell(monkeypatch):
    shown = []

    class Handle:
        def __init__(self, number):
            self.number = number

        def update(self, data, raw):
            assert raw
            shown.append((self.number, data["text/plain"]))

    def display(data, raw, display_id):
        assert raw
        assert display_id
        shown.append((len(shown), data["text/plain"]))
        return Handle(len(shown) - 1)

    monkeypatch.setitem(sys.modules, "ipykernel", ModuleType("ipykernel"))
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    fake = ModuleType("IPython.display")
    fake.display = display
    monkeypatch.setitem(sys.modules, "IPython.display", fake)
    for state in (FIRST, NEXT, LAST, FIRST, LAST):
        progress.show_to_person(state)
    numbers = [number for number, _ in shown]
    assert numbers == [0, 0, 0, 3, 3]
    assert [text for _, text in shown] == list(map(str, (FIRST, NEXT, LAST, FIRST, LAST)))


def test_commands_print_two_lines_where_there_is_no_terminal(monkeypatch, capsys):
    for state in (FIRST, NEXT, LAST):
        cli_progress.show_compiling(state)
    assert capsys.readouterr().err == f"{FIRST}\n{LAST}\n"
    terminal = on_terminal(monkeypatch)
    cli_progress.show_compiling(NEXT)
    assert terminal.getvalue() == f"\r\033[K{NEXT}"


def test_bars_and_spinners_make_way_for_it(monkeypatch):
    on_terminal(monkeypatch)
    texts = []
    update = Progress.update

    def record(*arguments, **changes):
        texts.extend(changes[name] for name in changes if name == "description")
        update(*arguments, **changes)

    monkeypatch.setattr(Progress, "update", record)
    monkeypatch.setattr(Status, "update", lambda _, text: texts.append(text))
    for _ in cli_progress.tracker(quiet=False)(range(1), "reading", 1):
        cli_progress.show_compiling(NEXT)
        cli_progress.show_compiling(LAST)
    with cli_progress.status(quiet=False) as show:
        show("working")
        cli_progress.show_compiling(NEXT)
        cli_progress.show_compiling(LAST)
    assert texts == [str(NEXT), "reading", "working", str(NEXT), "working"]
    assert cli_progress._fronts == []


def test_speeds_are_without_it(monkeypatch, capsys):
    seconds = SimpleNamespace(now=0.0, compiled=0.0)
    monkeypatch.setattr(cli_progress.time, "monotonic", lambda: seconds.now)
    monkeypatch.setattr(cli_progress, "compiled_seconds", lambda: seconds.compiled)
    for _ in cli_progress.tracker(quiet=False)(range(4), "reading", 4):
        seconds.now, seconds.compiled = seconds.now + 41, seconds.compiled + 40
    assert capsys.readouterr().err.splitlines()[1] == "reading: 2/4, 1.0/s, 2 s left"
    terminal = on_terminal(monkeypatch)
    for _ in cli_progress.tracker(quiet=False)(range(4), "reading", 4):
        seconds.compiled += 40  # longer than all took
    assert re.search(r"4/4\D.*\d{9}/s", terminal.getvalue())


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
    before, used = progress._compiler.show, []
    record = lambda *_, **__: used.append(progress._compiler.show)  # noqa: E731
    monkeypatch.setattr("lineament.simulation.simulate_log", record)
    monkeypatch.setattr("lineament.output.figures.plot_scan", record)
    ln.logs.save_npz(tmp_path / "a.npz", [ln.LaserScan([2.0] * 9, 0.0, 0.01)])
    picture = str(tmp_path / "a.png")
    for arguments in (["simulate", "room"], ["plot", str(tmp_path / "a.npz"), "-m", "liu"]):
        for option, expected in (("-o", cli_progress.show_compiling), ("-qo", None)):
            assert cli.run([*arguments, option, picture]) == 0
            assert used.pop() is expected
            assert progress._compiler.show is before


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
    assert first.startswith("compiling kernels (LINEAMENT_JIT is set): ")
    assert last.startswith("compiled kernels in ")
    assert complaints() == []
