"""`view` of a log of several scanners: one after the other, or over each other and merged."""

import json
import math

import numpy as np
import pytest
import ros_bags
from test_merge_command import MOUNTINGS, made
from test_view import asked, read, served

from lineament import Extractor
from lineament.logs import open_log
from lineament.mapping import LineMap, merge_features
from lineament.motion.rig import Rig
from lineament.scan.poses import compose
from lineament.simulation import room
from lineament.view import Session

FRONT, REAR = MOUNTINGS
METHOD = {"optimal": Extractor()}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return made(tmp_path_factory.mktemp("log"))


@pytest.fixture
def session(log):
    with read(log, METHOD, pose_topic="/odom") as session:
        yield session


def test_topics_are_offered_that_can_be_overlaid(session):
    with served(session) as server:
        named = [{"name": name, "alone": ""} for name in MOUNTINGS]
        assert asked(server, "/api/topics?log=0") == (200, {"topics": named, "chosen": [0, 1]})
        scans = [asked(server, f"/api/log?log=0&topics={k}")[1]["scans"] for k in ("0", "1", "1,0")]
    counts = [len(open_log(session._paths[0], name)) for name in MOUNTINGS]
    assert scans == [*counts, counts[1]]


def test_one_topic_is_as_with_the_option(session, log):
    for number, name in enumerate(MOUNTINGS):
        found = session.scan(0, 7, "optimal", (number,))
        scan = open_log(log, name, pose_topic="/odom").scan(7)
        assert found["topic"] == name
        np.testing.assert_allclose(found["pose"], scan.pose)
        features = Extractor()(scan).to_dict()
        assert found["segments"] == features["segments"]
        assert session.stamps(0, 7, 1, (number,))["stamps"] == [scan.stamp]


def test_several_are_merged_as_the_command_does_in_the_frame_of_the_robot(session, log):
    found = session.scan(0, 20, "optimal", (0, 1))
    first, second = found["parts"]
    assert [first["topic"], second["topic"], found["missing"]] == [FRONT, REAR, []]
    assert first["index"] == 20
    scans = [
        open_log(log, of["topic"], pose_topic="/odom").scan(of["index"]) for of in (first, second)
    ]
    assert abs(scans[1].stamp - scans[0].stamp) <= 0.055
    # Each has its own features; where its scanner is differs by the way between the two scans.
    for part, scan in zip((first, second), scans, strict=True):
        assert part["corners"] == Extractor()(scan).to_dict()["corners"]
        apart = math.dist(part["place"][:2], MOUNTINGS[part["topic"]][:2])
        assert apart < (1e-9 if part is first else 0.05)
    assert math.dist(second["place"][:2], MOUNTINGS[REAR][:2]) > 0.02
    parts = [Extractor()(scan) for scan in scans]
    merged = merge_features(parts, [first["place"], second["place"]], Rig((FRONT, REAR)).covariance)
    assert found["segments"] == merged.to_dict()["segments"]
    alone = [len(part["segments"]) for part in (first, second)]
    assert max(alone) <= len(found["segments"]) < sum(alone)
    # In the world the corners of the room are there.
    c, s = math.cos(found["pose"][2]), math.sin(found["pose"][2])
    for corner in found["corners"]:
        x, y = corner["position"]
        at = np.array([c * x - s * y, s * x + c * y]) + found["pose"][:2]
        assert np.linalg.norm(room().segments[:, :2] - at, axis=1).min() < 0.05


def test_each_beam_of_all_is_one_of_a_scanner(session):
    found = session.scan(0, 3, "optimal", (0, 1))
    whole = np.array(found["ranges"], float) * np.exp(1j * np.array(found["angles"]))
    for part in found["parts"]:
        numbers, (x, y, theta) = np.array(part["numbers"]), part["place"]
        valid = numbers >= 0
        assert valid.sum() > 500
        angles = part["angle_min"] + part["angle_increment"] * np.arange(part["beams"]) + theta
        points = x + 1j * y + np.array(part["ranges"], float) * np.exp(1j * angles)
        np.testing.assert_allclose(points[valid], whole[numbers[valid]], atol=1e-6)
    answer = session.trace(0, found["parts"][1]["index"], "optimal", 100, (1,))
    assert answer["beam"] == 100


def test_the_path_is_that_of_the_robot(session):
    poses = session.poses(0, 0, 50, (0, 1))["poses"]
    alone = session.poses(0, 0, 50, (0,))["poses"]
    for robot, scanner in zip(poses[1:], alone[1:], strict=True):
        np.testing.assert_allclose(compose(tuple(robot), MOUNTINGS[FRONT]), scanner, atol=1e-9)


def test_mountings_are_given_where_the_log_does_not_say(tmp_path):
    path = made(tmp_path, frames=False)
    with read(path, METHOD) as session:
        offered, expected = session.topics(0), "/tf_static, or --mounting /rear=X,Y,DEGREES"
        assert offered["chosen"] == [0]
        assert f"expected {expected}" in offered["topics"][1]["alone"]
        with served(session) as server:
            status, found = asked(server, "/api/scan?log=0&i=0&method=optimal&topics=0,1")
        assert status == 404
        assert found["error"].startswith("where the scanner of /front is on the robot is not known")
    with read(path, METHOD, mountings=MOUNTINGS) as session:
        assert session.topics(0)["chosen"] == [0, 1]
        places = [part["place"] for part in session.scan(0, 0, "optimal", (0, 1))["parts"]]
        np.testing.assert_allclose(places, list(MOUNTINGS.values()))


def test_a_scanner_without_a_scan_at_that_time_is_left_out(tmp_path):
    with read(made(tmp_path, missing=range(21, 60, 2)), METHOD) as session:
        found = session.scan(0, 20, "optimal", (0, 1))
    assert ([part["topic"] for part in found["parts"]], found["missing"]) == ([FRONT], [REAR])


def test_an_upside_down_scanner_is_turned_over(tmp_path):
    messages = ros_bags.Messages(2)
    links = [
        messages.transform(0.0, "base_link", "front", 0.0, 0.0, 0.0),
        messages.new(
            "geometry_msgs/TransformStamped", messages.header(0.0, "base_link"), "rear",
            ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        ),
    ]  # fmt: skip
    items = [("/tf_static", 0, messages.transforms(*links))]
    for k, name in enumerate(("front", "rear", "front", "rear")):
        scan = messages.scan(
            0.05 * k, [1.0, 2.0, 3.0], frame=name, angle_min=0.1, angle_increment=0.2
        )
        items.append((f"/{name}", int(5e7 * k), scan))
    with read(ros_bags.write(tmp_path, "mcap", items), METHOD) as session:
        front, rear = (session.scan(0, 0, "optimal", (k,)) for k in (0, 1))
    assert front["ranges"] == [1.0, 2.0, 3.0]
    assert rear["ranges"] == [3.0, 2.0, 1.0]
    assert rear["angle_min"] == pytest.approx(-0.5)


def test_on_a_plan_one_scanner_is_shown(log):
    plan = LineMap.from_lines(room().segments)
    with Session(log, METHOD, plan, pose_topic="/odom") as session:
        offered = session.topics(0)
        assert offered["chosen"] == [0]
        assert all("on a plan" in topic["alone"] for topic in offered["topics"])
        assert session.wait(60)
        assert session.scan(0, 30, "optimal", (0,))["where"]["verdict"] == "located"
        with pytest.raises(ValueError, match="on a plan, one scanner at a time"):
            session.scan(0, 30, "optimal", (0, 1))


@pytest.mark.parametrize(
    ("topics", "status", "words"),
    [
        ("0,x", 400, "topics is '0,x', expected whole numbers, as in 0,2"),
        ("", 400, "topics is ''"),
        ("1,1", 400, "topics is '1,1', expected each of them once"),
        ("2", 404, "topic 2 is not there, expected 0 to 1"),
        ("0,7", 404, "topic 7 is not there"),
    ],
)
def test_topics_that_are_not_there(session, topics, status, words):
    with served(session) as server:
        found, answer = asked(server, f"/api/scan?log=0&i=0&method=optimal&topics={topics}")
    assert found == status
    assert words in answer["error"]
    assert json.dumps(answer).count("\\n") == 0


def test_a_mounting_of_no_topic_is_one_line(log, refused):
    line = refused(["view", str(log), "--mounting", "/left=0,0,0", "--no-browser"], 2)
    assert "the mounting is of /left, expected one of /front, /rear" in line
