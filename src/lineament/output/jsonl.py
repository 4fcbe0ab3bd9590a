"""JSON lines: one line a scan."""

from __future__ import annotations

import json
import math
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from .writer import Found, Writer

__all__ = ["JsonLinesWriter"]


class JsonLinesWriter(Writer):
    """Writes ``{"scan": i, **features.to_dict()}``, in strict JSON; ``topic`` where it is told."""

    def _open(self, temporary: Path, files: ExitStack) -> None:
        # The same bytes on every system: no "\r\n".
        self._file = files.enter_context(temporary.open("w", encoding="utf-8", newline="\n"))

    def _write(self, found: list[Found], first_scan: int) -> None:
        for i, (features, _, topic) in enumerate(found, first_scan):
            where = {"scan": i, "topic": topic} if topic else {"scan": i}
            self._file.write(_line(where | features.to_dict()))


def _line(record: dict[str, Any]) -> str:
    try:
        return json.dumps(record, allow_nan=False) + "\n"
    except ValueError:  # a number that JSON does not have
        return json.dumps(_without_nan(record), allow_nan=False) + "\n"


def _without_nan(value: Any) -> Any:
    """Put None in place of every number that is not finite."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
