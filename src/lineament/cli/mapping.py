"""The command that makes a map of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .options import LOG, METHOD, NOISE, PATH, QUIET, SET, check_ending, make_extractor
from .options import reading_odometry as reading

#: Formats that a map is written in.
_ENDINGS = (".dxf", ".svg", ".parquet")


@click.command("map")
@LOG
@click.option("-o", "--output", required=True, type=PATH, help="The map: .dxf, .svg or .parquet.")
@click.option("--poses", type=PATH, help="Pose of each scan, as TUM writes them: .tum.")
@click.option("--onto", type=PATH, help="A plan in whose frame the map is: .dxf or .parquet.")
@click.option("--no-odometry", is_flag=True, help="Leave the poses of the log aside.")
@METHOD
@SET
@NOISE
@reading
@QUIET
def map_command(
    log: Path | str,
    output: Path,
    poses: Path | None,
    onto: Path | None,
    no_odometry: bool,
    method: str | None,
    settings: tuple[str, ...],
    noise: float | None,
    reading: dict[str, Any],
    quiet: bool,
) -> None:
    """Make a map of the walls of LOG, with its loops closed.

    Poses of the log are taken as odometry: their changes, not where they are.
    """
    from ..tasks.mapping import map_log
    from .progress import tracker

    check_ending(output, _ENDINGS)
    if poses is not None:
        check_ending(poses, (".tum", ".txt"))
    extractor = make_extractor(method, settings, noise)
    done = map_log(
        log,
        output,
        extractor,
        poses=poses,
        onto=onto,
        odometry=not no_odometry,
        track=tracker(quiet),
        **reading,
    )
    if not quiet:
        click.echo(str(done))
