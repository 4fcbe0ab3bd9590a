"""What a method is to reach on recordings and on the public benchmark, and what it reaches."""

from __future__ import annotations

from pathlib import Path

from ..evaluation.ple import load_benchmark, run_benchmark
from ..extractor import Extractor
from .aims import TOLD, Aim, Limits
from .arena import arena_scores, load_arena
from .findings import Progress, Setting

__all__ = ["recorded_aims"]

#: Both recordings of the arena, by name.
ARENAS = {
    "arena, static": "truth/jackal_static_data.npz",
    "arena, moving": "truth/jackal_mocap_02171554.npz",
}
#: Their limits of recall, and of the median error [mm].
_RECALL = {"arena, static": Limits(low=0.97), "arena, moving": Limits(low=0.95)}
_ERROR = {"arena, static": Limits(high=12.0), "arena, moving": Limits(high=15.0)}
#: Both halves of the public benchmark, and the authors' best method.
REAL, SIMULATED = "benchmark/ple_real.npz", "benchmark/ple_sim.npz"
_AUTHORS_BEST = "ple+"
#: Scans of the arena for each frame of the setting.
SCANS_A_FRAME = 35


def recorded_aims(method: str, setting: Setting, progress: Progress) -> list[Aim]:
    """Measure a method on those recordings that are there."""
    aims = []
    for name, file in ARENAS.items():
        if (path := setting.recording(file)) is not None:
            progress(name)
            aims += _arena_aims(name, method, path, SCANS_A_FRAME * setting.frames)
    for file, aims_of in ((REAL, _real_benchmark_aims), (SIMULATED, _simulated_benchmark_aims)):
        if (path := setting.recording(file)) is not None:
            progress(f"public benchmark: {path.name}")
            aims += aims_of(method, path)
    return aims


def _arena_aims(name: str, method: str, path: Path, scans: int) -> list[Aim]:
    figures = arena_scores(load_arena(path, scans), Extractor(method)).summary()
    recall, error = _RECALL.get(name, TOLD), _ERROR.get(name, TOLD)
    return [
        Aim(name, "recall within 0.1 m", recall, figures["recall"]),
        Aim(name, "median error [mm]", error, 1e3 * figures["median_error"]),
        Aim(name, "on no listed corner", TOLD, figures["false"]),
        Aim(name, "the same of sharp corners", TOLD, figures["sharp_false"]),
    ]


def _real_benchmark_aims(method: str, path: Path) -> list[Aim]:
    benchmark = load_benchmark(path)
    means, authors = run_benchmark(benchmark, method).means(), benchmark.means()
    aims = []
    for k, budget in enumerate(benchmark.max_vertices):
        rmse, f = (authors[score][_AUTHORS_BEST][k] for score in ("rmse", "f"))
        where = f"benchmark, real, J = {budget}"
        aims += [
            Aim(where, "RMSE [m]; PLE+", Limits(high=rmse), means["rmse"][k]),
            Aim(where, "f; PLE+", Limits(low=f), means["f"][k]),
        ]
    return aims


def _simulated_benchmark_aims(method: str, path: Path) -> list[Aim]:
    errors = run_benchmark(load_benchmark(path), method).means()["area_error"]
    return [Aim("benchmark, simulated", "least area error", Limits(high=0.004), min(errors))]
