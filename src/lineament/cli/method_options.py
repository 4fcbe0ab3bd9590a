"""The options that choose methods, their parameters and the noise, and what they make."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any

import click

from .options import wrong_usage

if TYPE_CHECKING:
    from ..extractor import Extractor

__all__ = ["METHOD", "METHODS", "NOISE", "SET", "make_extractor", "settings_of"]

METHOD = click.option("-m", "--method", help="Name of the method.  [default: optimal]")
METHODS = click.option(
    "-m",
    "--method",
    "methods",
    multiple=True,
    help="Name of the method; may be given again, side by side.  [default: optimal]",
)
SET = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter of the method; may be given again.",
)
NOISE = click.option(
    "--noise",
    type=click.FloatRange(min=0),
    metavar="SIGMA",
    help="Noise of the ranges [m].  [default: estimated from each scan]",
)


def make_extractor(method: str | None, settings: tuple[str, ...], noise: float | None) -> Extractor:
    """Make the extractor that the options ask for."""
    from ..extractor import Extractor
    from ..methods import DEFAULT_METHOD, get_method
    from ..scan import RangeNoise

    name = DEFAULT_METHOD if method is None else method
    with wrong_usage():
        return Extractor(
            get_method(name, **settings_of(settings)),
            noise=None if noise is None else RangeNoise(sigma=noise),
        )


def settings_of(settings: tuple[str, ...]) -> dict[str, Any]:
    """Parameters of a method by name, as ``--set NAME=VALUE`` gives them."""
    return dict(_setting(text) for text in settings)


def _setting(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise click.UsageError(f"--set {text!r}: expected NAME=VALUE")
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        return name, value
