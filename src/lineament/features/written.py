"""Features and noises as kernels write them."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from ..scan import LaserScan, NoiseLike, RangeNoise
from ..scan.fields import nanoseconds
from .records import TABLES

#: The number of each part of what is written, and its type.
_PARTS: dict[str, tuple[int, np.dtype[Any]]] = {
    name: (k, dtype) for k, (name, dtype) in enumerate(TABLES.items())
}
_PARTS |= {
    "clusters": (len(TABLES), np.dtype(np.int32)),
    "noise": (len(TABLES) + 1, np.dtype("f8")),
}


class LazyFields:
    """Makes its tables, clusters and noise when they are first asked for.

    A scan's features are made in a fraction of the time that all their fields take, and of these
    few are read.
    """

    __slots__ = ("_written",)

    #: Tables, clusters and the row of the noise, as bytes.
    _written: list[bytes]
    stamp: float
    frame_id: str
    scan: LaserScan | None

    @property
    def stamp_ns(self) -> int:
        """The stamp in nanoseconds [ns], exactly as the scan has it."""
        scan = self.scan
        if scan is not None and scan.stamp == self.stamp:
            return scan.stamp_ns
        return nanoseconds(self.stamp)

    @classmethod
    def as_written(cls, written: list[bytes], noise: RangeNoise | None, scan: LaserScan) -> Self:
        """Take what is written, and the noise where it is given."""
        features: Any = cls.__new__(cls)
        features._written, features.scan = written, scan
        features.stamp, features.frame_id = scan.stamp, scan.frame_id
        if noise is not None:
            features.noise = noise
        return cast("Self", features)

    if not TYPE_CHECKING:  # To which any name would then be a field.

        def __getattr__(self, name: str) -> Any:
            if name not in _PARTS:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            k, dtype = _PARTS[name]
            value = np.frombuffer(self._written[k], dtype)
            if name == "noise":
                value = noise_of(value)
            setattr(self, name, value)
            return value

    def raw(self, name: str) -> bytes:
        """Return the bytes of a table, or of the clusters, of which no array need be made."""
        k, dtype = _PARTS[name]
        try:
            made = object.__getattribute__(self, name)
        except AttributeError:
            return self._written[k]
        return np.asarray(made, dtype).tobytes()

    def counts(self) -> dict[str, int]:
        """Return how many features there are, by table.

        Examples
        --------
        >>> import lineament as ln
        >>> ln.extract(ln.LaserScan([2.0] * 5, -0.02, 0.01)).counts()
        {'segments': 1, 'corners': 0, 'edges': 0, 'arcs': 0, 'breakpoints': 2}
        """
        return {name: len(self.raw(name)) // dtype.itemsize for name, dtype in TABLES.items()}

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
