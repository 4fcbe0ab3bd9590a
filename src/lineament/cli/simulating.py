"""The commands that simulate. Each imports what it calls when it runs."""

from pathlib import Path
from typing import Any

import click

from .options import LIMITS, LOG_PATH, PATH, QUIET, SEED, wrong_usage


@click.command()
@click.argument("log", required=False, type=LOG_PATH)
@LIMITS
@click.option(
    "-o", "--output", type=PATH, default="demo", show_default=True, help="Folder to write to."
)
@QUIET
def demo(log: Path | str | None, limits: dict[str, int] | None, output: Path, quiet: bool) -> None:
    """Make a page of a simulated drive, or of LOG."""
    from ..tasks.demo import run_demo
    from .progress import tracker

    facts = run_demo(output, log, track=tracker(quiet), limits=limits)
    if not quiet:
        width = max(len(name) for name, _ in facts)
        click.echo("\n".join(f"{name:<{width}}  {value}" for name, value in facts))


@click.command()
@click.argument("world", default="building")
@click.option("-o", "--output", required=True, type=PATH, help="Log to write: .npz, .log, .log.gz.")
@click.option("--sensor", "name", default="utm30lx", show_default=True, help="Preset of a scanner.")
@click.option(
    "--scans", type=click.IntRange(min=1), help="[default: the whole drive, at most; or 100]"
)
@SEED
@click.option("--speed", type=float, help="Of the drive [m/s].  [default: 0.6]")
@click.option("--rate", type=float, help="Scans a second.  [default: the sensor's]")
@click.option(
    "--moving", is_flag=True, help="Sweep while moving; else all beams are taken at once."
)
@click.option(
    "--noise",
    "sigma",
    type=float,
    metavar="SIGMA",
    help="Noise of the ranges [m].  [default: the sensor's]",
)
@click.option(
    "--dropout",
    type=float,
    help="Probability that a beam returns nothing.  [default: the sensor's]",
)
@click.option(
    "--outlier", type=float, help="Probability of a false return.  [default: the sensor's]"
)
@QUIET
def simulate(
    world: str,
    output: Path,
    name: str,
    sigma: float | None,
    dropout: float | None,
    outlier: float | None,
    speed: float | None,
    quiet: bool,
    **settings: Any,
) -> None:
    """Record a simulated log, with true poses.

    WORLD is "building" (the default), driven through from end to end; or a kind of random scene,
    seen from one place: room, star, corridor, hall, grazing, layers.
    """
    from ..simulation import SCENES, sensor_like, simulate_log
    from .progress import tracker

    if speed is not None:
        if world in SCENES:
            raise click.UsageError(f"--speed: the scanner stands in world {world!r}")
        settings["speed"] = speed
    with wrong_usage():
        sensor = sensor_like(name, sigma=sigma, dropout=dropout, outlier=outlier)
        simulate_log(output, world, sensor, track=tracker(quiet), **settings)
    if not quiet:
        click.echo(f"{world}, seen by {name} -> {output}")
