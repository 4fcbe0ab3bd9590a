"""A program of others, run by files alone: here it repeats what was found, or lies."""

import csv
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from lineament_lab.reproduce.scans import scene_numbers, simulated_frames

import lineament as ln
from lineament.simulation import SENSORS

PATH = Path(__file__).parents[1] / "benchmarks" / "peers" / "run.py"
SPEC = importlib.util.spec_from_file_location("benchmark_peers", PATH)
peers = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(peers)
FRAMES = list(simulated_frames(SENSORS["paper"], ["room"], scene_numbers(2, 0)))


def rows_of(index, features, kinds):
    for segment in features.segments if "segment" in kinds else ():
        yield index, "segment", *segment["start"], *segment["end"]
    for corner in features.corners if "corner" in kinds else ():
        yield index, "corner", *corner["position"]


@pytest.mark.parametrize("kinds", [("segment", "corner"), ("segment",)])
def test_a_program_that_repeats_the_truth_is_right(tmp_path, kinds):
    """It reads no scan; its features are written before it is run, and copied."""
    made = tmp_path / "made.csv"
    with made.open("w", newline="") as file:
        for k, frame in enumerate(FRAMES):
            csv.writer(file).writerows([*rows_of(k, frame.truth, kinds), (k, "time", 7.5 + k)])
    copy = "import shutil, sys; shutil.copy(sys.argv[1], sys.argv[3])"
    scores = peers.run([sys.executable, "-c", copy, str(made)], FRAMES)
    assert scores["segment_f1"] == 1.0
    assert scores["time"] == 8.0
    if "corner" in kinds:
        assert scores["corner_f1_0.10"] == 1.0
    else:
        assert scores["corner_recall_0.10"] > 0.9


def test_scans_are_written_as_they_are(tmp_path):
    scan = ln.LaserScan([1.5, np.nan, 2.25, 0.0], -0.1, 0.05, range_min=0.5, range_max=9.0)
    peers.write_scans([scan], tmp_path / "scans.csv")
    text = (tmp_path / "scans.csv").read_text()
    assert text.splitlines() == ["-0.1,0.05,0.5,9.0,1.5,,2.25,"]


@pytest.mark.parametrize(
    "line",
    ["0,segment,1,2,3", "0,circle,1,2", "9,corner,1,2", "-1,corner,1,2", "0,corner,nan,2", "x"],
)
def test_what_is_no_feature_is_named(tmp_path, line):
    path = tmp_path / "features.csv"
    path.write_text(f"0,corner,1,2\n{line}\n")
    with pytest.raises(ValueError, match=r"line 2: .*, expected scan,segment"):
        peers.read_features(path, 2)


def test_lines_meet_where_both_end():
    ends = np.array([[2.0, -1, 2, 0], [2, 0.1, 1, 0.1], [1, 2, 0, 2], [0, 2, -1, 2]])
    np.testing.assert_allclose(peers.intersections(ends), [[2.0, 0.1]])
