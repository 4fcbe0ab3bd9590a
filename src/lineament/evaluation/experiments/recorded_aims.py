"""What a method is to reach on recordings and on the public benchmark, and what it reaches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...extractor import Extractor
from ...features import Features
from ..beams import MIN_BEAMS
from ..ple import load_benchmark, run_benchmark
from ..repeatability import Repeats
from .aims import TOLD, Aim, Limits
from .arena import FLAT, arena_scores, load_arena
from .contenders import feature_methods
from .findings import Progress, Setting
from .repeatability import LOGS, repeats_of, scan_pairs

__all__ = ["clear_corners", "recorded_aims"]

#: Both recordings of the arena, by name.
ARENAS = {
    "arena, static": "truth/jackal_static_data.npz",
    "arena, moving": "truth/jackal_mocap_02171554.npz",
}
#: Best recall of the C++ systems on the static set, measured elsewhere.
_PEERS = 0.833
#: Both halves of the public benchmark, and the authors' best method.
REAL, SIMULATED = "benchmark/ple_real.npz", "benchmark/ple_sim.npz"
_AUTHORS_BEST = "ple+"
#: Scans of the arena and pairs of scans of a log for each frame of the setting.
SCANS_A_FRAME, PAIRS_A_FRAME = 35, 12


def recorded_aims(method: str, setting: Setting, progress: Progress) -> list[Aim]:
    """Measure a method on those recordings that are there."""
    aims = []
    for name, file in ARENAS.items():
        if (path := setting.recording(file)) is not None:
            progress(name)
            aims += _arena_aims(name, method, path, SCANS_A_FRAME * setting.frames)
    logs = {name: setting.recording(file) for name, file in LOGS.items()}
    extractors = feature_methods(setting, progress) if any(logs.values()) else {}
    for name, path in logs.items():
        if path is not None:
            progress(f"{name}: all methods")
            pairs = scan_pairs(path, PAIRS_A_FRAME * setting.frames)
            for kind, demanded in (("", lambda found: found), ("clear ", clear_corners)):
                repeats = {m: repeats_of(pairs, e, demanded).corners for m, e in extractors.items()}
                aims += _repeat_aims(name, kind, method, repeats)
    for file, aims_of in ((REAL, _real_benchmark_aims), (SIMULATED, _simulated_benchmark_aims)):
        if (path := setting.recording(file)) is not None:
            progress(f"public benchmark: {path.name}")
            aims += aims_of(method, path)
    return aims


def _arena_aims(name: str, method: str, path: Path, scans: int) -> list[Aim]:
    figures = arena_scores(load_arena(path, scans), Extractor(method)).summary()
    at_rest = name == "arena, static"
    error = Limits(high=12.0) if at_rest else TOLD
    return [
        Aim(name, "recall within 0.1 m; peers", Limits(low=_PEERS), figures["recall"]),
        Aim(name, "median error [mm]", error, 1e3 * figures["median_error"]),
        Aim(name, "on no listed corner", Limits(high=0.1), figures["false"]),
        Aim(name, "the same of sharp corners", Limits(high=0.1), figures["sharp_false"]),
    ]


def clear_corners(features: Features) -> Features:
    """Keep the corners that are well seen: both sides of 6 beams or more, and no flat opening.

    A method that cuts a wall at every other reading repeats many of its corners wherever they are.
    """
    sides = np.append(features.segments["n_points"] >= MIN_BEAMS, False)
    corners = features.corners
    clear = sides[corners["segments"]].all(axis=1) & (corners["opening"] < FLAT)
    return replace(features, corners=corners[clear])


def _repeat_aims(name: str, kind: str, method: str, repeats: Mapping[str, Repeats]) -> list[Aim]:
    mine = repeats[method]
    others = {m: r for m, r in repeats.items() if m != method}
    most = max(others, key=lambda m: others[m].repeated)
    # The rate of a handful of corners tells nothing.
    several = {m: r for m, r in others.items() if 2 * r.repeated >= mine.repeated} or others
    highest = max(several, key=lambda m: several[m].rate)
    return [
        Aim(
            name,
            f"{kind}corners repeated; best other {most}",
            Limits(low=others[most].repeated),
            mine.repeated,
        ),
        Aim(
            name,
            f"{kind}corner repeatability; best other {highest}",
            Limits(low=others[highest].rate),
            mine.rate,
        ),
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
