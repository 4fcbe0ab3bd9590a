"""Average repetition of `liu` for all parameters of Figure 9."""

from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.scan import LaserScan
from lineament.simulation import SCENES, SENSORS, scene, truth

from ..evaluation.counts import Counts, ratio
from ..evaluation.kinds import corner_scores
from ..evaluation.matching import match
from .findings import Progress, Setting
from .scans import batch_of, scene_numbers

#: Forms of the response: equation 22, and what else it and the text of Figure 9 may mean.
FORMS = ("tangent", "product", "relative", "chord_scaled", "product_scaled")
#: Half-widths of the filter [beams], which the paper does not state: that of `Liu`, and a wide.
HALF_WIDTHS = (2, 8)
#: The support radius [beams] and the threshold that the paper takes from its Figure 9.
RADIUS, THRESHOLD = 6, 0.66
RADII = (3, 4, 5, 6, 7, 8, 10, 12, 16)
THRESHOLDS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.66, 0.8, 1.0, 1.5)
#: A corner is found again, or is an actual one, within this distance [m].
GATE = 0.10
#: Scenes for each frame of the setting; turns of the sensor in each scene [beams].
SCENES_A_FRAME, TURNS = 2, (0.25, 0.5, 0.75)

#: What may be largest in Figure 9, by the name of the number.
CRITERIA = {
    "repetition": "AR of two views (Awrangjeb and Lu)",
    "half_sum": "½ (precision + recall) of one view",
}


class Parameters(NamedTuple):
    """What Figure 9 chooses: a reading of the paper, support radius [beams], threshold.

    A reading is a form of the response, and a half-width of the filter [beams].
    """

    response: str
    half_width: int
    support_radius: int
    threshold: float

    @property
    def reading(self) -> str:
        """Name of the reading."""
        return f"{self.response}, half-width {self.half_width}"


#: Numbers of `repetition` by parameters.
Grid = dict[Parameters, dict[str, float]]


def largest(grid: Grid, criterion: str, **fixed: object) -> Parameters:
    """Return the parameters that are best by a criterion, among those with some fields fixed."""
    among = [p for p in grid if all(getattr(p, name) == value for name, value in fixed.items())]
    return max(among, key=lambda p: grid[p][criterion])


def repetition_scenes(setting: Setting, *, reported: bool) -> range:
    """Return the seeds of this experiment's scenes, for the report or for the choice."""
    return scene_numbers(SCENES_A_FRAME * setting.frames, setting.seed, reported=reported)


def repetition_grid(setting: Setting, progress: Progress) -> Grid:
    """Measure all parameters with the paper's last steps, on scenes that are not reported."""
    numbers = repetition_scenes(setting, reported=False)
    grid = {}
    for form, half_width in product(FORMS, HALF_WIDTHS):
        progress(f"response {form}, half-width {half_width}")
        for radius, threshold in product(RADII, THRESHOLDS):
            parameters = Parameters(form, half_width, radius, threshold)
            grid[parameters] = repetition(parameters, numbers)
    return grid


@lru_cache(maxsize=8192)
def repetition(parameters: Parameters, numbers: range) -> dict[str, float]:
    """Measure some parameters with the paper's last steps, over some scenes, by `CRITERIA`.

    Each scene is seen once and then again after turns by parts of a beam, with fresh noise. AR is
    that of Awrangjeb and Lu, *Robust image corner detection based on the chord-to-point distance
    accumulation technique*, IEEE Transactions on Multimedia 2008: ½ (N_r/N_o + N_r/N_t), where of
    the N_o corners of the first view and the N_t of the second N_r are the same. It knows no
    truth. The half sum compares the second view alone with the truth. Both are means over the
    views: one without corners counts as 0, so that a single right corner in each earns little.
    """
    views = _views(numbers)
    found = batch_of(Extractor("liu:paper", **parameters._asdict()), [scan for scan, _, _ in views])
    counts, repeated, turned = [], [], []
    for (_, turn, true), features in zip(views, found, strict=True):
        if turn == 0:
            before = features
        else:
            counts.append(corner_scores(features, true).by_gate[GATE])
            repeated.append(average_repetition(before, features, turn))
            turned.append(float(len(features.corners)))
    return {
        "repetition": _mean(repeated),
        "half_sum": _mean([0.5 * (c.recall + c.precision) for c in counts if c.true]),
        "corners_per_view": _mean(turned),
        **Counts.total(counts).summary(),
    }


def average_repetition(before: Features, after: Features, turn: float) -> float:
    """Return AR of one view after a turn [rad]; 0 if only one view has corners, NaN if none has."""
    position = before.corners["position"]
    others = after.transform(0.0, 0.0, turn).corners["position"]
    distance = np.linalg.norm(position[:, np.newaxis] - others, axis=2)
    repeated = len(match(distance, distance <= GATE)[0])
    if repeated == 0:
        return ratio(0.0, len(position) + len(others))
    return 0.5 * (repeated / len(position) + repeated / len(others))


def _mean(values: list[float]) -> float:
    """Return the mean over views; a view that defines no value counts as 0."""
    return float(np.nan_to_num(values).mean()) if values else 0.0


@lru_cache(maxsize=8)
def _views(numbers: range) -> list[tuple[LaserScan, float, Features]]:
    """Simulate the view of each scene before the turn, and after the turns: scan, turn, truth."""
    sensor, kinds, views = SENSORS["paper"], list(SCENES), []
    for i, number in enumerate(numbers):
        world, (x, y, theta) = scene(kinds[i % len(kinds)], number)
        rng = np.random.default_rng([number, 9])
        for beams in (0.0, *TURNS):
            turn = beams * sensor.angle_increment
            pose = (x, y, theta + turn)
            views.append((sensor.scan(world, pose, rng), turn, truth(world, pose, sensor)))
    return views
