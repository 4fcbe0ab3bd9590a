"""The command line: arguments only. Every command is one call of the library."""

import sys

import click

from ..errors import LineamentError
from ..progress import compiling_shown
from .commands import COMMANDS
from .progress import show_compiling

__all__ = ["cli", "main"]


@click.group(
    commands=COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(package_name="lineament", message="%(package)s %(version)s")
def cli() -> None:
    """Lines, corners, arcs and clusters from 2-D LiDAR scans, each with its covariance."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit with 0, 1 for an error (one line), 2 for wrong usage."""
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    try:
        with compiling_shown(show_compiling):
            cli.main(arguments, prog_name="lineament", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "lineament"
        return _complain(f"{command}: {error.format_message()}", 2)
    except click.ClickException as error:
        return _complain(f"lineament: {error.format_message()}", 1)
    except LineamentError as error:
        return _complain(f"lineament: {error}", 1)
    except (click.Abort, KeyboardInterrupt):
        return _complain("lineament: stopped", 130)
    except BrokenPipeError:
        # The reader of our output has seen enough, as `head` does.
        sys.stdout = None
        return 0
    return 0


def _complain(message: str, status: int) -> int:
    click.echo(" ".join(message.split()), err=True)
    return status
