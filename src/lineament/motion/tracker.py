"""`Tracker`: features that keep their numbers from frame to frame, and the motion between."""

import math
from collections import deque
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from .._copies import InTurn, in_turn
from ..features import TABLES, Features
from ..kernels.tracking.association import move
from ..scan import Array, Pose
from ..scan.fields import at_least_0, checked_pose
from ..scan.poses import Twist, inverse, poses_along, relative
from .association import KINDS, Frame, Pairs, chi_square, paired, words_of
from .estimate import Motion, motion_by
from .relocation import is_contradicted, relocated

Numbers = NDArray[np.int64]
#: Of segments, corners and arcs.
AllPairs = tuple[Pairs, Pairs, Pairs]

#: No pairs at all.
_LOST: AllPairs = (np.empty((0, 2), np.intp),) * 3
#: Deviations of the motion by odometry [m, rad], and their growth with way and turn.
_ODOMETRY = (0.03, 0.01), (0.1, 0.1)
#: The same of the motion that goes on as it was, or of none: no way is known to grow with.
_CONTINUED = (0.1, 0.1), (0.5, 0.5)
#: A motion goes on for so long [s]; then the sensor may stand, or go like this [m/s, rad/s].
_GOES_ON, _MAY_GO = 1.0, (0.5, 0.5)
#: Where a motion is known worse than this, another corner may be where one is expected [m, rad].
_UNIQUE = 0.6, 0.35
#: Deviations of a motion of which nothing is known [m, m, rad].
_ANYWHERE = np.array((3.0, 3.0, math.pi))
#: A motion that would be faster is one whose stamps are wrong [m/s, rad/s].
FASTEST = 50.0
#: How often pairs are looked for: with the expected motion, then with the estimated one.
_ROUNDS = 3


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Tracks:
    """Who is who in a frame.

    Attributes
    ----------
    segments, corners, arcs : ndarray of int64
        Number of the track of each feature, parallel to the tables of the frame. A number belongs
        to one track alone, of whatever kind, for good.
    born : ndarray of int64
        Tracks that begin with this frame.
    ended : ndarray of int64
        Tracks that have been missed for too long, and are given up with this frame.
    motion : Motion or None
        Pose of this frame's sensor in the frame before; None of the first frame.
    """

    segments: Numbers
    corners: Numbers
    arcs: Numbers
    born: Numbers
    ended: Numbers
    motion: Motion | None

    def __repr__(self) -> str:
        sizes = [f"{len(getattr(self, name))} {name}" for name in (*KINDS, "born", "ended")]
        return f"Tracks({', '.join(sizes)}, {self.motion})"


class Tracker(InTurn):
    """Recognises features from frame to frame, and estimates the motion of the sensor.

    Features are paired with the last sight of all tracks (`associate`), first under the expected
    motion (by odometry; without it, the sensor goes on as it did), then under that of the pairs
    (`estimate_motion`, from the tracks seen in the very last frame). A feature without a pair
    begins a track; a track ends when it is missed in more than `max_missed` frames in a row. The
    world is taken to stand still: what moves by more than its gate from frame to frame gets a new
    number. Edges are ignored: they may be silhouettes, which move with the sensor.

    After a pause of more than a second or so, a jump of the clock, or where hardly any wall is near
    one of before, the sensor may be anywhere: it is looked for by its walls. If there is more than
    one place where it may be, as in a room that is the same from both ends, no direction of the
    motion is observed, and all tracks end.

    The covariance of the motion is that of the scans as they are given. What scans are off by as
    the sensor moves while they sweep is not in it, nor what `deskew` leaves of that where the twist
    changes; `Odometer` adds it.

    Parameters
    ----------
    max_missed : int
        Frames through which a track lasts without being seen.
    gate, roughness : float
        As in `associate`; surfaces are rough by 0 in a simulation, by 1 cm in offices.

    Raises
    ------
    ValueError
        If a parameter is out of bounds.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, drive, room
    >>> tracker, extract = Tracker(), ln.Extractor("liu:scale_free")
    >>> for scan in drive(room(), [(-2, 0), (-1.8, 0)], SENSORS["paper"], speed=1, rate=10):
    ...     tracks = tracker(extract(scan))
    >>> tracks.motion.observable, round(tracks.motion.x, 2)
    (True, 0.1)
    """

    def __init__(self, max_missed: int = 5, *, gate: float = 0.99, roughness: float = 0.01) -> None:
        is_whole = isinstance(max_missed, Integral) and not isinstance(max_missed, bool)
        if not is_whole or max_missed < 0:
            raise ValueError(f"max_missed is {max_missed!r}, expected a whole number ≥ 0")
        at_least_0("roughness", roughness)
        chi_square(gate, 2)
        self.max_missed, self.gate, self.roughness = max_missed, gate, roughness
        #: Last sight of each track, in the frame of the last scan; those of that scan come first.
        segments, corners, arcs = (np.empty((0, TABLES[kind].itemsize // 8)) for kind in KINDS)
        self._seen = Frame.of((segments, corners, arcs))
        self._tracks = {kind: np.empty(0, np.int64) for kind in KINDS}
        self._missed = {kind: np.empty(0, np.int64) for kind in KINDS}
        self._stamp: float | None = None
        self._odometry: Pose | None = None
        self._step = 0.0
        self._twists: deque[Twist] = deque(maxlen=2)
        self._next = 0
        #: The first number that a corner of the last frame was given anew.
        self._young = 0

    def __repr__(self) -> str:
        given = f"{self.max_missed}, gate={self.gate}, roughness={self.roughness}"
        return f"Tracker({given}: {sum(map(len, self._tracks.values()))} tracks)"

    @property
    @in_turn
    def twist(self) -> Twist | None:
        """Velocity of the sensor in the last frames, as `deskew` takes it.

        The mean of the last two motions: if scans are deskewed by it, the error of one motion
        comes back in the next with the other sign. None before there were two frames with
        increasing stamps, and after stamps by which the sensor would go at 50 m/s or more.
        """
        if not self._twists:
            return None
        (x, y, turn), (other_x, other_y, other_turn) = self._twists[0], self._twists[-1]
        return (x + other_x) / 2, (y + other_y) / 2, (turn + other_turn) / 2

    @in_turn
    def __call__(self, features: Features, odometry: Pose | None = None) -> Tracks:
        """Take in the next frame.

        Parameters
        ----------
        features : Features
            Those of the next scan, in the frame of its sensor.
        odometry : (x, y, theta), optional
            Pose of the sensor by odometry, in any frame that stays [m, m, rad]. Its change since
            the last frame is made use of, where both have one.

        Raises
        ------
        TypeError
            If it is given something else than features. The tracks are then as they were.
        ValueError
            If the odometry is not three finite numbers. Likewise.
        """
        if not isinstance(features, Features):
            kind = type(features).__name__
            raise TypeError(f"features is of type {kind}, expected Features: what extract returns")
        if odometry is not None:
            odometry = checked_pose(odometry, "odometry")
        motion, pairs, frame = None, _LOST, Frame.of(words_of(features))
        if self._stamp is not None:
            duration = features.stamp - self._stamp
            motion, pairs = self._moved(frame, odometry, duration)
            twist = motion.twist(duration) if duration > 0 else (math.inf,) * 3
            if all(abs(speed) <= FASTEST for speed in twist):
                self._twists.append(twist)
                self._step = duration
            else:
                self._twists.clear()
        self._stamp, self._odometry = features.stamp, odometry
        return self._renew(frame, pairs, motion)

    @in_turn
    def again(self, features: Features) -> Tracks:
        """Take the last scan in again, deskewed by the twist that it gave.

        The next motion would else be that between a scan that is skewed and one that is not. The
        twist stays, and the motion is that by which the two differ.
        """
        twists, step = self._twists.copy(), self._step
        tracks = self(features)
        self._twists, self._step = twists, step
        return tracks

    def _moved(
        self, frame: Frame, odometry: Pose | None, duration: float
    ) -> tuple[Motion, AllPairs]:
        """Find the tracks again, and the motion by them."""
        prior, deviations = self._expected(odometry, duration)
        fresh = self._seen.segments[self._missed["segments"] == 0]
        expected = [(prior, deviations)]
        if (deviations[[0, 2]] <= _UNIQUE).all():
            spread = np.diag(deviations) ** 2
            motion, pairs = self._follow(frame, prior, spread, prior, spread)
            # Where walls show a part of the motion, odometry is believed in the rest.
            is_partial = odometry is not None and len(motion.unobserved) in (1, 2)
            if is_partial or not is_contradicted(motion.pose, fresh, frame.segments):
                return motion, pairs
            deviations = _ANYWHERE
            expected.insert(0, (prior, deviations))
        (least_way, least_turn), _ = _CONTINUED
        near = np.array((least_way, least_way, least_turn))
        # It stood, or goes on after a jump of its clock.
        steps = poses_along(self.twist or (0.0, 0.0, 0.0), [0.0, self._step])
        expected += [((x, y, theta), near) for x, y, theta in steps.tolist()]
        spread, start = np.diag(deviations) ** 2, relocated(fresh, frame.segments, expected)
        if start is not None:
            motion, pairs = self._follow(frame, start, np.diag(near) ** 2, prior, spread)
            if not is_contradicted(motion.pose, fresh, frame.segments):
                return motion, pairs
        for kind in KINDS:
            self._missed[kind][:] = self.max_missed
        return Motion(*prior, spread, np.eye(3)), _LOST

    def _follow(
        self, frame: Frame, start: Pose, near: Array, prior: Pose, spread: Array
    ) -> tuple[Motion, AllPairs]:
        """Find the tracks again near a motion, and the motion by them."""
        # The motion is that of the tracks that were seen in the very last frame.
        is_fresh = [self._missed[kind] == 0 for kind in KINDS]
        gates = chi_square(self.gate, 2), chi_square(self.gate, 3)
        seen, rough = self._seen, float(self.roughness)
        found = paired(seen, frame, start, near, gates, rough)
        for left in reversed(range(_ROUNDS)):
            pairs = found
            segments, corners, arcs = (
                of[mask[of[:, 0]]] for of, mask in zip(pairs, is_fresh, strict=True)
            )
            fresh = segments, corners, arcs
            motion = motion_by(seen, frame, fresh, prior, spread, rough)
            if not left:
                break
            found = paired(seen, frame, motion.pose, motion.covariance, gates, rough)
            if all(map(np.array_equal, found, pairs)):
                break
        return motion, pairs

    def _expected(self, odometry: Pose | None, duration: float) -> tuple[Pose, Array]:
        """Motion since the last frame as it is expected, and its deviations."""
        pause = 0.0
        if odometry is not None and self._odometry is not None:
            (least_way, least_turn), (by_way, by_turn) = _ODOMETRY
            pose = relative(self._odometry, odometry)
        else:
            (least_way, least_turn), (by_way, by_turn) = _CONTINUED
            pose, pause = (0.0, 0.0, 0.0), max(abs(duration) - _GOES_ON, 0.0)
            twist = self.twist
            if twist is not None and duration > 0:
                x, y, theta = poses_along(twist, [min(duration, _GOES_ON)])[0].tolist()
                pose = (x, y, theta)
        way = least_way + by_way * math.hypot(pose[0], pose[1]) + _MAY_GO[0] * pause
        turn = least_turn + by_turn * abs(pose[2]) + _MAY_GO[1] * pause
        return pose, np.array((way, way, min(turn, math.pi)))

    def _renew(self, frame: Frame, pairs: AllPairs, motion: Motion | None) -> Tracks:
        """Give the features their numbers, and keep them with the tracks that were missed."""
        numbers, born, ended, rest = {}, [], [], []
        for kind, of, words in zip(KINDS, pairs, frame.words, strict=True):
            tracks, missed = self._tracks[kind], self._missed[kind] + 1
            before, now = of.T
            mine = np.full(len(words), -1, np.int64)
            mine[now] = tracks[before]
            born.append(np.arange(self._next, self._next + len(mine) - len(now)))
            mine[mine < 0] = born[-1]
            self._next += len(born[-1])
            missed[before] = 0
            kept = (missed > 0) & (missed <= self.max_missed)
            if kind == "corners":
                young = kept & (missed == 1) & (tracks >= self._young)
                self._young = int(born[-1][0]) if len(born[-1]) else self._next
                (young,) = young.nonzero()
                if len(young) and len(mine):
                    older = mine < tracks[young, None]
                    before = self._seen.corners[young]
                    kept[young] = ~self._doubles(before, frame.corners, older, motion)
            ended.append(tracks[(missed > 0) & ~kept])
            numbers[kind] = mine
            rest.append(kept)
            self._tracks[kind] = np.concatenate((mine, tracks[kept]))
            self._missed[kind] = np.concatenate((np.zeros_like(mine), missed[kept]))
        self._keep(frame, rest, motion)
        return Tracks(
            **numbers, born=np.concatenate(born), ended=np.concatenate(ended), motion=motion
        )

    def _keep(self, frame: Frame, rest: list[NDArray[np.bool_]], motion: Motion | None) -> None:
        """Keep the features of a frame, and behind them those of the frame before in `rest`."""
        missed = [words[kept] for words, kept in zip(self._seen.words, rest, strict=True)]
        if motion is not None:
            move(*missed, *inverse(motion.pose))
        segments, corners, arcs = map(np.concatenate, zip(frame.words, missed, strict=True))
        self._seen = Frame.of((segments, corners, arcs))

    def _doubles(
        self,
        before: NDArray[np.void],
        corners: NDArray[np.void],
        older: NDArray[np.bool_],
        motion: Motion | None,
    ) -> NDArray[np.bool_]:
        """Whether corners that were seen once are one of others, and were seen wrongly then.

        Of each, in a row, `older` has those that it may be.
        """
        x, y, theta = (0.0, 0.0, 0.0) if motion is None else motion.pose
        c, s = math.cos(theta), math.sin(theta)
        turn = np.array([[c, -s], [s, c]])
        off = corners["position"] @ turn.T + (x, y) - before["position"][:, None]
        rough = 2.0 * self.roughness**2 * np.eye(2)
        spread = turn @ corners["covariance"] @ turn.T + before["covariance"][:, None] + rough
        known = older & (corners["convex"] == before["convex"][:, None])
        known &= np.isfinite(spread).all(axis=(2, 3))
        (p, q), (xx, xy, yx, yy) = off[known].T, spread[known].reshape(-1, 4).T
        determinant = xx * yy - xy * yx
        square = yy * p * p - (xy + yx) * p * q + xx * q * q
        is_one = known.copy()
        is_one[known] = square < chi_square(self.gate, 2) * determinant
        return np.asarray(is_one.any(axis=1))
