"""The rclpy node of ``ros/``, over as much of rclpy as it calls, by rclpy's documentation.

It shows that the node can be imported, configured, run and ended; what rclpy does it cannot show.
"""

import importlib
import re
import runpy
import signal
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock
from xml.etree import ElementTree

import pytest
from ruamel.yaml import YAML

import lineament as ln
from lineament import LineamentError
from lineament.live import LiveConfig, RosSink
from lineament.output.markers import markers_of
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Moment, layers_of

ROS = Path(__file__).parents[1] / "ros"
SCAN = ln.LaserScan([2.0, 2.0, 2.0], -0.01, 0.01, stamp=5.5, frame_id="laser")
MOMENT = Moment(5, 500_000_000, "laser", "map")
DATA = RosMessages("cdr").scan("/scan", MOMENT, SCAN).data
MODULES = "rclpy event_handler executors node qos signals"


class Node(MagicMock):
    """A node with parameters, whose publishers and subscriptions are kept by topic."""

    def __init__(self, *_: object, **given: object) -> None:
        super().__init__()
        assert given.get("automatically_declare_parameters_from_overrides", True)
        self.parameters: dict[str, object] = {}
        self.callbacks: dict[str, Callable] = {}
        self.published: dict[str, list[bytes]] = {}
        self.kinds: dict[str, str] = {}
        self.get_name.return_value = "scanner"
        self.get_namespace.return_value = "/"
        self.context.ok.return_value = True
        self.has_parameter.side_effect = lambda name: name in self.parameters
        self.get_parameter.side_effect = lambda name: SimpleNamespace(value=self.parameters[name])

    def _get_child_mock(self, **given: object) -> MagicMock:
        return MagicMock(**given)

    def declare_parameter(self, name: str, value: object) -> None:
        assert self.parameters.setdefault(name, value) is value

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, object]:
        start, found = f"{prefix}." if prefix else "", self.parameters.items()
        return {name.removeprefix(start): value for name, value in found if name.startswith(start)}

    def resolve_topic_name(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"/ns/{topic}"

    def get_publishers_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        return [SimpleNamespace(topic_type=self.kinds[topic])] if topic in self.kinds else []

    def create_subscription(
        self, kind: str, topic: str, callback: Callable, qos: object, *, raw: bool, **_: object
    ) -> MagicMock:
        assert raw
        assert qos
        self.kinds[topic], self.callbacks[topic] = kind, callback
        return MagicMock(get_publisher_count=lambda: 1)

    def create_publisher(self, kind: str, topic: str, qos: object) -> MagicMock:
        assert kind.count("/") == 2
        assert qos
        kept = self.published.setdefault(topic, [])
        return MagicMock(publish=kept.append, get_subscription_count=lambda: 1)


class Executor:
    """Does one of the things that wait: each is a call."""

    def __init__(self, *waiting: Callable[[], object]) -> None:
        self.waiting = list(waiting)
        self.add_node, self.shutdown = MagicMock(), MagicMock()

    def spin_once(self, timeout_sec: float) -> None:
        assert timeout_sec <= 0.1
        if self.waiting:
            self.waiting.pop(0)()


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """Modules of the package, over the stand-in."""
    monkeypatch.syspath_prepend(ROS)
    first, *below = MODULES.split()
    utilities = MagicMock(get_message=lambda kind: kind)
    for name in (first, *(f"{first}.{one}" for one in below), "rosidl_runtime_py"):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    monkeypatch.setitem(sys.modules, "rosidl_runtime_py.utilities", utilities)
    bridge = importlib.import_module("lineament_ros.bridge")
    node = importlib.import_module("lineament_ros.node")
    yield SimpleNamespace(bridge=bridge, node=node)
    for name in ("lineament_ros.node", "lineament_ros.bridge", "lineament_ros"):
        del sys.modules[name]


def test_manifest_has_the_version_and_what_is_imported():
    manifest = ElementTree.parse(ROS / "package.xml").getroot()
    assert manifest.findtext("version") == ln.__version__
    assert f'version="{ln.__version__}"' in (ROS / "setup.py").read_text(encoding="utf-8")
    needed = {depend.text for depend in manifest.iter("exec_depend")}
    kinds = ("sensor", "geometry", "visualization", "diagnostic", "nav")
    assert {f"{kind}_msgs" for kind in kinds} <= needed
    assert (ROS / "resource" / "lineament_ros").is_file()


#: Types that displays of RViz show.
DISPLAYS = {
    "LaserScan": "sensor_msgs/msg/LaserScan",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "PoseArray": "geometry_msgs/msg/PoseArray",
    "PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "Odometry": "nav_msgs/msg/Odometry",
}


def test_rviz_shows_what_is_published():
    opened: dict[str, str] = {}
    publisher = MagicMock(advertise=opened.__setitem__)
    RosSink(publisher, RosMessages("cdr"), LiveConfig(log="a.npz", dock=(1, 2)))
    text = (ROS / "rviz" / "lineament.rviz").read_text(encoding="utf-8")
    manager = YAML(typ="safe").load(text)["Visualization Manager"]
    shown = {
        display["Topic"]["Value"]: DISPLAYS[display["Class"].removeprefix("rviz_default_plugins/")]
        for display in manager["Displays"]
        if "Topic" in display
    }
    assert len(shown) == 5
    assert shown.items() <= opened.items()
    layers = [layer.name for layer in layers_of(markers_of(ln.extract(SCAN)))]
    (features,) = (d for d in manager["Displays"] if d["Name"] == "Features")
    assert sorted(features["Namespaces"]) == sorted(layers)


def test_launch_file_starts_the_node_and_rviz_on_its_topics(monkeypatch, package):
    def kept(name: str):
        return lambda *values, **options: SimpleNamespace(kind=name, values=values, **options)

    names = {
        "launch": "LaunchDescription",
        "launch.actions": "DeclareLaunchArgument",
        "launch.conditions": "IfCondition",
        "launch.substitutions": "LaunchConfiguration PathJoinSubstitution",
        "launch_ros": "",
        "launch_ros.actions": "Node",
        "launch_ros.parameter_descriptions": "ParameterValue",
        "launch_ros.substitutions": "FindPackageShare",
    }
    for module, classes in names.items():
        made = SimpleNamespace(**{name: kept(name) for name in classes.split()})
        monkeypatch.setitem(sys.modules, module, made)
    launch = runpy.run_path(str(ROS / "launch" / "lineament.launch.py"))
    (entities,) = launch["generate_launch_description"]().values
    *arguments, node, rviz = entities
    declared = {argument.values[0]: argument.default_value for argument in arguments}
    (parameters,) = node.parameters
    assert set(parameters) <= set(package.node.KNOWN)
    assert set(declared) == {*parameters, "rviz", "frame"}
    for name, value in parameters.items():
        default = getattr(LiveConfig(), name)
        assert value.value_type is type(default)
        assert declared[name] == str(default).lower()
    text = (ROS / "rviz" / "lineament.rviz").read_text(encoding="utf-8")
    topics = re.findall("Value: (/.*)", text)
    assert sorted(topic for topic, _ in rviz.remappings) == sorted(topics)
    for topic, (beginning, below) in rviz.remappings:
        assert (beginning.values, f"/scan{below}") == (("topic",), topic)
    setup = (ROS / "setup.py").read_text(encoding="utf-8")
    for folder in ("launch", "rviz"):
        for file in (ROS / folder).iterdir():
            assert f'(f"share/{{NAME}}/{folder}", ["{folder}/{file.name}"])' in setup


def test_parameters_that_were_not_given_are_declared(package):
    node = Node()
    assert package.node.config_of(node) == LiveConfig(name="scanner")
    assert "noise" not in node.parameters  # has no default that ROS could hold
    assert node.parameters["method"] == "optimal"


def test_parameters_are_those_of_live(package):
    node = Node()
    node.parameters |= {
        "use_sim_time": False,
        "topic": "/front/scan",
        "noise": 0.02,
        "deskew": False,  # what YAML makes of off
        "laser_pose": [0.1, 0.0, 0.5],
        "upside_down": True,
        "stamp": "last",
        "dock": [5.3, 1.8],
        "parameters.evidence": 12,
    }
    config = package.node.config_of(node)
    assert (config.topic, config.noise, config.deskew) == ("/front/scan", 0.02, "off")
    assert (config.laser_pose, config.dock) == ((0.1, 0.0, 0.5), (5.3, 1.8))
    assert (config.upside_down, config.stamp) == (True, "last")
    assert config.parameters == {"evidence": 12}
    node.parameters["methd"] = "liu"
    with pytest.raises(LineamentError, match="parameter methd is not known, expected one of topic"):
        package.node.config_of(node)


def test_source_takes_bytes_and_knows_publishers(package):
    node, executor = Node(), Executor()
    source = package.bridge.RclpySource(node, executor, LiveConfig(deskew="/odom"))
    assert (source.publishers, source.lost, source.ended, source.problems()) == (1, 0, False, [])
    assert source.receive(0.1) == []
    identity = {"publisher_gid": {"data": b"\x01\x02"}}
    executor.waiting = [
        lambda: node.callbacks["/scan"](DATA, {}),
        lambda: node.callbacks["/odom"](b"", {}),
        lambda: node.callbacks["/scan"](DATA[:9], identity),
    ]
    first, odometry, broken = source.receive(0.1)
    assert first.read().ranges.tolist() == [2.0, 2.0, 2.0]
    assert first.read().stamp_ns == 5_500_000_000
    assert odometry.what == "an odometry"
    assert (first.publisher, broken.publisher) == ("the publisher", "0102")
    with pytest.raises(ValueError, match="ends early"):
        broken.read()
    node.kinds["/odom"] = "geometry_msgs/msg/Twist"
    problem = "/odom is published as geometry_msgs/msg/Twist, expected nav_msgs/msg/Odometry"
    assert source.problems() == [problem]
    source.close()
    assert node.destroy_subscription.call_count == 2


def test_publisher_hands_bytes_on(package):
    node = Node()
    publisher = package.bridge.RclpyPublisher(node)
    assert publisher.listeners("/scan") == 0
    message = RosMessages("cdr").scan("/scan", MOMENT, SCAN)
    publisher.publish(message)
    assert publisher.listeners("/scan") == 1
    assert node.published["/scan"] == [message.data]
    publisher.close()
    node.destroy_publisher.assert_called_once()


def test_node_runs_until_it_is_interrupted(package, monkeypatch):
    node, handlers = Node(), {}

    def scan_and_end() -> None:
        node.callbacks["/ns/scan"](DATA, {})
        handlers[signal.SIGTERM](signal.SIGTERM, None)

    package.node.rclpy.create_node.return_value = node
    monkeypatch.setattr(package.node, "SingleThreadedExecutor", lambda: Executor(scan_and_end))
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    assert package.node.main() == 0
    assert len(node.published["/ns/scan/features"]) == 1
    (report,) = node.published["/diagnostics"]
    assert struct.unpack_from("<I", report)[0] == 0x0100
    assert b"scanner: /ns/scan" in report
    node.destroy_node.assert_called_once()
    package.node.rclpy.try_shutdown.assert_called_once()


def test_what_is_wrong_is_one_line(package, monkeypatch, capsys):
    node = package.node.rclpy.create_node.return_value = Node()
    node.parameters["method"] = "nonsense"
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    assert package.node.main() == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("lineament: method 'nonsense' is unknown")
