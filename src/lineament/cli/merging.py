"""The command that makes one set of features of several scanners."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import (
    BASE_FRAME,
    LOG,
    PATH,
    QUIET,
    WORLD,
    check_ending,
    check_world,
    extracting,
    mountings,
    wrong_usage,
)
from .options import reading_topics as reading
from .types import Within

if TYPE_CHECKING:
    from ..extractor import Extractor


@click.command()
@LOG
@click.option("-o", "--output", required=True, type=PATH, help="File to write, as for extract.")
@mountings
@BASE_FRAME
@click.option(
    "--tolerance",
    type=Within(min=0),
    metavar="SECONDS",
    help="Longest time between scans that are merged.  [default: 0.55 periods of the slowest]",
)
@extracting
@reading
@WORLD
@QUIET
def merge(
    log: Path | str,
    output: Path,
    mountings: dict[str, tuple[float, float, float]],
    unsure: tuple[float, float] | None,
    base_frame: str,
    tolerance: float | None,
    extractor: Extractor,
    reading: dict[str, Any],
    world: bool,
    quiet: bool,
) -> None:
    """Merge what several scanners of LOG see into one set of features, in the frame of the robot.

    Each scan of the first --topic, with the nearest in time of the others. Poses of the log are
    those of the robot. The exit status is 3 if no scan has a feature.
    """
    from ..motion.rig import Rig
    from ..output import ENDINGS
    from ..tasks.extract import check_found
    from ..tasks.merging import merge_log
    from .progress import tracker

    check_ending(output, ENDINGS)
    check_world(world, output.suffix.lower())
    if reading.pop("laser_pose") is not None:
        raise click.UsageError(
            "--laser-pose: expected --mounting TOPIC=X,Y,DEGREES of each scanner"
        )
    known = {} if unsure is None else {"unsure": unsure}
    with wrong_usage():
        rig = Rig(reading.pop("topic"), mountings, base_frame, **known)
    done = merge_log(
        log,
        output,
        rig,
        extractor,
        tolerance=tolerance,
        world=world,
        track=tracker(quiet),
        **reading,
    )
    if not quiet:
        click.echo(str(done))
    check_found(done.log, done.scans, done.features, extractor.method)
