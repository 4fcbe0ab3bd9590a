"""The command that writes the features of logs into tables."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import LineamentError
from .options import (
    LOG_PATH,
    QUIET,
    TEXT_PATH,
    WORLD,
    check_ending,
    check_world,
    complain,
    extracting,
    reading,
)

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from ..extractor import Extractor

_COUNT = click.IntRange(min=1)


@click.command()
@click.argument("logs", nargs=-1, required=True, type=LOG_PATH)
@click.option(
    "-o",
    "--output",
    required=True,
    type=TEXT_PATH,
    help="File to write, its format by its ending; or a folder, FOLDER/, for a file a log.",
)
@extracting
@reading
@click.option(
    "--format", metavar="ENDING", help="Format of the files in a folder.  [default: parquet]"
)
@click.option("--resume", is_flag=True, help="Skip logs whose files in the folder are complete.")
@click.option(
    "--processes", type=_COUNT, help="Work in so many processes.  [default: one a processor]"
)
@click.option("--threads", type=_COUNT, help="Work in so many threads of one process.")
@click.option("--dask", metavar="ADDRESS", help="Work on the Dask cluster of this scheduler.")
@WORLD
@QUIET
def extract(
    logs: tuple[Path | str, ...],
    output: str,
    extractor: Extractor,
    reading: dict[str, Any],
    world: bool,
    quiet: bool,
    **bulk: Any,
) -> None:
    """Extract the features of LOGS into a table.

    LOGS are files, folders, patterns, archives or addresses. The exit status is 3 if no scan has
    a feature.
    """
    from ..output import ENDINGS

    # Not Path.is_dir, which raises where a name is too long.
    if output.endswith(("/", os.sep)) or os.path.isdir(output):  # noqa: PTH112
        _extract_into_folder(logs, output, extractor, reading, world, quiet, **bulk)
        return
    check_ending(Path(output), ENDINGS, or_folder=True)
    check_world(world, Path(output).suffix.lower())
    for name, value in bulk.items():
        if value:
            raise click.UsageError(f"--{name}: expected a folder as output, FOLDER/")
    from ..logs import find_logs
    from ..tasks.extract import check_found, extract_log
    from .progress import tracker

    found = find_logs(logs, reading["limits"])
    if len(found) > 1:
        raise LineamentError(f"{output}: is no folder, expected one for {len(found)} logs")
    extraction = extract_log(
        found[0], output, extractor, world=world, track=tracker(quiet), **reading
    )
    if not quiet:
        click.echo(str(extraction))
    check_found(extraction.log, extraction.scans, extraction.features, extractor.method)


def _extract_into_folder(
    logs: tuple[Path | str, ...],
    output: str,
    extractor: Extractor,
    reading: dict[str, Any],
    world: bool,
    quiet: bool,
    *,
    resume: bool,
    **given: Any,
) -> None:
    from ..output import ENDINGS
    from ..tasks.bulk import extract_logs
    from ..tasks.extract import check_found
    from .progress import status

    ending = f".{(given.pop('format') or 'parquet').removeprefix('.')}"
    if ending not in ENDINGS:
        raise click.UsageError(f"--format {ending}: expected one of {', '.join(ENDINGS)}")
    check_world(world, ending)
    with _executor(**given) as executor, status(quiet) as show:
        bulk = extract_logs(
            logs,
            output,
            extractor,
            executor=executor,
            ending=ending,
            resume=resume,
            world=world,
            show=show,
            **reading,
        )
    if not quiet:
        click.echo(str(bulk))
    for warning in bulk.warnings:
        complain(f"lineament: {warning}")
    if bulk.failed:
        raise LineamentError(f"{bulk.failed} of {bulk.logs} logs failed, see {bulk.manifest}")
    if not bulk.whole:  # Else what was found in those is not counted again.
        check_found(output, bulk.scans, bulk.features, extractor.method)


def _executor(
    processes: int | None, threads: int | None, dask: str | None
) -> AbstractContextManager[Executor]:
    from ..tasks.bulk import Processes, Threads, dask_executor

    if sum(value is not None for value in (processes, threads, dask)) > 1:
        raise click.UsageError("expected one of --processes, --threads and --dask")
    if dask is not None:
        return dask_executor(dask)
    return Processes(processes) if threads is None else Threads(threads)
