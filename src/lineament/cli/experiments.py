"""The commands that show, compare and simulate. Each imports what it calls when it runs."""

from pathlib import Path
from typing import Any

import click

from .options import (
    KEEP_GOING,
    LIMITS,
    LOG,
    LOG_PATH,
    PATH,
    QUIET,
    SCALE,
    SCAN,
    TOPIC,
    Place,
    check_ending,
    wrong_usage,
)

SEED = click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)


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
@LOG
@SCAN
@click.option("-m", "--method", "methods", multiple=True, help="Repeatable.  [default: all]")
@click.option("-o", "--output", required=True, type=PATH, help="A picture (.png …) or .html.")
@TOPIC
@SCALE
@KEEP_GOING
@LIMITS
@QUIET
def compare(log: Path, index: int, output: Path, quiet: bool, **options: Any) -> None:
    """Put methods side by side on a scan of LOG."""
    from ..files import check_outputs
    from ..reproduce.compare import ENDINGS, compare_log, write_comparison
    from .progress import tracker

    check_ending(output, ENDINGS)
    check_outputs([output], [log])
    with wrong_usage():
        comparison = compare_log(log, index, **options, track=tracker(quiet))
    write_comparison(comparison, output)
    if not quiet:
        click.echo(str(comparison.table()))


@click.command()
@click.option("-o", "--output", required=True, type=PATH, help="Folder to write to.")
@click.option(
    *("--only", "names"),
    metavar="NAME...",
    multiple=True,
    help="An experiment, or a figure or table of the paper: fig9, table3. Repeatable.",
)
@click.option(
    "--frames", type=click.IntRange(min=1), default=10, show_default=True, help="Scans a kind."
)
@SEED
@click.option(
    "--seeds", type=click.IntRange(min=1), default=5, show_default=True, help="Seeds in a row."
)
@click.option(
    "--data",
    envvar="LINEAMENT_DATA",
    type=Place(path_type=Path, exists=True, file_okay=False),
    help="Folder of the recordings.  [default: LINEAMENT_DATA if set]",
)
@click.option(
    "--museum",
    type=Place(path_type=Path, exists=True),
    help="A bag of the Deutsches Museum, by Cartographer.",
)
@QUIET
def reproduce(output: Path, names: tuple[str, ...], quiet: bool, **setting: Any) -> None:
    """Run the paper's experiments: a page, and all numbers as JSON."""
    from ..reproduce import Setting, experiment_names
    from ..reproduce.report import reproduce
    from .progress import status

    with wrong_usage():
        chosen = experiment_names(names)
    with status(quiet) as show:
        page = reproduce(output, chosen, Setting(**setting), show)
    if not quiet:
        click.echo(str(page))


@click.group()
def bench() -> None:
    """Measure methods on a public benchmark."""


@bench.command()
@click.option("--data", required=True, type=PATH, help="Half a benchmark, .npz.")
@click.option("-m", "--method", "methods", required=True, multiple=True, help="Repeatable.")
@click.option("--sparing", is_flag=True, help="As many vertices as there is evidence for, up to J.")
@click.option("--json", "output", type=PATH, help="File for all scores, of one method.")
@QUIET
def ple(
    data: Path, methods: tuple[str, ...], sparing: bool, output: Path | None, quiet: bool
) -> None:
    """Polylines of 2-D scans: Schaefer et al., IROS 2018, beside its authors' scores."""
    from ..evaluation.ple import load_benchmark, method_map, run_benchmark, sparing_map
    from ..files import check_outputs, write_text
    from ..reproduce.report import benchmark_tables
    from .progress import tracker

    if output is not None and len(methods) > 1:
        raise click.UsageError("--json holds the scores of one method, expected one -m")
    if output is not None:
        check_outputs([output], [data])
    make_map = sparing_map if sparing else method_map
    with wrong_usage():
        makers = {method: make_map(method) for method in methods}
    benchmark, track = load_benchmark(data), tracker(quiet)
    results = [
        run_benchmark(benchmark, make, name=method, track=track) for method, make in makers.items()
    ]
    if output is not None:
        write_text(output, results[0].to_json() + "\n")
    if not quiet:
        for table in benchmark_tables(results):
            click.echo(f"{table.title}\n{table}\n")


@click.command()
@click.argument("world", default="building")
@click.option("-o", "--output", required=True, type=PATH, help="Log to write: .npz, .log, .log.gz.")
@click.option("--sensor", "name", default="utm30lx", show_default=True, help="Preset of a scanner.")
@click.option("--scans", type=click.IntRange(min=1), help="[default: the whole drive, or 100]")
@SEED
@click.option("--speed", type=float, default=0.6, show_default=True, help="Of the drive [m/s].")
@click.option("--rate", type=float, help="Scans a second.  [default: the sensor's]")
@click.option("--moving", is_flag=True, help="Move while the scanner sweeps.")
@click.option("--noise", "sigma", type=float, metavar="SIGMA", help="Noise of the ranges [m].")
@click.option("--dropout", type=float, help="Probability that a beam returns nothing.")
@click.option("--outlier", type=float, help="Probability of a false return.")
@QUIET
def simulate(
    world: str,
    output: Path,
    name: str,
    sigma: float | None,
    dropout: float | None,
    outlier: float | None,
    quiet: bool,
    **settings: Any,
) -> None:
    """Record a simulated log, with true poses.

    WORLD is "building" (the default), driven through from end to end; or a kind of random scene,
    seen from one place: room, star, corridor, hall, grazing, layers.
    """
    from ..simulation import sensor_like, simulate_log
    from .progress import tracker

    with wrong_usage():
        sensor = sensor_like(name, sigma=sigma, dropout=dropout, outlier=outlier)
        simulate_log(output, world, sensor, track=tracker(quiet), **settings)
    if not quiet:
        click.echo(f"{world}, seen by {name} -> {output}")
