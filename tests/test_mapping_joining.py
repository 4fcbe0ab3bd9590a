"""What follows a lost key frame is put where most of its places are."""

from types import SimpleNamespace

import numpy as np
import pytest

from lineament.mapping import joining
from lineament.mapping.adjust import edges_of, optimise
from lineament.mapping.joining import _agreeing, _ties, joined
from lineament.mapping.loops import FLOOR, Survey
from lineament.walls.sights import SIGHT


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


@pytest.mark.parametrize(("agree", "others", "moves"), [(1, 0, 0), (2, 0, 1), (2, 1, 0), (3, 1, 1)])
@pytest.mark.parametrize("is_late", [False, True])
def test_what_follows_a_lost_key_frame_goes_where_enough_places_agree(
    monkeypatch, agree, others, moves, is_late
):
    """By 3 m to the left. If they are seen later alone, that is what is looked for at last."""
    poses = np.column_stack((np.arange(14.0), np.zeros((14, 2))))
    lost = [6, 12] if is_late else [6]
    frames = [SimpleNamespace(is_torn=k in lost) for k in range(14)]
    sure, loose = np.eye(3) * 1e-4, np.diag((10.0, 10.0, 1.0)) ** 2
    spreads = [loose if k + 1 in lost else sure for k in range(13)]
    chain = edges_of([(k, k + 1) for k in range(13)], [(1.0, 0, 0)] * 13, spreads)

    def located(_, here, rest, __):
        if here[0] != 6 or (is_late and 13 not in rest):
            return {}
        found = {q: (float(q), 3.0, 0.0) for q in range(6, 6 + agree)}
        found |= {10 + k: (9.0, -7.0, 1.0) for k in range(others)}
        return {q: SimpleNamespace(pose=pose, covariance=sure) for q, pose in found.items()}

    monkeypatch.setattr(joining, "_located", located)
    found = joined(frames, optimise(poses, chain), chain, np.zeros(0, SIGHT))
    left = found.poses[:, 1]
    np.testing.assert_allclose(left[:6], 0.0, atol=0.1)
    np.testing.assert_allclose(left[6:12], 3.0 * moves, atol=0.1)


def test_a_place_is_tied_to_the_nearest_key_frame_before():
    poses = np.column_stack((np.arange(6.0), np.zeros((6, 2))))
    survey = Survey([None] * 6, poses, None, None)
    where = SimpleNamespace(pose=(2.2, 0.5, 0.3), covariance=np.eye(3) * 1e-3)
    ties = _ties(survey, {5: where}, np.arange(4))
    assert ties["ends"].tolist() == [[2, 5]]
    np.testing.assert_allclose(ties["motion"], [(0.2, 0.5, 0.3)])
    np.testing.assert_allclose(np.linalg.inv(ties["information"][0]), where.covariance + FLOOR)
    assert ties["loop"].all()
