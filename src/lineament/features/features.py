"""What is found in a scan: segments, corners, arcs, clusters, breakpoints, with covariances."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scan import RangeNoise
from ..scan.fields import covariance_of_pose
from .records import TABLES

if TYPE_CHECKING:
    import pyarrow as pa

#: What is counted: edges apart from the corners.
COUNTED = ("segments", "corners", "edges", "arcs", "breakpoints")


@dataclass(slots=True, eq=False, repr=False)
class Features:
    """All features of one scan. The arrays are read-only.

    Attributes
    ----------
    segments, corners, arcs, breakpoints : structured arrays
        One record a feature, of dtypes `SEGMENT`, `CORNER`, `ARC`, `BREAKPOINT`; metres and
        radians, in the frame of the scan.
    clusters : int32 array, shape (n,)
        Cluster of each beam, -1 for none (invalid, noise).
    stamp : float
        The scan's own stamp [s].
    frame_id : str
        The scan's own frame.
    noise : RangeNoise or None
        The range noise that was used, given or estimated; None where the scan has no valid beam.

    Examples
    --------
    >>> import lineament as ln
    >>> ln.extract(ln.LaserScan([], angle_min=0.0, angle_increment=0.1))
    Features(0 segments, 0 corners, 0 arcs, 0 breakpoints, 0 clusters, stamp=0.000)
    """

    segments: NDArray[np.void]
    corners: NDArray[np.void]
    arcs: NDArray[np.void]
    clusters: NDArray[np.int32]
    breakpoints: NDArray[np.void]
    stamp: float = 0.0
    frame_id: str = ""
    noise: RangeNoise | None = None

    def __repr__(self) -> str:
        n_clusters = int(self.clusters.max(initial=-1)) + 1
        return f"Features({_sizes(self)}, {n_clusters} clusters, stamp={self.stamp:.3f})"

    def counts(self) -> dict[str, int]:
        """Return how many features there are, by the names of `COUNTED`.

        Examples
        --------
        >>> import lineament as ln
        >>> ln.extract(ln.LaserScan([2.0] * 5, -0.02, 0.01)).counts()
        {'segments': 1, 'corners': 0, 'edges': 0, 'arcs': 0, 'breakpoints': 2}
        """
        edges = int(np.count_nonzero(self.corners["kind"] == "edge"))
        corners = len(self.corners) - edges
        found = len(self.segments), corners, edges, len(self.arcs), len(self.breakpoints)
        return dict(zip(COUNTED, found, strict=True))

    def transform(
        self,
        x: float,
        y: float,
        theta: float,
        covariance: ArrayLike | None = None,
        *,
        frame_id: str | None = None,
    ) -> Features:
        """Move the features by a pose: p ↦ R(θ) p + (x, y), and their covariances with them.

        The covariance of a segment is in its own frame and stays as it is, but for that of the
        pose, which is propagated to first order: a turn moves what is far away the most.

        Parameters
        ----------
        x, y, theta : float
            Translation [m], and rotation counter-clockwise [rad].
        covariance : array_like, shape (3, 3), optional
            Of the pose [m, m, rad], independent of the features. Its part in the errors is the same
            for all features of the scan.
        frame_id : str, optional
            Name of the new frame; by default the old one stays.

        Examples
        --------
        >>> import lineament as ln
        >>> features = ln.extract(ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01))
        >>> moved = features.transform(1.0, 0.0, math.pi / 2)
        >>> moved.segments["centroid"].round(2).tolist()
        [[1.0, 2.0]]
        """
        c, s = math.cos(theta), math.sin(theta)
        rotation = np.array([[c, -s], [s, c]])
        shift = np.array([x, y])

        def moved(points: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(points @ rotation.T + shift)

        tables = {name: getattr(self, name).copy() for name in TABLES}
        segments, corners, arcs, breakpoints = tables.values()
        for name in ("start", "end", "centroid"):
            segments[name] = moved(segments[name])
        segments["angle"] = np.angle(np.exp(1j * (segments["angle"] + theta)))
        corners["position"] = moved(corners["position"])
        corners["covariance"] = rotation @ corners["covariance"] @ rotation.T
        with_radius = np.eye(3)
        with_radius[:2, :2] = rotation
        arcs["center"] = moved(arcs["center"])
        arcs["covariance"] = with_radius @ arcs["covariance"] @ with_radius.T
        breakpoints["position"] = moved(breakpoints["position"])
        if covariance is not None:
            _add_pose_covariance(segments, corners, arcs, shift, covariance_of_pose(covariance))
        for table in tables.values():
            table.flags.writeable = False
        return replace(self, **tables, frame_id=self.frame_id if frame_id is None else frame_id)

    def to_arrow(self) -> pa.Table:
        """Make a table with one row a feature; its schema is described in ``docs/formats.md``.

        Examples
        --------
        >>> import lineament as ln
        >>> ln.extract(ln.LaserScan([2.0] * 5, -0.02, 0.01)).to_arrow()["kind"].to_pylist()
        ['segment', 'breakpoint', 'breakpoint', 'cluster']
        """
        from .tables import features_table

        return features_table([self])

    def to_dict(self) -> dict[str, Any]:
        """Make plain dicts, lists, numbers and strings of everything, as JSON takes them.

        Examples
        --------
        >>> import lineament as ln
        >>> ln.extract(ln.LaserScan([2.0, 2.0, 2.0], -0.01, 0.01)).to_dict()["clusters"]
        [0, 0, 0]
        """
        return {
            "stamp": self.stamp,
            "frame_id": self.frame_id,
            "noise": None if self.noise is None else asdict(self.noise),
            **{name: _records(getattr(self, name)) for name in TABLES},
            "clusters": self.clusters.tolist(),
        }


@dataclass(slots=True, eq=False, repr=False)
class FeatureBatch:
    """Features of many scans: the arrays of `Features`, one after the other.

    ``batch[i]`` is a view of the i-th scan's features; iterating gives them in order.

    Attributes
    ----------
    segments, corners, arcs, breakpoints : structured arrays
        As in `Features`; indices into a scan's segments count within that scan.
    clusters : int32 array, shape (m, n)
        Cluster of each beam of each scan.
    offsets : structured array, shape (m + 1,)
        ``offsets["segments"][i]`` is where the segments of scan i begin, and likewise for
        "corners", "arcs" and "breakpoints".
    stamps : float64 array, shape (m,)
        Stamp of each scan [s].
    noises : float64 array, shape (m, 4)
        (sigma, proportional, bearing, quantum) used for each scan; NaN where no beam is valid.
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
    arcs: NDArray[np.void]
    clusters: NDArray[np.int32]
    breakpoints: NDArray[np.void]
    offsets: NDArray[np.void]
    stamps: NDArray[np.float64]
    noises: NDArray[np.float64]
    frame_id: str = ""

    def __repr__(self) -> str:
        return f"FeatureBatch({len(self)} scans: {_sizes(self)})"

    def __len__(self) -> int:
        return len(self.clusters)

    def __getitem__(self, index: int) -> Features:
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

    def __iter__(self) -> Iterator[Features]:
        return (self[i] for i in range(len(self)))

    def to_arrow(self) -> pa.Table:
        """Make a table with one row a feature; its schema is described in ``docs/formats.md``."""
        from .tables import batch_table

        return batch_table(self)


def noise_row(noise: RangeNoise | None) -> NDArray[np.float64]:
    """(sigma, proportional, bearing, quantum) as the kernels take them, NaN where not given."""
    if noise is None:
        return np.full(4, np.nan)
    return np.array([noise.sigma, noise.proportional, noise.bearing, noise.quantum])


def noise_of(row: NDArray[np.float64]) -> RangeNoise | None:
    """Name the four parts of a noise; None if they are NaN (no valid beam to estimate from)."""
    parts = row.tolist()
    return None if math.isnan(parts[0]) else RangeNoise(*parts)


def _add_pose_covariance(
    segments: NDArray[np.void],
    corners: NDArray[np.void],
    arcs: NDArray[np.void],
    shift: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> None:
    """Add J P Jᵀ to the covariances of features that were moved by a pose with the covariance P.

    A point q from the pose moves with (x, y) and, as the pose turns, at right angles to q.
    """

    def jacobian(places: NDArray[np.float64]) -> NDArray[np.float64]:
        turning = (places - shift)[:, ::-1] * (-1.0, 1.0)
        straight = np.broadcast_to(np.eye(2), (len(places), 2, 2))
        return np.concatenate((straight, turning[..., None]), axis=2)

    def added(of_pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(of_pose @ covariance @ of_pose.transpose(0, 2, 1))

    corners["covariance"] += added(jacobian(corners["position"]))
    arcs["covariance"][:, :2, :2] += added(jacobian(arcs["center"]))
    # The offset of a segment is along its normal; its angle is the pose's.
    of_segment = np.zeros((len(segments), 2, 3))
    normals = np.column_stack((-np.sin(segments["angle"]), np.cos(segments["angle"])))
    of_segment[:, 0] = (normals[:, None] @ jacobian(segments["centroid"]))[:, 0]
    of_segment[:, 1, 2] = 1.0
    segments["covariance"] += added(of_segment)


def _sizes(tables: Features | FeatureBatch) -> str:
    return ", ".join(f"{len(getattr(tables, name))} {name}" for name in TABLES)


def _records(table: NDArray[np.void]) -> list[dict[str, Any]]:
    """List the records of a structured array as dicts of plain lists and numbers."""
    columns = {name: table[name].tolist() for name in table.dtype.names or ()}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
