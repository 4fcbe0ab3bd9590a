"""Options and arguments that several commands share, and what they make."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..progress import compiling_said
from .types import LogPlace, Place, Within

if TYPE_CHECKING:
    from ..extractor import Extractor

F = TypeVar("F", bound=Callable[..., Any])
_Command = Callable[..., None]


PATH, TEXT_PATH = Place(path_type=Path), Place(path_type=str)
LOG_PATH = LogPlace(path_type=Path)
LOG = click.argument("log", type=LOG_PATH)
SCAN = click.option("--scan", "index", type=int, default=0, help="Index of the scan, from 0.")


def _turned_into(convert: Callable[[Any], Any]) -> Callable[[Any, Any, Any], Any]:
    """Return the callback of an option whose value a function of it alone converts."""
    return lambda _context, _option, given: convert(given)


def _one_topic(given: tuple[str, ...]) -> str | None:
    if len(given) > 1:
        raise click.UsageError(f"--topic: expected one, not {' and '.join(given)}")
    return given[0] if given else None


TOPIC = click.option(
    "--topic",
    multiple=True,
    callback=_turned_into(_one_topic),
    help="Which scans of the log.  [default: the format's own choice]",
)
SEED = click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
KEEP_GOING = click.option(
    "--keep-going", is_flag=True, help="Skip and count faulty lines and records."
)
_ECHO = click.option(
    "--echo",
    type=click.Choice(["first", "last", "strongest"]),
    default="first",
    show_default=True,
    help="Which return of a beam that has several.",
)
_RING = click.option("--ring", type=click.IntRange(min=0), help="Ring of a point cloud to read.")
SCALE_HELP = "Factor on ranges and their limits: 0.001 where they are in millimetres."
SCALE = click.option("--scale", type=float, default=1.0, show_default=True, help=SCALE_HELP)
LASER_POSE = click.option(
    "--laser-pose",
    type=float,
    nargs=3,
    metavar="X Y THETA",
    help="Pose of the laser on the robot, that poses are of [m, m, rad].",
)


def _sectors(given: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    from ..scan.changes import checked_mask

    with wrong_usage():
        return checked_mask(given)


MASK = click.option(
    "--mask",
    type=float,
    nargs=2,
    multiple=True,
    metavar="FROM TO",
    callback=_turned_into(_sectors),
    help="Leave out the beams from one bearing counter-clockwise to another [rad], such as those "
    "that see the robot itself; may be given again.",
)


def _mountings(given: tuple[str, ...]) -> dict[str, tuple[float, float, float]]:
    found = {}
    for topic, value in _pairs(given).items():
        try:
            x, y, degrees = map(float, value.split(","))
        except ValueError:
            raise click.UsageError(
                f"--mounting {topic}={value}: expected {topic}=X,Y,DEGREES"
            ) from None
        found[topic] = x, y, math.radians(degrees)
    return found


_MOUNTINGS = click.option(
    "--mounting",
    "mountings",
    multiple=True,
    metavar="TOPIC=X,Y,DEGREES",
    callback=_turned_into(_mountings),
    help="Where the scanner of a topic is on the robot [m, m, °]; may be given again."
    "  [default: as in /tf_static]",
)
_UNSURE = click.option(
    "--unsure",
    type=Within(min=0),
    nargs=2,
    metavar="METRES DEGREES",
    callback=_turned_into(lambda given: given and (given[0], math.radians(given[1]))),
    help="How well mountings are known, a standard deviation.  [default: 0.01 0.5]",
)
BASE_FRAME = click.option(
    "--base-frame", default="base_link", show_default=True, help="Frame of the robot in the log."
)


def mountings(command: F) -> F:
    """Add the options of several scanners on one robot."""
    return _MOUNTINGS(_UNSURE(command))


def on_robot(command: F) -> F:
    """Add the options of where scanners are on a robot."""
    return _MOUNTINGS(BASE_FRAME(command))


UNIT = click.Choice(["m", "dm", "cm", "mm", "ft", "in"])
_UNITS = click.option(
    "--units", type=UNIT, help="Of the DXF.  [default: those that it names, or m]"
)
_LAYERS = click.option(
    "--layers",
    metavar="NAMES",
    callback=_turned_into(lambda names: names.split(",") if names else None),
    help="Layers of the DXF that hold walls, by commas; * is anything.  [default: *wall*, or all]",
)


def of_plan(command: F) -> F:
    """Add the options of how a plan is read that is a DXF: `layers` and `units`."""
    return _LAYERS(_UNITS(command))


_POSES = click.option("--poses", "pose_topic", metavar="TOPIC", help="Topic of the poses.")


def _limits(given: tuple[str, ...]) -> dict[str, int] | None:
    from ..limits import Limits

    found: dict[str, Any] = dict(_pairs(given))
    found |= {name: int(n) for name, n in found.items() if re.fullmatch(r"\d+(_\d+)*", n)}
    with wrong_usage():  # of what is no number, too
        Limits.of(found)
    return found or None


LIMITS = click.option(
    "--limit",
    "limits",
    metavar="NAME=VALUE",
    multiple=True,
    callback=_turned_into(_limits),
    help="Another limit of what is read, such as beams=200000; may be given again.",
)


def complain(message: str, *, nl: bool = True) -> None:
    """Write on standard error; nobody there to read it is no reason to end anything."""
    with suppress(OSError, ValueError):
        click.echo(message, nl=nl, err=True)


def _hush(context: click.Context, parameter: click.Parameter, quiet: bool) -> bool:  # noqa: ARG001
    if quiet:
        context.with_resource(compiling_said(None))
    return quiet


_QUIET: dict[str, Any] = {"is_flag": True, "callback": _hush, "help": "Print errors only."}
QUIET = click.option("-q", "--quiet", **_QUIET)
#: For commands that print nothing else than what is compiled.
HUSH = click.option("-q", "--quiet", expose_value=False, **_QUIET)


_READING = (
    "topic", "keep_going", "echo", "ring", "pose_topic", "limits", "scale", "mask", "laser_pose"
)  # fmt: skip


def _reading(poses: Any, topic: Any = TOPIC) -> Callable[[_Command], _Command]:
    def adding(command: _Command) -> _Command:
        """Add the options of a log; the command gets them as ``open_log(log, **reading)``."""

        @wraps(command)
        def collecting(**given: Any) -> None:
            from ..scan.changes import check_scale
            from ..scan.fields import checked_mounting

            with wrong_usage():
                check_scale(given["scale"])
                if given["laser_pose"] is not None:
                    checked_mounting(given["laser_pose"])
            command(reading={name: given.pop(name) for name in _READING}, **given)

        for option in (LIMITS, KEEP_GOING, SCALE, MASK, LASER_POSE, poses, _RING, _ECHO, topic):
            collecting = option(collecting)
        return collecting

    return adding


reading = _reading(_POSES)
#: The same where the poses are odometry, and others are made.
reading_odometry = _reading(
    click.option("--odometry", "pose_topic", metavar="TOPIC", help="Topic of the odometry.")
)

#: The same for scans of several topics.
reading_topics = _reading(
    _POSES,
    click.option(
        "--topic", multiple=True, help="Scans of one scanner: given once for each, two at least."
    ),
)


def check_ending(output: Path | None, endings: Iterable[str], *, or_folder: bool = False) -> None:
    """Refuse a file, if given, with another ending, before anything is computed for it."""
    if output is not None and output.suffix.lower() not in endings:
        wanted = "a folder or an ending" if or_folder else "an ending"
        raise click.UsageError(f"{output}: expected {wanted} of {', '.join(endings)}")


#: Formats that hold features alone; the others show scans at their poses.
_TABLES = (".parquet", ".csv", ".jsonl")
WORLD = click.option("--world", is_flag=True, help="Features in the frame of the poses; of tables.")


def check_world(world: bool, ending: str) -> None:
    """Refuse features in the world for a format that draws scans."""
    if world and ending not in _TABLES:
        raise click.UsageError(f"--world: expected a table, {', '.join(_TABLES)}, not {ending}")


@contextmanager
def wrong_usage() -> Iterator[None]:
    """Report a ValueError of the library about the options as wrong usage."""
    try:
        yield
    except ValueError as error:
        raise click.UsageError(str(error)) from None


_METHOD = click.option("-m", "--method", help="Name of the method.  [default: optimal]")
_SET = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the method; may be given again.",
)
_NOISE = click.option(
    "--noise",
    type=Within(min=0),
    metavar="SIGMA",
    help="Noise of the ranges [m].  [default: estimated from each scan]",
)


def of_method(command: F) -> F:
    """Add the options of a method: `method`, `settings`, `noise`."""
    return _METHOD(_SET(_NOISE(command)))


def methods_option(about: str) -> Callable[[F], F]:
    """Make the option of methods, which may be given again."""
    return click.option("-m", "--method", "methods", multiple=True, help=about)


def of_methods(about: str) -> Callable[[F], F]:
    """Add the options of several methods: `methods`, `settings`, `noise`."""
    return lambda command: methods_option(about)(_SET(_NOISE(command)))


def make_extractor(method: str | None, settings: tuple[str, ...], noise: float | None) -> Extractor:
    """Return the extractor that the options ask for."""
    from ..extractor import Extractor
    from ..methods import DEFAULT_METHOD, get_method

    name = DEFAULT_METHOD if method is None else method
    with wrong_usage():
        return Extractor(get_method(name, **settings_of(settings)), noise=noise)


def extracting(command: _Command) -> _Command:
    """Add the options of a method; the command gets the extractor that they ask for."""

    @wraps(command)
    def making(
        method: str | None, settings: tuple[str, ...], noise: float | None, **given: Any
    ) -> None:
        command(extractor=make_extractor(method, settings, noise), **given)

    return of_method(making)


def settings_of(settings: tuple[str, ...]) -> dict[str, Any]:
    """Return the parameters of a method that ``--set NAME=VALUE`` gives, by name."""
    return {name: _literal(value) for name, value in _pairs(settings).items()}


def _pairs(given: tuple[str, ...]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise click.UsageError(f"{text!r}: expected NAME=VALUE")
        if name in found:
            raise click.UsageError(f"{text!r}: {name} is given twice")
        found[name] = value
    return found


def _literal(value: str) -> Any:
    try:
        return ast.literal_eval(value)
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        return value
