"""Walls that are seen again are one only if the places that they are seen from are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_room import RING, scans_on, survey_of

from lineament.mapping import again
from lineament.mapping.adjust import edges_of
from lineament.mapping.again import tied
from lineament.scan.poses import relative
from lineament.simulation import World
from lineament.walls.sights import count_of, lines_of

N = len(RING)
#: Two passes of three key frames; the second is 0.1 m beside the first, or 1.5 m.
NEAR, FAR = (-2.0, -1.5, -1.0, -1.9, -1.4, -0.9), (-2.0, -1.5, -1.0, 0.5, 1.0, 1.5)
#: Between the passes the way is known to 5 cm, or to 1 m.
KNOWN, UNKNOWN = 0.05, 1.0


def two_passes(way, spread, world=None):
    """Key frames of two passes, each with its own numbers of the walls, and their motions."""
    scans = [*scans_on(way[:3]), *scans_on(way[3:], world)]
    frames = [SimpleNamespace(scan=scan, is_torn=False) for scan in scans]
    poses = np.array([scan.pose for scan in scans])
    spreads = np.tile(np.eye(3) * 1e-4, (5, 1, 1))
    spreads[2] = np.diag((spread, spread, 0.02)) ** 2
    motions = [relative(*map(tuple, poses[k : k + 2].tolist())) for k in range(5)]
    chain = edges_of([(k, k + 1) for k in range(5)], motions, spreads)
    return survey_of(frames, poses, again=3), chain


def walls_in(survey, chain):
    return count_of(tied(survey, chain, chain, np.zeros(1, np.int64)).sights)


@pytest.mark.parametrize("way", [NEAR, FAR])
def test_walls_seen_again_from_known_places_are_one(way):
    assert walls_in(*two_passes(way, KNOWN)) == N


def test_walls_seen_again_from_places_that_may_be_elsewhere_stay_apart():
    survey, chain = two_passes(FAR, UNKNOWN)
    assert walls_in(survey, chain) == 2 * N
    # A loop, which `edges` have and `chain` has not, makes the places known.
    loop = edges_of([(1, 4)], [relative(survey.pose(1), survey.pose(4))], [np.eye(3) * 1e-4])
    found = tied(survey, np.append(chain, loop), chain, np.zeros(1, np.int64))
    assert count_of(found.sights) == N


def test_scans_that_agree_make_near_places_known():
    assert walls_in(*two_passes(NEAR, UNKNOWN)) == N
    turned = -RING  # another room, in which the walls are said to be those of the first
    other = World(np.hstack((turned, np.roll(turned, -1, axis=0))), [])
    assert walls_in(*two_passes(NEAR, UNKNOWN, world=other)) == 2 * N


def test_what_is_tied_makes_more_places_known(monkeypatch):
    """The second pass begins where the first was, and goes on to where it was not."""
    survey, chain = two_passes((-2.0, -1.5, -1.0, -1.0, 0.5, 1.5), UNKNOWN)
    # Walls 4 to 7 are seen from the last two key frames alone.
    sights = survey.sights
    survey.sights = sights[(sights["frame"] != 3) | (sights["wall"] < N + 4)]
    assert walls_in(survey, chain) == N
    monkeypatch.setattr(again, "_ROUNDS", 1)
    assert N < walls_in(survey, chain) < 2 * N


def test_walls_that_are_not_on_one_line_stay_apart():
    survey, chain = two_passes(NEAR, KNOWN)
    survey.sights["centroid"][survey.sights["frame"] > 2] += (0.2, 0.2)
    survey.lines[:] = lines_of(survey.sights, survey.poses, 2 * N)
    assert walls_in(survey, chain) == 2 * N
