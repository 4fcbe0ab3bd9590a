"""What is found in a scan: segments, corners, edges, arcs, breakpoints, clusters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._copies import ReadOnly
from .._lazy import Pictured
from ..errors import needed_by
from ..scan import LaserScan, RangeNoise
from ..scan.fields import checked_pose, covariance_of_pose
from .records import TABLES
from .written import LazyFields

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    from matplotlib.axes import Axes


class Tabled:
    """Features that become a table, with one row a feature."""

    __slots__ = ()

    def to_arrow(self, scan: int = 0) -> pa.Table:
        """Make a table with one row a feature; its schema is described in ``docs/formats.md``.

        Scans are numbered from `scan`.

        Examples
        --------
        >>> import lineament as ln
        >>> table = ln.extract([2.0] * 5, angle_min=-0.02, angle_increment=0.01).to_arrow(scan=7)
        >>> table["kind"].to_pylist(), table["scan"][0].as_py()
        (['segment', 'breakpoint', 'breakpoint', 'cluster'], 7)
        """
        raise NotImplementedError

    def to_pandas(self, scan: int = 0) -> pd.DataFrame:
        """Make `to_arrow` a data frame of pandas; a LineamentError if pandas is missing."""
        with needed_by("to_pandas"):
            import pandas  # noqa: F401
        return self.to_arrow(scan).to_pandas()

    def to_polars(self, scan: int = 0) -> pl.DataFrame:
        """Make `to_arrow` a data frame of polars; a LineamentError if polars is missing."""
        with needed_by("to_polars"):
            import polars as pl
        return pl.from_arrow(self.to_arrow(scan))


@dataclass(slots=True, eq=False, repr=False, kw_only=True)
class Features(Tabled, LazyFields, ReadOnly, Pictured):
    """All features of one scan. The arrays are read-only.

    ``len(features)`` counts the records of its five tables, ``features["corners"]`` is a table by
    name, iterating gives the names; in a notebook they are a picture.
    They are made with all fields by name.

    Attributes
    ----------
    segments, corners, edges, arcs, breakpoints : structured arrays
        One record a feature, of dtypes `SEGMENT`, `CORNER`, `EDGE`, `ARC`, `BREAKPOINT`; metres
        and radians, in the frame of the scan.
    clusters : int32 array, shape (n,)
        Cluster of each beam, -1 for none (invalid, noise).
    stamp : float
        The scan's own stamp [s].
    frame_id : str
        The scan's own frame.
    noise : RangeNoise or None
        The range noise that was used, given or estimated; its `uncertainty` says how well it is
        known. None where the scan has no valid beam.
    scan : LaserScan or None
        The scan itself, for pictures; None in a batch, in another frame, and from a file.

    Examples
    --------
    >>> import lineament as ln
    >>> ln.extract(ln.LaserScan([], angle_min=0.0, angle_increment=0.1))
    Features(0 segments, 0 corners, 0 edges, 0 arcs, 0 breakpoints, 0 clusters, stamp=0.000)
    """

    segments: NDArray[np.void]
    corners: NDArray[np.void]
    edges: NDArray[np.void]
    arcs: NDArray[np.void]
    breakpoints: NDArray[np.void]
    clusters: NDArray[np.int32]
    stamp: float = 0.0
    frame_id: str = ""
    noise: RangeNoise | None = None
    scan: LaserScan | None = None

    def __len__(self) -> int:
        return sum(len(getattr(self, name)) for name in TABLES)

    def __iter__(self) -> Iterator[str]:
        return iter(TABLES)

    def __getitem__(self, name: str) -> NDArray[np.void]:
        if name not in TABLES:
            raise KeyError(f"{name!r}, expected one of: {', '.join(TABLES)}")
        table: NDArray[np.void] = getattr(self, name)
        return table

    def __repr__(self) -> str:
        n_clusters = int(self.clusters.max(initial=-1)) + 1
        return f"Features({sizes(self)}, {n_clusters} clusters, stamp={self.stamp:.3f})"

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

        Raises
        ------
        ValueError
            If the pose is not three finite numbers, or the covariance not one of such.

        Examples
        --------
        >>> import lineament as ln
        >>> features = ln.extract(ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01))
        >>> moved = features.transform(1.0, 0.0, math.pi / 2)
        >>> moved.segments["centroid"].round(2).tolist()
        [[1.0, 2.0]]
        """
        x, y, theta = checked_pose((x, y, theta))
        c, s = math.cos(theta), math.sin(theta)
        rotation = np.array([[c, -s], [s, c]])
        shift = np.array([x, y])

        def moved(points: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray(points @ rotation.T + shift)

        tables = {name: getattr(self, name).copy() for name in TABLES}
        segments, corners, edges, arcs, breakpoints = tables.values()
        for name in ("start", "end", "centroid"):
            segments[name] = moved(segments[name])
        segments["angle"] = np.angle(np.exp(1j * (segments["angle"] + theta)))
        for points in (corners, edges):
            points["position"] = moved(points["position"])
            points["covariance"] = rotation @ points["covariance"] @ rotation.T
        with_radius = np.eye(3)
        with_radius[:2, :2] = rotation
        arcs["center"] = moved(arcs["center"])
        arcs["covariance"] = with_radius @ arcs["covariance"] @ with_radius.T
        breakpoints["position"] = moved(breakpoints["position"])
        if covariance is not None:
            _add_pose_covariance(tables, shift, covariance_of_pose(covariance))
        for table in tables.values():
            table.flags.writeable = False
        name = self.frame_id if frame_id is None else frame_id
        return replace(self, **tables, frame_id=name, scan=None)

    def plot(self, ax: Axes | None = None, *, scan: LaserScan | None = None) -> Axes:
        """Draw the features over their scan, see `lineament.plot`; returns the axes.

        `scan` is needed where the features do not have it themselves: those of a batch.
        """
        axes: Axes = self._drawing().plot(self, scan, ax=ax)
        return axes

    def to_arrow(self, scan: int = 0) -> pa.Table:  # noqa: D102 (as in the base)
        from .tables import features_table

        return features_table([self], scan)

    def to_dict(self) -> dict[str, Any]:
        """Make plain dicts, lists, numbers and strings of everything, as JSON takes them.

        What is not known, such as the quality of a corner of a method that has none, is None.

        Examples
        --------
        >>> import lineament as ln
        >>> ln.extract(ln.LaserScan([2.0, 2.0, 2.0], -0.01, 0.01)).to_dict()["clusters"]
        [0, 0, 0]
        """
        return {
            "stamp": self.stamp,
            "stamp_ns": self.stamp_ns,
            "frame_id": self.frame_id,
            "noise": None if self.noise is None else asdict(self.noise),
            **{name: _records(getattr(self, name)) for name in TABLES},
            "clusters": self.clusters.tolist(),
        }


def _add_pose_covariance(
    tables: dict[str, NDArray[np.void]],
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

    for points in (tables["corners"], tables["edges"]):
        points["covariance"] += added(jacobian(points["position"]))
    segments, arcs = tables["segments"], tables["arcs"]
    arcs["covariance"][:, :2, :2] += added(jacobian(arcs["center"]))
    # The offset of a segment is along its normal; its angle is the pose's.
    of_segment = np.zeros((len(segments), 2, 3))
    normals = np.column_stack((-np.sin(segments["angle"]), np.cos(segments["angle"])))
    of_segment[:, 0] = (normals[:, None] @ jacobian(segments["centroid"]))[:, 0]
    of_segment[:, 1, 2] = 1.0
    segments["covariance"] += added(of_segment)


def sizes(tables: Tabled) -> str:
    """Write how many records there are in each table."""
    return ", ".join(f"{len(getattr(tables, name))} {name}" for name in TABLES)


def _records(table: NDArray[np.void]) -> list[dict[str, Any]]:
    """List the records of a structured array as dicts of plain lists and numbers."""
    columns = {name: _plain(table[name]) for name in table.dtype.names or ()}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _plain(values: NDArray[Any]) -> list[Any]:
    """List numbers, None in place of those that are not finite: JSON has none such."""
    if values.dtype.kind == "f" and not (known := np.isfinite(values)).all():
        values = values.astype(object)
        values[~known] = None
    return list(values.tolist())


def checked_features(features: Any) -> Features:
    """Return features; a TypeError for anything else, as a scan."""
    if not isinstance(features, Features):
        kind = type(features).__name__
        raise TypeError(f"features is of type {kind}, expected Features: what extract returns")
    return features


def scan_of(features: Features, scan: LaserScan | None = None) -> LaserScan:
    """Return the scan that is given, or that of the features; a ValueError without one."""
    scan = checked_features(features).scan if scan is None else scan
    if scan is None:
        raise ValueError("the features have no scan, expected it as an argument")
    return scan
