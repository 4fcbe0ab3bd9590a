"""Options and arguments that several commands share, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import click

__all__ = [
    "KEEP_GOING",
    "LOG",
    "LOG_PATH",
    "PATH",
    "QUIET",
    "SCAN",
    "TOPIC",
    "check_ending",
    "reading",
    "wrong_usage",
]

PATH = click.Path(path_type=Path)


def _log_path(text: str) -> str | Path:
    # As a path, the two slashes of an address would become one.
    return text if "://" in text else Path(text)


#: A log: a path, or an address such as s3://bucket/key.
LOG_PATH = click.types.FuncParamType(_log_path)
LOG = click.argument("log", type=LOG_PATH)
SCAN = click.option("--scan", "index", type=int, default=0, help="Index of the scan, from 0.")
TOPIC = click.option("--topic", help="Which scans of the log.  [default: the format's own choice]")
KEEP_GOING = click.option(
    "--keep-going", is_flag=True, help="Leave out what is faulty in a log, and count it."
)
_ECHO = click.option(
    "--echo",
    type=click.Choice(["first", "last", "strongest"]),
    default="first",
    show_default=True,
    help="Which return of a beam that has several.",
)
_RING = click.option("--ring", type=click.IntRange(min=0), help="Ring of a point cloud to read.")
_POSES = click.option("--poses", "pose_topic", metavar="TOPIC", help="Topic of the poses.")
QUIET = click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")


def reading(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of how a log is read, which the command gets as `reading`.

    It is what `open_log` takes: ``open_log(log, **reading)``.
    """

    @wraps(command)
    def collecting(**given: Any) -> None:
        names = ("topic", "keep_going", "echo", "ring", "pose_topic")
        command(reading={name: given.pop(name) for name in names}, **given)

    for option in (KEEP_GOING, _POSES, _RING, _ECHO, TOPIC):
        collecting = option(collecting)
    return collecting


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
