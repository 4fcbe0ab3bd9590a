"""Average repetition AR of `liu` for every reading, support radius and threshold of Figure 9."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from ..evaluation.counts import Counts
from ..evaluation.kinds import corner_scores
from ..extractor import Extractor
from ..features import Features
from ..scan import LaserScan
from ..simulation import SCENES, SENSORS, scene, truth
from .findings import Progress, Setting
from .frames import batch_of, scene_numbers
from .stability import corner_stability

__all__ = [
    "CRITERIA",
    "RADIUS",
    "READINGS",
    "THRESHOLD",
    "Grid",
    "Parameters",
    "Repetition",
    "best_parameters",
    "largest",
    "repetition",
    "repetition_grid",
    "repetition_scenes",
]

#: The readings of equation 22.
READINGS = ("tangent", "product", "relative")
#: The support radius [beams] and the threshold that the paper takes from its Figure 9.
RADIUS, THRESHOLD = 6, 0.66
RADII = (3, 4, 5, 6, 7, 8, 10, 12, 16)
THRESHOLDS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.66, 0.8, 1.0)
#: A corner is found again, or is an actual one, within this distance [m].
GATE = 0.10
#: Scenes for each frame of the setting; turns of the sensor in each of them [beams].
SCENES_A_FRAME, TURNS = 2, (0.25, 0.5, 0.75)

#: What N_o may be in AR = ½ (N_r/N_o + N_r/N_t), by the property of `Repetition`.
CRITERIA = {
    "of_actual": "the actual corners",
    "among_found": "the corners found before the turn",
}


@dataclass(frozen=True, slots=True)
class Parameters:
    """What Figure 9 chooses: reading of the response, support radius [beams], threshold."""

    response: str
    support_radius: int
    threshold: float

    def __str__(self) -> str:
        return f"{self.response}, radius {self.support_radius}, threshold {self.threshold:g}"

    def extractor(self, method: str) -> Extractor:
        """Make an extractor with these, all other parameters as in the method or preset."""
        return Extractor(method, **asdict(self))


@dataclass(frozen=True, slots=True, eq=False)
class Repetition:
    """How well the corners of some views are found again.

    AR is the mean over the views: one without any corner counts as 0, so that it does not pay to
    find a single corner in many views.

    Attributes
    ----------
    of_actual : float
        AR with N_o the actual corners and N_r those of them that are found after a turn.
    among_found : float
        AR with N_o the corners found before the turn (Awrangjeb and Lu).
    corners_per_view : float
        Mean number of corners after a turn.
    counts : Counts
        All views after a turn against the truth.
    """

    of_actual: float
    among_found: float
    corners_per_view: float
    counts: Counts

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        figures = {name: getattr(self, name) for name in (*CRITERIA, "corners_per_view")}
        return figures | self.counts.summary()


Grid = dict[Parameters, Repetition]


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    scan: LaserScan
    turn: float
    truth: Features


def repetition_scenes(setting: Setting, *, reported: bool) -> range:
    """Seeds of the scenes of this experiment, for the report or for the choice."""
    return scene_numbers(SCENES_A_FRAME * setting.frames, setting.seed, reported=reported)


def best_parameters(setting: Setting, progress: Progress) -> Parameters:
    """Find the parameters with the largest AR of the actual corners, over all readings.

    They are found with the paper's literal pipeline, on scenes that nothing is reported of. The
    same setting is computed once in a process.
    """
    return largest(repetition_grid(setting, progress), "of_actual")


@lru_cache(maxsize=1024)
def repetition(parameters: Parameters, numbers: range) -> Repetition:
    """Measure AR of the paper's literal pipeline with some parameters, over some scenes.

    Each scene is seen once and then again after turns by parts of a beam, with fresh noise.

    Parameters
    ----------
    parameters : Parameters
    numbers : range
        Seeds of the scenes, kinds in turn, and of the noise.

    Examples
    --------
    >>> found = repetition(Parameters("relative", 6, 0.25), range(1))
    >>> found.counts.true
    9
    """
    views = _views(numbers)
    found = batch_of(parameters.extractor("liu:paper"), [view.scan for view in views])
    counts, stability = [], []
    for i, view in enumerate(views):
        if view.turn == 0:
            before = found[i]
        else:
            counts.append(corner_scores(found[i], view.truth).by_gate[GATE])
            stability.append(corner_stability(before, found[i], view.turn, gate=GATE))
    return Repetition(
        _mean([0.5 * (c.recall + c.precision) for c in counts if c.true]),
        _mean([s.average_repetition for s in stability]),
        _mean([float(s.turned) for s in stability]),
        Counts.total(counts),
    )


def _mean(values: list[float]) -> float:
    """Mean over views; what nothing defines, as nothing was found, is 0."""
    return float(np.nan_to_num(values).mean()) if values else 0.0


@lru_cache(maxsize=2)
def _views(numbers: range) -> list[_View]:
    """Of each scene the view before the turn, and those after the turns."""
    sensor, kinds, views = SENSORS["paper"], list(SCENES), []
    for i, number in enumerate(numbers):
        world, (x, y, theta) = scene(kinds[i % len(kinds)], number)
        rng = np.random.default_rng([number, 9])
        for beams in (0.0, *TURNS):
            turn = beams * sensor.angle_increment
            pose = (x, y, theta + turn)
            views.append(_View(sensor.scan(world, pose, rng), turn, truth(world, pose, sensor)))
    return views


def repetition_grid(setting: Setting, progress: Progress) -> Grid:
    """Measure AR for all readings, radii and thresholds, on scenes that nothing is reported of."""
    numbers = repetition_scenes(setting, reported=False)
    grid = {}
    for reading, radius in product(READINGS, RADII):
        progress(f"reading {reading}, support radius {radius}")
        for threshold in THRESHOLDS:
            parameters = Parameters(reading, radius, threshold)
            grid[parameters] = repetition(parameters, numbers)
    return grid


def largest(
    grid: Grid,
    criterion: str,
    reading: str = "",
    *,
    radius: int | None = None,
    threshold: float | None = None,
) -> Parameters:
    """Tell the parameters with the largest AR, of one reading, radius or threshold if given."""
    among = [
        p
        for p in grid
        if (not reading or p.response == reading)
        and radius in (None, p.support_radius)
        and threshold in (None, p.threshold)
    ]
    return max(among, key=lambda p: getattr(grid[p], criterion))
