"""Figure 9: average repetition against support radius and threshold, for every reading."""

from itertools import product
from typing import Any

from lineament.output import canvas

from .findings import Figure, Findings, Progress, Setting, Table
from .grid import (
    CRITERIA,
    FORMS,
    HALF_WIDTHS,
    RADIUS,
    THRESHOLD,
    Grid,
    Parameters,
    largest,
    repetition,
    repetition_grid,
    repetition_scenes,
)

_COLORS = dict(zip(FORMS, canvas.PALETTE, strict=False))
#: Seeds of the bands in the figures.
_SEEDS = range(5)
#: The paper's parameters are as good as the best if they are within this.
_FLAT = 0.03
_COLUMNS = {
    "reading": "reading",
    "chosen by": "chosen_by",
    "radius [beams]": "support_radius",
    "threshold": "threshold",
    "AR of two views": "repetition",
    "½ (precision + recall)": "half_sum",
    "corners a view": "corners_per_view",
    "precision": "precision",
    "recall": "recall",
    "F1": "f1",
}


def run(setting: Setting, progress: Progress) -> Findings:
    """Repeat the experiment of Figure 9 on simulated scans, for every reading of the paper."""
    grid = repetition_grid(setting, progress)
    numbers = repetition_scenes(setting, reported=True)
    choices: list[dict[str, object]] = []
    for paper in _papers():
        progress(f"{paper.reading}, on other scenes")
        reading = {"response": paper.response, "half_width": paper.half_width}
        chosen = {"the paper": paper}
        chosen |= {about: largest(grid, key, **reading) for key, about in CRITERIA.items()}
        for by, p in chosen.items():
            measured = repetition(p, numbers)
            choices.append({"reading": p.reading, "chosen_by": by, **p._asdict(), **measured})
    choice_table = Table.of_records(
        "The paper’s parameters and the best of the grid, on other scenes",
        [{column: of[key] for column, key in _COLUMNS.items()} for of in choices],
        "Precision, recall and F1: corners within 0.1 m of true ones with six beams or more on "
        "both sides. The paper’s values of AR are lost.",
    )
    return Findings(
        "Average repetition against support radius and threshold (Figure 9)",
        _text(grid),
        (*(_peaks(grid, criterion) for criterion in CRITERIA), choice_table),
        _figures(setting, progress),
        {
            "grid": [p._asdict() | of for p, of in grid.items()],
            "choices": choices,
            "alike": {criterion: _alike(grid, criterion) for criterion in CRITERIA},
        },
    )


def _along(grid: Grid, paper: Parameters, criterion: str) -> tuple[Parameters, Parameters]:
    """Return the best along each line of Figure 9, for the reading of the paper."""
    reading = {"response": paper.response, "half_width": paper.half_width}
    by_radius = largest(grid, criterion, **reading, threshold=THRESHOLD)
    return by_radius, largest(grid, criterion, **reading, support_radius=RADIUS)


def _papers() -> list[Parameters]:
    """Return the parameters of the paper in every reading."""
    return [Parameters(*reading, RADIUS, THRESHOLD) for reading in product(FORMS, HALF_WIDTHS)]


def _alike(grid: Grid, criterion: str) -> list[str]:
    """Name the readings in which the paper's parameters are as good as any on both lines."""
    alike = []
    for paper in _papers():
        at_paper = grid[paper][criterion]
        best = max(grid[p][criterion] for p in _along(grid, paper, criterion))
        if at_paper > 0 and at_paper >= best - _FLAT:
            alike.append(paper.reading)
    return alike


def _peaks(grid: Grid, criterion: str) -> Table:
    """Where a criterion is largest along the two lines of Figure 9, and how large."""
    rows: list[tuple[Any, ...]] = [("paper", RADIUS, "lost", THRESHOLD, "lost", "lost", "lost")]
    for paper in _papers():
        by_radius, by_threshold = _along(grid, paper, criterion)
        most = [grid[p][criterion] for p in (by_radius, by_threshold, paper)]
        best = largest(grid, criterion, response=paper.response, half_width=paper.half_width)
        radius = by_radius.support_radius if most[0] else None
        at = (radius, most[0], by_threshold.threshold, most[1])
        rows.append((paper.reading, *at, most[2], grid[best][criterion]))
    return Table(
        f"Where it is largest: {CRITERIA[criterion]}",
        (
            "reading",
            f"best radius at {THRESHOLD}",
            "value there",
            f"best threshold at {RADIUS}",
            "value there ",
            f"at {RADIUS} and {THRESHOLD}",
            "largest of all",
        ),
        tuple(rows),
        f"A dash: at {THRESHOLD} no corner is found again with any radius. An optimum at an end of "
        "the grid may lie beyond it.",
    )


def _text(grid: Grid) -> tuple[str, ...]:
    readings = (
        f"{len(FORMS)} forms of equation 22 with {len(HALF_WIDTHS)} half-widths of the filter"
    )
    two, one = (len(_alike(grid, criterion)) for criterion in CRITERIA)
    return (
        "AR is ½ (N_r/N_o + N_r/N_t): N_o corners of a view, N_t of a second one after a turn by a "
        "part of a beam with fresh noise, N_r of them in both within 0.1 m (Awrangjeb and Lu "
        "2008), mean over the views. It knows no truth. Where the paper speaks of the actual "
        "corners, one view is compared with the truth: ½ (precision + recall). Both are measured "
        "with the paper’s last steps, on simulated scenes of all kinds.",
        "In the paper AR is largest at radius 6 and threshold 0.66. What its response is, and how "
        f"wide its filter, it leaves unsaid: {readings}. The paper’s parameters are within {_FLAT} "
        f"of the largest on both lines in {two} of {len(_papers())} by AR of two views, "
        f"and in {one} by ½ (precision + recall). liu:figure9 has one of the latter, selected "
        "after the fact: it is a hypothesis, not a reproduction.",
        "At a fixed radius the corners of a higher threshold are among those of a lower one, so "
        "recall alone has no largest value inside the grid: the peak needs a term of "
        "precision (docs/equations.md).",
    )


def _figures(setting: Setting, progress: Progress) -> tuple[Figure, ...]:
    """Draw both lines of Figure 9, with bands over the seeds."""
    grids = [repetition_grid(Setting(setting.frames, seed), progress) for seed in _SEEDS]
    about = (
        f"at the paper’s {{}}, for each reading: median of {len(_SEEDS)} seeds, and band of the "
        "least and the greatest. Above AR of two views, below ½ (precision + recall) of one. "
        "Grey: where the paper has its peak."
    )
    return (
        _figure(
            *(grids, "support_radius", "fig9a", "support radius [beams]"),
            "Repetition against the support radius " + about.format(f"threshold {THRESHOLD}"),
        ),
        _figure(
            *(grids, "threshold", "fig9b", "threshold [m; m² for product; else none]"),
            "Repetition against the threshold " + about.format(f"radius {RADIUS}"),
        ),
    )


def _figure(grids: list[Grid], field: str, name: str, label: str, caption: str) -> Figure:
    """Draw both criteria along one of the two parameters; a column for each half-width."""
    shown = list(product(CRITERIA, HALF_WIDTHS))
    figure, panels = canvas.new_panels(len(shown), len(HALF_WIDTHS), sharey=True)
    for axes, (criterion, half_width) in zip(panels, shown, strict=True):
        canvas.style(axes, f"half-width of the filter: {half_width} beams")
        axes.axvline(RADIUS if field == "support_radius" else THRESHOLD, color=canvas.FAINT)
        for form, color in _COLORS.items():
            paper = Parameters(form, half_width, RADIUS, THRESHOLD)
            # Those that differ from it in this field at most.
            along = [p for p in grids[0] if p._replace(**{field: getattr(paper, field)}) == paper]
            x = [getattr(p, field) for p in along]
            values = [sorted(grid[p][criterion] for grid in grids) for p in along]
            low, middle, high = zip(*((v[0], v[len(v) // 2], v[-1]) for v in values), strict=True)
            axes.fill_between(x, low, high, color=color, alpha=0.15)
            axes.plot(x, middle, color=color, marker="o", label=form)
        axes.set_xlabel(label)
        if field == "threshold":
            axes.set_xscale("log")
            axes.set_xticks([], minor=True)
            ticks = (0.05, 0.1, 0.2, 0.5, 1.0)
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    for axes, about in zip(panels[:: len(HALF_WIDTHS)], CRITERIA.values(), strict=True):
        axes.set_ylabel(about)
    canvas.add_legend(figure)
    return Figure(name, caption, canvas.figure_bytes(figure))
