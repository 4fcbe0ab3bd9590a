"""Features that are followed through real logs, and the motion that they give, beside ICP."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..evaluation.counts import ratio
from ..evaluation.icp import icp
from ..evaluation.tracking import motion_errors, track_scores
from ..extractor import Extractor
from ..methods import DEFAULT_METHOD
from ..motion import Tracker, Tracks
from ..scan import LaserScan, Pose
from ..scan.poses import compose, relative
from .findings import NO_RECORDINGS, Columns, Figure, Findings, Progress, Setting, Table, dot_chart
from .scans import archived_scans

#: The recordings, and the share that is left out at the beginning: the first half of fr079 is
#: where the tracker's roughness was chosen.
LOGS = {
    "Intel lab": ("truth/intel_graph.npz", 0.0),
    "fr079, second half": ("truth/fr079_graph.npz", 0.5),
    "arena, moving": ("truth/jackal_mocap_02171554.npz", 0.0),
    "arena, static": ("truth/jackal_static_data.npz", 0.0),
}
#: Successive scans of each log for each frame of the setting.
SCANS_A_FRAME = 30
#: Errors of the synthetic odometry: deviations [m, rad], and their growth with way and turn.
_WAY, _TURN = (0.02, 0.1), (0.01, 0.1)
#: Relative pose errors are given over one frame, and over so many.
_FAR = 10
ODOMETRY, FEATURES, ICP = "odometry, synthetic", "features", "ICP"

_MOTION = {
    "way, RMSE [mm]": ("way_rmse", 1e3),
    "median": ("way_median", 1e3),
    "95 %": ("way_p95", 1e3),
    "turn, RMSE [mrad]": ("turn_rmse", 1e3),
    "median ": ("turn_median", 1e3),
    f"way over {_FAR} scans, median [mm]": ("far_way_median", 1e3),
    "unobserved [%]": ("unobserved", 100),
}
_TRACKS = {
    "same in both scans": ("pairs", 1),
    "number kept [%]": ("kept", 100),
    "switched [%]": ("switched", 100),
    "lost [%]": ("lost", 100),
    "length of tracks, mean [scans]": ("length_mean", 1),
    "90 %": ("length_p90", 1),
}
_PANELS = {
    "error of the way, median [mm]": ("way_median", 1e3),
    "95 % [mm]": ("way_p95", 1e3),
    "error of the turn, median [mrad]": ("turn_median", 1e3),
}


def run(setting: Setting, progress: Progress) -> Findings:
    """Follow the features of all logs."""
    title = "Tracking and motion in real logs"
    paths = setting.recordings({name: file for name, (file, _) in LOGS.items()})
    if not paths:
        return Findings(title, (NO_RECORDINGS,))
    motions, tracks = {}, {}
    for log, path in paths.items():
        progress(f"{log}: reading")
        scans = load_recording(path, SCANS_A_FRAME * setting.frames, LOGS[log][1])
        motions[log], tracks[log] = measure(log, scans, setting.seed, progress)
    return Findings(
        title,
        _TEXT,
        (
            Table.of_records(
                "Relative pose errors",
                [
                    {"log": log, "motion from": name, **_cells(of, _MOTION)}
                    for log, found in motions.items()
                    for name, of in found.items()
                ],
            ),
            Table.of_records(
                "Tracks",
                [
                    {"log": log, "tracker": name, "of": kind, **_cells(of, _TRACKS)}
                    for log, found in tracks.items()
                    for name, kinds in found.items()
                    for kind, of in kinds.items()
                ],
            ),
        ),
        (
            Figure(
                "tracking",
                "Relative pose errors from scan to scan, by log (colours).",
                dot_chart(motions, _PANELS, _PANELS),
            ),
        ),
        {log: {"motion": motions[log], "tracks": tracks[log]} for log in motions},
    )


_TEXT = (
    "Relative pose errors: the motion between successive scans against that of the corrected "
    f"poses, and composed over {_FAR} scans. The corrected poses of the two offices are right to a "
    "few centimetres only, which limits the errors there; those of the arena come from motion "
    "capture, refined on its walls. ICP is point-to-line from scan to scan, with all points.",
    "The odometry in the two office logs repeats the corrected poses. A synthetic one is made of "
    f"the known poses, with normal errors of {1e3 * _WAY[0]:.0f} mm + {100 * _WAY[1]:.0f} % of the "
    f"way (in x and y) and {_TURN[0]} rad + {100 * _TURN[1]:.0f} % of the turn in each step. "
    "Tracker and ICP start from it, or else from the last motion; the tracker also takes from it "
    "what the features do not determine.",
    "A feature keeps its number if two successive scans have the same number for what is the same "
    "by the known poses; a switch is another number that was given before, lost is a new one.",
)


def _cells(numbers: Mapping[str, float], columns: Columns) -> dict[str, object]:
    return {label: factor * numbers[key] for label, (key, factor) in columns.items()}


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


def measure(
    name: str, scans: Sequence[LaserScan], seed: int, progress: Progress
) -> tuple[dict[str, dict[str, float]], dict[str, dict[str, dict[str, float]]]]:
    """Follow the features of a log, with an odometry and without, and run ICP on it.

    Returns the numbers of relative pose errors by what the motion is from, and those of tracks by
    tracker and kind of feature.
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
        tracks[features] = _track_numbers(frames, found, poses)
        progress(f"{name}: ICP{about}")
        motions[ICP + about] = _icp_motions(scans, None if about else steps)
    numbers = {
        source: motion_errors(motion, poses).summary()
        | {"far_" + k: v for k, v in motion_errors(motion, poses, _FAR).summary().items()}
        | {"unobserved": unobserved.get(source, math.nan)}
        for source, motion in motions.items()
    }
    return numbers, tracks


def _track_numbers(frames: Any, tracks: Sequence[Tracks], poses: Any) -> dict[str, Any]:
    return {
        kind: score.summary()
        | {
            "switched": ratio(score.switched, score.pairs),
            "lost": ratio(score.lost, score.pairs),
        }
        for kind, score in track_scores(frames, tracks, poses).items()
    }


def _icp_motions(scans: Sequence[LaserScan], starts: Sequence[Pose] | None) -> list[Pose]:
    """Return the motion from scan to scan; without starts, each search begins with the last one."""
    motions: list[Pose] = []
    for i in range(len(scans) - 1):
        last = motions[-1] if motions else (0.0, 0.0, 0.0)
        motions.append(icp(scans[i], scans[i + 1], last if starts is None else starts[i]))
    return motions
