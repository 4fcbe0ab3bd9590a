"""How well features are followed, and the motion between frames: against known poses."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from lineament.features import Features
from lineament.motion import Tracks
from lineament.scan import Array, Pose
from lineament.scan.poses import compose, relative

from .counts import Summable, quantile, ratio, rms
from .kinds import ANGLE, line_errors
from .matching import Indices, match, match_points

#: Features of two frames, in one frame, are the same within this distance [m]; segments also lie
#: side by side along this share of the shorter one.
_GATE, _OVERLAP = 0.10, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class MotionErrors(Summable):
    """Relative pose errors: how far estimated motions are from the true ones."""

    #: Errors of the way [m] and of the turn [rad], without their signs, (m,).
    ways: Array = field(default_factory=lambda: np.empty(0))
    turns: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, off: Sequence[Pose]) -> "MotionErrors":
        """Return those of estimated motions in the frames of the true ones."""
        x, y, turn = np.array(off).reshape(-1, 3).T
        return cls(np.hypot(x, y), abs(turn))

    def summary(self) -> dict[str, float]:
        """List the figures by name; `std` is the scatter about the mean."""
        figures: dict[str, float] = {"motions": len(self.ways)}
        for name, errors in (("way", self.ways), ("turn", self.turns)):
            mean = ratio(float(errors.sum()), len(errors))
            figures |= {
                f"{name}_rmse": rms(errors),
                f"{name}_mean": mean,
                f"{name}_std": rms(errors - mean),
                f"{name}_median": quantile(errors, 0.5),
                f"{name}_p95": quantile(errors, 0.95),
            }
        return figures


def chained(motions: Sequence[Pose]) -> list[Pose]:
    """Put motions between successive frames together: the pose of each, from (0, 0, 0) on."""
    return list(accumulate(motions, compose, initial=(0.0, 0.0, 0.0)))


def motion_errors(motions: Sequence[Pose], poses: Sequence[Pose], step: int = 1) -> MotionErrors:
    """Compare motions between successive frames, composed over `step` of them, with the true ones.

    Motions are the pose of each frame, from the second on, in the frame before; there is one more
    true pose, else ValueError.
    """
    if len(poses) != len(motions) + 1:
        raise ValueError(f"there are {len(poses)} poses, expected one more than motions")
    way = chained(motions)
    return MotionErrors.of(
        [
            relative(relative(poses[i], poses[i + step]), relative(way[i], way[i + step]))
            for i in range(len(poses) - step)
        ]
    )


@dataclass(frozen=True, slots=True, eq=False)
class TrackScores(Summable):
    """How the tracks of one kind last."""

    #: Features that are the same in two successive frames by the known poses; of these, those whose
    #: number changes to one that was given before, an *id switch*, or to a new one.
    pairs: int = 0
    switched: int = 0
    lost: int = 0
    #: Frames in which each track is seen, shape (m,).
    lengths: Array = field(default_factory=lambda: np.empty(0))

    def summary(self) -> dict[str, float]:
        """List the figures by name."""
        return {
            "pairs": self.pairs,
            "kept": ratio(self.pairs - self.switched - self.lost, self.pairs),
            "switched": ratio(self.switched, self.pairs),
            "lost": ratio(self.lost, self.pairs),
            "length_mean": ratio(float(self.lengths.sum()), len(self.lengths)),
            "length_p90": quantile(self.lengths, 0.9),
        }


def track_scores(
    frames: Sequence[Features], tracks: Sequence[Tracks], poses: Sequence[Pose]
) -> dict[str, TrackScores]:
    """Score the tracks of "segments" and "corners" by how often their numbers change.

    The features of a frame are moved by the known poses into the frame before. Corners are the
    same within 0.10 m; segments if the centroids of both are within 0.10 m of the other's line,
    the directions within 10°, and they lie side by side along half of the shorter one. They are
    matched one to one, without any of the tracker's own gates.
    """
    scores = {}
    for kind, same in (("segments", _same_segments), ("corners", _same_corners)):
        numbers: list[NDArray[np.int64]] = [getattr(track, kind) for track in tracks]
        tracked = [of_frame >= 0 for of_frame in numbers]
        numbers = [of_frame[kept] for of_frame, kept in zip(numbers, tracked, strict=True)]
        pairs = switched = lost = 0
        for i in range(len(frames) - 1):
            moved = frames[i + 1].transform(*relative(poses[i], poses[i + 1]))
            before, now = getattr(frames[i], kind), getattr(moved, kind)
            one, other = same(before[tracked[i]], now[tracked[i + 1]])
            changed = numbers[i][one] != numbers[i + 1][other]
            new = np.isin(numbers[i + 1][other], tracks[i + 1].born)
            pairs += len(one)
            switched += int((changed & ~new).sum())
            lost += int((changed & new).sum())
        _, lengths = np.unique(np.concatenate(numbers), return_counts=True)
        scores[kind] = TrackScores(pairs, switched, lost, lengths.astype(np.float64))
    return scores


def _same_corners(before: NDArray[np.void], now: NDArray[np.void]) -> tuple[Indices, Indices]:
    return match_points(before["position"], now["position"], _GATE)[:2]


def _same_segments(before: NDArray[np.void], now: NDArray[np.void]) -> tuple[Indices, Indices]:
    one, other = before[:, np.newaxis], now[np.newaxis]
    offset, turn = line_errors(other, one)
    back, _ = line_errors(one, other)
    tangent = np.stack((np.cos(one["angle"]), np.sin(one["angle"])), axis=-1)
    length = ((one["end"] - one["start"]) * tangent).sum(axis=-1)
    first, last = (((other[end] - one["start"]) * tangent).sum(axis=-1) for end in ("start", "end"))
    shared = np.minimum(last, length) - np.maximum(first, 0.0)
    near = (abs(offset) <= _GATE) & (abs(back) <= _GATE) & (abs(turn) <= ANGLE)
    beside = shared >= _OVERLAP * np.minimum(length, last - first)
    return match(-shared, near & beside)
