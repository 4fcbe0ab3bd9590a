"""Options and arguments that several commands share, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

__all__ = ["KEEP_GOING", "LOG", "PATH", "QUIET", "SCAN", "TOPIC", "check_ending", "wrong_usage"]

PATH = click.Path(path_type=Path)

LOG = click.argument("log", type=PATH)
SCAN = click.option("--scan", "index", type=int, default=0, help="Index of the scan, from 0.")
TOPIC = click.option("--topic", help="Which scans of the log.  [default: the format's own choice]")
KEEP_GOING = click.option(
    "--keep-going", is_flag=True, help="Leave out what is faulty in a log, and count it."
)
QUIET = click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")


def check_ending(output: Path, endings: Iterable[str], *, or_folder: bool = False) -> None:
    """Refuse a file whose ending is not one of these, before anything is computed for it."""
    if output.suffix.lower() not in endings and not (or_folder and output.is_dir()):
        wanted = "a folder or an ending" if or_folder else "an ending"
        raise click.UsageError(f"{output}: expected {wanted} of {', '.join(endings)}")


@contextmanager
def wrong_usage() -> Iterator[None]:
    """Tell what the library finds wrong with the options, a ValueError, as wrong usage."""
    try:
        yield
    except ValueError as error:
        raise click.UsageError(str(error)) from None
