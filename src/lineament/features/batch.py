"""Features of many scans, in one array a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Self, SupportsIndex, overload

import numpy as np
from numpy.typing import NDArray

from .._copies import ReadOnly, locked
from ..scan.fields import nanoseconds
from .features import Features, Tabled, sizes
from .records import TABLES
from .written import noise_of

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(slots=True, eq=False, repr=False, kw_only=True)
class FeatureBatch(Tabled, ReadOnly):
    """Features of many scans: the arrays of `Features`, one after the other, read-only too.

    ``batch[i]`` is a view of the i-th scan's features, ``batch[i:j]`` of several as a batch;
    iterating gives them in order.

    Attributes
    ----------
    segments, corners, edges, arcs, breakpoints : structured arrays
        As in `Features`; indices into a scan's segments count within that scan.
    clusters : int32 array, shape (m, n)
        Cluster of each beam of each scan.
    offsets : structured array, shape (m + 1,)
        ``offsets["segments"][i]`` is where the segments of scan i begin, and likewise for
        the other tables.
    stamps : float64 array, shape (m,)
        Stamp of each scan [s].
    noises : float64 array, shape (m, 5)
        (sigma, proportional, bearing, quantum, uncertainty) of each scan, as in `RangeNoise`; NaN
        where no beam is valid.
    frame_id : str
        Frame of all scans.

    Examples
    --------
    >>> import lineament as ln
    >>> batch = ln.Extractor("liu").batch(np.full((3, 9), 2.0), angle_min=0.0, angle_increment=0.01)
    >>> len(batch), batch.offsets["segments"].tolist(), len(batch[1].segments)
    (3, [0, 1, 2, 3], 1)
    """

    segments: NDArray[np.void]
    corners: NDArray[np.void]
    edges: NDArray[np.void]
    arcs: NDArray[np.void]
    breakpoints: NDArray[np.void]
    clusters: NDArray[np.int32]
    offsets: NDArray[np.void]
    stamps: NDArray[np.float64]
    noises: NDArray[np.float64]
    frame_id: str = ""

    def __post_init__(self) -> None:
        for field in fields(self):
            setattr(self, field.name, locked(getattr(self, field.name)))

    def __repr__(self) -> str:
        return f"FeatureBatch({len(self)} scans: {sizes(self)})"

    def __len__(self) -> int:
        return len(self.clusters)

    @overload
    def __getitem__(self, index: SupportsIndex) -> Features: ...

    @overload
    def __getitem__(self, index: slice) -> Self: ...

    def __getitem__(self, index: SupportsIndex | slice) -> Features | Self:
        if isinstance(index, slice):
            return self._part(range(len(self))[index])
        i = range(len(self))[index]
        tables = {
            name: getattr(self, name)[self.offsets[name][i] : self.offsets[name][i + 1]]
            for name in TABLES
        }
        return Features(
            **tables,
            clusters=self.clusters[i],
            stamp=float(self.stamps[i]),
            frame_id=self.frame_id,
            noise=noise_of(self.noises[i]),
        )

    def _part(self, scans: range) -> Self:
        if scans.step != 1:
            raise ValueError(f"step is {scans.step}, expected 1")
        begin, end = scans.start, max(scans.start, scans.stop)
        offsets = self.offsets[begin : end + 1].copy()
        tables = {}
        for name in TABLES:
            tables[name] = getattr(self, name)[offsets[name][0] : offsets[name][-1]]
            offsets[name] -= offsets[name][0]
        rows = {name: getattr(self, name)[begin:end] for name in ("clusters", "stamps", "noises")}
        return replace(self, **tables, **rows, offsets=offsets)

    def __iter__(self) -> Iterator[Features]:
        return (self[i] for i in range(len(self)))

    def to_arrow(self, scan: int = 0) -> pa.Table:  # noqa: D102 (as in the base)
        from .tables import table_of

        parts = {name: (getattr(self, name), np.diff(self.offsets[name])) for name in TABLES}
        m, n = self.clusters.shape
        frames = [self.frame_id] if m else []
        stamps = self.stamps, [nanoseconds(stamp) for stamp in self.stamps.tolist()]
        return table_of(parts, self.clusters.ravel(), np.full(m, n), stamps, scan, frames)
