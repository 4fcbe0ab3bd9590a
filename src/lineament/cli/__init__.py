"""The command line: arguments only. Every command is one call of the library."""

import errno
import os
import sys
import warnings
from typing import Any

import click

from ..errors import LineamentError, LineamentWarning, NothingFoundError
from ..progress import compiling_shown
from .finding import Commands
from .options import complain
from .progress import show_compiling
from .terminating import Terminated, terminating

__all__ = ["cli", "main"]

#: What ends a write to the standard output; files are named by what writes them.
_UNWRITABLE = (errno.ENOSPC, errno.EPIPE, errno.EIO, errno.EFBIG, errno.EDQUOT, errno.EBADF)


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
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    output = sys.stdout
    try:
        with compiling_shown(show_compiling), warnings.catch_warnings():
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
