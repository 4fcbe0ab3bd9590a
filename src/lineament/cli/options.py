"""Options and arguments that several commands share."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["KEEP_GOING", "LOG", "QUIET", "TOPIC"]

LOG = click.argument("log", type=click.Path(path_type=Path))
TOPIC = click.option("--topic", help="Which scans of the log.  [default: the format's own choice]")
KEEP_GOING = click.option(
    "--keep-going", is_flag=True, help="Leave out what is faulty in a log, and count it."
)
QUIET = click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
