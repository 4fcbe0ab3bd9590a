"""The commands by name, each imported when it is asked for; with those of other packages."""

from importlib import import_module
from importlib.metadata import EntryPoint
from typing import Any, cast

import click

from ..errors import LineamentError
from ..plugins import COMMANDS, missing, plugins

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
