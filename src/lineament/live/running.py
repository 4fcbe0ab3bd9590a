"""`run_live`: a node as it is configured, until it is stopped."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from importlib import import_module

import numpy as np

from ..errors import needed_by
from ..output.feature_points import feature_points
from ..output.ros_messages import RosMessages
from ..scan import LaserScan
from .config import LiveConfig
from .counters import Report
from .node import Node
from .pipeline import Pipeline
from .received import Source
from .replay import ReplaySource
from .sinks import FoxgloveSink, Publisher, RosSink, Sink

__all__ = ["run_live"]


def run_live(
    config: LiveConfig,
    is_stopped: Callable[[], bool] = lambda: False,
    *,
    tell: Callable[[str], None] = print,
    show: Callable[[Report], None] = lambda report: None,  # noqa: ARG005
) -> Report:
    """Run a node until its log ends, or it is stopped.

    Parameters
    ----------
    config : LiveConfig
    is_stopped : callable
        Says whether to stop; it is asked ten times a second once the node runs.
    tell : callable
        Is told in a line what a person should know.
    show : callable
        Is shown each report, each second.

    Returns
    -------
    Report
        The last one, with the totals of the run.

    Raises
    ------
    ValueError
        If the method or a parameter of it is unknown or out of bounds.
    LineamentError
        If the log cannot be read, or ROS or Foxglove cannot be reached.
    """
    with ExitStack() as stack:
        with _loading(stack):
            # Others are found over the network while the kernels are loaded.
            source, sinks = _ends(config, stack, tell)
            pipeline = Pipeline(config)
            frame = pipeline("", _WALL)
            feature_points(frame.features, frame.tracks)
        tell(f"{config.name} finds features on {config.scan_topic} by {config.method}")
        return Node(source, pipeline, sinks, tell=tell, show=show).run(is_stopped)


@contextmanager
def _loading(stack: ExitStack) -> Iterator[None]:
    """Load what stays as long as the node runs: it is not searched for garbage.

    The search would make the start longer, and later hold up a scan for a twentieth of a second.
    """
    gc.disable()
    try:
        yield
        gc.freeze()
        stack.callback(gc.unfreeze)
    finally:
        gc.enable()


#: What kernels are loaded with, so that the first scan need not wait for them.
_BEARINGS = np.linspace(-1.0, 1.0, 101)
_WALL = LaserScan(2.0 / np.cos(_BEARINGS), angles=_BEARINGS)


def _ends(
    config: LiveConfig, stack: ExitStack, tell: Callable[[str], None]
) -> tuple[Source, list[Sink]]:
    """Open where scans come from and where features go."""
    source: Source | None = None
    sinks: list[Sink] = []
    if config.log is not None:
        source = stack.enter_context(closing(_replay(config, config.log)))
    if config.ros:
        open_ros = _over_ros1 if config.ros == 1 else _over_dds
        heard, publisher = open_ros(config, stack, listens=source is None)
        messages = RosMessages("ros1" if config.ros == 1 else "cdr")
        replays = source is not None
        sinks.append(
            RosSink(publisher, messages, config.scan_topic, config.name, tells_scan=replays)
        )
        source = source or heard
    if config.foxglove is not None:
        sinks.append(_foxglove(config, config.foxglove, stack, tell))
    assert source is not None  # `LiveConfig` has seen to it.
    return source, sinks


def _replay(config: LiveConfig, log: str) -> ReplaySource:
    return ReplaySource(
        log,
        config.rate,
        loop=config.loop,
        topic=config.log_topic,
        pose_topic=config.poses,
        echo=config.echo,
        ring=config.ring,
        keep_going=config.keep_going,
    )


def _over_dds(
    config: LiveConfig, stack: ExitStack, *, listens: bool
) -> tuple[Source | None, Publisher]:
    with needed_by("live"):
        dds = import_module(".dds", __package__)
    participant = dds.Participant(config.domain, localhost=config.localhost)
    stack.callback(participant.close)
    publisher = dds.DdsPublisher(participant, config.depth)
    if not listens:
        return None, publisher
    source = dds.DdsSource(
        participant,
        config.scan_topic,
        f"sensor_msgs/msg/{config.type}",
        echo=config.echo,
        odometry=config.odometry_topic,
        reliability=config.reliability,
    )
    return source, publisher


def _over_ros1(
    config: LiveConfig, stack: ExitStack, *, listens: bool
) -> tuple[Source | None, Publisher]:
    ros1 = import_module(".ros1", __package__)  # It says itself where rospy comes from.
    node = ros1.Ros1Node(config.name)
    stack.callback(node.close)
    publisher = ros1.Ros1Publisher(node, config.depth)
    if not listens:
        return None, publisher
    source = ros1.Ros1Source(
        node,
        config.scan_topic,
        f"sensor_msgs/{config.type}",
        echo=config.echo,
        odometry=config.odometry_topic,
        depth=config.depth,
    )
    return source, publisher


def _foxglove(
    config: LiveConfig, port: int, stack: ExitStack, tell: Callable[[str], None]
) -> FoxgloveSink:
    with needed_by("live"):
        foxglove = import_module(".foxglove", __package__)
    server = foxglove.FoxgloveServer(config.host, port, config.name)
    stack.callback(server.close)
    tell(f"Foxglove: open a connection to {server.address}")
    return FoxgloveSink(server, foxglove.FoxgloveMessages(), config.scan_topic)
