"""`Around`: the walls of the last metres of a drive, and where among them a scan was taken."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..features import Features
from ..motion.association import associate
from ..motion.estimate import Motion, estimate_motion
from ..scan import Array, LaserScan, Pose
from ..walls import as_walls, wrapped
from .consistency import LEAST, agreement, is_consistent
from .evidence import Says, evidence_of
from .following import DENIED
from .line_map import LineMap
from .local_map import Query, beams_of, some
from .locate import distinct, squares_off, voted
from .refine import COARSE, FINE, refined

#: How surfaces are off straight lines [m].
ROUGHNESS = 0.01
#: What a beam that passes through a wall says [nats], and what it takes off those explained; with
#: it, what one says that is explained, and one that is short.
_MILD, _PASSED = -0.8, 0.5
_SAYS = Says(math.log(7 / 3) + 0.5, math.log(0.7), _MILD)
_ROUNDS = 4
#: With at least this share of the beams explained, less contradicted, a place is taken at once;
#: more where the last scan was long ago.
_SURE, _SURER = 0.75, 0.97
#: Steps of a grid around the expected pose, to each side; farther than so many deviations off it,
#: no pose is tried.
_STEPS, _FARTHEST = 3, 5.0
#: Beams that judge a pose; before, fewer beams, and how many poses they leave.
_BEAMS, _SIFTED = 120, ((12, 150), (40, 32))
#: Errors of beams and walls beside their covariances, where poses are tried, chosen and judged [m].
#: Walls bow and step: where they are taken to be straighter, a robot that drives seems to stand.
_WIDE, _FINAL, _TIGHT = 0.12, 0.07, 0.04
#: Poses that are tried are so far from each other [m, rad]; so many are chosen from.
_APART, _CHOSEN = (0.15, 0.06), 12
#: Poses along what no wall shows that are tried, in deviations; that judge how far it went [m].
_SLID, _ALONG = np.linspace(-2.5, 2.5, 11), np.linspace(-2.5, 2.5, 51)
#: What is expected is off by Student's distribution of 3 degrees of freedom, of this share of its
#: deviations: most motions go on as they did, and some robots turn at once.
USUAL, _FREEDOM = 0.5, 3.0
#: With less than this share of the beams explained, less contradicted, the way is lost.
_LOST = 0.38
#: With less than this share of the ends that agree, of those that this scan and the last key frame
#: can both see, it is lost too, unless walls say so much of it [nats] and few beams deny them: then
#: people stand there. If all agree, that says so much of a pose [nats], beside the walls.
_AGREE, _CLEAR, _LAST = 0.75, 10.0, 60.0
#: Another place is so far away [m, rad]; the way is lost if one is less than 4 nats less likely.
_OTHER, _DOUBT = 0.3, 4.0
#: Covariance of a pose that beams found [m, m, rad].
_NEAR = np.diag((0.05, 0.05, 0.02)) ** 2
#: A plan of one wall where no beam ends [m], for where there are no walls.
_NOWHERE = LineMap.from_lines([[999.0, 999.0, 999.1, 999.0]])


class Sought(NamedTuple):
    """A scan, what it sees, and the pose and covariance that are expected of it."""

    scan: LaserScan
    features: Features
    beams: Array
    prior: Pose
    spread: Array

    def known(self, poses: Array) -> Array:
        """Return what is known of poses before anything is seen [nats], 0 for the expected one."""
        squares = squares_off(poses, self.prior, USUAL**2 * self.spread)
        return np.asarray(-0.5 * (_FREEDOM + 3.0) * np.log1p(squares / _FREEDOM))


class Found(NamedTuple):
    """Where a scan was taken, in the frame of the last key frame.

    `by_beams` is the covariance of that by beams, where no wall shows all of it. `evidence` has log
    odds and the shares of beams that are explained, short and contradicted.
    """

    motion: Motion
    by_beams: Array | None
    is_lost: bool
    evidence: Array


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """What is around the last key frame, in its frame.

    Attributes
    ----------
    features : Features
        The walls of the last key frames, and the corners of the last one.
    scan : LaserScan
        The last key frame.
    views : ndarray, shape (n, 372)
        From where the key frames have looked, and how far; see `views_of`.
    plan : LineMap
        The walls.
    """

    features: Features
    scan: LaserScan
    views: Array
    plan: LineMap

    @classmethod
    def of(cls, features: Features, scan: LaserScan, views: Array) -> "Around":
        """Return what is around by the features there."""
        walls = as_walls(features.segments)
        return cls(features, scan, views, LineMap(walls) if len(walls) else _NOWHERE)

    def place(
        self, scan: LaserScan, features: Features, prior: Pose, spread: Array, is_soon: bool
    ) -> Found:
        """Find the pose by the walls; if it may be another, the one that explains most.

        `is_soon` is whether the last scan was so short a time ago that few others are possible.
        """
        sought = Sought(scan, features, some(beams_of(features, scan), _BEAMS), prior, spread)
        motion = self._match(features, prior, spread)
        evidence = self._evidence(motion, sought)
        is_sure = evidence[1] - evidence[3] >= (_SURE if is_soon else _SURER)
        if is_sure and motion.observable:
            return Found(motion, None, False, evidence)
        is_along = is_sure and is_soon and is_consistent(self.scan, scan, motion.pose)
        poses = self._searched(sought, motion, is_along)
        nats = self._nats(sought, poses, _FINAL)
        # The motion that was matched is preferred by a little.
        nats[-1] += 0.5
        few = np.append(distinct(poses[:-1], nats[:-1], _APART, _CHOSEN), len(poses) - 1)
        poses, nats = poses[few], nats[few] + self._agreed(scan, poses[few])
        is_doubted, by_beams = doubts(poses, nats, motion)
        motion = self._best(sought, motion, poses[nats.argmax()])
        evidence = self._evidence(motion, sought)
        is_lost = evidence[1] - _PASSED * evidence[3] < _LOST or evidence[0] < 0 or is_doubted
        is_vague = evidence[0] < _CLEAR or evidence[3] > DENIED
        is_lost |= is_vague and agreement(self.scan, scan, [motion.pose])[0] < _AGREE
        return Found(motion, None if motion.observable else by_beams, bool(is_lost), evidence)

    def beams_alone(self, scan: LaserScan, features: Features, motion: Motion) -> Array:
        """Return the covariance that beams alone leave along what no wall shows.

        Any pose less than 4 nats less likely than the best may be right: beams that say less say it
        by chance, and those of the next scan say it again.
        """
        beams, spread = some(beams_of(features, scan), _BEAMS), _NEAR.copy()
        for u in open_ways(motion):
            poses = motion.pose + _ALONG[:, None] * np.append(u, 0.0)
            judged = evidence_of(poses, beams, self.plan.index, _FINAL, _SAYS, views=self.views)
            nats = judged[:, 0] + self._agreed(scan, poses)
            shares = np.exp(np.minimum(nats - nats.max() + _DOUBT, 0.0))
            spread[:2, :2] += shares @ _ALONG**2 / shares.sum() * np.outer(u, u)
        return spread

    def _match(self, features: Features, prior: Pose, spread: Array) -> Motion:
        motion, matches = Motion(*prior, spread), None
        for _ in range(_ROUNDS):
            found = associate(
                self.features, features, motion.pose, motion.covariance, roughness=ROUGHNESS
            )
            if matches is not None and found.same_as(matches):
                break
            matches = found
            motion = estimate_motion(matches, prior, spread, roughness=ROUGHNESS)
        return motion

    def _evidence(self, motion: Motion, sought: Sought) -> Array:
        """Return what beams say of a motion, `evidence` of `Found`."""
        at, index = np.array([motion.pose]), self.plan.index
        found = evidence_of(at, sought.beams, index, _TIGHT, _SAYS, views=self.views)
        return np.asarray(found[0])

    def _nats(self, sought: Sought, poses: Array, wide: float, count: int = _BEAMS) -> Array:
        """Judge poses by so many of the beams, against that share of what is known before."""
        few = some(sought.beams, count)
        known = len(few) / max(len(sought.beams), 1) * sought.known(poses)
        found = evidence_of(
            poses, few, self.plan.index, wide, _SAYS, before=known, views=self.views
        )
        return np.asarray(found[:, 0])

    def _agreed(self, scan: LaserScan, poses: Array) -> Array:
        """Return what the last key frame says of poses [nats]; if it says nothing, a little."""
        shares = agreement(self.scan, scan, poses)
        return _LAST * np.nan_to_num(shares, nan=LEAST)

    def _searched(self, sought: Sought, motion: Motion, is_along: bool) -> Array:
        """Return the poses that may be the right one, shape (n, 3); the last one is the motion.

        Where the walls say all but how far along them, only poses along them are tried.
        """
        walls, tried = as_walls(sought.features.segments), np.array([motion.pose])
        query = Query(walls, np.zeros((2 * len(walls), 2 * len(walls))), sought.beams)
        slid = _SLID[:, None] * math.sqrt(sought.spread[0, 0])
        along = [motion.pose + slid * np.append(u, 0.0) for u in open_ways(motion)]
        if is_along:
            along = [*along, tried]
            return np.concatenate((self._refined(np.concatenate(along), query), *along))
        votes = voted(query.anchors, query, self.plan)
        is_near = squares_off(votes, sought.prior, sought.spread) < _FARTHEST**2
        every = np.concatenate((grid_around(sought.prior, sought.spread), votes[is_near]))
        for count, most in _SIFTED:
            every = every[distinct(every, self._nats(sought, every, _WIDE, count), _APART, most)]
        tried = np.concatenate((every, tried))
        return np.concatenate((self._refined(tried, query), *along, tried))

    def _refined(self, poses: Array, query: Query) -> Array:
        near = refined(poses, query, self.plan.index, COARSE)[0]
        return refined(near, query, self.plan.index, FINE)[0]

    def _best(self, sought: Sought, motion: Motion, pose: Array) -> Motion:
        """Return the motion by what is matched near a pose, or that pose, if it is likelier."""
        x, y, theta = pose.tolist()
        best = Motion(x, y, theta, sought.spread)
        if best.pose != motion.pose:
            motion = self._match(sought.features, best.pose, _NEAR)
            walls_say = np.linalg.inv(motion.covariance) - np.linalg.inv(_NEAR)
            covariance = np.linalg.inv(walls_say + np.linalg.inv(sought.spread))
            motion = replace(motion, covariance=covariance)
        both = np.array([motion.pose, best.pose])
        matched, found = self._nats(sought, both, _FINAL) + self._agreed(sought.scan, both)
        return best if found > matched + 1.0 else motion


def grid_around(prior: Pose, spread: Array) -> Array:
    """Return poses around the expected one, shape (n, 3), by steps of its deviations."""
    way, turn = np.sqrt(np.diag(spread)[1:]).tolist()
    steps, by = np.arange(-_STEPS, _STEPS + 1.0), min(max(way, 0.1), 0.3)
    sizes = by, by, min(max(turn / 2, 0.05), 0.1)
    of_axes = [at + size * steps for at, size in zip(prior, sizes, strict=True)]
    return np.stack(np.meshgrid(*of_axes, indexing="ij"), axis=-1).reshape(-1, 3)


def open_ways(motion: Motion) -> Array:
    """Return the directions in which no wall shows how far it goes, unit vectors (m, 2)."""
    ways = np.hypot(*motion.unobserved[:, :2].T)
    return np.asarray(motion.unobserved[ways > 0.5, :2] / ways[ways > 0.5, None])


def doubts(poses: Array, nats: Array, motion: Motion) -> tuple[bool, Array]:
    """Return whether another place may be right too, and the covariance of the best pose.

    Along what no wall shows, the pose is known as well as it is likelier than others there.
    """
    off, along = poses - poses[nats.argmax()], open_ways(motion)
    off[:, 2] = wrapped(off[:, 2])
    across = off[:, :2] - off[:, :2] @ along.T @ along
    is_other = (np.hypot(*across.T) > _OTHER) | (abs(off[:, 2]) > _OTHER)
    shares = np.where(is_other, 0.0, np.exp(nats - nats.max()))
    spread = _NEAR + (off.T * shares) @ off / shares.sum()
    return bool((nats[is_other] > nats.max() - _DOUBT).any()), spread
