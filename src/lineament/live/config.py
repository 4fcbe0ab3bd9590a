"""What a live node is told: by flags, by a TOML file, by both."""

from __future__ import annotations

import os
import re
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import LineamentError
from ..scan import Pose

__all__ = ["LiveConfig", "read_config", "resolved"]

_ECHOES = ("first", "last", "strongest")
_TYPES = ("LaserScan", "MultiEchoLaserScan")
_RELIABILITIES = ("best-effort", "reliable")


@dataclass(frozen=True, slots=True)
class LiveConfig:
    """Where a node listens, what it does with a scan, and where it tells what it found.

    Parameters
    ----------
    topic : str
        Topic of the scans. What is found goes to topics below it: ``TOPIC/features`` and others.
    namespace : str
        Put before topics that do not begin with ``/``.
    name : str
        Name of the node.
    type : str
        ``LaserScan`` or ``MultiEchoLaserScan``, of ``sensor_msgs``.
    echo : str
        Which echo of the latter: ``first``, ``last`` or ``strongest``.
    ros : int
        2, or 1 for ROS 1 (rospy); 0 for none, where a log is played for Foxglove alone.
    domain : int, optional
        Domain of DDS; by default that of the environment's ``ROS_DOMAIN_ID``, or 0.
    localhost : bool
        Whether DDS stays on this machine.
    reliability : str
        Of the subscription: ``best-effort``, which any publisher matches, or ``reliable``.
    depth : int
        How many messages of a topic are kept for a reader that is behind.
    method : str
        Name of the method.
    parameters : dict
        Parameters of the method that differ from its defaults.
    noise : float, optional
        Noise of the ranges [m]; estimated from each scan by default.
    deskew : str
        Where the motion of the sensor is known from: ``off``, ``scans`` (their own features),
        ``poses`` (of a log that is played), or a topic of ``nav_msgs/Odometry``.
    laser_pose : (x, y, theta)
        Pose of the scanner in the frame whose twist the odometry tells [m, m, rad].
    track : bool
        Whether features are recognised from scan to scan.
    log : str, optional
        A log that is played in place of a topic.
    log_topic : str, optional
        Which scans of the log, where it has several kinds.
    poses : str, optional
        Which topic of the log gives the poses.
    ring : int, optional
        Which ring of a point cloud of the log is the scan.
    keep_going : bool
        Whether to leave out what is faulty in the log.
    rate : float
        How many times faster than it was recorded; 0 for as fast as scans are worked at.
    loop : bool
        Whether the log begins anew at its end.
    foxglove : int, optional
        Port on which Foxglove is served by WebSocket.
    host : str
        Address on which it is served.

    Raises
    ------
    ValueError
        If a value is none of these. The message names the parameter.

    Examples
    --------
    >>> config = LiveConfig(topic="scan", namespace="robot1", method="liu")
    >>> config.scan_topic
    '/robot1/scan'
    """

    topic: str = "scan"
    namespace: str = ""
    name: str = "lineament"
    type: str = "LaserScan"
    echo: str = "first"
    ros: int = 2
    domain: int | None = None
    localhost: bool = False
    reliability: str = "best-effort"
    depth: int = 10
    method: str = "optimal"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    noise: float | None = None
    deskew: str = "off"
    laser_pose: Pose = (0.0, 0.0, 0.0)
    track: bool = False
    log: str | None = None
    log_topic: str | None = None
    poses: str | None = None
    ring: int | None = None
    keep_going: bool = False
    rate: float = 1.0
    loop: bool = False
    foxglove: int | None = None
    host: str = "127.0.0.1"

    def __post_init__(self) -> None:
        for known in fields(self):
            _check_type(known.name, known.type, getattr(self, known.name))
        _check_choice("type", self.type, _TYPES)
        _check_choice("echo", self.echo, _ECHOES)
        _check_choice("reliability", self.reliability, _RELIABILITIES)
        _check_choice("ros", self.ros, (0, 1, 2))
        _check_name("topic", self.topic)
        _check_name("namespace", self.namespace.strip("/") or "none")
        _check_name("name", self.name)
        if "/" in self.name:
            raise ValueError(f"name is {self.name!r}, expected no /: for that there is namespace")
        if self.deskew not in ("off", "scans", "poses"):
            _check_name("deskew", self.deskew)
        _check_between("depth", self.depth, 1, 1000)
        _check_between("rate", self.rate, 0, 1e6)
        if self.noise is not None:
            _check_between("noise", self.noise, 0, 1000)
        if self.domain is not None:
            _check_between("domain", self.domain, 0, 232)
        if self.foxglove is not None:
            _check_between("foxglove", self.foxglove, 0, 65535)
        if len(self.laser_pose) != 3 or not all(map(_is_finite, self.laser_pose)):
            raise ValueError(f"laser_pose is {self.laser_pose}, expected three finite numbers")
        self._check_log()

    def _check_log(self) -> None:
        if self.log is None and self.deskew == "poses":
            raise ValueError("deskew is 'poses', which only a log has; expected a topic, or scans")
        if self.log is not None and self.odometry_topic is not None:
            raise ValueError(
                f"deskew is {self.deskew!r}, but a log is played; expected poses or scans"
            )
        if self.log is None and self.ros == 0:
            raise ValueError("ros is 0, which leaves nothing to listen to; expected a log")

    @property
    def scan_topic(self) -> str:
        """Full name of the topic of the scans."""
        return resolved(self.topic, self.namespace)

    @property
    def odometry_topic(self) -> str | None:
        """Full name of the topic of the odometry, where there is one."""
        if self.deskew in ("off", "scans", "poses"):
            return None
        return resolved(self.deskew, self.namespace)


def resolved(topic: str, namespace: str) -> str:
    """Full name of a topic, by the rules of ROS: what begins with ``/`` is one already.

    Examples
    --------
    >>> resolved("scan", "robot1"), resolved("/scan", "robot1"), resolved("scan", "")
    ('/robot1/scan', '/scan', '/scan')
    """
    if topic.startswith("/"):
        return topic
    parts = [part for part in namespace.split("/") if part]
    return "/" + "/".join([*parts, topic])


def read_config(path: str | os.PathLike[str]) -> dict[str, Any]:
    r"""Read the parameters of a `LiveConfig` from a TOML file; the table is flat, but `parameters`.

    Raises
    ------
    LineamentError
        If the file cannot be read, is no TOML, or has a key that is no parameter.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "live.toml")
    >>> _ = path.write_text('topic = "/front/scan"\n[parameters]\nevidence = 12\n')
    >>> read_config(path)
    {'topic': '/front/scan', 'parameters': {'evidence': 12}}
    """
    try:
        with Path(path).open("rb") as file:
            found = tomllib.load(file)
    except OSError as error:
        raise LineamentError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise LineamentError(f"{path}: is no TOML: {error}") from None
    known = [parameter.name for parameter in fields(LiveConfig)]
    for name, value in found.items():
        if name not in known:
            raise LineamentError(f"{path}: has {name!r}, expected one of {', '.join(known)}")
        if isinstance(value, list):
            found[name] = tuple(value)
    return found


#: What each annotation takes, and what it is called.
_KINDS: dict[str, tuple[tuple[type, ...], str]] = {
    "str": ((str,), "a text"),
    "bool": ((bool,), "true or false"),
    "int": ((int,), "a whole number"),
    "float": ((int, float), "a number"),
    "Pose": ((tuple, list), "three numbers"),
    "Mapping[str, Any]": ((Mapping,), "a table"),
}


def _check_type(name: str, annotation: Any, value: object) -> None:
    kind, _, optional = str(annotation).partition(" | ")
    types, wanted = _KINDS[kind]
    is_optional = bool(optional) and value is None
    is_bool = isinstance(value, bool) and kind != "bool"
    if not is_optional and (is_bool or not isinstance(value, types)):
        raise ValueError(f"{name} is {value!r}, expected {wanted}")


def _check_choice(name: str, value: object, choices: tuple[object, ...]) -> None:
    if value not in choices:
        wanted = ", ".join(map(str, choices))
        raise ValueError(f"{name} is {value!r}, expected one of {wanted}")


def _check_between(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} is {value}, expected {low} to {high}")


def _check_name(name: str, value: str) -> None:
    if not re.fullmatch(r"/?\w+(/\w+)*", value, re.ASCII):
        raise ValueError(f"{name} is {value!r}, expected a name of letters, digits, _ and /")


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) <= sys.float_info.max
