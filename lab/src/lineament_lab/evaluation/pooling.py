"""Recordings pooled: the same data once, by building, with intervals over the buildings."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from lineament.errors import LogError
from lineament.logs import open_log

from .consistency import NormalisedErrors
from .counts import ratio
from .free_space import FreeSpaceScores
from .standing import StandingScores

#: Where recordings were made, by their path in the folder. All were at hand when the constants of
#: `optimal` were chosen: nothing was chosen on any other.
BUILDINGS = {
    "carmen/acapulco-corrected.log.gz": "Acapulco",
    "carmen/aces-corrected.log.gz": "ACES",
    "carmen/csail-corrected.log.gz": "MIT CSAIL",
    "carmen/intel-corrected.log.gz": "Intel lab",
    "graph/intel-lab.log.gz": "Intel lab",
    "truth/intel_graph.npz": "Intel lab",
    "graph/killian.g2o.zip": "MIT Killian Court",
    "truth/fr079_graph.npz": "fr079",
    "mcap/scans_demo.mcap": "obstacle_detector",
    "rosbag1/scans_demo.bag": "obstacle_detector",
    "truth/obstdet_front_scan.npz": "obstacle_detector",
    "rosbag1/jackal_mocap.bag": "arena",
    "rosbag2/jackal_mocap": "arena",
    "truth/jackal_mocap_02171554.npz": "arena",
    "truth/jackal_static_data.npz": "arena",
    "rosbag1/corridor_alternating_beams.bag": "corridor",
    "rosbag1/demo_stationary_simple_environment.bag": "URG, standing",
    "rosbag1/urg_handheld_v2_old.bag": "URG, by hand",
    "rosbag1/urg_v1_2.bag": "URG, v1.2",
    "rosbag2/ld19": "LD19",
    "text/lidar01.csv": "LD19",
    "rosbag2/two_publishers": "two publishers",
    "text/csm_scans.json": "CSM",
    "text/dpslam_loop5.log.gz": "DP-SLAM",
    "text/tinyslam_exp1.dat.gz": "tinySLAM",
    "text/rplidar_kitchenette/scans_2025-09-04-16-43-09.json": "kitchenette",
    "text/rplidar_kitchenette/scans_2025-09-04-16-51-11.json": "kitchenette",
}
#: Scans are the same if their valid ranges are, in steps of so much [m]; so few say nothing.
_STEP, _FEW = 0.01, 10
#: A recording is a double if this share of its scans is in another one.
_SHARE = 0.5
#: Draws of the bootstrap, the part on either side of its interval, and the fewest groups.
_DRAWS, _TAIL, _LEAST = 1000, 0.025, 3
#: Fewest and most measurements of the features whose scatter is shown.
_ARMS = 30, 100

T = TypeVar("T")
#: What a method has of one building, by method.
OfBuilding = Mapping[str, T]


class Interval(NamedTuple):
    """A number and its 95 % interval, whose ends may be NaN: unknown."""

    value: float
    low: float
    high: float

    def __rmul__(self, factor: Any) -> "Interval":
        """Return it in another unit."""
        return Interval(*(factor * value for value in self))


def bootstrap(groups: Sequence[T], figure: Callable[[Sequence[T]], float]) -> Interval:
    """Return a figure of some groups, and how it varies when groups are drawn with replacement.

    Of fewer than three groups the interval is unknown.

    Examples
    --------
    >>> bootstrap([2.0, 2.0, 2.0], sum)
    Interval(value=6.0, low=6.0, high=6.0)
    """
    rng, n = np.random.default_rng(0), len(groups)
    draws = rng.integers(n, size=(_DRAWS if n >= _LEAST else 0, n))
    drawn = [figure([groups[i] for i in draw]) for draw in draws]
    known = [value for value in drawn if np.isfinite(value)]
    ends = np.quantile(known, [_TAIL, 1 - _TAIL]) if known else [np.nan, np.nan]
    return Interval(figure(groups), float(ends[0]), float(ends[1]))


def distinct(
    logs: Mapping[str, Path], standing: Collection[str]
) -> tuple[dict[str, Path], dict[str, str]]:
    """Leave out recordings whose scans are in others; return those that stay, and the doubles.

    A double has the name of the recording that it is part of. Of equal ones that stays which has
    poses, or whose sensor is known to be `standing`.
    """
    scans, poses = {}, {}
    for name, path in logs.items():
        found, placed = set(), False
        try:
            for scan in open_log(path, keep_going=True):
                placed |= scan.pose is not None
                if scan.valid.sum() >= _FEW:
                    steps = np.floor(scan.ranges[scan.valid] / _STEP + 1e-3)
                    found.add(hash(steps.astype(np.int32).tobytes()))
        except LogError:
            pass  # it is reported where it is measured
        scans[name], poses[name] = found, placed
    order = sorted(logs, key=lambda n: (-len(scans[n]), not poses[n], n not in standing, n))
    kept: list[str] = []
    doubles = {}
    for name in order:
        shared = {other: len(scans[name] & scans[other]) for other in kept}
        most = max(shared, key=lambda other: shared[other], default=None)
        if most is not None and shared[most] > _SHARE * len(scans[name]):
            doubles[name] = most
        else:
            kept.append(name)
    return {name: path for name, path in logs.items() if name not in doubles}, doubles


def by_building(scored: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Add up the scores of each building, or of a recording of an unknown one, by method."""
    places: dict[str, list[Mapping[str, Any]]] = {}
    for log, of in scored.items():
        places.setdefault(BUILDINGS.get(log, log), []).append(of)
    return {
        place: {m: type(logs[0][m]).total(of[m] for of in logs) for m in logs[0]}
        for place, logs in places.items()
    }


def pools(
    free: Mapping[str, Mapping[str, FreeSpaceScores]],
    standing: Mapping[str, Mapping[str, StandingScores]],
) -> dict[str, dict[str, Any]]:
    """Pool the scores of all recordings, and of those on which nothing was chosen.

    Scores are by recording, then by method; what has none is left out. See `pooled`.
    """
    of_pools = {}
    for about, known in (("all", ()), ("nothing chosen", BUILDINGS)):
        parts = ({log: of for log, of in s.items() if log not in known} for s in (free, standing))
        if rows := pooled(*map(by_building, parts)):
            of_pools[about] = rows
    return of_pools


def pooled(
    free: Mapping[str, OfBuilding[FreeSpaceScores]],
    standing: Mapping[str, OfBuilding[StandingScores]],
) -> dict[str, dict[str, Any]]:
    """Pool scores by length, measurements and pairs, with intervals over buildings, by method.

    Each number says of how many buildings it is: `buildings`, `standing_buildings`.
    """
    places, still = list(free.values()), list(standing.values())
    rows: dict[str, dict[str, Any]] = {}
    for method in places[0] if places else ():
        lengths = [(of[method].phantom, of[method].drawn) for of in places]
        points = [(of[method].covered, of[method].valid) for of in places]
        row: dict[str, Any] = {
            "buildings": len(places),
            "standing_buildings": len(still),
            "phantom_in_100m": bootstrap(lengths, lambda of: 100 * _share(of)),
            "covered": bootstrap(points, _share),
        }
        for kind in ("segments", "corners"):
            scatter = (getattr(of[method], kind) for of in still)
            errors = [of.differences.whitened[_in_bin(of.arms)] for of in scatter]
            some = [one for one in errors if len(one)]
            if some:
                row[f"{kind}_nees"] = bootstrap(some, _median_nees)
        rows[method] = row
    return rows


def _in_bin(arms: Any) -> Any:
    return (arms >= _ARMS[0]) & (arms < _ARMS[1])


def _share(parts: Iterable[tuple[float, float]]) -> float:
    part, whole = (sum(values) for values in zip(*parts, strict=True))
    return ratio(part, whole)


def _median_nees(errors: Sequence[Any]) -> float:
    return NormalisedErrors(np.concatenate(errors)).median_ratio
