"""Noise of the recordings' scanners, and the prior that follows, as Markdown.

Run: LINEAMENT_DATA=FOLDER python benchmarks/scanner_noise.py. The constants of `kernels/noise.py`
are chosen on every second log; the others show what they are worth.
"""

import math
from itertools import islice
from pathlib import Path

import numpy as np
from recordings import DATA

from lineament.kernels.noise import SPREAD, TYPICAL_SIGMA
from lineament.logs import open_log
from lineament.methods.stages import estimate_noise

#: One log of each scanner and place, of several scans.
LOGS = (
    "carmen/acapulco-corrected.log.gz", "carmen/aces-corrected.log.gz",
    "carmen/csail-corrected.log.gz", "carmen/intel-corrected.log.gz", "graph/killian.g2o.zip",
    "rosbag1/scans_demo.bag", "rosbag1/corridor_alternating_beams.bag",
    "rosbag1/demo_stationary_simple_environment.bag", "rosbag1/jackal_mocap.bag",
    "rosbag1/urg_handheld_v2_old.bag", "rosbag1/urg_v1_2.bag", "rosbag2/ld19",
    "rosbag2/two_publishers", "text/dpslam_loop5.log.gz", "text/tinyslam_exp1.dat.gz",
    "truth/fr079_graph.npz", "truth/obstdet_front_scan.npz",
)  # fmt: skip
#: Every so many scans of the first ones, and how many of these are read.
STRIDE, FIRST = 30, 3000


def sigma_of(path: Path) -> float:
    """Median over scans of the deviation of a range in the middle of all of the scan [m]."""
    found = []
    for scan in islice(open_log(path), 0, FIRST, STRIDE):
        noise = estimate_noise(scan)
        if noise is not None:
            middle = float(np.median(scan.ranges[scan.valid]))
            found.append(math.sqrt(noise.range_variance(middle)))
    return float(np.median(found))


def main() -> None:
    """Print the noise of each log, and what each half says."""
    sigmas = np.array([sigma_of(DATA / name) for name in LOGS])
    print("| log | σ [mm] | chooses |\n|---|---|---|")
    for k, (name, sigma) in enumerate(zip(LOGS, sigmas, strict=True)):
        print(f"| {name} | {1000 * sigma:.2f} | {'yes' if k % 2 else ''} |")
    for title, half in (("chooses", sigmas[1::2]), ("reported", sigmas[::2])):
        spread = np.log(half**2).var(ddof=1)
        # The mean of a log-normal variance.
        mean = math.exp(0.5 * (np.log(half**2).mean() + 0.5 * spread))
        nees = (half**2).mean() / TYPICAL_SIGMA**2
        print(f"\n{title}: spread {spread:.1f} (is {SPREAD}), root of the mean variance "
              f"{1000 * mean:.1f} mm (is {1000 * TYPICAL_SIGMA:.0f}), NEES where nothing is known "
              f"{nees:.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
