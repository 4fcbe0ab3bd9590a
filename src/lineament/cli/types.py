"""Types of arguments: paths, logs, and numbers within limits."""

from __future__ import annotations

import math
from typing import Any

import click


class Place(click.Path):
    """A path; none is meant by an empty one, which is what a variable that is not set gives."""

    def convert(self, value: Any, parameter: Any, context: Any) -> Any:  # noqa: D102
        if not value:
            self.fail("is empty, expected a path", parameter, context)
        return super().convert(value, parameter, context)


class Within(click.FloatRange):
    """A number within limits; NaN, which no limit excludes, is refused."""

    def convert(self, value: Any, parameter: Any, context: Any) -> Any:  # noqa: D102
        number = super().convert(value, parameter, context)
        if math.isnan(number):
            self.fail(f"{value} is not a number", parameter, context)
        return number


class LogPlace(Place):
    """A log: a path, or an address such as s3://bucket/key."""

    def convert(self, value: Any, parameter: Any, context: Any) -> Any:  # noqa: D102
        # As a path, the two slashes of an address would become one.
        return value if "://" in value else super().convert(value, parameter, context)
