import pytest

import lineament as ln
from lineament.errors import LogError
from lineament.live import ReplaySource
from lineament.logs import save_npz


class Clock:
    """A time that passes only when it is changed, or slept through; or at each look."""

    now, step = 100.0, 0.0

    def __call__(self):
        self.now += self.step
        return self.now

    def sleep(self, seconds):
        assert seconds >= 0
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr("time.sleep", clock.sleep)
    return clock


@pytest.fixture
def played(tmp_path, clock):
    def play(stamps, **given):
        path = tmp_path / "log.npz"
        save_npz(path, [ln.LaserScan([2.0, 2.1], 0.0, 0.1, stamp=stamp) for stamp in stamps])
        return ReplaySource(path, clock=clock, **given)

    return play


def times(source, clock, most=1000):
    """When each scan came, and its stamp."""
    came = []
    for _ in range(most):
        if source.ended:
            break
        came += [(round(clock(), 6), r.read().stamp) for r in source.receive(0.05)]
    return came


@pytest.mark.parametrize(
    ("stamps", "rate", "after"),
    [
        ([7.0, 7.1, 7.4], 1.0, [0, 0.1, 0.4]),
        ([7.0, 7.1, 7.4], 2.0, [0, 0.05, 0.2]),
        ([0.0, 5.0, 9.0], 0.0, [0, 0, 0]),
        # Stamps that stand still, go back or leap too far are a tenth of a second apart.
        ([5.0, 5.0, 4.0, 14.1], 1.0, [0, 0.1, 0.2, 0.3]),
        ([5.0, 15.0], 1.0, [0, 10.0]),
    ],
)
def test_scans_come_at_the_times_of_their_stamps(played, clock, stamps, rate, after):
    source = played(stamps, rate=rate)
    assert source.publishers == 1
    due = [round(100.0 + seconds, 6) for seconds in after]
    assert times(source, clock) == list(zip(due, stamps, strict=True))
    assert (source.publishers, source.lost) == (0, 0)


def test_what_is_due_comes_together(played, clock):
    source = played([-0.1, 0.0, 0.1, 0.2, 0.3])
    clock.now += 70.0  # before it is first asked for
    assert [r.read().stamp for r in source.receive(0.0)] == [-0.1]
    clock.now += 0.35
    assert [r.read().stamp for r in source.receive(0.0)] == [0.0, 0.1, 0.2]
    # When it was due, not when it was asked for: the delay is latency.
    assert source.receive(1.0)[0].arrived == pytest.approx(170.4)


@pytest.mark.parametrize(("late", "counts"), [(0.005, [1, 1]), (0.0099, [1, 1]), (0.0101, [2, 0])])
def test_a_scan_in_time_for_a_hundredth_of_a_second_is_returned_alone(played, clock, late, counts):
    source = played([0.0, 0.001, 0.002])
    assert len(source.receive(0.0)) == 1
    clock.now += 0.001 + late  # both are due
    assert [len(source.receive(0.0)) for _ in range(2)] == counts


def test_a_loop_starts_again(played, clock):
    source = played([0.0, 0.5], loop=True)
    came = times(source, clock, most=26)
    assert came[:4] == [(100.0, 0.0), (100.5, 0.5), (100.6, 0.0), (101.1, 0.5)]
    assert not source.ended
    source.close()
    assert (source.receive(0.1), source.ended) == ([], True)


def test_a_log_that_breaks_says_where(tmp_path, clock):
    path = tmp_path / "a.log"
    line = "FLASER 2 1.5 1.6 0 0 0 0 0 0 7.5 robot 7.5\n"
    path.write_text(2 * line + "FLASER 2 1.5\n" + line)
    with pytest.raises(LogError, match=r"a\.log:3"):
        times(ReplaySource(path, clock=clock), clock)
    source = ReplaySource(path, clock=clock, keep_going=True)
    assert len(times(source, clock)) == 3
    assert len(source.problems()) == 1


def test_a_rate_beyond_reading_does_not_hold_the_node(played, clock):
    source = played([7.0, 7.1], rate=1e6, loop=True)
    clock.step = 0.001
    assert max(len(source.receive(0.05)) for _ in range(100)) == 64


@pytest.mark.parametrize(
    ("topic", "count", "said"),
    [
        (None, 2, ["scans of a, b are played as one topic: log_topic chooses one of them"]),
        ("b", 1, []),
    ],
)
def test_scans_of_several_topics_become_one_and_a_line(tmp_path, clock, topic, count, said):
    path = tmp_path / "units.json"
    path.write_text('{"a": [[1.5, 0.1], [1.6, 0.2]], "b": [[1.5, 0.1], [1.6, 0.2]]}')
    source = ReplaySource(path, clock=clock, topic=topic)
    assert len(times(source, clock)) == count
    assert source.problems() == said
