"""Figure 12: the distance of each point from its own fitted line."""

from ..evaluation.similarity import SimilarityScores, similarity_errors, similarity_scores
from ..extractor import Extractor
from ..methods.stages import bilateral_filter
from ..output import canvas, drawing
from ..scan import LaserScan
from ..simulation import SENSORS
from .contenders import LIU_BEST, LIU_PAPER, PDBS_LINES, Extract, drawn_methods
from .findings import Figure, Findings, Progress, Setting, Table
from .scans import INDOORS, recorded_scans, scene_numbers, simulated_frames

#: The literal pipeline, by the points that its lines are fitted to.
FILTERED = "liu:paper, filtered points"
#: What the paper says of its largest errors; its other values are lost.
PAPER = {
    LIU_PAPER: "within 0.01 m",
    FILTERED: "within 0.01 m",
    "iepf": "up to 0.25 m",
    PDBS_LINES: "up to 0.25 m",
}
#: What its Figure 12 shows, and the better numbers of its method.
SHOWN = (LIU_PAPER, LIU_BEST, "iepf", PDBS_LINES)
#: An error that the paper calls small [m].
SMALL = 0.01


def run(setting: Setting, progress: Progress) -> Findings:
    """Measure similarity errors on simulated scans and on recordings."""
    methods = drawn_methods(setting, progress)
    numbers = scene_numbers(len(INDOORS) * setting.frames, setting.seed)
    frames = list(simulated_frames(SENSORS["paper"], INDOORS, numbers))
    simulated = "simulated rooms, corridors and halls"
    scans = {simulated: [frame.scan for frame in frames]}
    scans |= dict(recorded_scans(setting, setting.frames))
    true = SimilarityScores.total(similarity_scores(f.scan, f.truth) for f in frames)
    found, figures = {}, []
    for where, some in scans.items():
        progress(f"{where}: {len(some)} scans")
        scores = {"the true lines": true} if where == simulated else {}
        for name, extract in methods.items():
            parts = (similarity_scores(scan, extract(scan)) for scan in some)
            scores[name] = SimilarityScores.total(parts)
        scores[FILTERED] = SimilarityScores.total(map(_of_filtered_points, some))
        found[where] = scores
        progress(f"{where}: drawing")
        figures.append(_figure(where, some[0], methods))
    return Findings(
        "Similarity error (Figure 12)",
        _text(true, found[simulated][LIU_PAPER]),
        tuple(_table(where, scores) for where, scores in found.items()),
        tuple(figures),
        {where: {m: s.summary() for m, s in of.items()} for where, of in found.items()},
    )


def _text(true: SimilarityScores, liu: SimilarityScores) -> tuple[str, ...]:
    beyond = 100 * float((true.errors > SMALL).mean())
    verdict = (
        "holds here"
        if liu.maximum <= SMALL
        else "does not hold here: a cluster whose corners are missed gets one line"
    )
    return (
        "The similarity error of a beam is the distance of its point from the line or arc that was "
        "fitted to it. The paper says that it stays within 0.01 m with its method and goes up to "
        "0.25 m with PDBS and IEPF; means, variances and peaks are lost.",
        "The claim says as much about the noise as about the method: at σ = 10 mm, "
        f"{beyond:.0f} % of the points are more than 0.01 m from the true lines, the farthest "
        f"{1e3 * true.maximum:.0f} mm. Nor is a small error good by itself: many short pieces have "
        "small errors, and points without a line have none. So the share of the valid beams that "
        "have a line is given. The last row is the literal pipeline: filtered points, and lines "
        "fitted to them.",
        f"With the paper’s numbers, the largest error is {liu.maximum:.2f} m: the claim {verdict}.",
    )


def _of_filtered_points(scan: LaserScan) -> SimilarityScores:
    """Errors of the filtered points from the lines that the literal pipeline fits to them."""
    filtered = LaserScan(bilateral_filter(scan), angles=scan.angles)
    return similarity_scores(filtered, Extractor("liu:paper")(scan))


def _table(where: str, scores: dict[str, SimilarityScores]) -> Table:
    return Table.of_records(
        f"Similarity error: {where}",
        [
            {
                "method": method,
                "largest, paper": PAPER.get(method),
                "largest, here [m]": score.maximum,
                "mean, paper": "lost" if method in PAPER else None,
                "mean, here [mm]": 1e3 * score.mean,
                "variance, paper": "lost" if method in PAPER else None,
                "variance, here [mm²]": 1e6 * score.variance,
                "within 0.01 m [%]": 100 * float((score.errors <= SMALL).mean()),
                "explained [%]": 100 * score.explained,
            }
            for method, score in scores.items()
        ],
    )


def _figure(where: str, scan: LaserScan, methods: dict[str, Extract]) -> Figure:
    figure = canvas.new_figure(11, 8.5)
    for axes, name in zip(figure.subplots(len(SHOWN), 1), SHOWN, strict=True):
        drawing.draw_errors(axes, scan, similarity_errors(scan, methods[name](scan)))
        axes.set_title(name, loc="right", fontsize=10, fontweight="bold", color=canvas.INK)
    least = f"{1e3 * drawing.LEAST_ERROR:g} mm"
    caption = (
        f"Similarity error of each beam of a scan, {where}. All axes are the same and logarithmic; "
        f"errors below {least} are drawn at {least}."
    )
    name = "-".join(["fig12", *where.lower().replace(",", "").split()[:2]])
    return Figure(name, caption, canvas.figure_bytes(figure))
