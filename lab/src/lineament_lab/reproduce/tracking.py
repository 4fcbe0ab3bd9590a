"""Features that are followed through real logs, and the motion that they give, beside ICP."""

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lineament.extractor import Extractor
from lineament.methods import DEFAULT_METHOD
from lineament.motion import Tracker
from lineament.scan import LaserScan, Pose
from lineament.scan.poses import compose, relative

from ..evaluation.arena import archived_scans
from ..evaluation.counts import ratio
from ..evaluation.icp import icp
from ..evaluation.relations import read_relations
from ..evaluation.tracking import chained, motion_errors, track_scores
from .experiment import Experiment, Measured, MissingError, Report
from .findings import Figure, Numbers, Progress, Setting, Table, dot_chart
from .prose import prose

#: The recordings, and the share that is left out at the beginning: the first half of fr079 is
#: where the tracker's roughness was chosen.
LOGS = {
    "Intel lab": ("truth/intel_graph.npz", 0.0),
    "fr079, second half": ("truth/fr079_graph.npz", 0.5),
    "arena, moving": ("truth/jackal_mocap_02171554.npz", 0.0),
    "arena, static": ("truth/jackal_static_data.npz", 0.0),
}
#: Their verified relations, in the folder of the recordings or beside it.
RELATIONS = {
    "Intel lab": "graph/intel-lab.relations",
    "fr079, second half": "../relations/fr079.relations",
}
#: Successive scans of each log for each frame of the setting.
SCANS_A_FRAME = 300
#: Errors of the synthetic odometry: deviations [m, rad], and their growth with way and turn.
_WAY, _TURN = (0.02, 0.1), (0.01, 0.1)
#: Relative pose errors are given over one frame, and over so many.
_FAR = 10
ODOMETRY, FEATURES, ICP = "odometry, synthetic", "features", "ICP"
CORRECTED = "the log’s corrected poses"
#: Numbers by relations: all, those up to a minute apart, those over a minute apart.
RELATION_KEYS = "relations", "near", "far_apart"

_RELATIONS = {
    "relations": "motions",
    "way, mean [mm]": "way_mean",
    "std [mm]": "way_std",
    "median [mm]": "way_median",
    "turn, mean [°]": "turn_mean",
    "std [°]": "turn_std",
    "median [°]": "turn_median",
}
_MOTION = {
    "way, RMSE [mm]": "way_rmse",
    "median [mm]": "way_median",
    "95 % [mm]": "way_p95",
    "turn, RMSE [mrad]": "turn_rmse",
    "median [mrad]": "turn_median",
    f"way over {_FAR} scans, median [mm]": "far_way_median",
    "unobserved [%]": "unobserved",
}
_TRACKS = {
    "same in both scans": "pairs",
    "number kept [%]": "kept",
    "switched [%]": "switched",
    "lost [%]": "lost",
    "length of tracks, mean [scans]": "length_mean",
    "90 %": "length_p90",
}
#: The tables of motions: titles, their numbers, columns.
_TABLES = (
    ("Motion against verified relations", "relations", _RELATIONS),
    ("Of these, those up to a minute apart", "near", _RELATIONS),
    ("Of these, those over a minute apart", "far_apart", _RELATIONS),
    ("Motion against the log’s corrected poses", "motion", _MOTION),
)
_PANELS = {
    "error of the way, median [mm]": "way_median",
    "95 % [mm]": "way_p95",
    "error of the turn, median [mrad]": "turn_median",
}


def measure(setting: Setting, progress: Progress) -> Measured:
    """Follow the features of all logs."""
    paths = setting.recordings({name: file for name, (file, _) in LOGS.items()})
    verified = setting.recordings(RELATIONS)
    if not paths:
        raise MissingError("no recordings")
    found = {}
    for log, path in paths.items():
        progress(f"{log}: reading")
        scans = load_recording(path, SCANS_A_FRAME * setting.frames, LOGS[log][1])
        found[log] = measure_log(log, scans, setting.seed, progress, verified.get(log))
    motions = {log: of["motion"] for log, of in found.items()}
    return Measured(
        found, lambda: [Figure.of("tracking", dot_chart(motions, _PANELS, _PANELS), "motions")]
    )


def report(n: Numbers, _: Setting) -> Report:
    """Make a table for each reference of motion, and that of tracks."""
    tables = []
    for title, key, columns in _TABLES:
        rows = {(log, source): of for log, every in n.items() for source, of in every[key].items()}
        tables.append(Table.of_numbers(title, rows, columns, first=("log", "motion from")))
    kinds = {
        (log, f"{source}: {kind}"): of
        for log, every in n.items()
        for source, tracks in every["tracks"].items()
        for kind, of in tracks.items()
    }
    tables.append(Table.of_numbers("Tracks", kinds, _TRACKS, first=("log", "tracker: of")))
    percent = {"way": (1e3 * _WAY[0], 100 * _WAY[1]), "turn": (_TURN[0], 100 * _TURN[1])}
    return prose("tracking", far=_FAR, **percent), tables


def load_recording(path: Path, count: int, skipped: float = 0.0) -> list[LaserScan]:
    """Load so many successive scans of an archive, after a share that is left out."""
    scans = archived_scans(path)
    first = int(skipped * len(scans))
    return scans[first : first + count]


def stand_in_odometry(poses: Sequence[Pose], seed: int) -> list[Pose]:
    """Make a synthetic odometry: the known poses, with errors that accumulate."""
    rng = np.random.default_rng(seed)
    way = [poses[0]]
    for pose, following in pairwise(poses):
        x, y, turn = relative(pose, following)
        off_way = _WAY[0] + _WAY[1] * math.hypot(x, y)
        off_turn = _TURN[0] + _TURN[1] * abs(turn)
        dx, dy, dt = (rng.standard_normal(3) * (off_way, off_way, off_turn)).tolist()
        way.append(compose(way[-1], (x + dx, y + dy, turn + dt)))
    return way


def measure_log(
    name: str,
    scans: Sequence[LaserScan],
    seed: int,
    progress: Progress,
    verified: Path | None = None,
) -> dict[str, dict[str, Any]]:
    """Follow the features of a log, with an odometry and without, and run ICP on it.

    Returns errors of motions by what they are from, against the poses as "motion", against the
    relations of a file by `RELATION_KEYS`, and "tracks" by tracker and kind of feature.
    """
    poses = [scan.pose for scan in scans if scan.pose is not None]
    extract = Extractor(DEFAULT_METHOD)
    frames = [extract(scan) for scan in scans]
    odometry = stand_in_odometry(poses, seed)
    steps = [relative(a, b) for a, b in pairwise(odometry)]
    motions, unobserved, tracks = {ODOMETRY: steps}, {}, {}
    for about, priors in (("", odometry), (", no odometry", [None] * len(poses))):
        progress(f"{name}: tracking{about}")
        tracker, features = Tracker(), FEATURES + about
        found = [tracker(frame, prior) for frame, prior in zip(frames, priors, strict=True)]
        moved = [track.motion for track in found if track.motion is not None]
        motions[features] = [motion.pose for motion in moved]
        unobserved[features] = ratio(sum(not motion.observable for motion in moved), len(moved))
        scores = track_scores(frames, found, poses)
        tracks[features] = {kind: score.summary() for kind, score in scores.items()}
        progress(f"{name}: ICP{about}")
        motions[ICP + about] = _icp_motions(scans, None if about else steps)
    numbers: dict[str, dict[str, Any]] = {key: {} for key in RELATION_KEYS} | {"tracks": tracks}
    if verified is not None:
        every = read_relations(verified, np.array([scan.stamp for scan in scans]))
        ways = {CORRECTED: poses} | {source: chained(of) for source, of in motions.items()}
        parts = every, every.far_apart(False), every.far_apart()
        for key, relations in zip(RELATION_KEYS, parts, strict=True):
            numbers[key] = {by: relations.errors(way).summary() for by, way in ways.items()}
    numbers["motion"] = {
        source: motion_errors(motion, poses).summary()
        | {"far_" + k: v for k, v in motion_errors(motion, poses, _FAR).summary().items()}
        | {"unobserved": unobserved.get(source, math.nan)}
        for source, motion in motions.items()
    }
    return numbers


def _icp_motions(scans: Sequence[LaserScan], starts: Sequence[Pose] | None) -> list[Pose]:
    """Return the motion from scan to scan; without starts, each search begins with the last one."""
    motions: list[Pose] = []
    for i, pair in enumerate(pairwise(scans)):
        last = motions[-1] if motions else (0.0, 0.0, 0.0)
        motions.append(icp(*pair, last if starts is None else starts[i]))
    return motions


EXPERIMENT = Experiment("Tracking and motion in real logs", measure, report, once=True)
