"""What follows a lost key frame is put where most of its places are."""

from types import SimpleNamespace

import numpy as np

from lineament.mapping.adjust import edges_of, optimise
from lineament.mapping.joining import _agreeing, _ties
from lineament.mapping.loops import FLOOR, Survey


def test_places_agree_as_far_as_the_way_between_them_is_known():
    """A key frame each metre; the third metre is known to 1 m along the way, others to 1 cm."""
    poses = np.column_stack((np.arange(6.0), np.zeros((6, 2))))
    sure, loose = np.eye(3) * 1e-4, np.diag((1.0, 1e-4, 1e-4))
    pairs = [(k, k + 1) for k in range(5)]
    chain = edges_of(pairs, [(1.0, 0, 0)] * 5, [loose if k == 2 else sure for k in range(5)])
    found = optimise(poses, chain)
    at = {0: (0.0, 5, 0), 2: (2.0, 5, 0), 3: (5.0, 5, 0), 5: (7.0, 5, 0)}
    places = {q: SimpleNamespace(pose=pose) for q, pose in at.items()}
    assert _agreeing(places, found) == ([0, 2, 3, 5], 0)
    # 4.2 deviations from the first along the way, or 0.6 m across it: elsewhere.
    places[5] = SimpleNamespace(pose=(9.2, 5.0, 0.0))
    assert _agreeing(places, found)[0] == [0, 2, 3]
    places[5] = SimpleNamespace(pose=(7.0, 5.6, 0.0))
    assert _agreeing(places, found)[0] == [0, 2, 3]
    assert _agreeing({}, found) == ([], 0)
    assert _agreeing({4: places[5]}, found) == ([4], 0)


def test_a_place_is_tied_to_the_nearest_key_frame_before():
    poses = np.column_stack((np.arange(6.0), np.zeros((6, 2))))
    survey = Survey([None] * 6, poses, None, None)
    where = SimpleNamespace(pose=(2.2, 0.5, 0.3), covariance=np.eye(3) * 1e-3)
    ties = _ties(survey, {5: where}, np.arange(4))
    assert ties["ends"].tolist() == [[2, 5]]
    np.testing.assert_allclose(ties["motion"], [(0.2, 0.5, 0.3)])
    np.testing.assert_allclose(np.linalg.inv(ties["information"][0]), where.covariance + FLOOR)
    assert ties["loop"].all()
