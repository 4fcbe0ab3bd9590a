"""The commands that make a map of a log, and that find a log on one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import (
    LIMITS,
    LOG,
    PATH,
    QUIET,
    check_ending,
    complain,
    extracting,
    of_plan,
    wrong_usage,
)
from .options import reading_odometry as reading

if TYPE_CHECKING:
    from ..extractor import Extractor

_NO_ODOMETRY = click.option("--no-odometry", is_flag=True, help="Leave the poses of the log aside.")
_NO_DESKEW = click.option(
    "--no-deskew", is_flag=True, help="The scans of the log are deskewed already."
)


def _check_odometry(no_odometry: bool, topic: str | None) -> None:
    if no_odometry and topic is not None:
        raise click.UsageError(f"--odometry {topic}: expected none beside --no-odometry")


#: Formats that a map is written in.
_ENDINGS = (".dxf", ".svg", ".parquet", ".yaml")
#: Those of a picture of walls and a way; in `plan -o` an .svg is a plan.
_PICTURES = (".png", ".svg", ".pdf")


@click.command("map")
@LOG
@click.option(
    "-o", "--output", required=True, type=PATH, help="The map: .dxf, .svg, .parquet or .yaml."
)
@click.option("--poses", type=PATH, help="Pose of each scan, as TUM writes them: .tum.")
@click.option("--picture", type=PATH, help="Walls and way, red if not sure: .png, .svg or .pdf.")
@click.option("--onto", type=PATH, help="A plan in whose frame the map is, as for locate.")
@click.option("--merge", is_flag=True, help="With the walls of the plan of --onto, as one map.")
@_NO_ODOMETRY
@_NO_DESKEW
@extracting
@reading
@QUIET
def map_command(
    log: Path | str,
    output: Path,
    poses: Path | None,
    picture: Path | None,
    onto: Path | None,
    merge: bool,
    no_odometry: bool,
    no_deskew: bool,
    extractor: Extractor,
    reading: dict[str, Any],
    quiet: bool,
) -> None:
    """Make a map of the walls of LOG, with its loops closed.

    Poses of the log are taken as odometry: their changes, not where they are. Where nothing shows
    how parts of the way lie to each other, they are drawn apart. The exit status is 3 if there are
    no walls, or the drive is not surely on the plan.
    """
    from ..tasks.mapping import map_log
    from .progress import tracker

    check_ending(output, _ENDINGS)
    _check_odometry(no_odometry, reading["pose_topic"])
    check_ending(poses, (".tum", ".txt"))
    check_ending(picture, _PICTURES)
    if merge and onto is None:
        raise click.UsageError("--merge is for the plan of --onto, which is not given")
    done = map_log(
        log,
        output,
        extractor,
        poses=poses,
        picture=picture,
        onto=onto,
        merge=merge,
        odometry=not no_odometry,
        deskewed=not no_deskew,
        track=tracker(quiet),
        **reading,
    )
    if not quiet:
        click.echo(str(done))
    if done.warning:
        complain(f"lineament: {done.warning}")


@click.command()
@LOG
@click.option(
    *("--map", "plan"),
    type=PATH,
    required=True,
    help="The plan: .dxf, .yaml of nav2, .parquet, .svg.",
)
@click.option("-o", "--output", required=True, type=PATH, help="Poses: .tum, .csv or .parquet.")
@click.option("--picture", type=PATH, help="The way on the plan: .png, .svg or .pdf.")
@of_plan
@_NO_ODOMETRY
@_NO_DESKEW
@extracting
@reading
@QUIET
def locate(
    log: Path | str,
    plan: Path,
    output: Path,
    picture: Path | None,
    extractor: Extractor,
    no_odometry: bool,
    no_deskew: bool,
    quiet: bool,
    reading: dict[str, Any],
    **drawn: Any,
) -> None:
    """Find where each scan of LOG was taken on a plan, and where that is not known.

    Poses of the log are taken as odometry: their changes, not where they are. The exit status is 3
    if no scan is located.
    """
    from ..tasks.locate import ENDINGS, locate_log
    from .progress import tracker

    check_ending(output, ENDINGS)
    _check_odometry(no_odometry, reading["pose_topic"])
    check_ending(picture, _PICTURES)
    found = locate_log(
        log,
        plan,
        output,
        extractor,
        picture=picture,
        odometry=not no_odometry,
        deskewed=not no_deskew,
        track=tracker(quiet),
        **drawn,
        **reading,
    )
    if not quiet:
        click.echo(str(found))
    found.check_found()
    if found.warning:
        complain(f"lineament: {found.warning}")


@click.command()
@click.argument("plan", type=PATH)
@click.option("-o", "--output", required=True, type=PATH, help="Another plan, or a picture.")
@of_plan
@click.option(
    "--resolution",
    type=float,
    help="Size of the cells of a grid that is drawn [m].  [default: 0.05]",
)
@click.option("--dark", is_flag=True, help="Draw on black.")
@LIMITS
@QUIET
def plan(
    plan: Path, output: Path, resolution: float | None, dark: bool, quiet: bool, **given: Any
) -> None:
    """Write PLAN in another format, or draw it.

    PLAN is a .dxf, .yaml (an occupancy grid of nav2), .parquet or .svg of lineament; OUTPUT one of
    them, .csv, .jsonl, .geojson (in metres), .png or .pdf.
    """
    from ..mapping.grid_files import check_resolution
    from ..mapping.grids import GRID_ENDINGS
    from ..tasks.plan import ENDINGS, PICTURES, convert_plan

    check_ending(output, ENDINGS)
    before, ending = plan.suffix.lower(), output.suffix.lower()
    if dark and ending not in PICTURES:
        raise click.UsageError(f"--dark: expected a picture, {' or '.join(PICTURES)}, not {ending}")
    if resolution is not None:
        if ending not in GRID_ENDINGS:
            raise click.UsageError(f"--resolution: expected a grid, .yaml, not {ending}")
        if before in GRID_ENDINGS:
            raise click.UsageError(f"--resolution: {plan} is a grid, whose cells are kept")
        with wrong_usage():
            check_resolution(resolution)
        given["resolution"] = resolution
    done = convert_plan(plan, output, dark=dark, **given)
    if not quiet:
        click.echo(done)
