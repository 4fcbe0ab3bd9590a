"""Figure 13 and Table 2: a convex and a concave corner, and their distance, from five places."""

import math
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.output import canvas, drawing
from lineament.scan import Array, LaserScan, Pose
from lineament.simulation import SENSORS, World, truth

from ..evaluation.counts import rms
from .contenders import PAPER, by_letter, feature_methods
from .experiment import Claim, Experiment, Margins, Measured, Report
from .findings import Columns, Figure, Progress, Setting, Table, each, median_of
from .prose import prose
from .scans import batch_of

#: Distance between the corners: the mean that the paper measured, here the truth [m].
DISTANCE = 2.302
#: A found corner is A or B within this distance [m].
GATE = 0.25
#: Scans from each place for each frame of the setting.
SCANS_A_FRAME = 20

#: B is the concave corner of a room, A the convex one of a box in it. They share no wall, so their
#: errors are independent.
B = np.array((6.0, 5.0))
A = B + DISTANCE * np.array((math.cos(math.radians(198)), math.sin(math.radians(198))))
_ROOM = np.array([(0, 0), (6, 0), (6, 5), (0, 5), (0, 0)])
_BOX = A + np.array([(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5), (0, 0)])
WORLD = World.of_polygons([_ROOM, _BOX])


def _pose(x: float, y: float, past: float) -> Pose:
    """Look past the middle of A and B by an angle."""
    to_middle = (A + B) / 2 - (x, y)
    return x, y, math.atan2(to_middle[1], to_middle[0]) + past


#: The five places.
_PLACES = ((0.7, 0.9, 0.5), (2.0, 0.6, -0.4), (2.9, 1.3, 0.2), (1.4, 2.3, -0.6), (2.6, 2.4, 0.1))
POSES = tuple(_pose(*place) for place in _PLACES)

_COLUMNS: Columns = {
    "paper: mean [m]": "paper",
    "here: mean [m]": "here",
    "paper: spread": "lost",
    "here: standard deviation [mm]": "standard_deviation",
    "RMS error [mm]": "error",
    "RMS error ÷ bound": "over",
    "share of scans with both": "found",
}
#: Titles of the tables by place, and the number in each with its factor.
_BY_PLACE = (
    ("Mean minus 2.302 m [mm]", "off", 1e3),
    ("Standard deviation [mm]", "standard_deviation", 1e3),
    ("Scans with both corners [%]", "found", 100),
)


def measure(setting: Setting, progress: Progress) -> Measured:
    """Measure the distance between two corners from five places, many times."""
    progress("simulating")
    scans = views(setting.seed, 13, SCANS_A_FRAME * setting.frames)
    methods = feature_methods(setting.methods)
    bounds = np.array([distance_bound(pose) for pose in POSES])
    places, overall = {}, {}
    for name, extract in each(methods, progress, "distances"):
        found = [
            found_distances(batch_of(extract, s), p) for s, p in zip(scans, POSES, strict=True)
        ]
        places[name] = [_numbers(distances, len(scans[0])) for distances in found]
        overall[name] = _numbers(np.concatenate(found), len(POSES) * len(scans[0]))
    return Measured(
        {"bound": bounds, "all_bound": rms(bounds), "places": places, "all": overall},
        lambda: [_figure(list(map(partial(_median_view, methods[PAPER]), scans, POSES)))],
    )


def report(n: Any, setting: Setting) -> Report:
    """Make a table of all places together, and one of each number by place."""
    places = n["places"]
    names = [name for name, of in n["all"].items() if of["found"] == 0]
    absent = [f"{' and '.join(names)}: no scan has both corners."] if names else []
    scans = SCANS_A_FRAME * setting.frames
    text = (*prose("two_corners", scans=scans), *prose("liu"), *absent)
    rows = {name: _row(of, n["all_bound"], name.startswith("liu")) for name, of in n["all"].items()}
    rows["bound"] = {"here": f"{DISTANCE:.4f}", "over": 1.0}
    rows["bound"] |= dict.fromkeys(("standard_deviation", "error"), n["all_bound"])
    of_all, of_place = prose("notes of two_corners", gate=GATE)
    title = "Table 2: distance between the two corners, from all five places together"
    tables = [Table.of_numbers(title, rows, _COLUMNS, of_all)]
    for title, key, factor in _BY_PLACE:
        of_places = {name: dict(enumerate(one[key] for one in of)) for name, of in places.items()}
        if key == "standard_deviation":
            of_places["bound"] = dict(enumerate(n["bound"]))
        columns = {f"place {k + 1}": (k, factor) for k in range(len(n["bound"]))}
        tables.append(Table.of_numbers(f"{title}, by place", of_places, columns, of_place))
    return text, tables


def views(seed: int, experiment: int, count: int) -> list[list[LaserScan]]:
    """Simulate so many scans from each of the five places, with noise of the experiment's own."""
    rngs = (np.random.default_rng([seed, k, experiment]) for k in range(len(POSES)))
    places = zip(POSES, rngs, strict=True)
    return [[SENSORS["paper"].scan(WORLD, p, rng) for _ in range(count)] for p, rng in places]


def distance_bound(pose: Pose) -> float:
    """Return the bound of the deviation of the distance from A to B, from one place [m].

    It is uᵀ (Σ_A + Σ_B) u with the bounds Σ of the corners and the direction u between them.
    """
    corners = truth(WORLD, pose, SENSORS["paper"]).transform(*pose).corners
    along = (B - A) / DISTANCE
    variance = 0.0
    for vertex in (A, B):
        is_it = np.hypot(*(corners["position"] - vertex).T) < 1e-6
        variance += float(along @ corners["covariance"][is_it][0] @ along)
    return math.sqrt(variance)


def found_distances(views: Iterable[Features], pose: Pose) -> Array:
    """Return the distances from A to B in the views from one pose that have both [m]."""
    distances = (distance_found(view.transform(*pose), A, B) for view in views)
    return np.array([distance for distance in distances if not math.isnan(distance)])


def distance_found(features: Features, a: Array, b: Array) -> float:
    """Return the distance of the corners that are nearest to two places [m]; NaN without one."""
    positions = features.corners["position"]
    away = [np.hypot(*(positions - place).T) for place in (a, b)]
    if not all((distance <= GATE).any() for distance in away):
        return math.nan
    return math.dist(*(positions[distance.argmin()] for distance in away))


def _median_view(
    extract: Extractor, scans: list[LaserScan], pose: Pose
) -> tuple[LaserScan, Features]:
    """Return the scan whose distance has the median error, and its features."""

    def error(view: tuple[LaserScan, Features]) -> float:
        distances = found_distances([view[1]], pose)
        return abs(float(distances[0]) - DISTANCE) if len(distances) else math.inf

    return median_of(zip(scans, batch_of(extract, scans), strict=True), error)


def _numbers(distances: Array, count: int) -> dict[str, float | None]:
    """Return the numbers of the distances that are found in so many scans."""
    mean = float(np.mean(distances)) if len(distances) else None
    return {
        "mean": mean,
        "off": None if mean is None else mean - DISTANCE,
        "standard_deviation": float(np.std(distances, ddof=1)) if len(distances) > 1 else None,
        "error": rms(distances - DISTANCE),
        "found": len(distances) / count,
    }


def _row(of: Any, bound: float, is_papers: bool) -> dict[str, Any]:
    """Return the row of a method, with what the paper says of it."""
    mean = None if of["mean"] is None else f"{of['mean']:.4f}"
    paper = {"paper": f"{DISTANCE}", "lost": "lost"} if is_papers else {}
    return {**of, **paper, "here": mean, "over": of["error"] / bound}


def _figure(views: list[tuple[LaserScan, Features]]) -> Figure:
    """Draw the room with the five places, and a scan from each."""
    figure, (room, *panels) = canvas.new_panels(1 + len(POSES), 3)
    canvas.style_plane(room, "The room", "and the five places", WORLD.segments.reshape(-1, 2))
    room.plot(*WORLD.segments.reshape(-1, 2, 2).T, color=canvas.INK)
    room.plot(*np.array((A, B)).T, ":", color=canvas.CORNER_COLOR)
    for name, vertex in (("A", A), ("B", B)):
        drawing.draw_name(
            room, name, vertex, WORLD.segments.reshape(-1, 2).mean(axis=0), canvas.CORNER_COLOR
        )
    for k, (axes, (x, y, theta), (scan, features)) in enumerate(
        zip(panels, POSES, views, strict=True), 1
    ):
        c, s = math.cos(theta), math.sin(theta)
        room.quiver(x, y, c, s, angles="xy", color=canvas.INK)
        room.annotate(f"{k} ", (x, y), ha="right", va="center")
        turn = np.array([[c, -s], [s, c]])
        draw_place(axes, k, scan, features, *((vertex - (x, y)) @ turn for vertex in (A, B)))
    canvas.add_legend(figure)
    return Figure.of("fig13", figure)


def draw_place(axes: Axes, k: int, scan: LaserScan, features: Features, a: Array, b: Array) -> None:
    """Draw what is found from one place, with the names of the corners, in the scanner's frame."""
    shown = drawing.draw_beams(axes, scan, features.clusters)
    canvas.style_plane(axes, f"Place {k}", "in the frame of the scanner", shown)
    drawing.draw_features(axes, features, scan, extent=6.0)
    for name, vertex in (("A", a), ("B", b)):
        drawing.draw_name(axes, name, vertex, np.zeros(2), canvas.CORNER_COLOR)


def _judged_found(n: Any, method: str) -> tuple[str, Margins]:
    found = [place["found"] for place in n["places"][method]]
    least, most = min(found), max(found)
    return f"{100 * least:.0f} to {100 * most:.0f} %", [share - 0.5 for share in found]


def _judged_distance(n: Any, method: str) -> tuple[str, Margins]:
    means = [place["mean"] for place in n["places"][method] if place["mean"] is not None]
    if not means:
        return "found in no scan", []
    about = f"{min(means):.3f} to {max(means):.3f} m"
    return about, [0.01 - abs(mean - DISTANCE) for mean in means]


_FOUND = by_letter("Both found, worst to best place", _judged_found)
_FAR = by_letter(f"Means of the places, of {DISTANCE} m", _judged_distance)
_PAPER = "Their distance: 2.302 m on average, variance lost"
TITLE = "A convex and a concave corner from five places"
CLAIMS = (
    Claim("Figure 13", TITLE, _FOUND, "fig13", "both"),
    Claim("Table 2", _PAPER, _FAR, open="both"),
)
EXPERIMENT = Experiment(f"{TITLE} (Figure 13, Table 2)", measure, report, CLAIMS)
