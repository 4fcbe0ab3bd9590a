"""What several test files share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the recordings, which are not part of the project."""
    default = Path(__file__).parents[1] / ".." / "shared" / "data"
    folder = Path(os.environ.get("LINEAMENT_DATA", default)).resolve()
    if not (folder / "carmen").is_dir():
        pytest.skip(f"no recordings in {folder}: set LINEAMENT_DATA to their folder")
    return folder
