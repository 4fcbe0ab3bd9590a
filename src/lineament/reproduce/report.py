"""The report of experiments: one page to read, and one file of all figures to compare with."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..evaluation.counts import plain
from ..evaluation.ple import BenchmarkResult
from ..files import made_folder, write_text
from ..output.page import (
    contents_part,
    heading_part,
    image_part,
    list_part,
    table_part,
    text_parts,
    write_parts,
)
from . import Findings, Setting, Table, experiment_names, run_experiments
from .findings import cell_text

__all__ = ["benchmark_tables", "findings_parts", "machine", "reproduce", "write_report"]

_INTRODUCTION = (
    "The experiments of Liu et al., Journal of Sensors 2023, article 6991467, made again, and "
    "further ones. The values of its tables and of its Figure 12 were not available: where one "
    "stands only there, the column “paper” says “lost”. Its recording, ten frames of the Deutsches "
    "Museum, is not used here: the methods are compared on simulated scans, of which all is known, "
    "and on other recordings where they are at hand.",
)


def reproduce(
    folder: str | os.PathLike[str],
    names: Iterable[str] = (),
    setting: Setting | None = None,
    progress: Callable[[str], None] = lambda about: None,  # noqa: ARG005
) -> Path:
    """Run experiments and write their report.

    Parameters
    ----------
    folder : path-like
        Where ``index.html`` and ``figures.json`` go; made if it does not exist.
    names : iterable of str
        Experiments or the paper's names of figures and tables; none asks for all.
    setting : Setting, optional
        Number of frames, seed, and where the recordings are.
    progress : callable
        Called with a few words on what is being done.

    Returns
    -------
    pathlib.Path
        The page.

    Raises
    ------
    ValueError
        If there is no such experiment.
    LineamentError
        If the folder cannot be written to.
    """
    setting = Setting() if setting is None else setting
    chosen, target = experiment_names(names), made_folder(folder)
    return write_report(target, run_experiments(chosen, setting, progress), setting)


def write_report(folder: Path, findings: Mapping[str, Findings], setting: Setting) -> Path:
    """Write ``index.html`` and ``figures.json`` of some findings; give the path of the page."""
    about = {
        "lineament": version("lineament"),
        "machine": machine(),
        "frames": setting.frames,
        "seed": setting.seed,
        "recordings": setting.data is not None,
    }
    experiments = {name: found.to_dict() for name, found in findings.items()}
    text = json.dumps({**about, "experiments": experiments}, indent=1, ensure_ascii=False)
    write_text(folder / "figures.json", text + "\n")
    facts = [(name, _fact(value)) for name, value in about.items()]
    parts = [list_part(facts), *text_parts(_INTRODUCTION)]
    parts.append(contents_part([(name, found.title) for name, found in findings.items()]))
    for name, found in findings.items():
        parts += [heading_part(name, found.title), *findings_parts(found)]
    page = folder / "index.html"
    write_parts(page, "lineament: the paper’s experiments", parts)
    return page


def findings_parts(findings: Findings) -> list[str]:
    """Text, tables and figures as parts of a page."""
    tables = [
        table_part(
            table.title,
            table.columns,
            [[(cell_text(cell), _is_number(cell)) for cell in row] for row in table.rows],
            table.note,
        )
        for table in findings.tables
    ]
    images = [image_part(figure.caption, figure.png) for figure in findings.figures]
    return [*text_parts(findings.text), *tables, *images]


def benchmark_tables(results: Sequence[BenchmarkResult]) -> list[Table]:
    """Make a table for each score of the public benchmark: methods, then its authors' methods.

    Parameters
    ----------
    results : sequence of BenchmarkResult
        At least one, all on the same benchmark.
    """
    benchmark = results[0].benchmark
    columns = ("method", *(f"J = {budget}" for budget in benchmark.max_vertices))
    means, authors = {r.method: r.means() for r in results}, benchmark.means()
    tables = []
    for score in dict.fromkeys(score for of in means.values() for score in of):
        rows = [(method, *of[score]) for method, of in means.items() if score in of]
        rows += [(f"{method} (authors)", *m) for method, m in authors.get(score, {}).items()]
        tables.append(Table(f"{benchmark.name}: {score}", columns, tuple(rows)))
    return tables


def machine() -> str:
    """Tell the processor, the system and Python, in a line.

    Examples
    --------
    >>> machine().endswith(f"Python {platform.python_version()}")
    True
    """
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = [line for line in cpuinfo.read_text().splitlines() if "model name" in line]
        name = lines[0].split(":")[1].strip() if lines else name
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    )


def _is_number(cell: object) -> bool:
    return isinstance(plain(cell), int | float)


def _fact(value: Any) -> str:
    return {True: "yes", False: "none"}[value] if isinstance(value, bool) else str(value)
