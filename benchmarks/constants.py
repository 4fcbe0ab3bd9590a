"""What each constant and each rule of method `optimal` is worth, as a Markdown table.

Run: python benchmarks/constants.py [-o TABLE]. The constants are compiled in, so that each row has
a process of its own, with its own cache of compiled kernels; all see the same scans.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import pickle
import pkgutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

# Compiled kernels have their constants as they were.
os.environ["LINEAMENT_JIT"] = "1"

import numpy as np
from constants_sample import figures, measure, resampled, take_sample
from recordings import DATA

from lineament import Extractor
from lineament.features.records import SLIT
from lineament.kernels import helper, inlined, optimal
from lineament.kernels.optimal.meeting import NO_CORNER
from lineament.methods.optimal import Optimal
from lineament.simulation import SENSORS

#: Rounds of the bootstrap; a difference counts beyond so many of its errors.
ROUNDS, ERRORS = 60, 2.0


@dataclass(frozen=True)
class Variant:
    """A row: constants of the kernels, parameters of the method, and functions of the kernels."""

    name: str
    constants: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    replaced: Callable[[Mapping[str, Any]], None] | None = None

    def extractor(self) -> Extractor:
        """Change the modules of the kernels, before anything is compiled, and make the method."""
        modules = {
            name: importlib.import_module(f"{optimal.__name__}.{name}")
            for _, name, _ in pkgutil.iter_modules(optimal.__path__)
        }
        for name, value in self.constants.items():
            holders = [module for module in modules.values() if hasattr(module, name)]
            if not holders:
                raise AttributeError(f"no kernel has {name}")
            for module in holders:
                setattr(module, name, value)
        if self.replaced is not None:
            self.replaced(modules)
        return Extractor("optimal", **self.parameters)


def variants() -> Iterator[Variant]:
    """All rows: the method as it is, its constants halved and doubled, its rules left out."""
    yield Variant("as it is")
    constants = importlib.import_module(f"{optimal.__name__}.constants")
    for name in (
        *("TAU", "CLUTTER", "LEAST", "SIGMAS", "STEEPEST", "BEND", "RARE"),
        *("REACH", "MOST_DEVIATION", "ARC_RADIUS", "ARC_TURN"),
    ):
        value = getattr(constants, name)
        for how, factor in (("÷ 2", 0.5), ("× 2", 2.0)):
            changed = type(value)(factor * value)
            if name == "BEND":
                changed = math.cos(factor * math.acos(value))
            yield Variant(f"`{name}` {how}", {name: changed})
    method = Optimal()
    for name in ("evidence", "max_missing"):
        value = getattr(method, name)
        for how, factor in (("÷ 2", 0.5), ("× 2", 2.0)):
            yield Variant(f"`{name}` {how}", {}, {name: type(value)(factor * value)})
    yield Variant("no merging of bends", {"BEND": 2.0})
    yield Variant("no arcs", {"ARC_RADIUS": 0.0})
    yield Variant("borders not softened", replaced=_keep_borders)
    yield Variant("no growth of noise", replaced=_no_growth)
    yield Variant("noise taken as white", {"TOGETHER": 10**6})
    yield Variant("spikes kept", replaced=_keep_spikes)
    yield Variant("no corners over slits", replaced=_no_slits)
    yield Variant("no faces joined", replaced=_no_faces)
    yield Variant("no edges", replaced=_no_edges)


#: Rules that have no neutral value, and can only be changed in the code.
LEFT_OUT = (
    "a hole parts two lines; a full circle without a break is opened anew; an arc goes on beyond "
    "its lines; what is far off a line does not count in its fit"
)


def _keep_borders(modules: Mapping[str, Any]) -> None:
    @inlined
    def soften_borders(*_):  # type: ignore[no-untyped-def]
        return

    modules["fits"].soften_borders = soften_borders


def _no_growth(modules: Mapping[str, Any]) -> None:
    real = modules["extraction"].fit_noise

    @helper
    def fit_noise(points, beam, count, row, spare):  # type: ignore[no-untyped-def]
        constant, _, uncertainty, square = real(points, beam, count, row, spare)
        return constant, 0.0, uncertainty, square

    modules["extraction"].fit_noise = fit_noise


def _keep_spikes(modules: Mapping[str, Any]) -> None:
    real = modules["clustering"]._is_broken

    @inlined
    def is_broken(work, i, j, n, most_missing):  # type: ignore[no-untyped-def]
        return j - i == 2 or real(work, i, j, n, most_missing)

    modules["clustering"]._is_broken = is_broken


def _no_slits(modules: Mapping[str, Any]) -> None:
    real = modules["joining"].meet

    @inlined
    def meet(work, scan, k, m):  # type: ignore[no-untyped-def]
        joined, kind = real(work, scan, k, m)
        return joined, np.int64(NO_CORNER) if kind == SLIT else kind

    modules["joining"].meet = meet


def _no_faces(modules: Mapping[str, Any]) -> None:
    @helper
    def is_face(*_):  # type: ignore[no-untyped-def]
        return False

    modules["meeting"]._is_face = is_face


def _no_edges(modules: Mapping[str, Any]) -> None:
    @helper
    def add_edge(*_):  # type: ignore[no-untyped-def]
        return

    modules["joining"]._add_edge = add_edge


def work(name: str, sample_file: Path) -> None:
    """Measure one row, and write its figures and those of the bootstrap as JSON."""
    variant = next(variant for variant in variants() if variant.name == name)
    sample = pickle.loads(sample_file.read_bytes())  # It is of the process that started this one.
    parts = measure(variant.extractor(), sample)
    rounds = [figures(resampled(parts, np.random.default_rng(r))) for r in range(ROUNDS)]
    json.dump({"figures": figures(parts), "rounds": rounds}, sys.stdout)


def run(name: str, sample_file: Path) -> dict[str, Any] | None:
    """Measure a row in its own process; None where that fails."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, __file__, "--work", name, "--sample", str(sample_file)],
            env={**os.environ, "NUMBA_CACHE_DIR": cache},
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode:
        print(f"{name} failed: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return None
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def table(results: Mapping[str, dict[str, Any] | None], about: str) -> str:
    """Make the table; bold is what differs from the first row by more than twice its error."""
    first = next(iter(results.values()))
    if first is None:
        return "The method as it is could not be measured."
    columns = list(first["figures"])
    lines = [("", *columns), ("---", *("--:" for _ in columns))]
    for k, (name, result) in enumerate(results.items()):
        if result is None:
            lines.append((name, *("–" for _ in columns)))
            continue
        lines.append((name, *(_cell(result, first, column) for column in columns)))
        if k == 0:
            lines.append(("± of that", *(f"{_error(result, None, c):.2g}" for c in columns)))
    note = (
        f"{about} Bold: differs from the first row by more than {ERRORS:g} errors of the "
        "difference, by a bootstrap over the scans. Without a neutral value, and left out: "
        f"{LEFT_OUT}."
    )
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + f"\n\n{note}\n"


def _cell(result: dict[str, Any], first: dict[str, Any], column: str) -> str:
    value, usual = result["figures"].get(column, math.nan), first["figures"][column]
    counts = abs(value - usual) > ERRORS * _error(result, first, column)
    if result is not first and counts and _text(value) != _text(usual):
        return f"**{_text(value)}**"
    return _text(value)


def _text(value: float) -> str:
    return f"{value:.{3 - sum(abs(value) >= limit for limit in (1, 10, 100))}f}"


def _error(result: dict[str, Any], first: dict[str, Any] | None, column: str) -> float:
    """Bootstrap error of a figure, or of its difference from that of the first row."""
    values = np.array([figures[column] for figures in result["rounds"]])
    if first is not None:
        values -= np.array([figures[column] for figures in first["rounds"]])
    return float(np.nanstd(values))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, help="file for the table")
    parser.add_argument("--only", nargs="+", default=[], help="rows whose names have these in them")
    parser.add_argument("--scenes", type=int, default=8, help="of each kind, for each sensor")
    parser.add_argument("--scans", type=int, default=6, help="of each recording")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    parser.add_argument("--sample", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.work:
        work(given.work, given.sample)
        return
    with tempfile.TemporaryDirectory() as folder:
        sample = take_sample(given.scenes, given.scans, DATA)
        sample_file = Path(folder) / "sample"
        sample_file.write_bytes(pickle.dumps(sample))
        names = [variant.name for variant in variants()]
        chosen = [n for n in names[1:] if not given.only or any(word in n for word in given.only)]
        results: dict[str, dict[str, Any] | None] = {}
        for k, name in enumerate([names[0], *chosen], 1):
            started = time.perf_counter()
            results[name] = run(name, sample_file)
            took = time.perf_counter() - started
            print(f"{k}/{len(chosen) + 1} {name}: {took:.0f} s", file=sys.stderr)
    about = f"{given.scenes} scenes of each kind for {len(SENSORS)} sensors."
    if sample.recorded:
        about += f" {given.scans} scans of each of {len(sample.recorded)} recordings."
    else:
        about += f" No recordings in {DATA}: simulation alone."
    written = table(results, about)
    print(written)
    if given.output is not None:
        given.output.write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main()
