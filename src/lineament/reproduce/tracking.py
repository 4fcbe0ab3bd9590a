"""Features that are followed through real logs, and the motion that they tell, beside ICP's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..evaluation.counts import ratio
from ..evaluation.icp import icp
from ..evaluation.tracking import MotionErrors, TrackScores, motion_errors, track_scores
from ..extractor import Extractor
from ..methods import DEFAULT_METHOD
from ..motion import Tracker, Tracks
from ..scan import LaserScan, Pose
from ..scan.poses import compose, relative
from .charts import dot_chart
from .findings import Figure, Findings, Progress, Setting, Table

__all__ = ["LOGS", "Recording", "load_recording", "measure", "run", "stand_in_odometry"]

#: The recordings, by name, and the share of each that is left out at its beginning: the first half
#: of fr079 is where the tracker's roughness was chosen.
LOGS = {
    "Intel lab": ("truth/intel_graph.npz", 0.0),
    "fr079, second half": ("truth/fr079_graph.npz", 0.5),
    "arena, moving": ("truth/jackal_mocap_02171554.npz", 0.0),
    "arena, static": ("truth/jackal_static_data.npz", 0.0),
}
#: Successive scans of each log for each frame of the setting.
SCANS_A_FRAME = 30
#: Errors of the stand-in for odometry: deviations [m, rad], and their growth with way and turn.
_WAY, _TURN = (0.02, 0.1), (0.01, 0.1)
#: Relative pose errors are given over one frame, and over so many.
_FAR = 10
ODOMETRY, FEATURES, ICP = "odometry, stand-in", "features", "ICP"


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Successive scans, and the known pose of each."""

    scans: list[LaserScan]
    poses: list[Pose]


@dataclass(frozen=True, slots=True, eq=False)
class _Result:
    """What was measured in a log."""

    frames: int
    motions: dict[str, tuple[MotionErrors, MotionErrors]]
    tracks: dict[str, dict[str, TrackScores]]
    unobserved: dict[str, float]

    def summary(self) -> dict[str, object]:
        """List all figures by name."""
        return {
            "frames": self.frames,
            "motion": {
                name: {"step": near.summary(), f"step_{_FAR}": far.summary()}
                for name, (near, far) in self.motions.items()
            },
            "tracks": {
                name: {kind: score.summary() for kind, score in scores.items()}
                for name, scores in self.tracks.items()
            },
            "unobserved": self.unobserved,
        }


def run(setting: Setting, progress: Progress) -> Findings:
    """Follow the features of all logs that are there."""
    title = "Tracking and motion in real logs"
    results = {}
    for name, (file, skipped) in LOGS.items():
        path = setting.recording(file)
        if path is not None:
            progress(f"{name}: reading")
            recording = load_recording(path, SCANS_A_FRAME * setting.frames, skipped)
            results[name] = measure(name, recording, setting.seed, progress)
    if not results:
        return Findings(title, ("The recordings are not there: nothing was measured.",))
    return Findings(
        title,
        _TEXT,
        (_motion_table(results), _track_table(results)),
        (_figure(results),),
        {name: result.summary() for name, result in results.items()},
    )


_TEXT = (
    "Relative pose errors: the motion between successive scans against that of the corrected "
    f"poses, and put together over {_FAR} scans. The corrected poses of the two offices are right "
    "to a few centimetres only, and so is what the errors tell there; those of the arena come from "
    "motion capture, refined on its walls.",
    "What the two office logs hold as odometry is no measurement of its own: it repeats the "
    "corrected poses, turn by turn. A stand-in is made of the known poses instead, with the "
    f"errors of each step {1e3 * _WAY[0]:.0f} mm + {100 * _WAY[1]:.0f} % of the way (in x and y) "
    f"and {_TURN[0]} rad + {100 * _TURN[1]:.0f} % of the turn, normally distributed. It is where "
    "both the tracker and ICP begin; the tracker takes what the features do not tell from it. "
    "Without it, both begin with the last motion.",
    "ICP is point-to-line from scan to scan, with all points, written plainly. A feature keeps its "
    "number where two successive scans have the same number for what the known poses tell to be "
    "the same; a switch is another number that was given before, lost is a new one.",
)


def load_recording(path: Path, count: int, skipped: float = 0.0) -> Recording:
    """Load so many successive scans of an archive, after a share that is left out."""
    with np.load(path) as archive:
        known = archive["poses_refined" if "poses_refined" in archive else "poses"]
        first = int(skipped * len(known))
        chosen = slice(first, first + count)
        x_axis = float(archive["angle_min"]), float(archive["angle_increment"])
        range_max = float(archive["range_max"])
        rows, stamps = archive["ranges"][chosen], archive["stamps"][chosen].tolist()
    scans = [
        LaserScan(row, *x_axis, range_max=range_max, stamp=stamp)
        for row, stamp in zip(rows, stamps, strict=True)
    ]
    return Recording(scans, [(x, y, theta) for x, y, theta in known[chosen].tolist()])


def stand_in_odometry(poses: Sequence[Pose], seed: int) -> list[Pose]:
    """Poses as an odometry might tell them: the known ones, with errors that add up.

    Examples
    --------
    >>> way = stand_in_odometry([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], seed=1)
    >>> way[0], round(way[1][0])
    ((0.0, 0.0, 0.0), 1)
    """
    rng = np.random.default_rng(seed)
    way = [poses[0]]
    for pose, following in pairwise(poses):
        x, y, turn = relative(pose, following)
        off_way = _WAY[0] + _WAY[1] * math.hypot(x, y)
        off_turn = _TURN[0] + _TURN[1] * abs(turn)
        dx, dy, dt = (rng.standard_normal(3) * (off_way, off_way, off_turn)).tolist()
        way.append(compose(way[-1], (x + dx, y + dy, turn + dt)))
    return way


def measure(name: str, recording: Recording, seed: int, progress: Progress) -> _Result:
    """Follow the features of a log, with an odometry and without, and run ICP on it."""
    scans, poses = recording.scans, recording.poses
    extract = Extractor(DEFAULT_METHOD)
    frames = [extract(scan) for scan in scans]
    odometry = stand_in_odometry(poses, seed)
    motions = {ODOMETRY: [relative(a, b) for a, b in pairwise(odometry)]}
    followed: dict[str, list[Tracks]] = {}
    for about, priors in (("", odometry), (", no odometry", [None] * len(poses))):
        progress(f"{name}: tracking{about}")
        tracker = Tracker()
        tracks = [tracker(features, prior) for features, prior in zip(frames, priors, strict=True)]
        followed[FEATURES + about] = tracks
        motions[FEATURES + about] = [t.motion.pose for t in tracks if t.motion is not None]
        progress(f"{name}: ICP{about}")
        motions[ICP + about] = _icp_motions(scans, motions[ODOMETRY] if not about else None)
    return _Result(
        len(scans),
        {n: (motion_errors(m, poses), motion_errors(m, poses, _FAR)) for n, m in motions.items()},
        {n: track_scores(frames, tracks, poses) for n, tracks in followed.items()},
        {n: _unobserved(tracks) for n, tracks in followed.items()},
    )


def _icp_motions(scans: Sequence[LaserScan], starts: Sequence[Pose] | None) -> list[Pose]:
    """Motion from scan to scan; each search begins with the last motion if nothing is given."""
    motions: list[Pose] = []
    for i in range(len(scans) - 1):
        last = motions[-1] if motions else (0.0, 0.0, 0.0)
        motions.append(icp(scans[i], scans[i + 1], last if starts is None else starts[i]))
    return motions


def _unobserved(tracks: Sequence[Tracks]) -> float:
    """Share of the motions that the features do not tell in some direction."""
    motions = [track.motion for track in tracks if track.motion is not None]
    return ratio(sum(not motion.observable for motion in motions), len(motions))


def _motion_table(results: Mapping[str, _Result]) -> Table:
    rows = []
    for log, result in results.items():
        for name, (near, far) in result.motions.items():
            figures, over = near.summary(), far.summary()
            rows.append(
                {
                    "log": log,
                    "motion from": name,
                    "way, RMSE [mm]": 1e3 * figures["way_rmse"],
                    "median": 1e3 * figures["way_median"],
                    "95 %": 1e3 * figures["way_p95"],
                    "turn, RMSE [mrad]": 1e3 * figures["turn_rmse"],
                    "median ": 1e3 * figures["turn_median"],
                    f"way over {_FAR} scans, median [mm]": 1e3 * over["way_median"],
                    "unobserved [%]": 100 * result.unobserved.get(name, math.nan),
                }
            )
    return Table.of_records("Relative pose errors", rows)


def _track_table(results: Mapping[str, _Result]) -> Table:
    rows = []
    for log, result in results.items():
        for name, scores in result.tracks.items():
            for kind, score in scores.items():
                figures = score.summary()
                rows.append(
                    {
                        "log": log,
                        "tracker": name,
                        "of": kind,
                        "same in both scans": score.pairs,
                        "number kept [%]": 100 * figures["kept"],
                        "switched [%]": 100 * ratio(score.switched, score.pairs),
                        "lost [%]": 100 * ratio(score.lost, score.pairs),
                        "length of tracks, mean [scans]": figures["length_mean"],
                        "90 %": figures["length_p90"],
                    }
                )
    return Table.of_records("Tracks", rows)


def _figure(results: Mapping[str, _Result]) -> Figure:
    shown = {
        "error of the way, median [mm]": "way_median",
        "95 % [mm]": "way_p95",
        "error of the turn, median [mrad]": "turn_median",
    }
    panels = {
        label: {
            log: {name: 1e3 * near.summary()[key] for name, (near, _) in result.motions.items()}
            for log, result in results.items()
        }
        for label, key in shown.items()
    }
    return Figure(
        "tracking",
        "Relative pose errors from scan to scan, by log (colours).",
        dot_chart(panels, log_axes=frozenset(shown)),
    )
