"""Threads, processes and Dask: the same table, and what happens when one of them dies."""

import os
import signal
import subprocess
import sys
import time
import warnings
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import active_children, get_context

import pytest
from bulk_logs import Deadly, corner_log, flaser_log, halves, outcomes, rows_of, table_of

import lineament as ln
from lineament.cli import run
from lineament.tasks.bulk import Processes, Row, dask_executor, extract_logs, parts, workers
from lineament.tasks.bulk.parts import Task, extract_part

IEPF = ln.Extractor("iepf")

posix = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")


@pytest.fixture
def logs(tmp_path):
    home = tmp_path / "logs"
    return [corner_log(home / f"{name}.npz", 3 + k) for k, name in enumerate("abcd")]


@pytest.fixture
def cluster():
    """Give the address of a Dask cluster of one worker process with two threads."""
    distributed = pytest.importorskip("distributed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what Dask makes of its own libraries is its own matter
        with distributed.LocalCluster(
            n_workers=1,
            threads_per_worker=2,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=50,
        ) as local:
            yield local.scheduler_address


def processes_of_ours():
    return [child for child in active_children() if "Dask" not in child.name]


@pytest.mark.slow
def test_threads_processes_and_dask_make_the_same_table(logs, cluster, tmp_path):
    extract_logs(logs, tmp_path / "threads", IEPF)
    with Processes(2) as processes:
        extract_logs(logs, tmp_path / "processes", IEPF, executor=processes)
    assert processes_of_ours() == []
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        extract_logs(logs, tmp_path / "pool", IEPF, executor=pool)
    with dask_executor(cluster) as executor:
        extract_logs([*logs, "/none.bag"], tmp_path / "dask", IEPF, executor=executor)
    expected = table_of(tmp_path / "threads")
    assert expected.num_rows > 0
    for name in ("processes", "pool", "dask"):
        assert table_of(tmp_path / name).equals(expected)
    assert rows_of(tmp_path / "dask")["none.bag"]["error"].startswith("/none.bag: there is no")
    home = str(tmp_path / "logs")
    arguments = ["extract", home, "-q", "-m", "iepf", "-o", f"{tmp_path}/threads/", "--resume"]
    assert run([*arguments, "--dask", cluster]) == 0


def test_a_dask_cluster_that_does_not_answer_is_named(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("lineament.tasks.bulk.workers._ANSWER", 0.3)
    for address in ("tcp://127.0.0.1:9", "nonsense://a"):
        with (
            pytest.raises(ln.LineamentError, match=f"{address}: no Dask scheduler answers"),
            dask_executor(address),
        ):
            pass
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ln.LineamentError, match="needs distributed, "), dask_executor(address):
        pass


@posix
@pytest.mark.slow
def test_a_log_whose_worker_dies_is_tried_twice_and_the_others_go_on(logs, tmp_path, monkeypatch):
    marker = tmp_path / "once"
    marker.touch()
    monkeypatch.setenv("MARKER", str(marker))
    # Of this one the first worker dies, but not the second.
    once = corner_log(tmp_path / "once.npz", beams=57)
    always = corner_log(tmp_path / "always.npz", beams=43)
    with Processes(2) as processes:
        for method in (Deadly(fatal_beams=43), Deadly(fatal_beams=57, is_once=True)):
            extract_logs(
                [always, once, *logs],
                tmp_path / "out",
                ln.Extractor(method),
                executor=processes,
                resume=True,
            )
            rows = rows_of(tmp_path / "out")
            if method.fatal_beams == 43:
                ended = "its process died twice (exit status 3, exit status 3)"
                assert rows.pop("always.npz")["error"] == f"{always}: {ended}"
            assert {row["outcome"] for row in rows.values()} == {"done"}
    assert not marker.exists()
    assert halves(tmp_path / "out") == []
    assert processes_of_ours() == []


class Dying:
    """A worker that dies in its task the first times."""

    deaths = 0

    def run(self, task, _report):
        if Dying.deaths:
            raise EOFError
        return task.row

    def end(self):
        Dying.deaths -= 1
        return "SIGKILL"


@pytest.mark.parametrize(
    ("deaths", "error"), [(1, ""), (2, "/a: its process died twice (SIGKILL, SIGKILL)")]
)
def test_a_task_whose_process_dies_is_tried_once_more(deaths, error, monkeypatch):
    monkeypatch.setattr(Dying, "deaths", deaths)
    monkeypatch.setattr(workers, "_Worker", Dying)
    with Processes(1) as processes:
        task = Task(Row(log="/a", name="a"), "/out", IEPF.method, None, {})
        assert processes.begin(task, lambda *_: None).result().error == error


@pytest.mark.parametrize(
    ("status", "text"),
    [(None, "exit status None"), (0, "exit status 0"), (-9, "SIGKILL"), (-250, "signal 250")],
)
def test_how_a_process_ended(status, text):
    assert workers._ending_of(status) == text


@posix
def test_interrupts_are_held_while_a_process_starts_and_no_longer():
    def is_held():
        return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])

    with workers._interrupts_held():
        assert is_held()
    assert not is_held()


class Lost(ProcessPoolExecutor):
    """An executor whose workers are lost."""

    def submit(self, *_arguments):
        future = Future()
        future.set_exception(RuntimeError("lost\nit"))
        return future


def test_what_an_executor_loses_is_reported(logs, tmp_path):
    assert extract_logs(logs, tmp_path / "out", IEPF, executor=Lost()).failed == 4
    error = rows_of(tmp_path / "out")["a.npz"]["error"]
    assert error == f"{logs[0]}: its worker failed: RuntimeError: lost it"


class Waiting(ProcessPoolExecutor):
    """An executor that begins nothing."""

    def submit(self, *_arguments):
        self.futures = [*getattr(self, "futures", []), Future()]
        return self.futures[-1]


def test_an_interrupted_run_cancels_what_has_not_begun(logs, tmp_path):
    def interrupt(about):
        raise KeyboardInterrupt(about)

    waiting = Waiting()
    with pytest.raises(KeyboardInterrupt, match=r"^0/4 logs"):
        extract_logs(logs, tmp_path / "out", IEPF, executor=waiting, show=interrupt)
    assert [future.cancelled() for future in waiting.futures] == [True] * 4
    assert set(outcomes(tmp_path / "out").values()) == {"pending"}


def test_what_a_report_raises_ends_the_work_and_leaves_nothing(logs, tmp_path, monkeypatch):
    monkeypatch.setattr(parts, "_PERIOD", 0.0)

    def stop(scans, total):
        assert (scans, total) == (0, 3)
        assert len(halves(tmp_path)) == 1
        raise KeyboardInterrupt

    row = Row(log=str(logs[0]), name="a.npz", output="log=a.npz/part-0.parquet")
    with pytest.raises(KeyboardInterrupt):
        extract_part(Task(row, str(tmp_path), IEPF.method, None, {}), stop)
    assert not (tmp_path / "log=a.npz").exists()


def wait_for(condition):
    deadline = time.monotonic() + 300
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert condition()


@posix
@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "workers"),
    [
        (signal.SIGINT, "--processes"),
        (signal.SIGTERM, "--processes"),
        (signal.SIGKILL, "--processes"),
        (signal.SIGINT, "--threads"),
    ],
)
def test_a_stopped_run_leaves_whole_files_and_is_resumed(how, workers, tmp_path):
    home, out = tmp_path / "logs", tmp_path / "out"
    home.mkdir()
    for name in "ab":
        flaser_log(home / f"{name}.log", 40_000)
    short = corner_log(home / "c.npz")
    arguments = ["extract", home / "c.npz", home, "-m", "iepf", "-o", f"{out}/", "--resume"]
    # A group of its own: as at a terminal, a signal to it reaches all processes.
    process = subprocess.Popen(
        [sys.executable, "-m", "lineament", *map(str, arguments), workers, "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_for(lambda: "done" in outcomes_so_far(out) and halves(out))
    if how != signal.SIGKILL:
        os.killpg(process.pid, how)
    else:
        process.kill()
    _, errors = process.communicate(timeout=120)
    assert process.returncode == (128 + how if how != signal.SIGKILL else -how)
    assert "Traceback" not in errors
    if how != signal.SIGKILL:
        assert errors.splitlines()[-1] == "lineament: stopped"
    # Its processes end when the run is gone, and take their half files with them.
    wait_for(lambda: not halves(out))
    assert outcomes(out) == {"a.log": "pending", "b.log": "pending", short.name: "done"}
    assert [path.parent.name for path in out.rglob("*.parquet")] == ["log=c.npz"]
    for name in "ab":
        flaser_log(home / f"{name}.log", 50)  # the rest of the test need not wait
    assert run([*map(str, arguments), "-q", "--threads", "1"]) == 0
    assert set(outcomes(out).values()) == {"done"}
    assert halves(out) == []
    extract_logs(home, tmp_path / "fresh", IEPF)
    assert table_of(out).equals(table_of(tmp_path / "fresh"))


def outcomes_so_far(folder):
    try:
        return outcomes(folder).values()
    except (OSError, ValueError):  # not there yet, or in the middle of a line
        return ()


def test_a_process_is_started_without_an_import(tmp_path):
    """A tool that takes modules out of `sys.modules` meanwhile would have the log fail."""
    script = tmp_path / "starts.py"
    script.write_text(
        "import sys\n"
        "from lineament.tasks.bulk import workers\n"
        "if __name__ == '__main__':\n"
        "    before = set(sys.modules)\n"
        "    worker = workers._Worker()\n"
        "    print(sorted(set(sys.modules) - before))\n"
        "    worker.end()\n",
        encoding="utf-8",
    )
    found = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert found.stdout == "[]\n"
