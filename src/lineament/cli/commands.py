"""The commands. What they call is imported when they run: ``--help`` has to be quick."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .experiments import bench, compare, reproduce, simulate
from .options import KEEP_GOING, LOG, PATH, QUIET, SCAN, TOPIC, check_ending, wrong_usage

if TYPE_CHECKING:
    from ..extractor import Extractor

__all__ = ["COMMANDS"]

_SET = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the method; may be given again.",
)
_NOISE = click.option(
    "--noise",
    type=click.FloatRange(min=0),
    metavar="SIGMA",
    help="Noise of the ranges [m].  [default: estimated from each scan]",
)


_METHOD = click.option("-m", "--method", help="Name of the method.  [default: optimal]")


def _extractor(method: str | None, settings: tuple[str, ...], noise: float | None) -> Extractor:
    """Make the extractor that the options ask for."""
    from ..extractor import Extractor
    from ..methods import DEFAULT_METHOD
    from ..scan import RangeNoise

    with wrong_usage():
        return Extractor(
            DEFAULT_METHOD if method is None else method,
            noise=None if noise is None else RangeNoise(sigma=noise),
            **dict(_setting(text) for text in settings),
        )


def _setting(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise click.UsageError(f"--set {text!r}: expected NAME=VALUE")
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return name, value


@click.command()
@click.argument("logs", nargs=-1, required=True, type=PATH)
@click.option(
    "-o",
    "--output",
    required=True,
    type=PATH,
    help="File to write, .parquet or .jsonl; for several logs, a folder.",
)
@_METHOD
@_SET
@_NOISE
@TOPIC
@KEEP_GOING
@QUIET
def extract(
    logs: tuple[Path, ...],
    output: Path,
    method: str | None,
    settings: tuple[str, ...],
    noise: float | None,
    topic: str | None,
    keep_going: bool,
    quiet: bool,
) -> None:
    """Extract the features of LOGS into a table."""
    from ..extraction import extract_log, output_paths
    from ..output import ENDINGS
    from .progress import tracker

    check_ending(output, ENDINGS, or_folder=True)
    extractor, track = _extractor(method, settings, noise), tracker(quiet)
    for log, path in zip(logs, output_paths(logs, output), strict=True):
        extraction = extract_log(
            log,
            path,
            extractor,
            topic=topic,
            keep_going=keep_going,
            track=track,
        )
        if not quiet:
            click.echo(str(extraction))


@click.command()
@LOG
@TOPIC
@KEEP_GOING
@QUIET
def info(log: Path, topic: str | None, keep_going: bool, quiet: bool) -> None:
    """Tell what LOG holds."""
    from ..logs import open_log, summarize
    from .progress import tracker

    opened = open_log(log, topic=topic, keep_going=keep_going)
    scans = tracker(quiet)(opened, opened.path.name, len(opened))
    click.echo(str(summarize(opened, scans)))


@click.command()
@LOG
@SCAN
@click.option(
    "-o",
    "--output",
    required=True,
    type=PATH,
    help="Picture to write: .png, .svg or .pdf.",
)
@click.option(
    "-m",
    "--method",
    "methods",
    multiple=True,
    help="Name of the method; may be given again, side by side.  [default: optimal]",
)
@_SET
@_NOISE
@click.option("--trace", is_flag=True, help="Draw the stages of the (first) method instead.")
@TOPIC
@KEEP_GOING
def plot(
    log: Path,
    index: int,
    output: Path,
    methods: tuple[str, ...],
    settings: tuple[str, ...],
    noise: float | None,
    trace: bool,
    topic: str | None,
    keep_going: bool,
) -> None:
    """Draw a scan of LOG and what is found in it."""
    from ..logs import open_log
    from ..methods import DEFAULT_METHOD
    from ..output.canvas import PICTURE_ENDINGS
    from ..output.figures import plot_scan, plot_trace

    check_ending(output, PICTURE_ENDINGS)
    names = methods or (DEFAULT_METHOD,)
    extractors = {name: _extractor(name, settings, noise) for name in names}
    scan = open_log(log, topic=topic, keep_going=keep_going).scan(index)
    if trace:
        plot_trace(extractors[names[0]].trace(scan), output)
    else:
        plot_scan(scan, {name: extractor(scan) for name, extractor in extractors.items()}, output)


@click.command()
@click.option(
    "-m",
    "--method",
    "methods",
    multiple=True,
    help="Name of the method; may be given again.  [default: optimal]",
)
@QUIET
def warmup(methods: tuple[str, ...], quiet: bool) -> None:
    """Compile and cache the kernels of a method."""
    from ..warmup import warm_up

    with wrong_usage():
        seconds = warm_up(methods)
    if not quiet:
        click.echo(f"kernels ready after {seconds:.2f} s")


@click.command()
@click.argument("log", required=False, type=PATH)
@click.option(
    "-o",
    "--output",
    type=PATH,
    default=Path("demo"),
    show_default=True,
    help="Folder to write to.",
)
@QUIET
def demo(log: Path | None, output: Path, quiet: bool) -> None:
    """Make a page of a simulated drive, or of LOG."""
    from ..demo import run_demo
    from .progress import tracker

    facts = run_demo(output, log, track=tracker(quiet))
    if not quiet:
        width = max(len(name) for name, _ in facts)
        click.echo("\n".join(f"{name:<{width}}  {value}" for name, value in facts))


_ALL = (extract, info, plot, demo, warmup, compare, reproduce, bench, simulate)
COMMANDS = {command.name: command for command in _ALL if command.name}
