"""Time of the default method by the number of beams, over scans that are hard to part.

Run: python benchmarks/sizes.py. Figures of docs/optimal.md.
"""

import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from hostile import hard_scans

import lineament as ln

SIZES = (181, 361, 541, 1081, 2160, 4320, 8640)


def microseconds(extractor: ln.Extractor, scan: ln.LaserScan) -> float:
    """Least time of a call in a tenth of a second."""
    extractor(scan)
    least, end = float("inf"), time.perf_counter() + 0.1
    while time.perf_counter() < end:
        started = time.perf_counter()
        extractor(scan)
        least = min(least, time.perf_counter() - started)
    return 1e6 * least


def main() -> None:
    extractor = ln.Extractor()
    print("| beams | median [µs] | worst [µs] | which | median of a beam [ns] |")
    print("|---|---|---|---|---|")
    for n in SIZES:
        took = {name: microseconds(extractor, scan) for name, scan in hard_scans(n).items()}
        median, worst = statistics.median(took.values()), max(took, key=lambda name: took[name])
        print(f"| {n:,} | {median:.0f} | {took[worst]:.0f} | {worst} | {1e3 * median / n:.0f} |")


if __name__ == "__main__":
    main()
