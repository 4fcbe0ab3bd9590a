"""The rclpy node of ``ros/``, over as much of rclpy as it calls, by rclpy's documentation.

It shows that the node can be imported, configured, run and ended; what rclpy does it cannot show.
"""

import importlib
import re
import runpy
import signal
import struct
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock
from xml.etree import ElementTree

import pytest
from ruamel.yaml import YAML

import lineament as ln
from lineament.live import LiveConfig, RosSink
from lineament.live.received import LINKS, MOUNTINGS, RELOCATE
from lineament.output.markers import markers_of
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Moment, layers_of
from lineament.rosmsg.poses import StampedPose
from lineament.simulation import SENSORS, Wheels, office

ROS = Path(__file__).parents[1] / "ros"
SCAN = ln.LaserScan([2.0, 2.0, 2.0], -0.01, 0.01, stamp=5.5, frame_id="laser")
MOMENT = Moment(5, 500_000_000, "laser", "map")
DATA = RosMessages("cdr").scan("/scan", MOMENT, SCAN).data
MODULES = "rclpy event_handler executors node lifecycle qos signals"
DONE = SimpleNamespace(SUCCESS="success", FAILURE="failure")
STATIC = SimpleNamespace(description="", dynamic_typing=False)


class Node(MagicMock):
    """A node with parameters, whose publishers and subscriptions are kept by topic."""

    overrides: Mapping[str, object] = {}

    def __init__(self, *_: object, **given: object) -> None:
        super().__init__()
        assert given.get("automatically_declare_parameters_from_overrides", True)
        assert given.get("allow_undeclared_parameters", True)
        self.parameters: dict[str, object] = dict(self.overrides)
        # As rclpy declares what is given at the start: of one type for good.
        self.descriptors: dict[str, object] = dict.fromkeys(self.overrides, STATIC)
        self.services: dict[str, Callable] = {}
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

    def declare_parameter(self, name: str, value: object, about: object = None) -> None:
        assert value != ()
        assert self.parameters.setdefault(name, value) is value
        self.descriptors[name] = about or STATIC

    def set_descriptor(self, name: str, about: object) -> None:
        assert name in self.parameters
        self.descriptors[name] = about

    def create_service(self, kind: object, name: str, callback: Callable) -> str:
        assert kind is std_srvs_srv.Empty
        self.services[name] = callback
        return name

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


class LifecycleNode(Node):
    """Goes from state to state as it is asked to."""

    def on_configure(self, _: object) -> str:
        return DONE.SUCCESS

    on_activate = on_deactivate = on_cleanup = on_shutdown = on_configure

    def trigger_configure(self) -> str:
        return self.on_configure(None)

    def trigger_activate(self) -> str:
        return self.on_activate(None)


std_srvs_srv = MagicMock()


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
    names = first, *(f"{first}.{one}" for one in below), "rosidl_runtime_py", "std_srvs"
    for name in (*names, "rcl_interfaces", "rcl_interfaces.msg"):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    sys.modules["rclpy.node"].Node = Node
    sys.modules["rclpy.lifecycle"].LifecycleNode = LifecycleNode
    sys.modules["rclpy.lifecycle"].TransitionCallbackReturn = DONE
    sys.modules["rcl_interfaces.msg"].SetParametersResult = SimpleNamespace
    sys.modules["rcl_interfaces.msg"].ParameterDescriptor = SimpleNamespace
    monkeypatch.setitem(sys.modules, "std_srvs.srv", std_srvs_srv)
    monkeypatch.setitem(sys.modules, "rosidl_runtime_py.utilities", utilities)
    bridge = importlib.import_module("lineament_ros.bridge")
    node = importlib.import_module("lineament_ros.node")
    parameters = importlib.import_module("lineament_ros.parameters")
    yield SimpleNamespace(bridge=bridge, node=node, parameters=parameters)
    for name in [name for name in sys.modules if name.startswith("lineament_ros")]:
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
        "launch.actions": "DeclareLaunchArgument OpaqueFunction",
        "launch.conditions": "IfCondition",
        "launch.substitutions": "LaunchConfiguration PathJoinSubstitution",
        "launch_ros": "",
        "launch_ros.actions": "LifecycleNode Node",
        "launch_ros.substitutions": "FindPackageShare",
    }
    for module, classes in names.items():
        made = SimpleNamespace(**{name: kept(name) for name in classes.split()})
        monkeypatch.setitem(sys.modules, module, made)
    launch = runpy.run_path(str(ROS / "launch" / "lineament.launch.py"))
    (entities,) = launch["generate_launch_description"]().values
    *arguments, opaque, rviz = entities
    declared = {argument.values[0]: argument.default_value for argument in arguments}
    assert set(declared) == {*package.parameters.FIELDS, *launch["OTHERS"]}

    def started(**given: str) -> list[object]:
        (node,) = opaque.function(SimpleNamespace(launch_configurations=declared | given))
        assert (node.kind, node.executable) == ("LifecycleNode", "lineament")
        return node.parameters

    assert started() == [{"autostart": True}]
    *files, parameters = started(
        topic="/front/scan", deskew="off", laser_pose="[0.1, 0, 0.5]", dock="[1, 2]", noise="0.02",
        track="true", params_file="of.yaml", autostart="False",
    )  # fmt: skip
    assert files == ["of.yaml"]
    assert parameters.pop("autostart") is False
    assert package.parameters.config_of(parameters) == LiveConfig(
        topic="/front/scan", laser_pose=(0.1, 0, 0.5), dock=(1, 2), noise=0.02, track=True
    )
    text = (ROS / "rviz" / "lineament.rviz").read_text(encoding="utf-8")
    topics = re.findall("Value: (/.*)", text)
    assert sorted(topic for topic, _ in rviz.remappings) == sorted(topics)
    for topic, (beginning, below) in rviz.remappings:
        assert (beginning.values, f"/scan{below}") == (("topic",), topic)
    setup = (ROS / "setup.py").read_text(encoding="utf-8")
    for folder in ("launch", "rviz"):
        for file in (ROS / folder).iterdir():
            assert f'(f"share/{{NAME}}/{folder}", ["{folder}/{file.name}"])' in setup


def test_each_option_of_the_node_is_a_parameter_or_of_ros_itself(package):
    """A new option is a parameter unless somebody says that it is not."""
    others = {"name", "namespace", "domain", "localhost", "ros", "mountings", "foxglove", "host"}
    of_logs = {"log", "log_topic", "poses", "ring", "keep_going", "rate", "loop"}
    every = {field.name for field in fields(LiveConfig)}
    assert every == {*package.parameters.FIELDS, *package.parameters.TABLES} | others | of_logs
    assert all(package.parameters.DESCRIPTIONS[name] for name in package.parameters.FIELDS)
    readme = (ROS / "README.md").read_text(encoding="utf-8")
    for name in (*package.parameters.FIELDS, "autostart"):
        assert f"`{name}`" in readme


def test_parameters_that_were_not_given_are_declared(package):
    node = package.node.Scanner()
    assert node._asked() == LiveConfig(name="scanner")
    assert node.parameters["noise"] is None  # has no default that ROS could hold
    assert node.parameters["method"] == "optimal"
    assert node.parameters["track"] is False


def test_parameters_are_those_of_live(package):
    given = {
        "topic": "/front/scan",
        "noise": 0.02,
        "deskew": False,  # what YAML makes of off
        "laser_pose": [0.1, 0.0, 0.5],
        "upside_down": True,
        "stamp": "last",
        "dock": [5.3, 1.8],
        "mask": [1.0, 1.2, -0.1, 0.1],
        "merge": ["/rear/scan"],
        "map": None,
        "parameters.evidence": 12,
        "limits.beams": 5000,
    }
    config = package.parameters.config_of(given | {"laser_pose": None, "upside_down": None})
    assert (config.topic, config.noise, config.deskew) == ("/front/scan", 0.02, "off")
    assert (config.dock, config.stamp, config.merge) == ((5.3, 1.8), "last", ("/rear/scan",))
    assert config.mask == ((1.0, 1.2), (-0.1, 0.1))
    assert (config.parameters, config.limits) == ({"evidence": 12}, {"beams": 5000})
    config = package.parameters.config_of(given | {"merge": None})
    assert (config.laser_pose, config.upside_down) == ((0.1, 0.0, 0.5), True)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"methd": "liu"}, "parameter methd is not known, expected one of topic, merge"),
        ({"parameters": 1}, "parameter parameters is not known"),
        ({"mask": [1.0, 2.0, 3.0]}, r"mask is \(1.0, 2.0, 3.0\), expected pairs of bearings"),
        ({"noise": "much"}, "noise is 'much', expected a number"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_named(package, given, problem):
    with pytest.raises(ValueError, match=problem):
        package.parameters.config_of(given)


def changed(node, **values: object) -> str:
    """Set parameters as a service of ROS does; returns why they were refused, "" if not."""
    named = {name.replace("__", "."): value for name, value in values.items()}
    told = node.on_set([SimpleNamespace(name=name, value=v) for name, v in named.items()])
    if told.successful:
        node.parameters |= named
        return ""
    return told.reason


def test_parameters_change_while_the_node_runs(package):
    node = package.node.Scanner()
    assert changed(node, topic="/front/scan", parameters__evidence=20.0) == ""
    assert "not known" in changed(node, methd="liu")
    assert node.trigger_configure() == DONE.SUCCESS
    assert len(node._pipeline("", SCAN).features.segments) == 0
    assert "has no parameter 'evidence'" in changed(node, method="liu")
    assert changed(node, parameters__evidence=1.0) == ""
    pipeline = node._pipeline
    assert pipeline("", SCAN).scan is SCAN
    assert changed(node, noise=0.02, scale=2.0) == ""
    assert pipeline("", SCAN).scan.ranges.tolist() == [4.0, 4.0, 4.0]
    assert node._pipeline is pipeline  # whose tracks and place on the plan stay
    assert changed(node, topic="/rear/scan").startswith("topic is read at the start, expected a ch")
    node.on_cleanup(None)
    assert changed(node, topic="/rear/scan") == ""


def test_what_was_given_at_the_start_may_get_another_type_and_is_described(package, monkeypatch):
    monkeypatch.setattr(Node, "overrides", {"scale": 1, "parameters.evidence": 12})
    node = package.node.Scanner()
    assert node._asked() == LiveConfig(name="scanner", scale=1, parameters={"evidence": 12})
    for name in package.parameters.FIELDS:
        about = node.descriptors[name]
        assert about.dynamic_typing
        assert about.description == package.parameters.DESCRIPTIONS[name]


def test_a_manager_leads_the_node_from_state_to_state(package, monkeypatch):
    node, steps = package.node.Scanner(), []
    node.parameters["autostart"] = False

    def scan() -> None:
        node.callbacks["/ns/scan"](DATA, {})

    waiting = [
        lambda: steps.append(dict(node.callbacks)),
        node.trigger_configure,
        lambda: steps.append(node._pipeline is not None),
        node.trigger_activate,
        scan,
        lambda: node.on_deactivate(None),
        lambda: steps.append(node.destroy_subscription.call_count),
        node.trigger_activate,
        lambda: node.on_shutdown(None),
        lambda: stopped.append(True),
    ]
    stopped: list[bool] = []
    monkeypatch.setattr(package.node, "SingleThreadedExecutor", lambda: Executor(*waiting))
    node.spin(lambda: bool(stopped))
    assert steps == [{}, True, 1]
    assert len(node.published["/ns/scan/features"]) == 1


def test_a_service_has_the_robot_looked_for(package):
    node = Node()
    executor = Executor(lambda: node.services["reinitialize_global_localization"](None, None))
    config = LiveConfig(map="plan.dxf")
    source = package.bridge.RclpySource(node, executor, config)
    (call,) = source.receive(0.1)
    assert (call.what, call.read()) == (RELOCATE, None)
    source.close()
    node.destroy_service.assert_called_once()


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
    node, handlers = package.node.Scanner(), {}

    def scan_and_end() -> None:
        node.callbacks["/ns/scan"](DATA, {})
        handlers[signal.SIGTERM](signal.SIGTERM, None)

    monkeypatch.setattr(package.node, "Scanner", lambda: node)
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
    monkeypatch.setattr(Node, "overrides", {"method": "nonsense"})
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    assert package.node.main() == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("lineament: method 'nonsense' is unknown")


def test_a_map_is_written_when_the_node_is_cleaned_up(package, tmp_path):
    node = package.node.Scanner()
    path = tmp_path / "made.svg"
    assert changed(node, mapping=str(path)) == ""
    assert node.trigger_configure() == DONE.SUCCESS
    storey = office(1, (30, 20))
    scans, _ = storey.drive(SENSORS["lms181"], seed=1, speed=0.7, rate=2.0, wheels=Wheels())
    for scan in islice(scans, 12):
        node._pipeline.hear([StampedPose(scan.stamp, "odom", "base_link", scan.pose)], LINKS)
        mounted = StampedPose(0.0, "base_link", "laser", (0.0, 0.0, 0.0))
        node._pipeline.hear([mounted], MOUNTINGS)
        node._pipeline("scanner", scan.with_pose(None))
    node.on_cleanup(None)
    (line,) = node.get_logger().info.call_args.args
    assert line.startswith(f"{path}: LineMap(")
    assert path.read_text().startswith("<svg")
