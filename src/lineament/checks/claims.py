"""How a check says what broke: by an AssertionError of one line, also under ``python -O``."""

from __future__ import annotations

import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LineamentWarning, one_line, shortened
from ..scan import LaserScan

#: What is compared of a scan besides its arrays.
_OF_SCANS = (
    *("stamp_ns", "stamp_beam", "frame_id", "pose"),
    *("range_min", "range_max", "scan_time", "time_increment"),
)


def claim(holds: object, problem: str) -> None:
    """Raise an AssertionError of one line unless something holds."""
    if not holds:
        raise AssertionError(one_line(shortened(problem)))


@contextmanager
def during(doing: str) -> Iterator[None]:
    """Put what was being done before what is claimed within; whatever is raised breaks a claim.

    Examples
    --------
    >>> with during("cut"), during("one beam"):
    ...     claim(False, "nothing is found")
    Traceback (most recent call last):
    AssertionError: cut: one beam: nothing is found
    """
    try:
        yield
    except AssertionError as error:
        raise AssertionError(f"{doing}: {error}") from error
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(frame.filename).name}:{frame.lineno}"
        problem = f"{doing}: raised {type(error).__name__}: {error} ({where})"
        raise AssertionError(one_line(shortened(problem))) from error


def claim_raises(kind: type[Exception], call: Callable[[], object], doing: str) -> None:
    """Raise an AssertionError unless a call raises an error of this kind, of one line."""
    try:
        call()
    except kind as error:
        is_line = str(error) and str(error).isprintable()
        claim(is_line, f"{doing}: {kind.__name__} is not one line")
    else:
        claim(False, f"{doing} is no {kind.__name__}")


@contextmanager
def without_warnings(*, of_scans: bool = False) -> Iterator[None]:
    """Make warnings errors within; those of scans that can hardly be meant only if `of_scans`."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if not of_scans:
            warnings.simplefilter("ignore", LineamentWarning)
        yield


@contextmanager
def taking_turns() -> Iterator[None]:
    """Let threads take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def words_of(value: Any) -> object:
    """Return a value so that it can be compared; NaN is equal to NaN."""
    if isinstance(value, LaserScan):
        arrays = map(words_of, (value.ranges, value.angles, value.intensities))
        return repr([getattr(value, name) for name in _OF_SCANS]), *arrays
    if isinstance(value, np.ndarray):
        # The bytes of records would have their padding.
        words = repr(value.tolist()) if value.dtype.names else value.tobytes()
        return str(value.dtype), value.shape, words
    if isinstance(value, Iterator | list | tuple):
        return tuple(map(words_of, value))
    if isinstance(value, dict):
        return {name: words_of(one) for name, one in value.items()}
    if is_dataclass(value):
        return tuple(words_of(getattr(value, field.name)) for field in fields(value))
    return repr(value) if isinstance(value, float) else value
