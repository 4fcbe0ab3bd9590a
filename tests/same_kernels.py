"""Whether the library and numba's JIT find the same, in every byte.

Run: python tests/same_kernels.py [--scans 1500]. Each runs in a process, for the same level of the
CPU: hostile scans by any method, a drive followed by the tracker, and its scans on a plan. What
they find is hashed by input, so that a difference is named.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "building")]


def hashed(*arrays: Any) -> str:
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()[:16]


def found(scans: int) -> dict[str, str]:
    """Hash what the kernels find, by input."""
    import numpy as np
    from fuzz_targets import Methods

    import lineament as ln
    from lineament.features import TABLES, noise_row
    from lineament.kernels import by_numba
    from lineament.mapping import LineMap, LocalMap, locate
    from lineament.mapping.drive_map import Drive
    from lineament.simulation import SENSORS, drive
    from lineament.simulation.buildings import office

    hashes = {"kernels": "numba" if by_numba else "library"}
    methods = Methods(ROOT)
    for seed in range(scans):
        method, noise, scan = methods.make(Random(seed))
        features = ln.Extractor(method, noise=noise)(scan)
        tables = [features[name] for name in TABLES]
        of_noise = noise_row(features.noise)
        hashes[f"seed {seed}, {method}"] = hashed(*tables, features.clusters, of_noise)
    extract, tracker, local, driven = ln.Extractor(), ln.Tracker(), LocalMap(), Drive()
    storey = office(3, (24.0, 16.0))
    plan = LineMap.from_lines(storey.plan.segments, side=1)
    for k, scan in enumerate(
        islice(drive(storey.world, storey.waypoints, SENSORS["utm30lx"], rate=3), 60)
    ):
        features = extract(scan)
        tracks = tracker(features)
        motion = (tracks.motion.covariance,) if tracks.motion else ()
        hashes[f"frame {k}"] = hashed(tracks.segments, tracks.corners, *motion)
        step = driven.add(scan, features)
        hashes[f"step {k}"] = hashed(np.array(step.pose), step.covariance, step.evidence)
        local.add(features, tracks)
        if k % 15 == 14:
            place = locate(local, plan)
            hashes[f"place {k}, {place.verdict}"] = hashed(np.array(place.pose), place.covariance)
    return hashes


def ran(by_numba: bool, level: str, scans: int) -> dict[str, str]:
    from compile import FEATURES

    environment = os.environ | {"LINEAMENT_JIT": str(int(by_numba))}
    environment |= {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": FEATURES[level]}
    command = [sys.executable, __file__, "--scans", str(scans), "--alone"]
    out = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    hashes: dict[str, str] = json.loads(out.stdout.splitlines()[-1])
    return hashes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=1500)
    parser.add_argument("--alone", action="store_true", help="print the hashes of this process")
    options = parser.parse_args()
    if options.alone:
        print(json.dumps(found(options.scans)))
        return 0
    from lineament.kernels.library import levels

    level = levels()[0]
    library, jit = (ran(by_numba, level, options.scans) for by_numba in (False, True))
    if (library.pop("kernels"), jit.pop("kernels")) != ("library", "numba"):
        sys.exit("there is no library of these kernels: run python building/compile.py")
    others = [name for name in library if library[name] != jit.get(name)]
    print(*others[:20], f"{len(library)} inputs, {len(others)} differ ({level})", sep="\n")
    return bool(others)


if __name__ == "__main__":
    sys.exit(main())
