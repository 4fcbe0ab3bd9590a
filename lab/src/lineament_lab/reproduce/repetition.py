"""Figure 9: average repetition against support radius and threshold, for every reading."""

from itertools import product
from typing import Any

from lineament.methods.liu import Liu
from lineament.output import canvas

from .experiment import Claim, Experiment, Judged, Measured, Report
from .findings import Columns, Figure, Progress, Setting, Table
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
from .prose import prose
from .seeds import by_seed

_COLORS = dict(zip(FORMS, canvas.PALETTE, strict=False))
#: Seeds of the bands in the figures.
_SEEDS = range(5)
#: The paper's parameters are as good as the best if they are within this.
FLAT = 0.03
_PEAKS: Columns = {
    f"best radius at {THRESHOLD}": "radius",
    "value there": "at_radius",
    f"best threshold at {RADIUS}": "threshold",
    "value there ": "at_threshold",
    f"at {RADIUS} and {THRESHOLD}": "here",
    "largest of all": "largest",
}
_COLUMNS: Columns = {
    "radius [beams]": "support_radius",
    "threshold": "threshold",
    "AR of two views": "repetition",
    "½ (precision + recall)": "half_sum",
    "corners a view": "corners_per_view",
    "precision": "precision",
    "recall": "recall",
    "F1": "f1",
}


def measure(setting: Setting, progress: Progress) -> Measured:
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
    peaks = {criterion: _peaks(grid, criterion) for criterion in CRITERIA}
    points = [p._asdict() | of for p, of in grid.items()]
    return Measured(
        {"grid": points, "choices": choices, "peaks": peaks}, lambda: _figures(setting, progress)
    )


def _papers() -> list[Parameters]:
    """Return the parameters of the paper in every reading."""
    return [Parameters(*reading, RADIUS, THRESHOLD) for reading in product(FORMS, HALF_WIDTHS)]


def _peaks(grid: Grid, criterion: str) -> dict[str, dict[str, Any]]:
    """Return where a criterion is largest along both lines of Figure 9, by reading.

    `lead` is not negative where the paper's parameters are as good as any on both lines.
    """
    peaks = {}
    for paper in _papers():
        reading = {"response": paper.response, "half_width": paper.half_width}
        by_radius = largest(grid, criterion, **reading, threshold=THRESHOLD)
        by_threshold = largest(grid, criterion, **reading, support_radius=RADIUS)
        best = largest(grid, criterion, **reading)
        here, at_radius, at_threshold = (
            grid[p][criterion] for p in (paper, by_radius, by_threshold)
        )
        peaks[paper.reading] = {
            "radius": by_radius.support_radius if at_radius else None,
            "at_radius": at_radius,
            "threshold": by_threshold.threshold,
            "at_threshold": at_threshold,
            "here": here,
            "largest": grid[best][criterion],
            "lead": min(here - max(at_radius, at_threshold) + FLAT, here - 1e-9),
        }
    return peaks


def _alike(n: Any, criterion: str) -> float:
    """Return in how many readings the paper's parameters are as good as any on both lines."""
    leads = (at["lead"] for at in n["peaks"][criterion].values())
    return by_seed(lambda *each: sum(lead >= 0 for lead in each), *leads)


def report(n: Any, _: Setting) -> Report:
    """Make a table of peaks for each criterion, and that of the choices on other scenes."""
    lost: dict[str, Any] = {"radius": RADIUS, "threshold": THRESHOLD}
    lost |= dict.fromkeys(("at_radius", "at_threshold", "here", "largest"), "lost")
    of_peaks, of_choices = prose("notes of repetition", threshold=THRESHOLD)
    tables = []
    for criterion, about in CRITERIA.items():
        title, rows = f"Where it is largest: {about}", {"paper": lost} | n["peaks"][criterion]
        tables.append(Table.of_numbers(title, rows, _PEAKS, of_peaks, "reading"))
    title = "The paper’s parameters and the best of the grid, on other scenes"
    choices = {(of["reading"], of["chosen_by"]): of for of in n["choices"]}
    names = ("reading", "chosen by")
    tables.append(Table.of_numbers(title, choices, _COLUMNS, of_choices, names))
    two, one = (_alike(n, criterion) for criterion in CRITERIA)
    sizes = {"forms": len(FORMS), "widths": len(HALF_WIDTHS), "readings": len(_papers())}
    text = prose("repetition", flat=FLAT, two=two, one=one, **sizes)
    return text, tables


def _judged(n: Any) -> Judged:
    """Judge the letter by the repetition of two views; all readings by both criteria beside it."""
    letter = Liu.paper()
    reading = Parameters(letter.response, letter.half_width, RADIUS, THRESHOLD).reading
    peaks = n["peaks"]["repetition"]
    alike = "; ".join(f"{_alike(n, name):.0f} by {about}" for name, about in CRITERIA.items())
    return Judged(
        f"Of {len(peaks)} readings, within {FLAT} of the largest there: {alike}",
        [peaks[reading]["lead"]],
    )


def _figures(setting: Setting, progress: Progress) -> tuple[Figure, ...]:
    """Draw both lines of Figure 9, with bands over the seeds."""
    grids = [repetition_grid(Setting(setting.frames, seed), progress) for seed in _SEEDS]
    return (
        _figure(grids, "support_radius", "fig9a", "support radius", "[beams]"),
        _figure(grids, "threshold", "fig9b", "threshold", "[m; m² for product; else none]"),
    )


def _figure(grids: list[Grid], field: str, name: str, along: str, unit: str) -> Figure:
    """Draw both criteria along one of the two parameters; a column for each half-width."""
    shown = list(product(CRITERIA, HALF_WIDTHS))
    figure, panels = canvas.new_panels(len(shown), len(HALF_WIDTHS), sharey=True)
    for axes, (criterion, half_width) in zip(panels, shown, strict=True):
        canvas.style(axes, f"half-width of the filter: {half_width} beams")
        axes.axvline(RADIUS if field == "support_radius" else THRESHOLD, color=canvas.FAINT)
        for form, color in _COLORS.items():
            paper = Parameters(form, half_width, RADIUS, THRESHOLD)
            # Those that differ from it in this field at most.
            same = [p for p in grids[0] if p._replace(**{field: getattr(paper, field)}) == paper]
            x = [getattr(p, field) for p in same]
            values = [sorted(grid[p][criterion] for grid in grids) for p in same]
            low, middle, high = zip(*((v[0], v[len(v) // 2], v[-1]) for v in values), strict=True)
            axes.fill_between(x, low, high, color=color, alpha=0.15)
            axes.plot(x, middle, color=color, marker="o", label=form)
        axes.set_xlabel(f"{along} {unit}")
        if field == "threshold":
            axes.set_xscale("log")
            axes.set_xticks([], minor=True)
            ticks = (0.05, 0.1, 0.2, 0.5, 1.0)
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    for axes, about in zip(panels[:: len(HALF_WIDTHS)], CRITERIA.values(), strict=True):
        axes.set_ylabel(about)
    canvas.add_legend(figure)
    fixed = f"threshold {THRESHOLD}" if field == "support_radius" else f"radius {RADIUS}"
    return Figure.of(name, figure, "fig9", along=along, fixed=fixed, seeds=len(_SEEDS))


TITLE = "Average repetition against support radius and threshold (Figure 9)"
_PAPER = "Repetition is largest at radius 6 and threshold 0.66"
EXPERIMENT = Experiment(TITLE, measure, report, (Claim("Figure 9", _PAPER, _judged, "fig9a"),))
