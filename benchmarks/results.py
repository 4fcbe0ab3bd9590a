"""Measures the tables of docs/results.md again and writes them between its marks: make results.

The stamp of the file has a hash of what its numbers follow from, `MEASURED` without comments and
docstrings: a test compares it, so that no table is older than the code. Recordings come from
LINEAMENT_DATA.
"""

import argparse
import ast
import hashlib
import math
import re
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from lineament_lab.evaluation.ple import load_benchmark, run_benchmark
from lineament_lab.evaluation.pooling import bootstrap
from lineament_lab.methods import RIVALS
from lineament_lab.reproduce import Setting, Table, run_experiments
from lineament_lab.reproduce import scans as recorded
from lineament_lab.reproduce.claims import bands, verdicts
from lineament_lab.reproduce.contenders import KEYPOINTS
from lineament_lab.reproduce.findings import Columns, cell_text, cells
from lineament_lab.reproduce.machine import machine
from lineament_lab.reproduce.real import FURTHER_LOGS
from recordings import DATA

from lineament import Extractor
from lineament.methods import METHODS
from lineament.simulation import SENSORS

ROOT = Path(__file__).parents[1]
DOCUMENTS = tuple(ROOT / name for name in ("docs/results.md", "README.md", "docs/comparison.md"))
SEEDS = range(5)
#: Kernels and methods, what simulates, bounds and moves; rivals, metrics and experiments. Those of
#: maps are measured by other benchmarks.
MEASURED = (
    *(f"src/lineament/{name}" for name in ("kernels", "methods", "simulation", "motion")),
    "src/lineament/bounds.py",
    *(f"lab/src/lineament_lab/{n}" for n in ("kernels", "methods", "evaluation", "reproduce")),
)

Rows = Iterable[Sequence[object]]


# What is measured --------------------------------------------------------------------------------


def source_hash() -> str:
    """Return a hash of the syntax of all that is measured, and by which it is measured."""
    trees = [(path.name, shape(ast.parse(path.read_text("utf-8")))) for path in measured_files()]
    return hashlib.sha256(repr(trees).encode()).hexdigest()[:16]


def measured_files() -> list[Path]:
    """Return the files that the hash is of, in order: none of maps, which no table measures."""
    places = [ROOT / name for name in MEASURED]
    inside = (place.rglob("*.py") if place.is_dir() else [place] for place in places)
    files = sorted(path for files in inside for path in files)
    return [path for path in files if "mapping" not in path.parts and path.name != "maps.py"]


def shape(node: object) -> object:
    """Return what a syntax tree means: without docstrings, places in the text, empty fields."""
    if isinstance(node, list):
        return [shape(item) for item in node if not is_text(item)]
    if isinstance(node, ast.AST):
        fields = [(name, shape(value)) for name, value in ast.iter_fields(node)]
        return type(node).__name__, [(n, v) for n, v in fields if v is not None and v != []]
    return repr(node) if node is not None else None


def is_text(node: object) -> bool:
    """Return whether a statement is a mere string: a docstring."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def stamp(seconds: float, frames: int) -> str:
    """Return commit, date, machine, versions and seeds, and the hash of what was measured."""
    git = ["git", "-C", str(ROOT)]
    commit = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    dirty = subprocess.run([*git, "status", "--porcelain", "src"], capture_output=True, text=True)
    return (
        f"Commit {commit.stdout.strip()}{' with changes' * bool(dirty.stdout.strip())}, "
        f"{datetime.now(UTC):%Y-%m-%d}, in {seconds / 60:.0f} min on {machine()}, "
        f"numba {version('numba')}, numpy {version('numpy')}. Seeds {SEEDS[0]} to {SEEDS[-1]}, "
        f"{frames} frames of each kind. "
        f"Code measured: `{source_hash()}`."
    )


# Tables ------------------------------------------------------------------------------------------


Write = Callable[[Any], str]


def markdown(columns: Sequence[str], rows: Rows, write: Write = cell_text) -> str:
    """Return a table in Markdown, compact; what is no text is written by a function."""
    cells = ([cell if isinstance(cell, str) else write(cell) for cell in row] for row in rows)
    return "\n".join(f"|{'|'.join(line)}|" for line in (columns, ["---"] * len(columns), *cells))


def of_numbers(
    first: str | tuple[str, ...],
    numbers: Mapping[Any, Mapping[Any, Any]],
    columns: Columns,
    write: Write = cell_text,
) -> str:
    """Return a table of named numbers, as `Table.of_numbers` makes it."""
    table = Table.of_numbers("", numbers, columns, first=first)
    return markdown(table.columns, table.rows, write)


def over(first: str, names: Iterable[str], groups: Iterable[Any], columns: Columns) -> str:
    """Return a table of medians over groups, with the least and the greatest."""

    def ends(values: Iterable[Any]) -> str:
        known = list(map(float, values))
        few = (statistics.median(known), min(known), max(known))
        return "{}<br>({}–{})".format(*map(cell_text, few))

    each = {name: zip(*(cells(of[name], columns) for of in groups), strict=True) for name in names}
    return markdown((first, *columns), ((name, *map(ends, of)) for name, of in each.items()))


def two_digits(value: Any) -> str:
    """Write a number, and its range over the seeds, with two digits after the point."""
    return "–" if value is None or math.isnan(value) else f"{value:.2f}"


def two_lines(interval: Any) -> str:
    """Write a number, and its interval below it."""
    return cell_text(interval).replace(" (", "<br>(")


def without_ranges(text: str) -> str:
    """Leave out the ranges of what stands beside what is judged.

    Examples
    --------
    >>> without_ranges("0.5 (0.4–0.6) m (beside it: liu 1 (0–2) m)")
    '0.5 (0.4–0.6) m (beside it: liu 1 m)'
    """
    judged, mark, beside = text.partition("(beside it: ")
    return judged + mark + re.sub(r" \([^()]*–[^()]*\)", "", beside)


class Results:
    """Runs experiments once each, with all seeds, and makes the tables of their numbers."""

    def __init__(self, frames: int) -> None:
        data = DATA if DATA.is_dir() else None
        self.setting = Setting(frames, SEEDS[0], data, seeds=len(SEEDS))
        self.found: dict[str, Any] = {}
        self.timed: dict[str, dict[str, Any]] = {}

    def findings(self, name: str) -> Any:
        """Return what an experiment found: numbers that differ by seed have their range."""
        if name not in self.found:
            print(name, file=sys.stderr, flush=True)
            self.found |= run_experiments([name], self.setting, str)
        return self.found[name]

    def numbers(self, name: str) -> Any:
        """Return all numbers of an experiment."""
        return self.findings(name).numbers

    def simulation(self, methods: Sequence[str] = ()) -> str:
        """Most methods, or some, with the paper's sensor."""
        found = self.numbers("all_methods")["paper"]
        columns = {
            "corner F1": "corner_f1_0.10",
            "error ÷ bound": "corner_over_bound_median",
            "segment F1": "segment_f1",
            "clusters right": "partition_success",
        }
        rows = {method: found[method] for method in methods or (*ON_RECORDINGS, "liu", "pdbs")}
        return of_numbers("method", rows, columns, two_digits)

    def summary(self) -> str:
        """The table of README: some methods with the paper's sensor."""
        return self.simulation(SOME)

    def sensors(self) -> str:
        """F1 of corners of some methods with each sensor, and on plans that others made."""
        found = self.numbers("all_methods")
        plans = self.numbers("plans").get("methods", {})
        keys = "corner_f1_0.10", "corner_least", "corner_greatest"
        rows = {m: {sensor: of[m].get(keys[0]) for sensor, of in found.items()} for m in SOME}
        for method in SOME if plans else ():
            ends = (plans[method][key] for key in keys)
            rows[method]["plans"] = "{:.2f} ({:.2f}–{:.2f})".format(*ends)
        columns = {sensor: sensor for sensor in found} | {"others’ plans": "plans"}
        return of_numbers("method", rows, columns, two_digits)

    def optimal(self) -> str:
        """More numbers of the default method, by sensor."""
        found = self.numbers("all_methods")
        shown = {
            "corner error ÷ bound, RMS": "corner_over_bound",
            "corner NEES, mean": "corner_nees",
            "corner NEES, median": "corner_nees_median",
            "line offset ÷ bound": "segment_offset_over_bound_median",
            "line angle ÷ bound": "segment_angle_over_bound_median",
            "segment NEES, mean": "segment_nees",
            "segment NEES, median": "segment_nees_median",
            "arc F1": "arc_f1",
        }
        rows = {
            label: {sensor: of["optimal"].get(key) for sensor, of in found.items()}
            for label, key in shown.items()
        }
        return of_numbers("optimal", rows, {sensor: sensor for sensor in found}, two_digits)

    def real(self) -> str:
        """Methods on all recordings, by measures that need no truth, with intervals."""
        found, rows = self.numbers("real"), {}
        repeats = found["repeats"]
        for method in ON_RECORDINGS:
            rows[method] = dict(found["pooled"]["all"][method])
            for name, logs in (("again", repeats), ("kept", FURTHER_LOGS)):
                counts = [repeats[log][method]["count"] for log in logs if log in repeats]
                total = bootstrap(counts, sum)
                rows[method][name] = total if total.value else None
        columns = {
            "phantom m in 100 m": "phantom_in_100m",
            "covered [%]": "covered",
            "segment NEES, still": "segments_nees",
            "corner NEES, still": "corners_nees",
            "corners repeated": "again",
            "of logs kept from the fit": "kept",
        }
        return of_numbers("method", rows, columns, two_lines)

    def keypoints(self) -> str:
        """Corners found again by those of methods and by detectors of keypoints, over the logs."""
        columns = {
            "corners a scan": "corners_per_scan",
            "repeated of the fewer [%]": "fewer_rate",
            "repeated, less chance [%]": "rate_without_edges",
        }
        return over("method", FOUND_AGAIN, self.numbers("real")["repeats"].values(), columns)

    def fits(self) -> str:
        """Errors and covariances of line fits, given the walls, over the sensors."""
        found = self.numbers("fits").values()
        columns = {
            "offset ÷ bound": "segment_offset_over_bound",
            "angle ÷ bound": "segment_angle_over_bound",
            "segment NEES": "segment_nees",
            "corner NEES": "corner_nees",
        }
        return over("fit", next(iter(found)), found, columns)

    def arena(self) -> str:
        """Corners of a real arena, at rest and moving."""
        arenas = self.numbers("real")["arena"]
        shown = {"recall": "recall", "error [mm]": "median_error"}
        columns = {f"{a}: {label}": f"{a}, {key}" for a in arenas for label, key in shown.items()}
        rows = {
            m: {f"{a}, {key}": value for a, of in arenas.items() for key, value in of[m].items()}
            for m in SOME
        }
        return of_numbers("method", rows, columns)

    def relations(self) -> str:
        """Motion against relations that people verified: up to a minute apart, and beyond."""
        rows = []
        for log, of in self.numbers("tracking").items():
            for source in MOTIONS if of["near"] else ():
                near, far = of["near"][source], of["far_apart"].get(source)
                way, turn = ([near[f"{of}_{k}"] for k in ("mean", "std")] for of in ("way", "turn"))
                rows.append(
                    (
                        *(log, source, near["motions"]),
                        "{:.0f} ± {:.0f}".format(*(1e3 * part for part in way)),
                        f"{1e3 * near['way_median']:.0f}",
                        "{:.2f} ± {:.2f}".format(*map(math.degrees, turn)),
                        f"{1e3 * far['way_median']:.0f} ({far['motions']})" if far else None,
                    )
                )
        columns = ("log", "motion from", "n", "way [mm]", "median", "turn [°]")
        return markdown((*columns, "over 60 s: way, median [mm] (n)"), rows)

    def tracking(self) -> str:
        """Motion from features and by ICP, and tracks."""
        rows = {}
        for log, of in self.numbers("tracking").items():
            for source in ("features", "ICP"):
                tracks = of["tracks"].get(source, {})
                kept = {kind: track["kept"] for kind, track in tracks.items()}
                rows[log, source] = of["motion"][source] | kept
        columns = {
            "way, median [mm]": "way_median",
            "RMSE": ("way_rmse", 1e3),
            "turn, median [mrad]": "turn_median",
            "segments kept [%]": "segments",
            "corners kept [%]": "corners",
        }
        return of_numbers(("log", "motion from"), rows, columns)

    def maps(self) -> str:
        """The public benchmark of polylines."""
        methods = "optimal", "iepf", "line_tracking"
        rows: dict[str, list[object]] = {name: [name] for name in methods}
        authors = {"ple+": "*PLE+*", "ple": "*PLE*"}
        rows |= {name: [label] for name, label in authors.items()}
        columns = ["map"]
        for half, scores in (("real", ("rmse", "f")), ("sim", ("area_error",))):
            benchmark = load_benchmark(DATA / "benchmark" / f"ple_{half}.npz")
            given = benchmark.means()
            for name in methods:
                print(f"benchmark {half}: {name}", file=sys.stderr, flush=True)
                means = run_benchmark(benchmark, name).means()
                rows[name] += [means[s][k] for s in scores for k in (0, 2, 4)]
            for name in authors:
                rows[name] += [given[s][name][k] for s in scores for k in (0, 2, 4)]
            columns += [f"{s}, J = {benchmark.max_vertices[k]}" for s in scores for k in (0, 2, 4)]
        return markdown(columns, rows.values())

    def claims(self) -> str:
        """The paper's figures and tables, what is found here, and the verdict."""
        names = "definitions", "noise", "layers", "repetition", "scenes", "similarity"
        names += "two_corners", "sensitivity", "success"
        found = {name: self.findings(name) for name in names}
        of_open = bands(found)
        rows = [
            (claim.place, claim.paper, without_ranges(here), of_open.get(claim.place), verdict)
            for name, claim, here, verdict in verdicts(found)
            if name != "definitions"
        ]
        return markdown(("", "paper", "here", "by what it leaves open", "verdict"), rows)

    def similarity(self) -> str:
        """Share of measurements that methods explain, and the error of these."""
        found = next(iter(self.numbers("similarity").values()))
        rows = {method: found[method] for method in ("the true lines", "pdbs, fitted", *SOME)}
        columns = {
            "explained [%]": "similarity_explained",
            "RMS error of these [mm]": "similarity_rms",
        }
        return of_numbers("method", rows, columns, "{:.0f}".format)

    def times(self) -> dict[str, dict[str, Any]]:
        """Time methods in turns, once: by sensor and method the rounds and scans [s]."""
        if not self.timed:
            compiled = [name for name in (*METHODS, *RIVALS) if name not in KEYPOINTS]
            methods = {name: Extractor(name) for name in compiled}
            for sensor in ("paper", "utm30lx"):
                scenes = recorded.scene_numbers(30, 0)
                frames = recorded.simulated_frames(SENSORS[sensor], recorded.INDOORS, scenes)
                scans = [frame.scan for frame in frames]
                self.timed[sensor] = recorded.interleaved_times(methods, scans)
        return self.timed

    def speed(self) -> str:
        """Times of methods in turns in one run, as ratios to that of `liu`."""
        times = self.times()
        rows: dict[str, list[object]] = {name: [name] for name in times["paper"]}
        for of in times.values():
            for name, taken in of.items():
                middle, least, most = recorded.time_ratio(taken, of["liu"])
                ratio = f"{middle:.1f} ({least:.1f}–{most:.1f})"
                rows[name] += [1e6 * float(np.median(taken)), ratio]
        columns = [f"{beams} beams{what}" for beams in (481, 1081) for what in (" [µs]", " ÷ liu")]
        return markdown(("method", *columns), rows.values())

    def ours(self) -> str:
        """What the comparison with other projects says of this one."""
        found, times = self.numbers("all_methods"), self.times()["paper"]
        arenas = self.numbers("real")["arena"] if self.setting.data else {}
        rest, moving = (arenas.get(name, {}) for name in ("arena, static", "arena, moving"))
        rows = [
            (
                name,
                1e6 * float(np.median(times[name])),
                *(two_digits(found[s][name]["corner_f1_0.10"]) for s in ("paper", "noisy")),
                *(of.get(name, {}).get("recall") for of in (rest, moving)),
                1e3 * rest[name]["median_error"] if rest else None,
            )
            for name in ("optimal", "iepf", "split_and_merge")
        ]
        columns = ("481 beams [µs]", "corner F1, σ = 1 cm", "σ = 3 cm, 2 % lost")
        arena = ("arena, recall at rest", "moving", "error [mm]")
        return markdown(("method", *columns, *arena), rows)

    def process(self) -> str:
        """What a process costs: starts and threads."""
        import speed  # beside this file

        gains = (f"{speed.speed_of_method(m, 'utm30lx')[3]:.2f}" for m in ("optimal", "liu"))
        rows = [
            ("two threads ÷ one, 1081 beams: optimal, liu", ", ".join(gains)),
            ("pure arithmetic, the same", f"{speed.gain_of_the_machine():.2f}"),
            *((name.replace("`", ""), value) for name, value in speed.start_up()),
            *speed.throughput(),
        ]
        return markdown(("what", "measured"), rows)


TABLES = (
    *("speed", "process", "maps", "relations", "tracking", "real", "keypoints", "arena"),
    *("simulation", "summary", "sensors", "optimal", "fits", "similarity", "claims", "ours"),
)
#: Methods of the shorter tables; lineament reproduce has them all.
SOME = (
    *("optimal", "liu:paper", "liu:figure9", "liu:tuned", "iepf:paper", "split_and_merge:paper"),
    *("liu’s operator, shared steps", "iepf", "split_and_merge", "blind cut, shared steps"),
)
#: Methods of the table of recordings: those, and the other rivals as published.
ON_RECORDINGS = (
    *SOME,
    *(f"{name}:paper" for name in ("line_tracking", "hough", "ransac", "region_growing", "ple")),
    "ple",
)
#: Methods of the table of keypoints.
FOUND_AGAIN = "optimal", "iepf:paper", "split_and_merge:paper", "falko:paper", "falko", "flirt"
#: What motions are from, in the table of relations.
MOTIONS = "the log’s corrected poses", "features", "ICP", "features, no odometry"
#: Tables of recordings.
RECORDED = ("maps", "relations", "tracking", "real", "keypoints", "arena")


# The document ------------------------------------------------------------------------------------


def written(text: str, tables: Mapping[str, str]) -> str:
    """Put tables between the marks of their names."""
    for name, table in tables.items():
        mark = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = mark.sub(lambda found, new=table: f"{found[1]}{new}\n{found[2]}", text)
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10, help="fewer to try it out")
    parser.add_argument("--print", nargs="+", metavar="TABLE", help="print these, write nothing")
    given = parser.parse_args()
    started, results = datetime.now(UTC), Results(given.frames)
    missing = RECORDED if results.setting.data is None else ()
    tables = {
        name: "Not measured: no recordings." if name in missing else getattr(results, name)()
        for name in given.print or TABLES
    }
    if given.print:
        print("\n\n".join(tables.values()))
        return
    tables["stamp"] = stamp((datetime.now(UTC) - started).total_seconds(), given.frames)
    for path in DOCUMENTS:
        text = path.read_text(encoding="utf-8")
        path.write_text(written(text, tables), encoding="utf-8")


if __name__ == "__main__":
    main()
