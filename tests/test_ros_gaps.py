"""Scans around whose stamps there are no poses."""

import pytest
from test_ros_poses import poses, scans, write

from lineament import LineamentWarning
from lineament.logs import ros_poses


def test_a_gap_or_another_clock_gives_no_pose(tmp_path):
    """A robot at 1 m/s whose odometry stops for 4 s, and at last; and one that is an hour ahead."""

    def make(messages, ahead=0.0):
        for k in range(100):
            stamp = 0.1 * k
            if not 2 < stamp < 6 and stamp < 8:
                yield "/odom", stamp, messages.odometry(stamp + ahead, stamp, 0.0, 0.0)
            yield from scans(messages, stamp + 0.05, time=stamp)

    path = write(tmp_path, "mcap", make)
    said = r"log.mcap: 46 of 100 scans have no pose: /odom has none near .* every 1.5 s at least"
    with pytest.warns(LineamentWarning, match=said) as caught:
        found = poses(path, "/odom")
    assert len(caught) == 1
    known = [k for k, pose in enumerate(found) if pose is not None]
    assert known == [*range(20), *range(60, 94)]
    off = [found[k][0] - (0.1 * k + 0.05) for k in known]
    assert off[:-15] == pytest.approx([0.0] * 39, abs=1e-9)
    for ahead in (-3600.0, 3600.0):
        path = write(tmp_path, "mcap", lambda messages, ahead=ahead: make(messages, ahead))
        with pytest.warns(LineamentWarning, match="100 of 100 scans have no pose"):
            assert poses(path, "/odom") == [None] * 100


def test_a_robot_that_stands_has_a_pose_though_its_localiser_is_silent(tmp_path):
    """As AMCL: the next pose comes a minute later, when the robot has moved by half a metre."""

    def make(messages):
        for stamp, x, theta in ((0.0, 0.0, 0.0), (60.0, 0.5, -0.6), (90.0, 1.5, -0.6)):
            yield from scans(messages, *(stamp - 0.1 * i for i in range(20, 0, -1) if stamp))
            yield "/amcl_pose", stamp, messages.pose_with_covariance(stamp, x, 0.0, theta)
            yield from scans(messages, *(stamp + 0.1 * i for i in range(600 if not stamp else 1)))

    path = write(tmp_path, "mcap", make)
    with pytest.warns(LineamentWarning, match="20 of 642 scans have no pose"):
        found = poses(path, "/amcl_pose")
    assert [pose is None for pose in found] == [False] * 621 + [True] * 20 + [False]


def test_the_link_that_breaks_off_is_named(tmp_path):
    def make(messages):
        at = messages.transform
        yield "/tf", 0.0, messages.transforms(at(0.0, "map", "odom", 1.0, 0.0, 0.0))
        for stamp in (0.0, 1.0, 2.0):
            yield "/tf", stamp, messages.transforms(at(stamp, "odom", "base", stamp, 0.0, 0.0))
        yield from scans(messages, 0.0, 1.0, 2.0, time=2.0)

    path = write(tmp_path, "mcap", make)
    with pytest.warns(LineamentWarning, match="1 of 3 scans have no pose: /tf has no map->odom"):
        found = poses(path, "/tf:map->odom->base")
    assert [pose is None for pose in found] == [False, False, True]


def test_scans_wait_behind_one_of_another_clock_without_losing_their_poses(tmp_path, monkeypatch):
    monkeypatch.setattr(ros_poses, "MAX_POSES", 20)

    def make(messages):
        yield from scans(messages, 3600.0, time=0.0)
        for k in range(100):
            yield from scans(messages, 0.1 * k + 0.05, time=0.1 * k)
            yield "/odom", 0.1 * k, messages.odometry(0.1 * k, 0.1 * k, 0.0, 0.0)

    path = write(tmp_path, "mcap", make)
    with pytest.warns(LineamentWarning, match="1 of 101 scans have no pose"):
        _, *found = poses(path, "/odom")
    assert [pose[0] for pose in found[:99]] == pytest.approx([0.1 * k + 0.05 for k in range(99)])
