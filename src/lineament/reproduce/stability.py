"""Whether the same corners are found again when the view turns a little (the paper's Figure 9)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..evaluation.counts import Summable, ratio, rms
from ..evaluation.kinds import vertices
from ..evaluation.matching import match
from ..features import Features
from ..scan import Array, LaserScan, Pose

if TYPE_CHECKING:
    from ..simulation import Sensor, World

__all__ = ["Stability", "corner_stability", "rotation_stability"]


@dataclass(frozen=True, slots=True, eq=False)
class Stability(Summable):
    """Corners found again in turned views.

    Attributes
    ----------
    reference : int
        N_o, corners found in the reference view, once for each view that is compared with it.
    turned : int
        N_t, corners found in the turned views.
    distances : ndarray, shape (N_r,)
        Distance between the two positions of each corner that was found in both [m].
    """

    reference: int = 0
    turned: int = 0
    distances: Array = field(default_factory=lambda: np.empty(0))

    @property
    def repeated(self) -> int:
        """N_r, corners found in both."""
        return len(self.distances)

    @property
    def average_repetition(self) -> float:
        """AR = ½ (N_r / N_o + N_r / N_t); 0 where one of the two views has no corner."""
        if self.repeated == 0:
            return ratio(0.0, self.reference + self.turned)
        return 0.5 * (self.repeated / self.reference + self.repeated / self.turned)

    @property
    def localisation_error(self) -> float:
        """LE, root of the mean squared distance of the repeated corners [m]."""
        return rms(self.distances)


def rotation_stability(
    extract: Callable[[LaserScan], Features],
    world: World,
    pose: Pose,
    sensor: Sensor,
    rotations: Iterable[float],
    seeds: Iterable[int],
    *,
    gate: float = 0.10,
) -> Stability:
    """Find the corners of a view again after the sensor has turned by less than a beam.

    Every scan has fresh noise. Corners of the turned view are moved back into the frame of the
    reference view and matched one to one by distance. AR and LE are those of Awrangjeb and Lu,
    *Robust image corner detection based on the chord-to-point distance accumulation technique*,
    IEEE Transactions on Multimedia 2008, over all views together.

    Parameters
    ----------
    extract : callable
        Features of a scan: an `Extractor`, for example.
    world : World
        What there is to see.
    pose : (x, y, theta)
        Pose of the reference view [m, m, rad].
    sensor : Sensor
        The scanner.
    rotations : iterable of float
        Turns to compare with it [rad].
    seeds : iterable of int
        One reference view and all its turned views for each.
    gate : float
        Largest distance of a corner that is found again [m].

    Returns
    -------
    Stability

    Raises
    ------
    ValueError
        If the gate is not more than 0.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> turns = np.radians([0.1, 0.2])
    >>> stability = rotation_stability(
    ...     ln.Extractor("liu:scale_free"), room(), (0, 0, 0), SENSORS["paper"], turns, [1]
    ... )
    >>> stability.reference, stability.turned, stability.average_repetition
    (4, 4, 1.0)
    """
    x, y, theta = pose
    turns = tuple(float(turn) for turn in rotations)
    results = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        reference = extract(sensor.scan(world, pose, rng))
        for turn in turns:
            view = extract(sensor.scan(world, (x, y, theta + turn), rng))
            results.append(corner_stability(reference, view, turn, gate=gate))
    return Stability.total(results)


def corner_stability(
    reference: Features, turned: Features, turn: float, *, gate: float = 0.10
) -> Stability:
    """Compare the corners of one turned view with those of the reference view.

    Parameters
    ----------
    reference, turned : Features
        What was found in both, each in its own frame.
    turn : float
        By how much the sensor had turned [rad].
    gate : float
        Largest distance of a corner that is found again [m].

    Returns
    -------
    Stability

    Raises
    ------
    ValueError
        If the gate is not more than 0.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> scan = SENSORS["paper"].scan(room(), (0, 0, 0), np.random.default_rng(1))
    >>> found = ln.extract(scan, method="liu:scale_free")
    >>> corner_stability(found, found.transform(0, 0, -0.1), 0.1).average_repetition
    1.0
    """
    if not gate > 0:
        raise ValueError(f"gate is {gate}, expected a distance > 0")
    position = vertices(reference)["position"]
    others = vertices(turned.transform(0.0, 0.0, turn))["position"]
    difference = position[:, np.newaxis] - others
    distance = np.hypot(difference[..., 0], difference[..., 1])
    repeated = distance[match(distance, distance <= gate)]
    return Stability(len(position), len(others), repeated)
