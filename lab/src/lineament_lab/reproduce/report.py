"""The report of experiments: one page, and one file with all numbers."""

import io
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from lineament.files import check_outputs, made_folder, write_text
from lineament.output.page import (
    Cell,
    contents_part,
    heading_part,
    image_part,
    list_part,
    table_part,
    text_parts,
    write_parts,
)

from ..evaluation.ple import BenchmarkResult
from ..evaluation.pooling import Interval
from . import experiment_names, run_experiments
from .claims import Verdict, bands, verdicts
from .experiment import WORDS
from .findings import Findings, Progress, Setting, Table, cell_text
from .machine import machine
from .prose import prose
from .seeds import Spread

#: Names of the files.
_PAGE, _NUMBERS = "index.html", "figures.json"
#: Colours of a picture: those of ten methods, and what is between them and the paper.
_COLORS = 32


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
        If the folder cannot be written to, or a file in it is the museum's bag.
    """
    setting = Setting() if setting is None else setting
    chosen, target = experiment_names(names), made_folder(folder)
    museum = () if setting.museum is None else (setting.museum,)
    check_outputs([target / name for name in (_PAGE, _NUMBERS)], museum)
    return write_report(target, run_experiments(chosen, setting, progress), setting)


def write_report(folder: Path, findings: Mapping[str, Findings], setting: Setting) -> Path:
    """Write page and numbers of some findings; return the path of the page."""
    about: dict[str, object] = {
        "lineament": version("lineament"),
        "machine": machine(),
        "frames": setting.frames,
        "seeds": [one.seed for one in setting.by_seed()],
        "recordings": setting.data is not None,
        "museum": setting.museum is not None,
    }
    judged = verdicts(findings)
    written = {
        **about,
        "verdicts": {one.claim.place: one.verdict for one in judged},
        "experiments": {name: found.to_dict() for name, found in findings.items()},
    }
    text = json.dumps(written, indent=1, ensure_ascii=False)
    write_text(folder / _NUMBERS, text + "\n")
    shown = {**about, "seeds": ", ".join(str(one.seed) for one in setting.by_seed())}
    facts = [(k, ("no", "yes")[v] if isinstance(v, bool) else str(v)) for k, v in shown.items()]
    entries = {"verdicts": "The paper’s figures and tables"}
    entries |= {name: found.title for name, found in findings.items()}
    parts = [
        *(list_part(facts), *text_parts(prose("page")), contents_part(entries.items())),
        *(heading_part("verdicts", entries["verdicts"]), _verdicts_part(judged, findings)),
    ]
    for name, found in findings.items():
        parts += [heading_part(name, found.title), *findings_parts(found)]
    page = folder / _PAGE
    write_parts(page, "lineament: the paper’s experiments", parts)
    return page


_VERDICTS = "", "verdict", "paper", "here", "by what the paper leaves open"


def _verdicts_part(judged: Sequence[Verdict], findings: Mapping[str, Findings]) -> str:
    """Make the table of the paper's figures and tables: where they are here, and verdicts."""
    rows, of_open = [], bands(findings)
    for name, claim, here, verdict in judged:
        found = findings.get(name)
        figures = {figure.name for figure in found.figures} if found else {}
        at = claim.figure if claim.figure in figures else name
        place = Cell(claim.place, href=f"#{at}" if found else "")
        band = Cell(of_open.get(claim.place, "–"))
        verdict_cell = Cell(verdict or "–", "verdict")
        rows.append([place, verdict_cell, Cell(claim.paper), Cell(here or "–"), band])
    words = "; ".join(f"{word}: {about}" for word, about in WORDS.items())
    note = prose("verdicts", words=f"{words[0].upper()}{words[1:]}")[0]
    return table_part("Verdicts", _VERDICTS, rows, note)


def findings_parts(findings: Findings) -> list[str]:
    """Return text, tables and figures as parts of a page."""
    tables = [
        table_part(
            table.title,
            table.columns,
            [[_cell(cell) for cell in row] for row in table.rows],
            table.note,
        )
        for table in findings.tables
    ]
    images = [
        image_part(figure.caption, _smaller(figure.png), figure.name) for figure in findings.figures
    ]
    return [*text_parts(findings.text), *tables, *images]


def _smaller(png: bytes) -> bytes:
    """Return a picture with so few colours that the page can be sent by mail."""
    from PIL import Image

    buffer = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        method, plain = Image.Quantize.FASTOCTREE, Image.Dither.NONE
        few = image.convert("RGB").quantize(_COLORS, method=method, dither=plain)
    few.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


#: A cell that is a number and nothing else; a dash is one that is missing.
_NUMBER = re.compile(r"[+−-]?\d[\d.e-]*|–")


def _cell(cell: object) -> Cell:
    text = cell_text(cell)
    is_number = isinstance(cell, Spread | Interval) or _NUMBER.fullmatch(text)
    return Cell(text, "number" if is_number else "")


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
