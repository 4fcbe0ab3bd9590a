"""Scenes that are not ours: scans simulated on plans that others made, of real storeys."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lineament.mapping import LineMap
from lineament.mapping.grids import Grid
from lineament.scan import Array, LaserScan
from lineament.simulation import SENSORS, World, truth
from lineament.simulation.placing import clearance
from lineament.simulation.surfaces import View

from ..evaluation.scores import Scores
from .contenders import feature_methods
from .experiment import Experiment, Measured, MissingError, Report
from .findings import Columns, Numbers, Progress, Setting, Table
from .prose import prose
from .scans import Frame, scored, totals

#: Occupancy grids, in a folder beside that of the recordings.
PLANS = ("stata_basement", "building_31", "depot", "warehouse", "tb3_sandbox")
#: Scans in each for each frame of the setting, and how far from walls they are at least [m].
SCANS_A_FRAME, CLEAR = 4, 0.4
#: Walls bow by up to so much [m] if they are so long [m]: the arena's by 13 to 23 mm.
BOW, LONG = 0.02, 1.0
#: A person stands on each so many square metres, a round thing of this radius [m].
AREA, RADIUS = 20.0, 0.2
SENSOR = "utm30lx"
_COLUMNS: Columns = {
    "corner F1": "corner_f1_0.10",
    "least": "corner_least",
    "greatest": "corner_greatest",
    "precision": "corner_precision_0.10",
    "recall": "corner_recall_0.10",
    "median error [mm]": "corner_median_error",
    "segment F1": "segment_f1",
    "segment F1, least": "segment_least",
    "greatest segment F1": "segment_greatest",
}


def measure(setting: Setting, progress: Progress) -> Measured:
    """Score all methods on scans simulated in each of the plans."""
    folder = None if setting.data is None else setting.data / ".." / "plans"
    if folder is None or not all((folder / f"{name}.yaml").exists() for name in PLANS):
        raise MissingError("no plans")
    methods = feature_methods(setting.methods)
    by_plan: list[dict[str, Scores]] = []
    for plan in PLANS:
        progress(f"{plan}: simulating")
        frames = list(frames_on(folder / f"{plan}.yaml", SCANS_A_FRAME * setting.frames))
        by_plan.append(totals(scored(methods, frames, progress, plan)))
    over_plans = {name: _over_plans([of[name] for of in by_plan]) for name in methods}
    return Measured({"methods": over_plans})


def report(n: Numbers, setting: Setting) -> Report:
    """Make a table of all plans together."""
    title = f"{len(PLANS)} plans, {SCANS_A_FRAME * setting.frames} scans in each"
    about = prose("plans", sensor=SENSOR, area=AREA, long=LONG, bow=1e3 * BOW)
    table = Table.of_numbers(title, n["methods"], _COLUMNS, "Least and greatest: of one plan.")
    return (*about, *prose("rivals")), (table,)


def frames_on(path: Path, count: int) -> Iterator[Frame]:
    """Simulate scans at free places of a plan, among people, with walls that bow."""
    plan, grid, sensor = LineMap.read(path), Grid.read(path), SENSORS[SENSOR]
    ends = np.hstack((plan.walls["start"], plan.walls["end"]))
    rng = np.random.default_rng([len(ends), count])
    free = grid.placed(np.argwhere(grid.free)[:, ::-1].astype(np.float64) + 0.5)
    anywhere = free[rng.integers(len(free), size=round(len(free) * grid.resolution**2 / AREA))]
    people = anywhere[clearance(World(ends), anywhere) > 2.0 * RADIUS]
    world, found = World(ends, [(*person, RADIUS) for person in people]), 0
    while found < count:
        place = free[rng.integers(len(free))]
        if clearance(world, [place])[0] < CLEAR:
            continue
        pose = (float(place[0]), float(place[1]), float(rng.uniform(-math.pi, math.pi)))
        scan = sensor.scan(world, pose, rng)
        if scan.valid.sum() < len(scan) // 2:
            continue  # of a hall that the plan leaves open
        found += 1
        bowed = scan.ranges + _bows(View(world, pose, sensor), scan, rng)
        yield Frame(
            LaserScan(bowed, scan.angle_min, scan.angle_increment, range_max=scan.range_max),
            truth(world, pose, sensor),
        )


def _bows(view: View, scan: LaserScan, rng: np.random.Generator) -> Array:
    """Return what ranges are longer by, as long walls bow between their ends [m]."""
    longer = np.zeros(len(scan))
    for k, (start, end) in enumerate(view.walls):
        length = math.dist(start, end)
        on = np.flatnonzero((view.surface == k) & scan.valid)
        bow = rng.uniform(-BOW, BOW)
        if length < LONG or not len(on):
            continue
        along, beams = (end - start) / length, view.bearings[on]
        toward = np.stack((np.cos(beams), np.sin(beams)), axis=1)
        part = (view.ranges[on, None] * toward - start) @ along / length
        normal = abs(toward[:, 0] * along[1] - toward[:, 1] * along[0])
        longer[on] = 4.0 * bow * part * (1.0 - part) / np.maximum(normal, 0.1)
    return longer


def _over_plans(scores: list[Scores]) -> dict[str, Any]:
    """Return the summary of all plans, with the least and the greatest F1 of one."""
    summary = Scores.total(scores).summary()
    for kind, key in (("corner", "corner_f1_0.10"), ("segment", "segment_f1")):
        of = [one.summary().get(key, math.nan) for one in scores]
        if np.isfinite(of).all():
            summary |= {f"{kind}_least": min(of), f"{kind}_greatest": max(of)}
    return summary


EXPERIMENT = Experiment("Scenes that are not ours", measure, report, once=True)
