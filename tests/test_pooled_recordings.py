"""Recordings pooled by building: doubles, sums and intervals, by hand."""

import numpy as np
import pytest
from lineament_lab.evaluation import FreeSpaceScores, StandingScores, pooling
from lineament_lab.evaluation.consistency import NormalisedErrors
from lineament_lab.evaluation.pooling import Interval
from lineament_lab.evaluation.standing import ScatterScores
from lineament_lab.reproduce.findings import cell_text
from lineament_lab.reproduce.real import STANDING, pooled_table

from lineament import LaserScan
from lineament.logs import save_npz


def scan(seed, pose=None):
    ranges = np.random.default_rng(seed).uniform(1, 5, 40).round(3)
    return LaserScan(ranges, -0.4, 0.02, pose=pose, stamp=float(seed))


def free(phantom, drawn):
    return FreeSpaceScores(drawn, phantom, np.array([phantom]), 8, 10)


def still(*squares):
    """Standing scores of segments of 50 measurements with these squared errors."""
    whitened = np.column_stack((np.sqrt(squares), np.zeros(len(squares))))
    arms = np.full(len(squares), 50, np.int32)
    one = ScatterScores(NormalisedErrors(whitened), arms, arms, np.ones(len(squares), bool))
    return StandingScores(one, ScatterScores())


def test_recordings_whose_scans_are_in_others_are_left_out(tmp_path):
    of = {
        "whole": [scan(k) for k in range(6)],
        "part, with poses": [scan(k, (0.0, 0.0, 0.0)) for k in range(3)],
        "equal, with poses": [scan(k, (0.0, 0.0, 0.0)) for k in range(6)],
        "overlap": [scan(k) for k in (0, 7, 8, 9)],
        "other": [scan(k) for k in range(20, 24)],
    }
    logs = {}
    for name, scans in of.items():
        logs[name] = tmp_path / f"{name}.npz"
        save_npz(logs[name], scans)
    kept, doubles = pooling.distinct(logs, STANDING)
    assert list(kept) == ["equal, with poses", "overlap", "other"]
    assert set(doubles) == {"whole", "part, with poses"}
    assert set(doubles.values()) == {"equal, with poses"}


def test_a_file_that_cannot_be_read_stays_to_be_reported(tmp_path):
    path = tmp_path / "no.npz"
    path.write_bytes(b"none")
    assert pooling.distinct({"no.npz": path}, ()) == ({"no.npz": path}, {})


def test_scores_are_added_by_building():
    of = {
        "truth/jackal_static_data.npz": {"liu": free(1.0, 10.0)},
        "rosbag2/jackal_mocap": {"liu": free(2.0, 20.0)},
        "mine.npz": {"liu": free(0.0, 5.0)},
    }
    added = pooling.by_building(of)
    assert list(added) == ["arena", "mine.npz"]
    assert (added["arena"]["liu"].phantom, added["arena"]["liu"].drawn) == (3.0, 30.0)


def test_numbers_are_pooled_by_length_and_by_pairs():
    places = {name: {"liu": free(p, d)} for name, p, d in (("a", 9, 10), ("b", 1, 90), ("c", 0, 0))}
    standing = {"a": {"liu": still(4.0, 4.0, 4.0)}, "b": {"liu": still(1.0)}}
    row = pooling.pooled(places, standing)["liu"]
    assert (row["buildings"], row["standing_buildings"]) == (3, 2)
    assert row["phantom_in_100m"].value == pytest.approx(10.0)
    assert 0.0 <= row["phantom_in_100m"].low < 10.0 < row["phantom_in_100m"].high <= 90.0
    assert row["covered"] == pytest.approx((0.8, 0.8, 0.8))
    # The median of χ² of two components is 2 ln 2; two buildings have no interval.
    assert row["segments_nees"].value == pytest.approx(4.0 / (2 * np.log(2)))
    assert np.isnan(row["segments_nees"].low)
    assert "corners_nees" not in row
    table = pooled_table("All", {"liu": row})
    assert "of 3 buildings (2 where a sensor stands)" in table.note
    assert cell_text(table.rows[0][2]) == "80 (80–80)"
    assert cell_text(table.rows[0][3]) == "2.89"


def test_bootstrap_covers_the_mean_as_often_as_it_says():
    """Of 200 samples of 20 normal numbers: 95 % less what the bootstrap of few is short of."""
    rng, covered = np.random.default_rng(1), 0
    for _ in range(200):
        values = rng.normal(size=20)
        interval = pooling.bootstrap(values.tolist(), lambda of: sum(of) / len(of))
        covered += interval.low <= 0 <= interval.high
    assert 0.88 < covered / 200 < 0.98
    assert cell_text(Interval(1.0, float("nan"), float("nan"))) == "1"
