"""`run_live`: a node as it is configured, until it is stopped."""

import gc
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec

from ..errors import needed_by, needs
from ..extractor import WALL
from ..output.feature_points import feature_points
from ..output.ros_messages import RosMessages
from ..progress import compiling
from ..scan import LaserScan
from .config import LiveConfig
from .counters import Report
from .merging import MergingPipeline
from .node import Node
from .pipeline import Pipeline
from .received import GUESS, JUDGED, LINKS, MOUNTINGS, ODOMETRY, Source, wanted
from .replay import ReplaySource
from .sinks import FoxgloveSink, RosSink, Sink
from .terminal import Terminal

_PLACING = (MOUNTINGS, LINKS, ODOMETRY, GUESS, JUDGED)


def run_live(
    config: LiveConfig,
    is_stopped: Callable[[], bool] = lambda: False,
    *,
    write: Callable[[str], None] = print,
    show: Callable[[Report], None] = lambda report: None,  # noqa: ARG005
) -> Report:
    """Run a node until its log ends, or it is stopped.

    Parameters
    ----------
    config : LiveConfig
    is_stopped : callable
        Returns whether to stop; it is called every 0.1 s once the node runs.
    write : callable
        Called with each line that a person should see.
    show : callable
        Called with each report, each second.

    Returns
    -------
    Report
        The last one, with the totals of the run.

    Raises
    ------
    ValueError
        If the method or one of its parameters is unknown or out of bounds.
    LineamentError
        If the log cannot be read, or ROS or Foxglove cannot be reached.
    """
    with ExitStack() as stack:
        with _loading(stack):
            # Other nodes are discovered while the kernels are loaded.
            source, sinks = _ends(config, stack, write)
            pipeline = make_pipeline(config)
            # Of the wall that the kernels are tried on there is to be no map.
            trial = pipeline if config.mapping is None else Pipeline(replace(config, mapping=None))
            # The motion of tracks is estimated from the second scan on.
            # It has times: that scans are not deskewed is a line if they have none.
            wall = LaserScan(WALL.ranges, angles=WALL.angles, scan_time=0.1)
            with compiling():
                for frame in (trial("", wall), trial("", wall)):
                    feature_points(frame.features, frame.tracks)
        stack.enter_context(closing(pipeline))
        is_stopped()  # From here on a signal ends a node that runs, and not a start.
        topics = ", ".join(config.rig.topics) if config.merge else config.scan_topic
        write(f"{config.name} finds features on {topics} by {config.method}")
        terminal = Terminal(write, config)
        if config.has_map:
            sinks.append(terminal)
        report = Node(source, pipeline, sinks, write=write, show=show).run(is_stopped)
        if terminal.summary:
            write(terminal.summary)
        if config.mapping is not None:
            write(f"stopped: the map is made of {report.taken}")
            write(pipeline.save())
        return report


def make_pipeline(config: LiveConfig) -> Pipeline:
    """Make the pipeline of a configuration: of one scanner, or of several as one."""
    return MergingPipeline(config) if config.merge else Pipeline(config)


@contextmanager
def _loading(stack: ExitStack) -> Iterator[None]:
    """Load what stays as long as the node runs, and exempt it from garbage collection.

    Collection would make the start longer, and later delay a scan by a twentieth of a second.
    """
    gc.disable()
    try:
        yield
        gc.freeze()
        stack.callback(gc.unfreeze)
    finally:
        gc.enable()


def _ends(
    config: LiveConfig, stack: ExitStack, write: Callable[[str], None]
) -> tuple[Source, list[Sink]]:
    """Open where scans come from and where features go."""
    source: Source | None = None
    sinks: list[Sink] = []
    if config.log is not None:
        source = ReplaySource(
            config.log,
            config.rate,
            loop=config.loop,
            topic=config.log_topic,
            merge=config.rig.topics if config.merge else (),
            # Of a bag whose localiser is judged, all that places the robot.
            heard=[one for one in wanted(config) if config.is_localiser and one.what in _PLACING],
            pose_topic=config.poses,
            echo=config.echo,
            ring=config.ring,
            keep_going=config.keep_going,
            limits=config.limits,
            # Poses of what is merged stay those of the robot.
            laser_pose=config.laser_pose if any(config.laser_pose) or config.merge else None,
        )
        stack.enter_context(closing(source))
    if config.ros == 1:
        ros1 = import_module(".ros1", __package__)  # Its own error says where rospy comes from.
        node = stack.enter_context(closing(ros1.Ros1Node(config.name)))
        source = source or ros1.Ros1Source(node, config)
        sinks.append(RosSink(ros1.Ros1Publisher(node, config.depth), RosMessages("ros1"), config))
    elif config.ros == 2 and not _is_for_foxglove_alone(config, write):
        with needed_by("live"):
            dds = import_module(".dds", __package__)
        participant = dds.Participant(config.domain, localhost=config.localhost)
        stack.enter_context(closing(participant))
        source = source or dds.DdsSource(participant, config)
        publisher = dds.DdsPublisher(participant, config.depth)
        sinks.append(RosSink(publisher, RosMessages("cdr"), config))
    if config.foxglove is not None:
        with needed_by("live"):
            foxglove = import_module(".foxglove", __package__)
        server = foxglove.FoxgloveServer(config.host, config.foxglove, config.name)
        stack.enter_context(closing(server))
        write(f"Foxglove: open a connection to {server.address}")
        sinks.append(FoxgloveSink(server, foxglove.FoxgloveMessages(), config))
    assert source is not None  # `LiveConfig` requires a log where there is no ROS.
    return source, sinks


def _is_for_foxglove_alone(config: LiveConfig, write: Callable[[str], None]) -> bool:
    """Whether a log is played for Foxglove where DDS is not installed: that needs none."""
    alone = config.log is not None and config.foxglove is not None
    if not alone or find_spec("cyclonedds") is not None:
        return False
    write(f"without ROS 2, for Foxglove alone: {needs('cyclonedds')}")
    return True
