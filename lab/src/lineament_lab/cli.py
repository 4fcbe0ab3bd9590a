"""The commands that judge methods. Each imports what it calls when it runs."""

from pathlib import Path
from typing import Any

import click

from lineament.cli.options import (
    KEEP_GOING,
    LIMITS,
    LOG,
    PATH,
    QUIET,
    SCALE,
    SCAN,
    SEED,
    TOPIC,
    check_ending,
    wrong_usage,
)
from lineament.cli.types import Place


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
    from lineament.cli.progress import tracker
    from lineament.files import check_outputs

    from .compare import ENDINGS, compare_log, write_comparison

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
@click.option(
    "-m",
    "--method",
    "methods",
    multiple=True,
    help="A method besides those that are compared, such as my.py:find; repeatable.",
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
    from lineament.cli.progress import status
    from lineament.methods import get_method

    from .reproduce import Setting, experiment_names
    from .reproduce.report import reproduce

    with wrong_usage():
        chosen = experiment_names(names)
        any(map(get_method, setting["methods"]))
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
    from lineament.cli.progress import tracker
    from lineament.files import check_outputs, write_text

    from .evaluation.ple import load_benchmark, method_map, run_benchmark, sparing_map
    from .reproduce.report import benchmark_tables

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
