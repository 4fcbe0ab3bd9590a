"""The configuration of a live node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..limits import Limits
from ..motion.rig import UNSURE, Rig
from ..scan import Pose
from ..scan.changes import Mask, checked_mask
from ..scan.fields import checked_mounting
from .checking import FRAMES, Names, Point, check, check_needed

#: Formats that a map is written in.
MAPS = (".dxf", ".svg", ".parquet", ".yaml")
#: Values of `LiveConfig.deskew` that are not topics.
_NOT_TOPICS = ("off", "scans", "poses")


@dataclass(frozen=True, slots=True)
class LiveConfig:
    """Where a node listens, what it does with a scan, and where it publishes features.

    Parameters
    ----------
    topic : str
        Topic of the scans. Features go to topics below it: ``TOPIC/features`` and others.
    merge : sequence of str
        Topics of further scanners of the robot: what they see is merged with what that of `topic`
        does, in the frame `base_frame`; see `lineament.mapping.merge_features`.
    mountings : dict
        Where a scanner is on the robot [m, m, rad], by its topic; else ``/tf_static`` says it.
    unsure : (float, float)
        Standard deviations of the mountings [m, rad].
    tolerance : float
        Scans farther apart in time are not merged [s].
    namespace : str
        Put before topics that do not begin with ``/``.
    name : str
        Name of the node.
    type : str
        ``LaserScan`` or ``MultiEchoLaserScan``, of ``sensor_msgs``.
    echo : str
        Which echo of the latter: ``first``, ``last`` or ``strongest``.
    stamp : str
        Which beam of a scan is taken at the time of its header: ``first``, ``middle`` or ``last``.
    scale : float
        What ranges and their limits are multiplied by to be in metres: 0.001 for millimetres.
    ros : int
        2, or 1 for ROS 1 (rospy); 0 for none, where a log is played for Foxglove alone.
    domain : int, optional
        DDS domain; by default that of the environment's ``ROS_DOMAIN_ID``, or 0.
    localhost : bool
        Whether DDS stays on this machine.
    reliability : str
        Of the subscription: ``best-effort``, which matches any publisher, or ``reliable``.
    depth : int
        Messages of a topic that are kept for a slow reader.
    method : str
        Name of the method.
    parameters : dict
        Parameters of the method that differ from its defaults.
    noise : float, optional
        Noise of the ranges [m]; estimated from each scan by default.
    deskew : str
        Where the motion of the sensor is known from: ``off``, ``scans`` (their features),
        ``poses`` (of a log that is played), or a topic of ``nav_msgs/Odometry``.
    laser_pose : (x, y, theta)
        Pose of the scanner in the frame of the odometry's twist [m, m, rad].
    upside_down : bool
        Whether the scanner hangs upside down: then its frame is turned about its x axis.
    mask : sequence of (from, to)
        Sectors of bearings that see the robot itself [rad], see `LaserScan.masked`.
    track : bool
        Whether features are recognised from scan to scan. Then, and where `deskew` is ``scans``,
        the motion by them is known too: ``TOPIC/odometry``.
    dock : (x, y), optional
        The corner nearest to this point, in the frame of the first scan [m], within 1 m, is
        followed, and its pose goes to ``TOPIC/dock``.
    dock_track : int, optional
        The same of the corner of this track.
    dock_shape : str, optional
        A DXF of a `lineament.docking.Shape`, which is followed in place of a corner; its origin is
        within 0.5 m of `dock`.
    map : str, optional
        A plan on which the sensor is followed: its pose goes to ``TOPIC/pose``. A name without an
        ending, ``/map``, is a topic of ``nav_msgs/OccupancyGrid``; a log that is played has none.
    mapping : str, optional
        Where the map is written that is made of the scans, once it stops: ``.dxf``, ``.svg``,
        ``.parquet`` or ``.yaml``. Meanwhile the sensor is followed on it as on a plan, and its
        walls go to ``TOPIC/plan``.
    layers : str
        Layers of the plan that hold walls, by commas, as in `LineMap.read`.
    units : str, optional
        Units of the plan, as there.
    odometry : str, optional
        With a plan, a topic of ``nav_msgs/Odometry`` that says where the robot has come to; by
        default that of `deskew`, or ``/tf``.
    map_frame, odom_frame, base_frame : str
        With a plan, frames of it, of the odometry, and of the robot; what is merged is in the last.
    transform_tolerance : float
        For so long after a scan the transform from `map_frame` to `odom_frame` holds [s].
    broadcast : bool
        Whether that transform is published on ``/tf``.
    judge : str, optional
        With a plan, a topic of ``geometry_msgs/PoseWithCovarianceStamped``: the poses of another
        localiser, which get a verdict each. Then nothing of ours takes their place. Of a bag that
        is played, ``/tf`` and the topic of `odometry` are heard as well, as from the robot.
    log : str, optional
        A log that is played in place of a topic.
    log_topic : str, optional
        Topic of the scans in the log, where it has several.
    poses : str, optional
        Topic of the poses in the log.
    ring : int, optional
        Ring of a point cloud in the log that is the scan.
    keep_going : bool
        Whether to skip what is faulty in the log.
    limits : dict
        Limits that differ from those of `lineament.limits.Limits`, of messages and of the log.
    rate : float
        Factor on the speed of the log; 0 for as fast as scans are processed.
    loop : bool
        Whether the log starts again at its end.
    foxglove : int, optional
        Port of the WebSocket server for Foxglove.
    host : str
        Address of that server.

    Raises
    ------
    ValueError
        If a value is not one of these. The message names the parameter.

    Examples
    --------
    >>> LiveConfig(topic="scan", namespace="robot1", method="liu").scan_topic
    '/robot1/scan'
    """

    topic: str = "scan"
    merge: Names = ()
    mountings: Mapping[str, Any] = field(default_factory=dict)
    unsure: Point = UNSURE
    tolerance: float = 0.15
    namespace: str = ""
    name: str = "lineament"
    type: str = "LaserScan"
    echo: str = "first"
    stamp: str = "first"
    scale: float = 1.0
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
    upside_down: bool = False
    mask: Mask = ()
    track: bool = False
    dock: Point | None = None
    dock_track: int | None = None
    dock_shape: str | None = None
    map: str | None = None
    mapping: str | None = None
    layers: str = ""
    units: str | None = None
    odometry: str | None = None
    map_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    transform_tolerance: float = 1.0
    broadcast: bool = True
    judge: str | None = None
    log: str | None = None
    log_topic: str | None = None
    poses: str | None = None
    ring: int | None = None
    keep_going: bool = False
    limits: Mapping[str, Any] = field(default_factory=dict)
    rate: float = 1.0
    loop: bool = False
    foxglove: int | None = None
    host: str = "127.0.0.1"

    def __post_init__(self) -> None:
        for known in fields(self):
            check(known.name, str(known.type), getattr(self, known.name))
        Limits.of(self.limits)
        if "/" in self.name:
            raise ValueError(f"name is {self.name!r}, expected no /: use namespace for that")
        checked_mounting(self.laser_pose)
        object.__setattr__(self, "mask", checked_mask(self.mask))
        self._check_together()
        self._check_mapping()
        self._check_merged()
        check_needed(self)

    def _check_together(self) -> None:
        """Check what has to fit together."""
        if self.dock is not None and self.dock_track is not None:
            raise ValueError("dock and dock_track are given, expected one of them")
        if self.log is None and self.deskew == "poses":
            raise ValueError("deskew is 'poses', which only a log has; expected a topic, or scans")
        if self.log is not None and self.odometry_topic is not None and not self.is_localiser:
            name = "deskew" if self.odometry is None else "odometry"
            raise ValueError(
                f"{name} is {getattr(self, name)!r}, but a log is played; expected poses or scans"
            )
        if self.odometry is not None and self.odometry_topic != self.resolved(self.odometry):
            raise ValueError(
                f"deskew is {self.deskew!r}, and odometry {self.odometry!r}, expected one topic"
            )
        if self.judge is not None and (self.poses is not None or self.deskew == "poses"):
            raise ValueError("poses are not used with judge; expected odometry, or none for /tf")
        if len({getattr(self, name).strip("/") for name in FRAMES}) < len(FRAMES):
            raise ValueError("two of map_frame, odom_frame and base_frame are one, expected three")
        if self.log is None and self.ros == 0:
            raise ValueError("ros is 0, which leaves nothing to listen to; expected a log")

    def _check_mapping(self) -> None:
        """Check what goes with a map that is sent, or made."""
        if self.map_topic is not None and self.log is not None:
            raise ValueError(
                f"map is {self.map!r}, a topic, but a log is played; expected the file of a plan"
            )
        if self.map_topic is not None and (self.layers or self.units is not None):
            raise ValueError(f"layers and units are of a DXF, expected none for {self.map!r}")
        if self.mapping is None:
            return
        for name in ("map", "judge"):
            if getattr(self, name) is not None:
                raise ValueError(f"{name} and mapping are given, expected one of them")
        if Path(self.mapping).suffix.lower() not in MAPS:
            raise ValueError(
                f"mapping is {self.mapping!r}, expected an ending of {', '.join(MAPS)}"
            )

    def _check_merged(self) -> None:
        """Check what several scanners leave no room for."""
        if not self.merge:
            return
        _ = self.rig  # Its own errors say what is wrong with it.
        for name in ("laser_pose", "upside_down", "log_topic"):
            if getattr(self, name) not in ((0, 0, 0), False, None):
                raise ValueError(f"{name} is of one scanner, expected none with several topics")
        if self.deskew == "scans":
            raise ValueError("deskew is 'scans', expected odometry or poses with several topics")

    @property
    def rig(self) -> Rig:
        """The scanners that are merged, by their full topics, or those of the log."""
        named = self.resolved if self.log is None else str
        mountings = {named(topic): pose for topic, pose in self.mountings.items()}
        topics = tuple(map(named, (self.topic, *self.merge)))
        return Rig(topics, mountings, self.base_frame, self.unsure)

    @property
    def scan_topic(self) -> str:
        """Full name of the topic of the scans."""
        return self.resolved(self.topic)

    @property
    def is_tracking(self) -> bool:
        """Whether the motion of the sensor is found by its scans."""
        return self.track or self.deskew == "scans" or self.is_docking

    @property
    def is_docking(self) -> bool:
        """Whether the pose of a corner is published."""
        return self.dock is not None or self.dock_track is not None

    @property
    def odometry_topic(self) -> str | None:
        """Full name of the topic of the odometry, where there is one."""
        if self.deskew not in _NOT_TOPICS:
            return self.resolved(self.deskew)
        return None if self.odometry is None else self.resolved(self.odometry)

    @property
    def has_map(self) -> bool:
        """Whether the sensor is followed on a map: one that there is, or one that is made."""
        return self.map is not None or self.mapping is not None

    @property
    def map_topic(self) -> str | None:
        """Full name of the topic of the plan, where it is one."""
        if self.map is None or Path(self.map).suffix:
            return None
        return self.resolved(self.map)

    @property
    def judge_topic(self) -> str | None:
        """Full name of the topic of the poses that are judged, if any."""
        return None if self.judge is None else self.resolved(self.judge)

    @property
    def is_broadcasting(self) -> bool:
        """Whether the transform of the odometry is published."""
        return self.broadcast and self.has_map and self.judge is None

    @property
    def is_localiser(self) -> bool:
        """Whether a robot is followed on a plan: its frames, and what it is asked, are listened to.

        A log that is played has poses in their place, but where its localiser is judged.
        """
        return self.has_map and (self.log is None or self.judge is not None)

    @property
    def can_relocate(self) -> bool:
        """Whether a robot can be looked for anew: on a map that there is, not one that is made."""
        return self.is_localiser and self.mapping is None

    def resolved(self, topic: str) -> str:
        """Return the full name of a topic; one that begins with ``/`` is full already, in ROS."""
        if topic.startswith("/"):
            return topic
        return "/" + "/".join([*filter(None, self.namespace.split("/")), topic])
