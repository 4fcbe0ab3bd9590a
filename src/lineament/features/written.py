"""Features and noises as kernels write them."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from ..scan import LaserScan, NoiseLike, RangeNoise
from .records import TABLES

#: The number of each table in the order in which they are written, and its type.
_TABLES = {name: (k, dtype) for k, (name, dtype) in enumerate(TABLES.items())}


class LazyFields:
    """Makes its tables, clusters and noise when they are first asked for.

    A scan's features are made in a fraction of the time that all their fields take, and of these
    few are read.
    """

    __slots__ = ("_written",)

    #: Tables and clusters as bytes, and the row of the noise.
    _written: tuple[list[bytes], bytes, NDArray[np.float64]]

    @classmethod
    def as_written(
        cls,
        tables: list[bytes],
        clusters: bytes,
        row: NDArray[np.float64],
        noise: RangeNoise | None,
        scan: LaserScan,
    ) -> Self:
        """Take the bytes of the tables in their order, and the noise, given or as its row."""
        features: Any = cls.__new__(cls)
        features._written = tables, clusters, row
        features.scan, features.stamp, features.frame_id = scan, scan.stamp, scan.frame_id
        if noise is not None:
            features.noise = noise
        return cast("Self", features)

    if not TYPE_CHECKING:  # To which any name would then be a field.

        def __getattr__(self, name: str) -> Any:
            if name in _TABLES:
                k, dtype = _TABLES[name]
                value = np.frombuffer(self._written[0][k], dtype)
            elif name == "clusters":
                value = np.frombuffer(self._written[1], np.int32)
            elif name == "noise":
                value = noise_of(self._written[2])
            else:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            setattr(self, name, value)
            return value

    def __getstate__(self) -> tuple[None, dict[str, Any]]:
        """Return all fields, made."""
        state: Any = super().__getstate__()
        return None, {name: value for name, value in state[1].items() if name != "_written"}


def noise_row(noise: NoiseLike | None) -> NDArray[np.float64]:
    """Write the parts of a noise as the kernels take them, NaN where it is not given."""
    if noise is None:
        return np.full(5, np.nan)
    return np.array(astuple(RangeNoise.of(noise)))


def noise_of(row: NDArray[np.float64]) -> RangeNoise | None:
    """Name the parts of a noise; None if they are NaN (no valid beam to estimate from)."""
    parts = row.tolist()
    return None if math.isnan(parts[0]) else RangeNoise(*parts)
