"""The command line: arguments only. Every command is one call of the library."""

import errno
import os
import sys
import warnings
from importlib import import_module
from importlib.metadata import EntryPoint
from typing import Any, cast

import click

from ..errors import LineamentError, LineamentWarning, NothingFoundError
from ..plugins import COMMANDS, missing, plugins
from ..progress import compiling_said
from .options import complain
from .terminating import Terminated, terminating

__all__ = ["cli", "main"]

#: What ends a write to the standard output; files are named by what writes them.
_UNWRITABLE = (errno.ENOSPC, errno.EPIPE, errno.EIO, errno.EFBIG, errno.EDQUOT, errno.EBADF)


#: Where each of our own commands is.
OWN = {
    "calibrate": "calibrate:calibrate",
    "demo": "simulating:demo",
    "extract": "extract:extract",
    "info": "commands:info",
    "live": "live:live",
    "locate": "mapping:locate",
    "map": "mapping:map_command",
    "plan": "mapping:plan",
    "merge": "merging:merge",
    "methods": "commands:methods",
    "plot": "commands:plot",
    "simulate": "simulating:simulate",
    "view": "commands:view",
    "warmup": "commands:warmup",
}


class Commands(click.Group):
    """Our own commands, and those of other packages; ours where both have a name."""

    def list_commands(self, context: click.Context) -> list[str]:  # noqa: ARG002
        """Return the names of all."""
        return sorted({*OWN, *plugins(COMMANDS)})

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        """Return the command of a name; what is missing names its package."""
        if name in OWN:
            module, _, own = OWN[name].partition(":")
            return cast(click.Command, getattr(import_module(f".{module}", __package__), own))
        if entry := plugins(COMMANDS).get(name):
            return _loaded(entry)
        if problem := missing(COMMANDS, name):
            raise click.UsageError(problem, context)
        return None


def _loaded(entry: EntryPoint) -> click.Command:
    """Load a command; one that cannot be loaded is listed with the reason, and fails with it."""
    try:
        command = entry.load()
    except Exception as error:
        return _broken(entry, f"{type(error).__name__}: {error}")
    if not isinstance(command, click.Command):
        return _broken(entry, f"it is {command!r:.60}, expected a click command")
    return command


def _broken(entry: EntryPoint, why: str) -> click.Command:
    problem = f"{entry.name} cannot be loaded from {entry.value}: {why}"

    def fail(**_: Any) -> None:
        raise LineamentError(problem)

    words = click.Argument(["words"], nargs=-1, type=click.UNPROCESSED)
    settings = {"ignore_unknown_options": True}
    return click.Command(entry.name, settings, fail, [words], help=problem)


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(package_name="lineament", message="%(package)s %(version)s")
@click.pass_context
def cli(context: click.Context) -> None:
    """Lines, corners, arcs and clusters from 2-D LiDAR scans, each with its covariance.

    Exit status: 0; 1 for an error, 2 for wrong usage, 3 if nothing was found.
    """
    if context.invoked_subcommand != "live":  # It ends by signals, as it should.
        context.with_resource(terminating())


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit with 0, 1 for an error (one line), 2 for wrong usage.

    3 if nothing was found, 130 or 143 if it is stopped, by SIGINT (Ctrl-C) or SIGTERM.
    """
    status = run(arguments)
    try:
        print(end="", flush=True)  # There may be no standard output.
    except OSError as error:
        status = status or _unwritten(None, error.strerror)
        # When Python ends it writes once more what is left: a message, and another status.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(status)


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    output = sys.stdout
    try:
        with compiling_said(complain), warnings.catch_warnings():
            _show_warnings()
            return _run(arguments)
    except (click.Abort, KeyboardInterrupt):
        return _complain("lineament: stopped", 130)
    except Terminated as stopped:
        return _complain("lineament: stopped", 128 + stopped.number)
    except OSError as error:
        if error.filename is None and error.errno not in _UNWRITABLE:
            raise
        return _unwritten(error.filename, error.strerror)
    except SystemExit:
        if sys.stdout is output:
            raise
        # It ended in a pipe that nobody reads any more: click exits, with a wrapper around it.
        return _unwritten(None, os.strerror(errno.EPIPE))


def _run(arguments: list[str] | None) -> int:
    try:
        cli.main(arguments, prog_name="lineament", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        complain(error.format_message())
        return 2
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "lineament"
        return _complain(f"{command}: {error.format_message()}", 2)
    except click.ClickException as error:
        return _complain(f"lineament: {error.format_message()}", 1)
    except LineamentError as error:
        return _complain(f"lineament: {error}", 3 if isinstance(error, NothingFoundError) else 1)
    return 0


def _show_warnings() -> None:
    """Show a warning of ours as one line, once; others as before."""
    others = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
        if issubclass(category, LineamentWarning):
            complain(f"lineament: {message}")
        else:
            others(message, category, *where)

    warnings.simplefilter("once", LineamentWarning)
    warnings.showwarning = show  # type: ignore[assignment]


def _unwritten(name: str | None, reason: str | None) -> int:
    return _complain(f"lineament: {name or 'standard output'}: {reason}", 1)


def _complain(message: str, status: int) -> int:
    complain(" ".join(message.split()))
    return status
