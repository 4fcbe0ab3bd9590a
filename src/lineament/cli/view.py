"""The command that opens a log in the browser."""

from pathlib import Path
from typing import Any

import click

from .options import LOG, NOISE, SET, make_extractor, methods_option, reading


@click.command()
@LOG
@methods_option("A method to choose from; may be given again.  [default: all; with --set, optimal]")
@SET
@NOISE
@reading
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, help="Port.  [default: any that is free]"
)
@click.option("--no-browser", is_flag=True, help="Print the address, and open no browser.")
def view(
    log: Path | str,
    methods: tuple[str, ...],
    settings: tuple[str, ...],
    noise: float | None,
    reading: dict[str, Any],
    host: str,
    port: int,
    no_browser: bool,
) -> None:
    """Look at LOG in the browser: scans, features, and why a segment is missing."""
    from ..methods import DEFAULT_METHOD, method_names
    from ..view import Session, serve

    names = methods or ((DEFAULT_METHOD,) if settings else method_names())
    extractors = {name: make_extractor(name, settings, noise) for name in names}
    session = Session(log, extractors, **reading)
    serve(session, host, port, browser=not no_browser, write=click.echo)
