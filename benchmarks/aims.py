"""What method `optimal` is to reach, and what it reaches. Run: python benchmarks/aims.py.

Simulated scenes that nothing was chosen on, both recordings of the arena, the public benchmark,
and the time of a scan; `--quick` measures a tenth. A figure that misses its limit is marked.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from statistics import median

import numpy as np
from lineament_lab.evaluation.arena import ARENAS, arena_scores, load_arena
from lineament_lab.evaluation.beams import MIN_BEAMS
from lineament_lab.evaluation.ple import load_benchmark, run_benchmark
from lineament_lab.evaluation.scores import Scores, evaluate
from lineament_lab.reproduce import Setting, Table
from lineament_lab.reproduce.findings import cell_text
from lineament_lab.reproduce.scans import (
    INDOORS,
    batch_of,
    frame_times,
    interleaved_times,
    recorded_scans,
    scene_numbers,
    simulated_frames,
    time_ratio,
)
from recordings import DATA

from lineament import Extractor, Features, LaserScan, RangeNoise
from lineament.methods.optimal import Optimal
from lineament.simulation import SENSORS, Sensor

#: Method and constants were tuned on scenes of the seeds 0 and 1.
SEEDS, SCENES = range(3, 8), 120
#: Repetitions of a call, and scans of a batch for one and two threads.
CALLS, BATCH = 15, 2000

NOISY = ("noisy", "rplidar")
QUIET = tuple(name for name in SENSORS if name not in NOISY)
#: Limits of a figure, from and to.
NONE = (-math.inf, math.inf)


def most(limit: float) -> tuple[float, float]:
    return -math.inf, limit


def least(limit: float) -> tuple[float, float]:
    return limit, math.inf


#: Figures of `Scores.summary`, their limits, and the sensors that these are for.
SIMULATED = (
    ("corner F1 within 0.1 m", "corner_f1_0.10", least(0.98), SENSORS),
    ("corner RMSE ÷ bound", "corner_over_bound", most(1.1), SENSORS),
    ("its median", "corner_over_bound_median", NONE, SENSORS),
    ("corner NEES", "corner_nees", (0.9, 1.1), SENSORS),
    ("its median", "corner_nees_median", NONE, SENSORS),
    ("segment F1", "segment_f1", least(0.985), QUIET),
    ("the same with much noise", "segment_f1", least(0.95), NOISY),
    ("segments in pieces", "segment_fragmentation", most(0.02), SENSORS),
    ("line offset ÷ bound, median", "segment_offset_over_bound_median", most(1.05), SENSORS),
    ("line angle ÷ bound, median", "segment_angle_over_bound_median", most(1.05), SENSORS),
    ("segment NEES", "segment_nees", (0.9, 1.1), SENSORS),
    ("its median", "segment_nees_median", NONE, SENSORS),
    ("partition F1", "partition_region_f1", least(0.97), SENSORS),
    ("arc F1", "arc_f1", least(0.95), QUIET),
    ("the same with much noise", "arc_f1", least(0.88), NOISY),
    ("arcs that are no lines", "curved_arcs", NONE, SENSORS),
    ("arc NEES, median", "arc_nees_median", NONE, SENSORS),
)
ARENA_LIMITS = {"arena, static": (0.97, 12.0), "arena, moving": (0.95, 15.0)}

#: A figure: what it is measured on, its name, its limits, its value.
Aim = tuple[str, str, tuple[float, float], float]


def simulated(extractor: Extractor, scenes: int) -> Table:
    """Return median and range over the seeds, by sensor; * marks a median beyond its limits."""
    numbers: dict[str, list[dict[str, float]]] = {name: [] for name in SENSORS}
    for name, sensor in SENSORS.items():
        for seed in SEEDS:
            frames = list(simulated_frames(sensor, INDOORS, scene_numbers(scenes, seed)))
            truths = [frame.truth for frame in frames]
            found = batch_of(extractor, [frame.scan for frame in frames])
            curved = np.concatenate([curved_arcs(truth, sensor) for truth in truths])
            share = float(curved.mean()) if len(curved) else math.nan
            scores = Scores.total(map(evaluate, found, truths)).summary()
            numbers[name].append(scores | {"curved_arcs": share})
    rows = []
    for figure, key, limits, sensors in SIMULATED:
        cells = []
        for name, seeds in numbers.items():
            values = [of.get(key, math.nan) for of in seeds]
            middle = median(values)
            low, high = cell_text(min(values)), cell_text(max(values))
            cell = f"{cell_text(middle)}{mark(middle, limits)} ({low}–{high})"
            cells.append(cell if name in sensors else None)
        rows.append((figure, limits_text(limits), *cells))
    title = f"Simulation, {len(SEEDS)} seeds of {scenes} scans each: median (range)"
    return Table(title, ("figure", "aim", *SENSORS), tuple(rows))


def curved_arcs(truth: Features, sensor: Sensor) -> list[bool]:
    """Return whether each demanded arc differs from all lines by the evidence for a line."""
    arcs = truth.arcs[truth.arcs["n_points"] >= MIN_BEAMS]
    return [line_misfit(sensor.angles, a, sensor.noise) >= Optimal().evidence for a in arcs]


def line_misfit(angles: np.ndarray, arc: np.void, noise: RangeNoise) -> float:
    """Return χ² of the best line through noise-free measurements of an arc.

    Where it is small, no method can tell the arc from a wall. A line is 1/ρ = A cos φ + B sin φ,
    and the error of 1/ρ times ρ² is that of the range.
    """
    beams = (arc["first_beam"] + np.arange(arc["n_points"])) % len(angles)
    design = np.column_stack((np.cos(angles[beams]), np.sin(angles[beams])))
    along = design @ arc["center"]
    off_center = float(arc["center"] @ arc["center"]) - along**2
    ranges = along - np.sqrt(np.maximum(arc["radius"] ** 2 - off_center, 0.0))
    weight = ranges**2 / np.sqrt(noise.range_variance(ranges))
    left, right = weight[:, np.newaxis] * design, weight / ranges
    return float(np.square(left @ np.linalg.lstsq(left, right)[0] - right).sum())


def recorded(extractor: Extractor, setting: Setting, scans: int) -> Iterator[Aim]:
    for name, path in setting.recordings(ARENAS).items():
        figures, _ = arena_scores(load_arena(path, scans), extractor)
        recall, error = ARENA_LIMITS[name]
        yield name, "recall within 0.1 m", least(recall), figures["recall"]
        yield name, "median error [mm]", most(error), 1e3 * figures["median_error"]
        yield name, "at no listed corner", NONE, figures["false"]
    halves = {"real": "benchmark/ple_real.npz", "simulated": "benchmark/ple_sim.npz"}
    for half, path in setting.recordings(halves).items():
        benchmark = load_benchmark(path)
        means, authors = run_benchmark(benchmark, "optimal").means(), benchmark.means()
        if half == "simulated":
            yield "benchmark, simulated", "least area error", most(0.004), min(means["area_error"])
            continue
        for k, budget in enumerate(benchmark.max_vertices):
            where = f"benchmark, real, J = {budget}"
            rmse, f = (authors[score]["ple+"][k] for score in ("rmse", "f"))
            yield where, "RMSE [m]; PLE+", most(rmse), means["rmse"][k]
            yield where, "f; PLE+", least(f), means["f"][k]


def speed(extractor: Extractor, setting: Setting, count: int) -> Iterator[Aim]:
    for name in ("paper", "utm30lx"):
        scans = simulated_scans(SENSORS[name], count)
        times = interleaved_times({"": extractor, "liu": Extractor("liu")}, scans)
        kernels = np.median(times[""], axis=0)
        ratio = time_ratio(times[""], times["liu"])[0]
        calls = [median(seconds(partial(extractor, s)) for _ in range(CALLS)) for s in scans]
        worst = max(frame_times(extractor, [scan])[0] for scan in garbage(scans[0]))
        yield name, f"kernels, {len(scans[0])} beams [µs]", NONE, 1e6 * float(np.median(kernels))
        yield name, "the same ÷ liu", most(1.6), ratio
        above = 1e6 * float(np.median(np.array(calls) - kernels))
        yield name, "call, above the kernels [µs]", most(4.0), above
        yield name, "worst garbage ÷ median", most(4.0), float(worst / np.median(kernels))
        yield name, "two threads ÷ one", least(1.85), gain(extractor, scans)
    for name, scans in recorded_scans(setting, count):
        times = frame_times(extractor, scans)
        yield name, f"kernels, {len(scans[0])} beams [µs]", NONE, 1e6 * float(np.median(times))
    like, each = SENSORS["utm30lx"], {}
    for n in (500, 1000, 2000, 4000):
        step = (like.n_beams - 1) * like.angle_increment / (n - 1)
        dense = Sensor("dense", n, like.angle_min, step, 0.1, 30.0, noise=like.noise)
        each[n] = float(np.median(frame_times(extractor, simulated_scans(dense, count)))) / n
        yield "270°", f"{n} beams [ns a beam]", NONE, 1e9 * each[n]
    yield "270°", "4000 beams ÷ 500, a beam", most(1.0), each[4000] / each[500]


def simulated_scans(sensor: Sensor, count: int) -> list[LaserScan]:
    frames = simulated_frames(sensor, INDOORS, scene_numbers(count, 1))
    return [frame.scan for frame in frames]


def seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


def garbage(like: LaserScan) -> list[LaserScan]:
    """Return scans of no place: the worst input for a method, with the beams of another scan."""
    n, rng = len(like), np.random.default_rng(0)
    spike = np.full(n, 2.0)
    spike[n // 2] = 1.0
    ranges = (
        rng.uniform(0.5, 10.0, n),
        np.full(n, 2.0),
        spike,
        np.where(np.arange(n) % 2, 2.0, 5.0),
        rng.choice((2.0, 5.0), n) + rng.normal(0.0, 0.01, n),
        3.0 + np.abs(np.cumsum(rng.normal(0.0, 0.05, n))),
    )
    beams = like.angle_min, like.angle_increment
    return [LaserScan(r, *beams, range_max=like.range_max) for r in ranges]


def gain(extractor: Extractor, scans: list[LaserScan]) -> float:
    """Return how many times as fast two threads are, timed in turns."""
    rows = np.stack([scan.ranges for scan in scans])
    batch = partial(
        extractor.batch,
        np.tile(rows, (-(-BATCH // len(rows)), 1)),
        angle_min=scans[0].angle_min,
        angle_increment=scans[0].angle_increment,
        range_max=scans[0].range_max,
    )
    pairs = [[seconds(partial(batch, workers=n)) for n in (1, 2)] for _ in range(CALLS)]
    one, two = np.median(pairs, axis=0)
    return float(one / two)


def limits_text(limits: tuple[float, float]) -> str:
    low, high = limits
    if limits == NONE:
        return "–"
    if math.isinf(low):
        return f"≤ {cell_text(high)}"
    return f"≥ {cell_text(low)}" if math.isinf(high) else f"{low}–{high}"


def mark(value: float, limits: tuple[float, float]) -> str:
    """Return a star if a value misses its limits."""
    return "" if limits == NONE or limits[0] <= value <= limits[1] else "*"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    part = 10 if parser.parse_args().quick else 1
    extractor, setting = Extractor("optimal"), Setting(data=DATA)
    table = simulated(extractor, SCENES // part)
    print(f"{table.title}\n{table}\n")
    for title, aims in (
        ("Recordings", recorded(extractor, setting, 350 // part)),
        ("Speed, one thread", speed(extractor, setting, 30 // part)),
    ):
        rows = ((w, f, limits_text(a), f"{cell_text(v)}{mark(v, a)}") for w, f, a, v in aims)
        print(f"{title}\n{Table(title, ('on', 'figure', 'aim', 'reached'), tuple(rows))}\n")


if __name__ == "__main__":
    main()
