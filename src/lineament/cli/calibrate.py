"""The command that finds where a scanner is on its robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import LOG, PATH, QUIET, check_ending, extracting
from .options import reading_odometry as reading
from .types import Within

if TYPE_CHECKING:
    from ..extractor import Extractor


@click.command()
@LOG
@click.option("-o", "--output", type=PATH, help="A picture of what is left: .png, .svg or .pdf.")
@click.option("--json", "as_json", is_flag=True, help="Print all numbers as JSON.")
@click.option(
    "--track",
    "track_width",
    type=Within(0, 10, min_open=True),
    metavar="METRES",
    help="Distance between the wheels by which the odometry was computed: radii and track are "
    "found instead of scales.",
)
@click.option("--against", metavar="TOPIC", help="Another scanner, in place of the wheels.")
@click.option("--no-deskew", is_flag=True, help="The scans of the log are deskewed already.")
@extracting
@reading
@QUIET
def calibrate(
    log: Path | str,
    output: Path | None,
    extractor: Extractor,
    against: str | None,
    track_width: float | None,
    as_json: bool,
    no_deskew: bool,
    quiet: bool,
    reading: dict[str, Any],
) -> None:
    """Find where the scanner of LOG is on its robot, and the radii and track of its wheels.

    Or where it is in the frame of another scanner, the one that --topic names in that of --against.
    Poses of the log are taken as odometry. What the drive does not show is named, and has no
    number: it takes turns and ways, in any order.
    """
    from ..files import strict_json
    from ..output.canvas import PICTURE_ENDINGS
    from ..tasks.calibrate import calibrate_log
    from .progress import tracker

    check_ending(output, PICTURE_ENDINGS)
    if against is not None and reading["topic"] is None:
        raise click.UsageError("--against: expected --topic, too: that whose mounting is found")
    for name, value in (("--track", track_width), ("--odometry", reading["pose_topic"])):
        if against is not None and value is not None:
            raise click.UsageError(f"{name}: is of wheels, expected none beside --against")
    if reading.pop("laser_pose") is not None:
        raise click.UsageError("--laser-pose: is what calibrate finds, expected no such option")
    done = calibrate_log(
        log,
        output,
        extractor,
        against=against,
        track_width=track_width or 0.0,
        deskewed=not no_deskew,
        track=tracker(quiet),
        **reading,
    )
    if as_json:
        click.echo(strict_json(done.as_dict()))
    elif not quiet:
        click.echo(str(done))
