"""The public benchmark of polyline extraction (PLE): its scans, its scores, and maps to score.

A. Schaefer, D. Büscher, L. Luft, W. Burgard, *A maximum likelihood approach to extract polylines
from 2-D laser range scans*, IROS 2018: real scans of seven buildings and simulated ones of random
polygons, each mapped by polylines with at most 10, 20, … 50 vertices in all.
"""

from .benchmark import Benchmark, BenchmarkResult, load_benchmark, run_benchmark
from .maps import (
    MapMaker,
    MapScore,
    cast_map,
    method_map,
    polylines_of,
    score_map,
    sparing_map,
)

__all__ = [
    "Benchmark",
    "BenchmarkResult",
    "MapMaker",
    "MapScore",
    "cast_map",
    "load_benchmark",
    "method_map",
    "polylines_of",
    "run_benchmark",
    "score_map",
    "sparing_map",
]
