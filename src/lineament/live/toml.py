"""The configuration of a live node in a TOML file."""

import os
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..errors import LineamentError
from ..limits import LIMITS
from .config import LiveConfig


def read_config(path: str | os.PathLike[str]) -> dict[str, Any]:
    r"""Read a `LiveConfig` from a TOML file: a flat table, ``[parameters]`` and ``[limits]``.

    Raises
    ------
    LineamentError
        If the file cannot be read, is not TOML, is longer than a line of a log may be, or has an
        unknown key.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "live.toml")
    >>> _ = path.write_text('topic = "/front/scan"\n[parameters]\nevidence = 12\n')
    >>> read_config(path)
    {'topic': '/front/scan', 'parameters': {'evidence': 12}}
    """
    try:
        with Path(path).open("rb") as file:
            data = file.read(LIMITS.line + 1)
        if len(data) > LIMITS.line:
            raise ValueError(f"it has more than {LIMITS.line} bytes")
        found = tomllib.loads(data.decode())
    except OSError as error:
        raise LineamentError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise LineamentError(f"{path}: is not TOML: {error}") from None
    known = [parameter.name for parameter in fields(LiveConfig)]
    for name in found:
        if name not in known:
            raise LineamentError(f"{path}: has {name!r}, expected one of {', '.join(known)}")
    return {k: tuple(value) if isinstance(value, list) else value for k, value in found.items()}
