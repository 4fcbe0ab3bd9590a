"""The command that turns a running scanner into a stream of features."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import (
    LASER_POSE,
    LIMITS,
    MASK,
    PATH,
    QUIET,
    SCALE_HELP,
    TEXT_PATH,
    UNIT,
    complain,
    mountings,
    of_method,
    settings_of,
    wrong_usage,
)
from .types import Within

if TYPE_CHECKING:
    from ..live import LiveConfig, Report

_TYPES = click.Choice(["LaserScan", "MultiEchoLaserScan"])
_ECHOES = click.Choice(["first", "last", "strongest"])
_STAMPS = click.Choice(["first", "middle", "last"])
_RELIABILITIES = click.Choice(["best-effort", "reliable"])
_FLAG: dict[str, Any] = {"is_flag": True, "default": None}


@click.command()
@click.option("--config", type=PATH, help="TOML file of the options below; flags override it.")
@click.option(
    "--topic",
    "topics",
    multiple=True,
    help="Topic of the scans; of several scanners, which are merged, given for each."
    "  [default: scan]",
)
@mountings
@click.option(
    "--tolerance", type=float, help="Longest time between such scans [s].  [default: 0.15]"
)
@click.option("--namespace", help="Put before topics that do not begin with /.")
@click.option("--name", help="Name of the node.  [default: lineament]")
@click.option("--type", type=_TYPES, help="Type of the messages.  [default: LaserScan]")
@click.option("--echo", type=_ECHOES, help="Which echo.  [default: first]")
@click.option("--stamp", type=_STAMPS, help="Beam of the header's time.  [default: first]")
@click.option("--scale", type=float, help=SCALE_HELP + "  [default: 1]")
@click.option("--ros", type=click.IntRange(0, 2), help="Version of ROS; 0: none.  [default: 2]")
@click.option("--domain", type=click.IntRange(0, 232), help="DDS domain.  [default: ROS_DOMAIN_ID]")
@click.option("--localhost", **_FLAG, help="Stay on this machine.")
@click.option(
    "--reliability", type=_RELIABILITIES, help="Of the subscription.  [default: best-effort]"
)
@click.option(
    "--depth", type=click.IntRange(1, 1000), help="Messages kept for slow readers.  [default: 10]"
)
@of_method
@click.option(
    "--deskew",
    metavar="off|scans|poses|TOPIC",
    help="Undo the motion of the sensor, known from its scans, a log's poses, or odometry."
    "  [default: off]",
)
@LASER_POSE
@click.option("--upside-down", **_FLAG, help="The laser is turned about its x axis.")
@MASK
@click.option("--track", **_FLAG, help="Number features from scan to scan.")
@click.option(
    "--dock", type=float, nargs=2, help="x y of a corner, in the first scan [m]: publish its pose."
)
@click.option(
    "--dock-shape", type=TEXT_PATH, metavar="DXF", help="A shape in place of a corner, near --dock."
)
@click.option("--dock-track", type=click.IntRange(min=0), help="The same, by its track.")
@click.option("--map", type=TEXT_PATH, metavar="PLAN", help="Publish the pose on this plan.")
@click.option(
    "--mapping",
    type=TEXT_PATH,
    metavar="MAP",
    help="Make a map, and write it at the end: .dxf, .svg, .parquet or .yaml.",
)
@click.option("--layers", metavar="NAMES", help="Layers of the plan that hold walls, by commas.")
@click.option("--units", type=UNIT, help="Units of a DXF.  [default: those that it names, or m]")
@click.option(
    "--odometry", metavar="TOPIC", help="Odometry of the robot on the plan.  [default: /tf]"
)
@click.option("--map-frame", metavar="FRAME", help="Frame of the plan.  [default: map]")
@click.option("--odom-frame", metavar="FRAME", help="Frame of the odometry.  [default: odom]")
@click.option("--base-frame", metavar="FRAME", help="Frame of the robot.  [default: base_link]")
@click.option(
    "--transform-tolerance",
    type=Within(0, 10),
    help="For so long map → odom holds, in seconds.  [default: 1]",
)
@click.option("--broadcast/--no-broadcast", default=None, help="Publish map → odom on /tf.")
@click.option("--judge", metavar="TOPIC", help="Judge the poses of another localiser on the plan.")
@click.option(
    "--from", "log", type=TEXT_PATH, metavar="LOG", help="Play a log in place of a topic."
)
@click.option("--log-topic", metavar="TOPIC", help="Topic of the scans in the log.")
@click.option("--poses", metavar="TOPIC", help="Topic of the poses in the log.")
@click.option("--ring", type=click.IntRange(min=0), help="Ring of a point cloud in the log.")
@click.option("--keep-going", **_FLAG, help="Skip what is faulty in the log.")
@LIMITS
@click.option("--rate", type=Within(min=0), help="Factor on the speed; 0: no pauses.  [default: 1]")
@click.option("--loop", **_FLAG, help="Start the log again at its end.")
@click.option(
    "--foxglove",
    type=click.IntRange(0, 65535),
    is_flag=False,
    flag_value=8765,
    help="Serve Foxglove by WebSocket, at port 8765 or another.",
)
@click.option("--host", help="Address on which Foxglove is served.  [default: 127.0.0.1]")
@click.argument("remappings", nargs=-1, metavar="[NAME:=VALUE]...")
@QUIET
def live(
    config: Path | None,
    settings: tuple[str, ...],
    remappings: tuple[str, ...],
    quiet: bool,
    **given: Any,
) -> None:
    """Turn a running scanner into a stream of features, over ROS 2 (or ROS 1), or play a log."""
    from ..live.stopping import stopping

    totals = "stopped before the first scan"
    with stopping() as is_stopped:
        from ..live import run_live

        configured = _configured(config, settings, remappings, given)
        # On a terminal reports are shown in one line that changes, and makes way for others.
        is_shown = sys.stderr.isatty() and not quiet
        beginning = "\r\033[K" if is_shown else ""

        def write(line: str) -> None:
            if not quiet:
                complain(beginning + line)

        def show(report: Report) -> None:
            if is_shown:
                width = shutil.get_terminal_size().columns - 1
                complain(beginning + str(report)[:width], nl=False)

        try:
            with wrong_usage():
                totals = run_live(configured, is_stopped, write=write, show=show).totals
        finally:
            complain(beginning, nl=False)
    if not quiet:
        click.echo(totals)


def _configured(
    path: Path | None,
    settings: tuple[str, ...],
    remappings: tuple[str, ...],
    given: dict[str, Any],
) -> LiveConfig:
    from ..live import LiveConfig, read_config

    options = {} if path is None else read_config(path)
    limits = given.pop("limits") or {}
    if topics := given.pop("topics"):
        options["topic"], *options["merge"] = topics
    options.update({name: value for name, value in given.items() if value not in (None, (), {})})
    for argument in remappings:  # Those of roslaunch are for rospy, which finds them by itself.
        if options.get("ros") != 1 or ":=" not in argument:
            raise click.UsageError(f"got an unexpected argument {argument!r}")
    with wrong_usage():
        config = LiveConfig(**options)
    return replace(
        config,
        parameters={**config.parameters, **settings_of(settings)},
        limits={**config.limits, **limits},
    )
