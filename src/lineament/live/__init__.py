"""A running scanner turned into a stream of features, over ROS 2, ROS 1, or from a log.

One way: source → (the newest scan of each publisher) → deskewing → features → tracks → sinks.
"""

from typing import TYPE_CHECKING

from .._lazy import lazily

if TYPE_CHECKING:
    from ..rosmsg.poses import Odometry as Odometry
    from .config import LiveConfig as LiveConfig
    from .counters import Counts as Counts
    from .counters import Report as Report
    from .merging import MergingPipeline as MergingPipeline
    from .node import Node as Node
    from .pipeline import Frame as Frame
    from .pipeline import Pipeline as Pipeline
    from .received import Received as Received
    from .received import Source as Source
    from .replay import ReplaySource as ReplaySource
    from .running import make_pipeline as make_pipeline
    from .running import run_live as run_live
    from .sinks import FoxgloveSink as FoxgloveSink
    from .sinks import RosSink as RosSink
    from .sinks import Sink as Sink
    from .toml import read_config as read_config

_HOME = {
    "Counts": "counters",
    "FoxgloveSink": "sinks",
    "Frame": "pipeline",
    "LiveConfig": "config",
    "MergingPipeline": "merging",
    "Node": "node",
    "Odometry": "received",
    "Pipeline": "pipeline",
    "Received": "received",
    "ReplaySource": "replay",
    "Report": "counters",
    "RosSink": "sinks",
    "Sink": "sinks",
    "Source": "received",
    "make_pipeline": "running",
    "read_config": "toml",
    "run_live": "running",
}

__all__ = [*_HOME]

__getattr__ = lazily(__name__, _HOME)
