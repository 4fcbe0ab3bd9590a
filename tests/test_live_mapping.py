"""A map that is made while its scans come: poses on it, its walls on topics, and what is saved."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from itertools import chain, islice, repeat
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from in_memory import Taken
from live_driving import eventually
from robot_driving import storey_driven

import lineament as ln
from lineament.cli import cli
from lineament.errors import LineamentError
from lineament.live import LiveConfig, Pipeline
from lineament.live.pipeline import stamp_of
from lineament.live.plan_topics import PlanTopics
from lineament.live.received import LINKS, MOUNTINGS, SCAN, wanted
from lineament.logs import save_log
from lineament.mapping import LineMap
from lineament.mapping.drive_map import Drive
from lineament.mapping.making import make_map
from lineament.mapping.mapper import Mapper
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Moment
from lineament.rosmsg.poses import StampedPose
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, office


def driven(count: int = 90, sensor: str = "lms181"):
    """Scans of a drive with wheels that slip, and where they were taken."""
    return storey_driven(3, count, sensor, 4.0)[1:]


def off(pose, truth, k):
    return math.dist(pose[:2], relative(truth[0], truth[k])[:2])


@pytest.mark.slow
def test_scans_are_placed_while_a_map_is_made_beside_them():
    scans, truth = driven()
    extract, mapper = ln.Extractor(), Mapper()
    with closing(mapper):
        for k, scan in enumerate(scans):
            where = mapper.step(extract(scan), scan.pose)
            assert where
            assert off(where.pose, truth, k) < 0.1
            assert 0 <= where.evidence.explained <= 1
        # The last scan again, the robot stands: the process beside it is done some time.
        draft = eventually(lambda: mapper.step(extract(scan), scan.pose) and mapper.draft)
        where = mapper.step(extract(scan), scan.pose)
        assert 20 <= draft.frames <= len(mapper.drive.frames)
        assert off(where.pose, truth, k) < 0.05
        assert len(draft.map.walls) > 10
        made = mapper.finish()
        twin = make_map(mapper.drive.frames, mapper.drive.scans)
        np.testing.assert_array_equal(made.map.walls, twin.map.walls)
        assert not mapper._process.is_alive()


def test_a_pose_goes_on_from_where_the_draft_has_its_key_frame():
    (first, second, third), _ = driven(3)
    extract, mapper, twin = ln.Extractor(), Mapper(), Drive()
    with closing(mapper):
        for scan in (first, second):
            mapper.step(extract(scan), scan.pose)
            twin.add(scan, extract(scan), scan.pose)
        mapper._moved = (5.0, -2.0, 0.3)
        after = mapper.step(extract(third), third.pose)
        alone = twin.add(third, extract(third), third.pose)
        np.testing.assert_allclose(after.pose, compose((5.0, -2.0, 0.3), alone.pose))
        sample = np.random.default_rng(1).multivariate_normal((0, 0, 0), alone.covariance, 40_000)
        c, s = math.cos(0.3), math.sin(0.3)
        turned = sample @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        scale = np.sqrt(np.diag(after.covariance))
        np.testing.assert_allclose(
            np.cov(turned.T) / np.outer(scale, scale),
            after.covariance / np.outer(scale, scale),
            atol=0.03,
        )
        with pytest.raises(ValueError, match="the features have no scan"):
            mapper.step(replace(extract(first), scan=None))


@pytest.mark.slow
def test_a_robot_in_another_place_is_lost_until_it_is_known_how_that_lies_to_the_first():
    """It is carried to another floor, and back to where it was before."""
    (scans, truth), extract, mapper = driven(60, "utm30lx"), ln.Extractor(), Mapper()
    floor = office(7, (24, 16), visits=0.1)
    others = list(islice(floor.drive(SENSORS["utm30lx"], seed=1, rate=4)[0], 40))
    with closing(mapper):
        assert all(mapper.step(extract(scan)) for scan in scans)
        assert not any(mapper.step(extract(scan)) for scan in others)
        again = scans[10:60]
        assert not mapper.step(extract(again[0]))
        turns = chain.from_iterable(repeat([*reversed(again), *again]))
        for scan in again:
            mapper.step(extract(scan))

        # Where the robot stands no key frame is taken: it turns to and fro until it is known.
        where = eventually(lambda: mapper.step(extract(next(turns))) or None)
        k = scans.index(mapper.drive.frames[-1].scan)
        assert off(mapper.step(extract(scans[k])).pose, truth, k) < 0.1
        assert where


def test_a_scanner_that_sees_nothing_is_lost():
    scan = driven(1)[0][0]
    blind = ln.LaserScan([math.inf] * len(scan), scan.angle_min, scan.angle_increment, stamp=9.0)
    extract, mapper = ln.Extractor(), Mapper()
    with closing(mapper):
        assert mapper.step(extract(scan))
        where = mapper.step(extract(blind))
        assert not where
        assert not where.is_known


@pytest.mark.slow
def test_a_node_publishes_poses_and_walls_and_saves_the_map(tmp_path):
    """With the scanner mounted ahead and turned, and odometry on ``/tf``."""
    scans, truth = driven()
    mounting, path, kept = (0.25, -0.1, 0.4), tmp_path / "map.yaml", Taken()
    config = LiveConfig(mapping=str(path))
    topics = PlanTopics(kept, RosMessages("cdr"), config)
    with closing(Pipeline(config)) as pipeline:
        pipeline.hear([StampedPose(0.0, "base_link", "laser", mounting)], MOUNTINGS)

        def seen(scan):
            base = compose(scan.pose, inverse(mounting))
            pipeline.hear([StampedPose(scan.stamp, "odom", "base_link", base)], LINKS)
            bare = scan.with_pose(None)
            frame = pipeline("scanner", bare)
            topics.publish(frame, Moment(*stamp_of(bare.stamp_ns), "laser", "odom"))
            return frame

        for k, scan in enumerate(scans):
            frame = seen(scan)
            assert off(frame.where.pose, truth, k) < 0.1
            # map → odom → base_link is where the robot is.
            on_map = compose(frame.placed.odom, compose(scan.pose, inverse(mounting)))
            np.testing.assert_allclose(on_map, frame.placed.base, atol=1e-9)
        assert {"/scan/pose", "/amcl_pose", "/tf"} <= {of.topic for of in kept.messages}
        eventually(lambda: seen(scans[-1]).plan)
        topics.diagnose((9, 0))
        assert kept.messages[-1].topic == "/scan/plan"
        with pytest.raises(ValueError, match="a map is made of 'laser' alone"):
            pipeline("another", ln.LaserScan([2.0] * 9, 0.0, 0.1, frame_id="rear"))
        said = pipeline.save()
    assert "map.yaml: LineMap(" in said
    assert "not sure on 0.0 m of" in said
    assert len(LineMap.read(path).walls) > 10


def test_a_process_that_dies_is_a_line_and_the_map_is_made_at_the_end(tmp_path):
    """One that the system kills, for want of memory say: poses go on, but no loop is closed."""
    path = tmp_path / "made.svg"
    pipeline = Pipeline(LiveConfig(log="played.npz", mapping=str(path)))
    with closing(pipeline):
        scans, _ = driven(12)
        pipeline("front", scans[0])
        assert not list(pipeline.problems())
        pipeline._localiser._mapper._process.kill()
        eventually(lambda: list(pipeline.problems()))
        (problem,) = pipeline.problems()
        assert problem.startswith("the process that closes loops has ended")
        for scan in scans[1:]:
            assert pipeline("front", scan).where
        assert pipeline.save().startswith(f"{path}: LineMap(")


def test_a_node_without_scans_saves_nothing(tmp_path):
    with closing(Pipeline(LiveConfig(mapping=str(tmp_path / "a.svg")))) as pipeline:
        assert pipeline.save() == "no map: there was no scan"
        scan = driven(1)[0][0]
        pipeline("", ln.LaserScan([math.inf] * len(scan), scan.angle_min, scan.angle_increment))
        assert pipeline.save().startswith("no map: no walls are seen")
    assert not list(tmp_path.iterdir())


def test_nobody_says_where_a_robot_is_on_a_map_that_is_made():
    told = {one.what for one in wanted(LiveConfig(mapping="a.dxf"))}
    assert told == {SCAN, LINKS, MOUNTINGS}


def test_a_map_that_cannot_be_written_is_said_at_once():
    with pytest.raises(LineamentError, match="nowhere"):
        Pipeline(LiveConfig(mapping="/nowhere/at/all/b.svg"))


@pytest.mark.slow
def test_the_command_plays_a_log_and_saves_its_map(tmp_path):
    scans, _ = driven()
    save_log(tmp_path / "log.npz", scans)
    target = tmp_path / "map.svg"
    given = ["live", "--from", str(tmp_path / "log.npz"), "--rate", "0", "--ros", "0"]
    result = CliRunner().invoke(cli, [*given, "--mapping", str(target)])
    assert result.exit_code == 0, result.output
    assert f"stopped: the map is made of {len(scans)} scans\n" in result.output
    assert "map.svg: LineMap(" in result.output
    live, whole = LineMap.read(target), tmp_path / "whole.svg"
    result = CliRunner().invoke(cli, ["map", str(tmp_path / "log.npz"), "-o", str(whole)])
    assert result.exit_code == 0, result.output
    # The same follower: the map of the log is the same.
    np.testing.assert_allclose(live.ends, LineMap.read(whole).ends, atol=1e-3)


@pytest.mark.slow
def test_the_process_beside_a_mapper_does_not_outlive_it():
    script = (
        "import os\n"
        "from lineament.mapping.mapper import Mapper\n"
        "if __name__ == '__main__':\n"
        "    print(Mapper()._process.pid, flush=True)\n"
        "    os._exit(0)\n"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    pid = int(done.stdout)

    def is_gone():
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        return Path(f"/proc/{pid}/stat").read_text().split()[2] == "Z"

    assert eventually(is_gone)
