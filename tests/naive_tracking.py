"""Slow, obvious twin of the tracker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from naive_association import associate
from naive_motion import estimate_motion

from lineament.motion import Motion, Tracker, Tracks
from lineament.scan.poses import inverse

KINDS = ("segments", "corners", "arcs")


class NaiveTracker(Tracker):
    """A tracker that looks for pairs three times, and moves all that it has seen."""

    def _follow(self, features, prior, spread):
        motion = Motion(*prior, spread)
        for _ in range(3):
            matches = associate(
                self._seen,
                features,
                motion.pose,
                motion.covariance,
                gate=self.gate,
                roughness=self.roughness,
            )
            motion = estimate_motion(self._fresh(matches), prior, spread, roughness=self.roughness)
        return motion, matches

    def _renew(self, features, matches, motion):
        if motion is not None:
            self._seen = self._seen.transform(*inverse(motion.pose))
        numbers, born, ended = {}, [], []
        tables = {}
        for kind in KINDS:
            table, seen = getattr(features, kind), getattr(self._seen, kind)
            tracks, missed = self._tracks[kind], self._missed[kind] + 1
            pairs = getattr(matches, kind)
            mine = np.full(len(table), -1, np.int64)
            mine[pairs[:, 1]] = tracks[pairs[:, 0]]
            new = np.flatnonzero(mine < 0)
            mine[new] = self._next + np.arange(len(new))
            self._next += len(new)
            missed[pairs[:, 0]] = 0
            kept = (missed > 0) & (missed <= self.max_missed)
            born.append(mine[new])
            ended.append(tracks[missed > self.max_missed])
            numbers[kind], tables[kind] = mine, np.concatenate((table, seen[kept]))
            self._tracks[kind] = np.concatenate((mine, tracks[kept]))
            self._missed[kind] = np.concatenate((np.zeros_like(mine), missed[kept]))
        self._seen = replace(features, **tables)
        return Tracks(
            **numbers, born=np.concatenate(born), ended=np.concatenate(ended), motion=motion
        )
