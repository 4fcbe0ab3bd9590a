"""Figure 9: average repetition against support radius and threshold, for every reading."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import asdict, replace

from ..output import canvas
from .findings import Figure, Findings, Progress, Setting, Table
from .repetition_grid import (
    CRITERIA,
    RADIUS,
    READINGS,
    THRESHOLD,
    Grid,
    Parameters,
    Repetition,
    largest,
    repetition,
    repetition_grid,
    repetition_scenes,
)

__all__ = ["run"]

_COLORS = {"tangent": "#4477aa", "product": "#ee9933", "relative": "#228833"}

#: Sets of parameters within so much of the largest AR are told of.
_FLAT = 0.02

#: Who chose some parameters, these, and what they give.
Choice = tuple[str, Parameters, Repetition]


def run(setting: Setting, progress: Progress) -> Findings:
    """Repeat the experiment of Figure 9 on simulated scans, for every reading of equation 22."""
    grid = repetition_grid(setting, progress)
    numbers = repetition_scenes(setting, reported=True)
    choices: list[Choice] = []
    for reading in READINGS:
        progress(f"reading {reading}, on other scenes")
        chosen = {"the paper": Parameters(reading, RADIUS, THRESHOLD)}
        chosen |= {f"AR of {CRITERIA[c]}": largest(grid, c, reading) for c in CRITERIA}
        choices += [(by, p, repetition(p, numbers)) for by, p in chosen.items()]
    progress("threshold 0, on other scenes")
    everywhere = repetition(Parameters("tangent", RADIUS, 0.0), numbers)
    progress("drawing")
    return Findings(
        "Average repetition against support radius and threshold (Figure 9)",
        _text(grid, everywhere),
        (_peaks(grid), _choices(choices)),
        (
            _figure(
                *(grid, "support_radius", "fig9a", "support radius [beams]"),
                "AR against the support radius, at the threshold 0.66 of the paper (solid) and at "
                "the best threshold of each reading (dotted). In the paper it is largest at 6.",
            ),
            _figure(
                *(grid, "threshold", "fig9b", "threshold [m; m² for product; none for relative]"),
                "AR against the threshold, at the radius 6 of the paper (solid) and at the best "
                "radius of each reading (dotted). In the paper it is largest at 0.66.",
            ),
        ),
        {
            "grid": [asdict(p) | r.summary() for p, r in grid.items()],
            "choices": [{"chosen_by": by} | asdict(p) | r.summary() for by, p, r in choices],
            "threshold_0": everywhere.summary(),
            "best": asdict(largest(grid, "of_actual")),
        },
    )


def _peaks(grid: Grid) -> Table:
    """Where AR is largest along the two lines of Figure 9, and how large."""
    rows: list[tuple[object, ...]] = []
    for criterion, about in CRITERIA.items():
        by_radius = [largest(grid, criterion, r, threshold=THRESHOLD) for r in READINGS]
        by_threshold = [largest(grid, criterion, r, radius=RADIUS) for r in READINGS]
        radii = [p.support_radius if _ar(grid, p, criterion) else None for p in by_radius]
        thresholds = [p.threshold for p in by_threshold]
        rows += [
            (f"best radius at {THRESHOLD} [beams]", about, RADIUS, *radii),
            ("AR there", about, "lost", *(_ar(grid, p, criterion) for p in by_radius)),
            (f"best threshold at radius {RADIUS}", about, THRESHOLD, *thresholds),
            ("AR there", about, "lost", *(_ar(grid, p, criterion) for p in by_threshold)),
        ]
    return Table(
        "Where the average repetition is largest",
        ("", "N_o", "paper", *(f"here, {reading}" for reading in READINGS)),
        tuple(rows),
        f"A dash: at {THRESHOLD} no corner is found again with any radius.",
    )


def _choices(choices: list[Choice]) -> Table:
    return Table.of_records(
        "The paper’s parameters and the best of the grid, on other scenes",
        [
            {
                "reading": p.response,
                "chosen by": by,
                "radius [beams]": p.support_radius,
                "threshold": p.threshold,
                "AR of actual": r.of_actual,
                "AR among found": r.among_found,
                "corners a view": r.corners_per_view,
                "precision": r.counts.precision,
                "recall": r.counts.recall,
                "F1": r.counts.f1,
            }
            for by, p, r in choices
        ],
        "Precision, recall and F1 are of corners within 0.1 m of actual ones that show six beams "
        "or more of both sides. The paper’s values of AR are lost.",
    )


def _text(grid: Grid, everywhere: Repetition) -> tuple[str, ...]:
    """Say what the paper claims, what is found here, and what AR is worth."""
    best = largest(grid, "of_actual")
    largest_f1 = max(r.counts.f1 for r in grid.values())
    flat = sum(r.of_actual >= grid[best].of_actual - _FLAT for r in grid.values())
    return (
        "The paper takes the support radius 6, at which AR is largest with the threshold 0.66, and "
        "the threshold 0.66, at which it is largest with the radius 6. The values of its figure "
        "are lost. AR is ½ (N_r/N_o + N_r/N_t): N_t corners after a turn by a part of a beam with "
        "fresh noise, N_r of them found again, mean over the views. In the paper's words N_o are "
        "the actual corners; in the literature (Awrangjeb and Lu 2008) those found before the "
        "turn. Both are shown, for the paper's literal pipeline on simulated scenes of all kinds.",
        _verdict(grid),
        "AR hardly minds false corners. With the threshold 0 almost every reading is a corner: "
        f"AR among the corners found is then {everywhere.among_found:.2f}, with a precision of "
        f"{everywhere.counts.precision:.3f}. Over all views together, a single right corner in all "
        "of them would do for an AR of 0.5: hence the mean over views, in which a view without "
        "corners counts as 0.",
        "As the best parameters of the paper's own experiment the other tables take those with the "
        f"largest AR of the actual corners: {best}. The F1 of these is "
        f"{grid[best].counts.f1:.2f}, the largest of the grid {largest_f1:.2f}; and the largest AR "
        f"is flat: {flat} of the {len(grid)} sets of parameters are within {_FLAT:g} of it.",
    )


def _verdict(grid: Grid) -> str:
    """Say whether any reading has the largest AR where the paper has it."""
    told, reproduced, radii, thresholds = [], [], set(), set()
    for reading in READINGS:
        at_threshold = largest(grid, "of_actual", reading, threshold=THRESHOLD)
        at_radius = largest(grid, "of_actual", reading, radius=RADIUS)
        best_radius, best_threshold = at_threshold.support_radius, at_radius.threshold
        thresholds.add(best_threshold)
        if not _ar(grid, at_threshold, "of_actual"):
            told.append(f"{reading} finds none at 0.66, and most at {best_threshold:g} (radius 6)")
            continue
        radii.add(best_radius)
        told.append(
            f"{reading} at radius {best_radius} (threshold 0.66) and at threshold "
            f"{best_threshold:g} (radius 6)"
        )
        if (best_radius, best_threshold) == (RADIUS, THRESHOLD):
            reproduced.append(reading)
    if reproduced:
        return f"Reproduced by the reading {' and '.join(reproduced)}."
    ends = [
        *_at_an_end(radii, {p.support_radius for p in grid}),
        *_at_an_end(thresholds, {p.threshold for p in grid}),
    ]
    beyond = f" At an end of the grid: {', '.join(ends)}; the optimum may lie beyond." * bool(ends)
    return (
        "Not reproduced: along the lines of the figure, no reading of equation 22 has the largest "
        f"AR of the actual corners at 6 and 0.66, but {'; '.join(told)}. Radius and threshold are "
        "each the best beside the paper’s value of the other: two separate optima, no pair. At "
        f"0.66 a larger radius finds more corners, at radius 6 a lower threshold does.{beyond}"
    )


def _at_an_end(optima: AbstractSet[float], values: AbstractSet[float]) -> list[str]:
    """Name the optima that are the least or the largest of the values of the grid."""
    return [f"{best:g}" for best in sorted(optima & {min(values), max(values)})]


def _ar(grid: Grid, parameters: Parameters, criterion: str) -> float:
    return float(getattr(grid[parameters], criterion))


def _figure(grid: Grid, field: str, name: str, label: str, caption: str) -> Figure:
    """Draw AR along one of the two parameters, with N_o either way."""
    figure = canvas.new_figure(11, 4.2)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (criterion, about) in zip(panels, CRITERIA.items(), strict=True):
        canvas.style(axes, f"N_o: {about}")
        for reading, color in _COLORS.items():
            paper, best = Parameters(reading, RADIUS, THRESHOLD), largest(grid, criterion, reading)
            for through, dashes, label_of in (
                (paper, "-", reading),
                (best, ":", f"{reading}, best"),
            ):
                # Those that differ from it in this field at most.
                along = [
                    p for p in grid if replace(p, **{field: getattr(through, field)}) == through
                ]
                x = [getattr(p, field) for p in along]
                y = [_ar(grid, p, criterion) for p in along]
                axes.plot(x, y, dashes, color=color, marker="o", markersize=3.5, label=label_of)
        axes.axvline(getattr(paper, field), color=canvas.FAINT, linewidth=0.9, zorder=0)
        axes.annotate(
            "paper",
            (getattr(paper, field), 0.95),
            xytext=(4, 0),
            fontsize=8,
            textcoords="offset points",
            color="#57606a",
        )
        axes.set_xlabel(label, fontsize=9)
        axes.set_ylim(-0.02, 1.0)
        if field == "threshold":
            axes.set_xscale("log")
            axes.set_xticks([], minor=True)
            ticks = (0.05, 0.1, 0.2, 0.5, 1.0)
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panels[0].set_ylabel("AR", fontsize=9)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=9, frameon=False)
    return Figure(name, caption, canvas.figure_bytes(figure))
