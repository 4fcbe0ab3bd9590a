"""Commands that show things. Each imports what it calls when it runs: ``--help`` stays quick."""

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from .options import (
    HUSH,
    LOG,
    LOG_PATH,
    PATH,
    QUIET,
    SCAN,
    check_ending,
    make_extractor,
    methods_option,
    of_methods,
    of_plan,
    on_robot,
    reading,
    wrong_usage,
)


@click.command()
@LOG
@reading
@QUIET
def info(log: Path | str, reading: dict[str, Any], quiet: bool) -> None:
    """Print what LOG contains, or a plan: .dxf, .svg, .parquet, or the .yaml of a grid."""
    from ..tasks.plan import PLANS, describe_plan

    if Path(log).suffix.lower() in PLANS:
        context = click.get_current_context()
        for option in context.command.params:
            is_given = context.get_parameter_source(str(option.name)) is ParameterSource.COMMANDLINE
            if is_given and option.name not in ("log", "limits", "quiet"):
                raise click.UsageError(f"{option.opts[0]}: is of a log, but {log} is a plan")
        click.echo(describe_plan(log, reading["limits"]))
        return
    from ..logs import open_log, summarize
    from .progress import tracker

    opened = open_log(log, **reading)
    items = tracker(quiet)(opened.items(), Path(opened.name).name, opened)
    summary = summarize(opened, items)
    click.echo(str(summary))
    if not any(topic.ranges for topic in summary.topics):
        for _ in opened.measured():  # Raises the error that says why.
            pass


@click.command()
@LOG
@SCAN
@click.option("-o", "--output", required=True, type=PATH, help="A picture: .png, .svg or .pdf.")
@of_methods("Name of the method; may be given again, side by side.  [default: optimal]")
@click.option("--trace", is_flag=True, help="Draw the stages of the (first) method instead.")
@click.option("--dark", is_flag=True, help="Draw on black.")
@reading
@QUIET
def plot(
    log: Path | str,
    index: int,
    output: Path,
    methods: tuple[str, ...],
    settings: tuple[str, ...],
    noise: float | None,
    trace: bool,
    dark: bool,
    quiet: bool,
    reading: dict[str, Any],
) -> None:
    """Draw a scan of LOG and what is found in it."""
    from ..files import check_outputs
    from ..logs import open_log
    from ..methods import DEFAULT_METHOD
    from ..output.canvas import PICTURE_ENDINGS
    from ..output.figures import plot_scan, scan_title
    from ..output.stages import plot_trace

    check_ending(output, PICTURE_ENDINGS)
    check_outputs([output], [log])
    names = methods or (DEFAULT_METHOD,)
    extractors = {name: make_extractor(name, settings, noise) for name in names}
    opened = open_log(log, **reading)
    topic, scan = opened.item(index)
    title = scan_title(opened.name, index, scan, topic if len(opened.topics) > 1 else "")
    if trace:
        title = f"{title} · {names[0]}"
        plot_trace(extractors[names[0]].trace(scan), output, title=title, dark=dark)
    else:
        found = {name: extractor(scan) for name, extractor in extractors.items()}
        plot_scan(scan, found, output, title=title, dark=dark)
    if not quiet:
        click.echo(f"{title} -> {output}")


@click.command()
@click.argument("logs", nargs=-1, required=True, type=LOG_PATH)
@of_methods("A method to choose from; may be given again.  [default: all; with --set, optimal]")
@reading
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, help="Port.  [default: any that is free]"
)
@click.option("--map", "plan", type=PATH, help="A plan on which the logs are located.")
@of_plan
@on_robot
@click.option("--no-browser", is_flag=True, help="Print the address, and open no browser.")
@HUSH
def view(
    logs: tuple[Path | str, ...],
    methods: tuple[str, ...],
    settings: tuple[str, ...],
    noise: float | None,
    reading: dict[str, Any],
    host: str,
    port: int,
    plan: Path | None,
    mountings: dict[str, tuple[float, float, float]],
    base_frame: str,
    no_browser: bool,
    **drawing: Any,
) -> None:
    """Look at LOGS in the browser: scans, features, and why a segment is missing.

    LOGS are files, folders, patterns, archives or addresses; the page has a list of them.
    Scanners of one log are shown over each other, where it is known how they are mounted.
    """
    from ..methods import DEFAULT_METHOD, method_names
    from ..view import Session, serve

    names = methods or ((DEFAULT_METHOD,) if settings else method_names())
    extractors = {name: make_extractor(name, settings, noise) for name in names}
    for name, value in drawing.items():
        if plan is None and value is not None:
            raise click.UsageError(f"--{name}: is of the plan of --map, which is not given")
    drawn = None
    if plan is not None:
        from ..mapping import LineMap

        drawn = LineMap.read(plan, **drawing, limits=reading["limits"])
    with wrong_usage():
        session = Session(
            logs, extractors, drawn, mountings=mountings, base_frame=base_frame, **reading
        )
    serve(session, host, port, browser=not no_browser, write=click.echo)


@click.command()
@click.argument("name", default="")
def methods(name: str) -> None:
    """List the methods; or the parameters of NAME, with defaults, units and bounds."""
    from ..methods import describe

    with wrong_usage():
        click.echo(describe(name))


@click.command()
@methods_option("Name of the method; may be given again.  [default: optimal]")
@QUIET
def warmup(methods: tuple[str, ...], quiet: bool) -> None:
    """Load the kernels of a method; compile and cache them where no library fits."""
    from ..tasks.warmup import warm_up

    with wrong_usage():
        seconds = warm_up(methods)
    if not quiet:
        click.echo(f"kernels ready after {seconds:.2f} s")
