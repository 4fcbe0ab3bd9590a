"""The rclpy node of ``ros/``, as far as it goes without rclpy: see ``rclpy_stand_in``."""

from __future__ import annotations

import importlib
import signal
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from rclpy_stand_in import Executor, Node, modules

import lineament as ln
from lineament import LineamentError
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Moment

ROS = Path(__file__).parents[1] / "ros"
SCAN = ln.LaserScan([2.0, 2.0, 2.0], -0.01, 0.01, stamp=5.5, frame_id="laser")
MOMENT = Moment(5, 500_000_000, "laser", "map")


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """Modules of the package, over the stand-in."""
    monkeypatch.syspath_prepend(ROS)
    for name, module in modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    bridge = importlib.import_module("lineament_ros.bridge")
    node = importlib.import_module("lineament_ros.node")
    yield SimpleNamespace(bridge=bridge, node=node)
    for name in ("lineament_ros.node", "lineament_ros.bridge", "lineament_ros"):
        del sys.modules[name]


@pytest.fixture
def ros_node() -> Node:
    return Node("scanner", automatically_declare_parameters_from_overrides=True)


def test_manifest_has_the_version_and_what_is_imported():
    manifest = ElementTree.parse(ROS / "package.xml").getroot()
    assert manifest.findtext("version") == ln.__version__
    assert f'version="{ln.__version__}"' in (ROS / "setup.py").read_text(encoding="utf-8")
    needed = {depend.text for depend in manifest.iter("exec_depend")}
    make = RosMessages("cdr")
    features = ln.extract(SCAN)
    kinds = [
        make.features("/m", MOMENT, ()).kind,
        make.corners("/c", MOMENT, features).kind,
        make.cloud("/f", MOMENT, features).kind,
        make.diagnostics("/d", MOMENT, "node", "laser", 0, "well", {}).kind,
    ]
    assert {kind.partition("/")[0] for kind in kinds} <= needed
    assert (ROS / "resource" / "lineament_ros").is_file()


def test_parameters_that_were_not_given_are_declared(package, ros_node):
    config = package.node.config_of(ros_node)
    assert config == ln.live.LiveConfig(name="scanner")
    assert "noise" not in ros_node.parameters  # has no default that ROS could hold
    assert ros_node.parameters["method"] == "optimal"


def test_parameters_are_those_of_live(package, ros_node):
    ros_node.parameters |= {
        "use_sim_time": False,
        "topic": "/front/scan",
        "noise": 0.02,
        "deskew": False,  # what YAML makes of off
        "laser_pose": [0.1, 0.0, 0.5],
        "parameters.evidence": 12,
    }
    config = package.node.config_of(ros_node)
    assert (config.topic, config.noise, config.deskew) == ("/front/scan", 0.02, "off")
    assert config.laser_pose == (0.1, 0.0, 0.5)
    assert config.parameters == {"evidence": 12}


def test_parameter_that_is_not_known(package, ros_node):
    ros_node.parameters["methd"] = "liu"
    with pytest.raises(LineamentError, match="parameter methd is not known, expected one of topic"):
        package.node.config_of(ros_node)


def test_source_takes_bytes_and_knows_publishers(package, ros_node):
    executor = Executor()
    executor.add_node(ros_node)
    config = ln.live.LiveConfig(deskew="/odom")
    source = package.bridge.RclpySource(ros_node, executor, config)
    assert (source.publishers, source.lost, source.ended, source.problems()) == (1, 0, False, [])
    assert source.receive(0.1) == []
    data = RosMessages("cdr").scan("/scan", MOMENT, SCAN).data
    executor.put("/scan", data)
    executor.put("/odom", b"")
    executor.put("/scan", data[:9], {"publisher_gid": {"data": b"\x01\x02"}})
    first, odometry, broken = source.receive(0.1)
    assert first.read().ranges.tolist() == [2.0, 2.0, 2.0]
    assert first.time == (5, 500_000_000)
    assert odometry.is_odometry
    assert broken.publisher == "0102"
    with pytest.raises(ValueError, match="ends early"):
        broken.read()
    ros_node.types["/odom"] = "geometry_msgs/msg/Twist"
    assert source.problems() == [
        "/odom is published as geometry_msgs/msg/Twist, expected nav_msgs/msg/Odometry"
    ]
    source.close()
    assert not ros_node.subscriptions


def test_publisher_hands_bytes_on(package, ros_node):
    publisher = package.bridge.RclpyPublisher(ros_node)
    message = RosMessages("cdr").scan("/scan", MOMENT, SCAN)
    assert publisher.listeners("/scan") == 0
    publisher.publish(message)
    assert publisher.listeners("/scan") == 1
    assert ros_node.publishers["/scan"].published == [message.data]
    publisher.close()


def test_node_runs_until_it_is_interrupted(package, monkeypatch):
    executor = Executor()
    monkeypatch.setattr(package.node, "SingleThreadedExecutor", lambda: executor)
    monkeypatch.setattr(
        signal, "signal", lambda number, handler: handlers.update({number: handler})
    )
    handlers: dict = {}
    data = RosMessages("cdr").scan("/scan", MOMENT, SCAN).data

    def scan_and_end() -> None:
        executor.node.subscriptions["/scan"].callback(data, {})
        handlers[signal.SIGTERM](signal.SIGTERM, None)

    executor.waiting = [scan_and_end]
    assert package.node.main() == 0
    (report,) = executor.node.publishers["/diagnostics"].published
    assert struct.unpack_from("<I", report)[0] == 0x0100
    assert b"lineament: /scan" in report


def test_what_is_wrong_is_one_line(package, monkeypatch, capsys):
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(Node, "overrides", {"method": "nonsense"})
    assert package.node.main() == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("lineament: ")
    assert "nonsense" in line
