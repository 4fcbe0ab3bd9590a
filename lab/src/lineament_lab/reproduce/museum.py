"""Figures 11 to 13 and Tables 2 and 3 on a bag of the museum that the paper's scans are from."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.logs import open_log
from lineament.methods import DEFAULT_METHOD
from lineament.motion import Tracker
from lineament.output import canvas
from lineament.scan import Array, LaserScan
from lineament.scan.poses import compose

from ..evaluation.similarity import SimilarityScores, similarity_scores
from .contenders import IEPF, PAPER, PDBS_LINES, Extract, fitted_methods
from .experiment import Experiment, Measured, MissingError, Report
from .findings import Columns, Figure, Progress, Setting, Table, each
from .prose import prose
from .scans import frame_times, median_scan, spread_scans
from .scenes import pictures
from .similarity import error_strips, feature_counts
from .two_corners import DISTANCE, distance_found, draw_place

#: The topic of the scans in a bag of the Deutsches Museum, 2-D, by Cartographer.
TOPIC = "horizontal_laser_2d"
#: Scans in a row in which corners are followed, for each frame of the setting; their distance in
#: time at least [s]; and of the corners, at least and at most [m].
SCANS_A_FRAME, APART, FAR = 40, 0.1, (1.0, 5.0)
PLACES = 5


class View(NamedTuple):
    """A scan, what `optimal` finds in it, the way to it [m], and followed corners by number.

    Each has its position [m], and whether it is convex.
    """

    scan: LaserScan
    features: Features
    way: float
    corners: dict[int, tuple[Array, bool]]


def measure(setting: Setting, progress: Progress) -> Measured:
    """Measure all methods on the bag of the setting."""
    if setting.museum is None:
        raise MissingError("no bag")
    progress("reading")
    frames, in_row = read(setting.museum, setting.frames)
    methods = fitted_methods(setting.methods)
    scores, of_methods = {}, {}
    for name, extract in each(methods, progress, f"{len(frames)} scans"):
        scores[name], of_methods[name] = _measured(extract, frames)
    numbers: dict[str, Any] = {"methods": of_methods, "scans": len(frames)}
    scan = frames[median_scan(scores, lambda of: of.mean)]
    progress("following corners")
    seen = views_of_two(follow(in_row))
    if seen is not None:
        numbers |= {"distance": _distances(*seen, methods), "views": len(seen[0])}

    def draw() -> Iterable[Figure]:
        """Draw the scan with the median error, its errors, and the two corners."""
        (about,) = prose("museum-fig11", scans=len(frames))
        found = {name: extract(scan) for name, extract in methods.items()}
        yield from pictures("museum-fig11", about, scan, found)
        strips = {name: found[name] for name in (PAPER, IEPF, PDBS_LINES)}
        yield Figure.of("museum-fig12", error_strips(scan, strips))
        if seen is not None:
            yield _places(*seen)

    return Measured(numbers, draw)


_COLUMNS = {
    "clusters a scan": "clusters",
    "segments a scan": "segments",
    "corners a scan": "corners",
    "similarity error, mean [mm]": "mean",
    "largest [m]": "largest",
    "explained [%]": "explained",
    "time [µs]": "time",
}
_DISTANCE: Columns = {
    "paper: mean [m]": "paper",
    "here: mean [m]": "here",
    "standard deviation [mm]": "deviation",
    "found in [%]": "found",
    **{f"place {k} [m]": f"place {k}" for k in range(1, PLACES + 1)},
}


def report(n: Any, _: Setting) -> Report:
    """Make a table of all scans, and that of the distance."""
    title = f"Figure 12 and Table 3, as far as they need no truth: {n['scans']} scans"
    note, of_distance = prose("notes of museum")
    tables = [Table.of_numbers(title, n["methods"], _COLUMNS, note)]
    if "distance" in n:
        title = f"Table 2: distance of A and B in {n['views']} scans"
        rows = {name: _row(name, of) for name, of in n["distance"].items()}
        tables.append(Table.of_numbers(title, rows, _DISTANCE, of_distance))
    return prose("museum", near=FAR[0], far=FAR[1], method=DEFAULT_METHOD), tables


def _row(name: str, of: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of a method in the table of the distance."""
    metres = {"here": of["mean"]} | {f"place {k}": at for k, at in enumerate(of["places"], 1)}
    shown = {key: None if math.isnan(at) else f"{at:.3f}" for key, at in metres.items()}
    return {**of, **shown, "paper": f"{DISTANCE}" if name == PAPER else None}


def _measured(
    extract: Extract, scans: Sequence[LaserScan]
) -> tuple[list[SimilarityScores], dict[str, float]]:
    """Return the similarity of each scan, and the numbers of a method over all scans."""
    found = [extract(scan) for scan in scans]
    scores, counts = list(map(similarity_scores, scans, found)), list(map(feature_counts, found))
    total = SimilarityScores.total(scores)
    time = np.median(frame_times(extract, scans)) if isinstance(extract, Extractor) else math.nan
    kinds = ("clusters", "segments", "corners")
    return scores, {
        **{kind: float(np.mean([of[kind] for of in counts])) for kind in kinds},
        "mean": total.mean,
        "largest": total.maximum,
        "explained": total.explained,
        "time": float(time),
    }


def read(path: Path, count: int) -> tuple[list[LaserScan], list[LaserScan]]:
    """Read so many scans from equal parts of a bag, and those in a row from its first third on.

    The scans are of the museum's topic, or of the one that the bag would be read by without it.
    """
    log = open_log(path, keep_going=True)
    for topic in log.topics:
        if topic.strip("/") == TOPIC:
            log = open_log(path, topic=topic, keep_going=True)
    in_row: list[LaserScan] = []
    for scan in islice(log, len(log) // 3, None):
        if not in_row or scan.stamp >= in_row[-1].stamp + APART:
            in_row.append(scan)
        if len(in_row) == SCANS_A_FRAME * count:
            break
    return spread_scans(log, count), in_row


def follow(scans: Iterable[LaserScan]) -> list[View]:
    """Follow the corners of scans in a row."""
    extract, tracker, views = Extractor(DEFAULT_METHOD), Tracker(), []
    pose, way = (0.0, 0.0, 0.0), 0.0
    for scan in scans:
        features = extract(scan)
        tracks = tracker(features)
        if tracks.motion is not None:
            before, pose = pose, compose(pose, tracks.motion.pose)
            way += math.dist(before[:2], pose[:2])
        corners = {
            number: (row["position"], bool(row["convex"]))
            for number, row in zip(tracks.corners.tolist(), features.corners, strict=True)
            if number >= 0
        }
        views.append(View(scan, features, way, corners))
    return views


def views_of_two(views: Sequence[View]) -> tuple[list[View], int, int] | None:
    """Return the views that show a convex and a concave corner over the longest way, and these.

    None if no two are seen together from five places.
    """
    together: dict[tuple[int, int], list[View]] = defaultdict(list)
    for view in views:
        for (a, (place, convex)), (b, (other, other_convex)) in product(
            view.corners.items(), repeat=2
        ):
            if convex and not other_convex and FAR[0] <= math.dist(place, other) <= FAR[1]:
                together[a, b].append(view)
    enough = {pair: seen for pair, seen in together.items() if len(seen) >= PLACES}
    if not enough:
        return None
    (a, b), seen = max(enough.items(), key=lambda item: item[1][-1].way - item[1][0].way)
    return seen, a, b


def _at_places(views: Sequence[View]) -> list[View]:
    """Return the views nearest to five places at equal parts of the way."""
    ways = np.array([view.way for view in views])
    return [views[abs(ways - at).argmin()] for at in np.linspace(ways[0], ways[-1], PLACES)]


def _distances(
    views: Sequence[View], a: int, b: int, methods: Mapping[str, Extract]
) -> dict[str, dict[str, Any]]:
    """Measure the distance of the two corners by each method."""
    numbers = {}
    for name, extract in methods.items():
        places, all_views = (
            np.array(
                [distance_found(extract(v.scan), v.corners[a][0], v.corners[b][0]) for v in of]
            )
            for of in (_at_places(views), views)
        )
        some = all_views[~np.isnan(all_views)]
        numbers[name] = {
            "found": len(some) / len(all_views),
            "mean": float(some.mean()) if len(some) else math.nan,
            "deviation": float(some.std(ddof=1)) if len(some) > 1 else math.nan,
            "places": places,
        }
    return numbers


def _places(views: Sequence[View], a: int, b: int) -> Figure:
    """Draw what is found from the five places."""
    figure, panels = canvas.new_panels(PLACES, 3)
    for k, (axes, view) in enumerate(zip(panels, _at_places(views), strict=True), 1):
        places = (view.corners[number][0] for number in (a, b))
        draw_place(axes, k, view.scan, view.features, *places)
    canvas.add_legend(figure)
    return Figure.of("museum-fig13", figure, method=DEFAULT_METHOD)


EXPERIMENT = Experiment("The paper’s museum", measure, report, once=True)
