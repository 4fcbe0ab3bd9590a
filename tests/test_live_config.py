import pytest

from lineament.errors import LineamentError
from lineament.live import LiveConfig, read_config
from lineament.live.config import resolved


@pytest.mark.parametrize(
    ("topic", "namespace", "name"),
    [
        ("scan", "", "/scan"),
        ("scan", "/", "/scan"),
        ("scan", "robot", "/robot/scan"),
        ("front/scan", "/fleet/robot/", "/fleet/robot/front/scan"),
        ("/scan", "robot", "/scan"),
    ],
)
def test_topics_are_named_as_ros_does(topic, namespace, name):
    assert resolved(topic, namespace) == name
    assert LiveConfig(topic=topic, namespace=namespace).scan_topic == name


def test_odometry_is_a_topic_in_the_namespace():
    config = LiveConfig(namespace="robot", deskew="odom")
    assert config.odometry_topic == "/robot/odom"
    assert LiveConfig(deskew="scans").odometry_topic is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"type": "Image"}, "type is 'Image', expected one of LaserScan, MultiEchoLaserScan"),
        ({"echo": "middle"}, "echo is 'middle', expected one of first, last, strongest"),
        ({"reliability": "sure"}, "reliability is 'sure', expected one of best-effort, reliable"),
        ({"ros": 3}, "ros is 3, expected one of 0, 1, 2"),
        ({"ros": 0}, "ros is 0, which leaves nothing to listen to; expected a log"),
        ({"topic": "a b"}, "topic is 'a b', expected a name of letters, digits, _ and /"),
        ({"topic": ""}, "topic is '', expected a name of letters, digits, _ and /"),
        ({"topic": "/a//b"}, "topic is '/a//b', expected a name of letters, digits, _ and /"),
        ({"topic": "/"}, "topic is '/', expected a name of letters, digits, _ and /"),
        ({"topic": "scan/"}, "topic is 'scan/', expected a name of letters, digits, _ and /"),
        ({"topic": 7}, "topic is 7, expected a text"),
        ({"name": "a/b"}, "name is 'a/b', expected no /: for that there is namespace"),
        ({"namespace": "r\n"}, "namespace is 'r\\n', expected a name of"),
        ({"deskew": "up!"}, "deskew is 'up!', expected a name of letters"),
        ({"deskew": "poses"}, "deskew is 'poses', which only a log has; expected a topic, or"),
        ({"deskew": "odom", "log": "a.bag"}, "deskew is 'odom', but a log is played; expected"),
        ({"noise": 10**400}, "noise is 10*, expected 0 to 1000"),
        ({"laser_pose": (10**400, 0, 0)}, "laser_pose is .*, expected three finite numbers"),
        ({"depth": 0}, "depth is 0, expected 1 to 1000"),
        ({"depth": True}, "depth is True, expected a whole number"),
        ({"depth": 2.5}, "depth is 2.5, expected a whole number"),
        ({"rate": -1.0}, "rate is -1.0, expected 0 to"),
        ({"rate": float("nan")}, "rate is nan, expected 0 to"),
        ({"noise": float("inf")}, "noise is inf, expected 0 to"),
        ({"domain": 233}, "domain is 233, expected 0 to 232"),
        ({"foxglove": 70_000}, "foxglove is 70000, expected 0 to 65535"),
        ({"laser_pose": (1.0, 2.0)}, r"laser_pose is \(1.0, 2.0\), expected three finite numbers"),
        ({"laser_pose": (1, 2, "x")}, "laser_pose is .*, expected three finite numbers"),
        ({"track": 1}, "track is 1, expected true or false"),
        ({"parameters": 3}, "parameters is 3, expected a table"),
    ],
)
def test_what_makes_no_sense_is_named(given, message):
    with pytest.raises(ValueError, match=message.replace("\\n", "\\\\n")):
        LiveConfig(**given)


def test_a_file_gives_parameters(tmp_path):
    path = tmp_path / "live.toml"
    path.write_text(
        'topic = "/front/scan"\nlaser_pose = [0.2, 0, 0.0]\nrate = 2\n[parameters]\nevidence = 9\n'
    )
    config = LiveConfig(**read_config(path))
    assert config.scan_topic == "/front/scan"
    assert config.laser_pose == (0.2, 0, 0.0)
    assert config.parameters == {"evidence": 9}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"topic = ", "is no TOML"),
        (b"\xff\xfe", "is no TOML"),
        (b"tropic = '/scan'", "has 'tropic', expected one of topic, namespace"),
    ],
)
def test_a_file_that_makes_no_sense_is_one_line(tmp_path, content, message):
    path = tmp_path / "live.toml"
    path.write_bytes(content)
    with pytest.raises(LineamentError, match=message) as caught:
        read_config(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_missing_is_named(tmp_path):
    with pytest.raises(LineamentError, match=r"none\.toml: cannot be read: No such file"):
        read_config(tmp_path / "none.toml")
