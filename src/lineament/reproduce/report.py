"""The report of experiments: one page, and one file with all numbers."""

import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

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
from . import experiment_names, run_experiments
from .findings import Findings, Progress, Setting, Table, cell_text

_INTRODUCTION = (
    "The experiments of Liu et al., Journal of Sensors 2023, article 6991467, and further ones. "
    "The values of its tables and of its Figure 12 are not available: where one stands only there, "
    "the column “paper” says “lost”. Its recording, ten frames of the Deutsches Museum, is not "
    "used: the methods are compared on simulated scans and on other recordings if present.",
)


def reproduce(
    folder: str | os.PathLike[str],
    names: Iterable[str] = (),
    setting: Setting | None = None,
    progress: Progress = lambda about: None,  # noqa: ARG005
) -> Path:
    """Run experiments and write their report: ``index.html`` and ``figures.json``.

    Parameters
    ----------
    folder : path-like
        Made if it does not exist.
    names : iterable of str
        Experiments, or the paper's names of figures and tables; none: all.
    setting : Setting, optional
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
    """Write page and numbers of some findings; return the path of the page."""
    about: dict[str, object] = {
        "lineament": version("lineament"),
        "machine": machine(),
        "frames": setting.frames,
        "seed": setting.seed,
        "recordings": setting.data is not None,
    }
    experiments = {name: found.to_dict() for name, found in findings.items()}
    text = json.dumps({**about, "experiments": experiments}, indent=1, ensure_ascii=False)
    write_text(folder / "figures.json", text + "\n")
    about["recordings"] = "none" if setting.data is None else "yes"
    parts = [list_part((k, str(v)) for k, v in about.items()), *text_parts(_INTRODUCTION)]
    parts.append(contents_part([(name, found.title) for name, found in findings.items()]))
    for name, found in findings.items():
        parts += [heading_part(name, found.title), *findings_parts(found)]
    page = folder / "index.html"
    write_parts(page, "lineament: the paper’s experiments", parts)
    return page


def findings_parts(findings: Findings) -> list[str]:
    """Return text, tables and figures as parts of a page."""
    tables = [
        table_part(
            table.title,
            table.columns,
            [
                [(cell_text(cell), isinstance(plain(cell), int | float)) for cell in row]
                for row in table.rows
            ],
            table.note,
        )
        for table in findings.tables
    ]
    images = [image_part(figure.caption, figure.png) for figure in findings.figures]
    return [*text_parts(findings.text), *tables, *images]


def benchmark_tables(results: Sequence[BenchmarkResult]) -> list[Table]:
    """Make a table for each score of the public benchmark: methods, then its authors' methods."""
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
    """Return processor, cores, system and Python, in a line.

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
