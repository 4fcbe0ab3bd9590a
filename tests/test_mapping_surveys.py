"""What is looked for along a way, and where: queries of the last metres, loops, turns."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from small_room import RING, plan_of, query_at, scans_on, survey_of

from lineament import Extractor
from lineament.mapping.loops import Survey

PLAN = plan_of(RING)


@pytest.fixture(scope="module")
def survey():
    """To and fro along 4 m in steps of 0.5 m, for 12 m; all walls are seen from everywhere."""
    extract, x = Extractor(), np.abs(np.remainder(0.5 * np.arange(25) + 4, 8) - 4) - 2
    frames = [
        SimpleNamespace(scan=scan, features=extract(scan), is_torn=False) for scan in scans_on(x)
    ]
    return survey_of(frames, np.array([frame.scan.pose for frame in frames]), again=25)


@pytest.mark.parametrize(("q", "first"), [(4, 0), (10, 0), (11, 1), (24, 14)])
def test_a_query_is_of_the_last_five_metres(survey, q, first):
    """Its walls are those of the plan, its beams those of six key frames, the last one's first."""
    query, pose = survey.query(q), survey.pose(q)
    assert len(query.walls) == len(RING)
    assert (query.walls["views"] == q - first + 1).all()
    expected = np.sort(query_at(pose, PLAN).walls["angle"] % (2 * math.pi))
    np.testing.assert_allclose(np.sort(query.walls["angle"] % (2 * math.pi)), expected, atol=1e-6)
    origins = {round(x, 6) for x in query.beams[:, 0].tolist()}
    used = np.unique(np.linspace(first, q, 6).astype(int))
    assert origins <= {round(x, 6) for x in (survey.poses[used, 0] - pose[0]).tolist()}
    assert query.beams[0, 0] == 0.0 or len(origins) > 1
    np.testing.assert_allclose(query.covariance[:2, :2], query.walls["covariance"][0])
    assert not query.covariance[:2, 2:].any()


def test_queries_are_so_far_apart(survey):
    """The first key frame, and each that is the first past another so many metres."""
    every = np.arange(len(survey.frames))
    assert [q for q, _ in survey.queries(2.0, every)] == [0, *range(4, 25, 4)]
    assert [q for q, _ in survey.queries(3.0, every)] == [0, 6, 12, 18, 24]
    assert [q for q, _ in survey.queries(3.0, every[7:19])] == [12, 18]


def test_what_shows_fewer_than_four_walls_is_not_looked_for(survey):
    few = survey.sights[np.isin(survey.sights["wall"], (0, 1, 2))]
    assert Survey(survey.frames, survey.poses, few, survey.lines).query(24) is None
    enough = survey.sights[np.isin(survey.sights["wall"], (0, 1, 2, 3))]
    query = Survey(survey.frames, survey.poses, enough, survey.lines).query(24)
    assert len(query.walls) == 4


def twice(survey, drift=0.0):
    """The way there and back again, so that 12 m later all is passed once more.

    From key frame 28 on poses are off by the drift [m], and so are the walls that are seen.
    """
    longer = np.concatenate([np.arange(25), np.arange(23, -1, -1)])
    poses = survey.poses[longer]
    poses[28:, 1] += drift
    return survey_of([survey.frames[k] for k in longer], poses, again=28)


def test_loops_are_closed_where_the_way_was_passed(survey):
    """At least 12 m of way before: nothing yet, and then the first key frame from the last one."""
    assert len(survey.loops((0.3, 0.06))) == 0
    longer = twice(survey)
    loops, poses = longer.loops((0.3, 0.06)), longer.poses
    assert len(loops) >= 3
    assert loops["loop"].all()
    way = 0.5 * np.arange(49)
    assert (way[loops["ends"][:, 1]] - way[loops["ends"][:, 0]] > 12 - 2).all()
    for (j, q), motion, information in loops[["ends", "motion", "information"]].tolist():
        np.testing.assert_allclose(np.add(poses[j], motion), poses[q], atol=0.02)
        # What locate knows, and 20 mm, 20 mm and 5 mrad beside it.
        sigma = np.sqrt(np.diag(np.linalg.inv(information)))
        assert (sigma > (0.02, 0.02, 0.005)).all()
        assert (sigma < (0.03, 0.03, 0.0075)).all()


def test_loops_are_looked_for_as_far_as_the_way_is_not_known(survey):
    """All poses after 14 m are believed to be 6 m off: found if the way says that they may be."""
    drifted, poses = twice(survey, 6.0), twice(survey).poses
    assert len(drifted.loops((0.3, 0.06))) == 0

    def known(pairs):
        return (pairs[:, 1] >= 28)[:, None, None] * np.diag((4.0, 4.0, 0.1)) ** 2

    loops = drifted.loops((0.3, 0.06), known)
    assert len(loops) >= 3
    assert (loops["ends"][:, 1] >= 28).all()
    for (j, q), motion in loops[["ends", "motion"]].tolist():
        np.testing.assert_allclose(np.add(poses[j], motion), poses[q], atol=0.02)


def test_across_a_lost_key_frame_the_way_says_nothing(survey):
    longer = twice(survey)
    lost = SimpleNamespace(**{**vars(longer.frames[28]), "is_torn": True})
    frames = [*longer.frames[:28], lost, *longer.frames[29:]]
    asked = []

    def known(pairs):
        asked.append(pairs)
        return np.zeros((len(pairs), 3, 3))

    Survey(frames, longer.poses, longer.sights, longer.lines).loops((0.3, 0.06), known)
    ((before, after),) = (pairs.T for pairs in asked)
    assert ((before < 28) == (after < 28)).all()
