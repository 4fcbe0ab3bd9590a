"""The commands that compare, measure and simulate. What they call is imported when they run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .options import KEEP_GOING, LOG, QUIET, TOPIC

__all__ = ["bench", "compare", "reproduce", "simulate"]

_PATH = click.Path(path_type=Path)


@click.command()
@LOG
@click.option("--scan", "index", type=int, default=0, help="Index of the scan, from 0.")
@click.option(
    "-m", "--method", "methods", multiple=True, help="May be given again.  [default: all]"
)
@click.option("-o", "--output", required=True, type=_PATH, help="A picture (.png …) or .html.")
@TOPIC
@KEEP_GOING
@QUIET
def compare(
    log: Path,
    index: int,
    methods: tuple[str, ...],
    output: Path,
    topic: str | None,
    keep_going: bool,
    quiet: bool,
) -> None:
    """Put methods side by side on a scan of LOG."""
    from ..evaluation.compare import ENDINGS, compare_log, write_comparison
    from .progress import tracker

    if output.suffix.lower() not in ENDINGS:
        raise click.UsageError(f"{output}: expected an ending of {', '.join(ENDINGS)}")
    comparison = _usage(
        compare_log, log, index, methods, topic=topic, keep_going=keep_going, track=tracker(quiet)
    )
    write_comparison(comparison, output)
    if not quiet:
        click.echo(str(comparison.table()))


@click.command()
@click.option("-o", "--output", required=True, type=_PATH, help="Folder to write to.")
@click.option(
    "--only",
    "names",
    metavar="NAME...",
    multiple=True,
    help="An experiment, or a figure or table of the paper: fig9, table3; may be given again.",
)
@click.option(
    "--frames",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    help="Scans of each kind.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option(
    "--data",
    envvar="LINEAMENT_DATA",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    help="Folder of the recordings.  [default: LINEAMENT_DATA if set]",
)
@QUIET
def reproduce(
    output: Path, names: tuple[str, ...], frames: int, seed: int, data: Path | None, quiet: bool
) -> None:
    """Make the paper's experiments again: a page and all figures as JSON."""
    from ..evaluation.experiments import Setting
    from ..evaluation.report import reproduce
    from .progress import telling

    with telling(quiet) as tell:
        page = _usage(reproduce, output, names, Setting(frames, seed, data), tell)
    if not quiet:
        click.echo(str(page))


@click.group()
def bench() -> None:
    """Measure methods on a public benchmark."""


@bench.command()
@click.option("--data", required=True, type=_PATH, help="Half a benchmark, .npz.")
@click.option("-m", "--method", "methods", required=True, multiple=True, help="May be given again.")
@click.option("--json", "output", type=_PATH, help="File for all scores, of one method.")
@QUIET
def ple(data: Path, methods: tuple[str, ...], output: Path | None, quiet: bool) -> None:
    """Polylines of 2-D scans: Schaefer et al., IROS 2018, beside its authors' scores."""
    from ..atomic import naming_errors, written_beside
    from ..evaluation.ple import load_benchmark, run_benchmark
    from ..evaluation.report import benchmark_tables
    from .progress import telling

    if output is not None and len(methods) > 1:
        raise click.UsageError("--json holds the scores of one method, expected one -m")
    benchmark, results = load_benchmark(data), []
    with telling(quiet) as tell:
        for method in methods:

            def told(done: int, total: int, method: str = method) -> None:
                tell(f"{method}: {done}/{total} scans")

            results.append(_usage(run_benchmark, benchmark, method, progress=told))
    if output is not None:
        with written_beside(output) as temporary, naming_errors(output):
            temporary.write_text(results[0].to_json() + "\n", encoding="utf-8")
    if not quiet:
        for table in benchmark_tables(results):
            click.echo(f"{table.title}\n{table}\n")


@click.command()
@click.argument("world", required=False, metavar="[building|room]")
@click.option("--scene", "kind", help="A random scene in place of a world: room, hall, layers …")
@click.option(
    "-o", "--output", required=True, type=_PATH, help="Log to write: .npz, .log, .log.gz."
)
@click.option("--sensor", "name", default="utm30lx", show_default=True, help="Preset of a scanner.")
@click.option("--scans", type=click.IntRange(min=1), help="[default: the whole drive, or 100]")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--speed", type=float, default=0.6, show_default=True, help="Of the drive [m/s].")
@click.option("--rate", type=float, help="Scans a second.  [default: the sensor's]")
@click.option("--moving", is_flag=True, help="Move while the scanner sweeps.")
@click.option("--noise", "sigma", type=float, metavar="SIGMA", help="Noise of the ranges [m].")
@click.option("--dropout", type=float, help="Probability that a beam returns nothing.")
@click.option("--outlier", type=float, help="Probability of a false return.")
@QUIET
def simulate(
    world: str | None,
    kind: str | None,
    output: Path,
    name: str,
    sigma: float | None,
    dropout: float | None,
    outlier: float | None,
    quiet: bool,
    **settings: Any,
) -> None:
    """Record a simulated log, with true poses: a drive through a building, or a scene."""
    from ..simulation import sensor_like, simulate_log
    from .progress import tracker

    if (world is None) == (kind is None):
        raise click.UsageError("expected either a WORLD or --scene")
    sensor = _usage(sensor_like, name, sigma=sigma, dropout=dropout, outlier=outlier)
    _usage(simulate_log, output, world or kind, sensor, track=tracker(quiet), **settings)


def _usage(function: Any, *arguments: Any, **settings: Any) -> Any:
    """Call a function of the library; what it finds wrong with the options is wrong usage."""
    try:
        return function(*arguments, **settings)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
