"""Signals: before a node runs the first leaves the block, later they are only noted."""

import signal
import sys

import pytest

from lineament import LaserScan
from lineament.live import LiveConfig, Report, run_live
from lineament.live.stopping import stopping
from lineament.logs import save_npz

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_start_is_left_at_once_and_its_end_is_not_disturbed(number):
    before = [signal.getsignal(each) for each in SIGNALS]
    reached = []
    with stopping():
        try:
            signal.raise_signal(number)
            reached.append("gone on")
        finally:
            signal.raise_signal(number)
            reached.append("end")
    assert reached == ["end"]
    assert [signal.getsignal(each) for each in SIGNALS] == before


def test_once_it_runs_signals_are_noted():
    with stopping() as is_stopped:
        assert not is_stopped()
        for number in SIGNALS:
            signal.raise_signal(number)
            assert is_stopped()


def test_a_signal_behind_the_start_ends_a_node_that_runs(tmp_path):
    """It is noted, and the node comes to its end as always: with a report."""
    log, reports = str(tmp_path / "a.npz"), []
    save_npz(log, [LaserScan([2.0] * 9, 0.0, 0.1, stamp=stamp) for stamp in (0.0, 0.1)])

    def write(line):
        assert "finds features" in line
        signal.raise_signal(signal.SIGTERM)

    with stopping() as is_stopped:
        config = LiveConfig(log=log, rate=1, ros=0, loop=True)
        reports.append(run_live(config, is_stopped, write=write))
    assert [type(report) for report in reports] == [Report]


def test_what_an_interrupted_start_fails_with_is_not_told():
    with stopping():
        try:
            signal.raise_signal(signal.SIGTERM)
        except BaseException:
            # As the import of an extension does.
            raise SystemError("initialization failed") from None


@pytest.mark.filterwarnings("ignore")
def test_a_stop_that_is_lost_in_a_callback_is_found(capfd):
    class Callback:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    with stopping() as is_stopped:
        del (found := [Callback()])[0]
        assert not found
        assert is_stopped()
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("runs", [False, True])
def test_other_errors_are_raised(runs):
    def fail() -> None:
        with stopping() as is_stopped:
            if runs:
                is_stopped()
                signal.raise_signal(signal.SIGINT)
            raise OSError("faulty")

    with pytest.raises(OSError, match="faulty"):
        fail()


def test_what_else_is_raised_in_a_callback_is_told_as_before(monkeypatch):
    class Callback:
        def __del__(self):
            raise ValueError("of a callback")

    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda of: told.append(str(of.exc_value)))
    before = sys.unraisablehook
    with stopping():
        del (found := [Callback()])[0]
        assert not found
        assert told == ["of a callback"]
    assert sys.unraisablehook is before
