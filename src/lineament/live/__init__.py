"""A running scanner turned into a stream of features, over ROS 2, ROS 1, or from a log.

One way: source → (the newest scan of each publisher) → deskewing → features → tracks → sinks.
"""

from typing import TYPE_CHECKING

from .._lazy import lazily

if TYPE_CHECKING:
    from ..rosmsg.poses import Odometry
    from .config import LiveConfig, read_config
    from .counters import Counts, Report
    from .node import Node
    from .pipeline import Frame, Pipeline
    from .received import Received, Source
    from .replay import ReplaySource
    from .running import run_live
    from .sinks import FoxgloveSink, RosSink, Sink

_HOME = {
    "Counts": "counters",
    "FoxgloveSink": "sinks",
    "Frame": "pipeline",
    "LiveConfig": "config",
    "Node": "node",
    "Odometry": "received",
    "Pipeline": "pipeline",
    "Received": "received",
    "ReplaySource": "replay",
    "Report": "counters",
    "RosSink": "sinks",
    "Sink": "sinks",
    "Source": "received",
    "read_config": "config",
    "run_live": "running",
}

__all__ = [
    "Counts",
    "FoxgloveSink",
    "Frame",
    "LiveConfig",
    "Node",
    "Odometry",
    "Pipeline",
    "Received",
    "ReplaySource",
    "Report",
    "RosSink",
    "Sink",
    "Source",
    "read_config",
    "run_live",
]

__getattr__ = lazily(__name__, _HOME)
