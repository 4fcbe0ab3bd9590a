"""Table 3, all methods by sensor, and repeatability: what the runs hand back."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from lineament import Extractor
from lineament.evaluation import evaluate
from lineament.methods import METHODS
from lineament.reproduce import Setting, all_methods, repeatability, success
from lineament.reproduce.charts import dot_chart
from lineament.reproduce.contenders import drawn_methods, every_method, feature_methods
from lineament.reproduce.frames import (
    batch_of,
    frame_times,
    scene_numbers,
    simulated_frames,
)
from lineament.simulation import SENSORS


def silent(about: str) -> None:
    assert about


def test_frames_are_of_the_kinds_in_turn_and_made_again_the_same():
    numbers = scene_numbers(3, 2)
    frames = list(simulated_frames(SENSORS["ld19"], ["room", "star"], numbers))
    again = list(simulated_frames(SENSORS["ld19"], ["room", "star"], numbers))
    for one, other in zip(frames, again, strict=True):
        assert np.array_equal(one.scan.ranges, other.scan.ranges)
    alone = next(simulated_frames(SENSORS["ld19"], ["star"], numbers[1:2]))
    assert np.array_equal(alone.scan.ranges, frames[1].scan.ranges)
    assert evaluate(frames[0].truth, frames[0].truth).corners.counts.f1 == 1.0


def test_scans_at_once_give_what_each_alone_gives():
    scans = [f.scan for f in simulated_frames(SENSORS["paper"], ["room"], range(3))]
    extractor = Extractor("iepf")
    for scan, features in zip(scans, batch_of(extractor, scans), strict=True):
        assert np.array_equal(features.corners, extractor(scan).corners)
        assert np.array_equal(features.clusters, extractor(scan).clusters)


def test_times_are_one_a_scan():
    scans = [f.scan for f in simulated_frames(SENSORS["lms181"], ["room"], range(2))]
    times = frame_times(Extractor("pdbs"), scans)
    assert times.shape == (2,)
    assert (times > 0).all()


def test_dot_chart_draws_what_is_finite():
    panel = {"one": {"a": 1.0, "b": math.nan}, "other": {"b": 2.0}}
    assert dot_chart({"F1": panel, "time": panel}, log_axes=frozenset({"time"})).startswith(
        b"\x89PNG"
    )


def test_verdict_follows_the_numbers():
    frames = list(simulated_frames(SENSORS["paper"], ["room"], range(2)))
    true = success._measured({"true": _Told(frames)}, frames, 1, silent)["true"]
    none = success._measured({"none": Extractor("liu", threshold=1e9)}, frames, 1, silent)["none"]
    parted = {"liu:paper, no corners": true, "pdbs, fixed 0.3 m": none}
    cornered = {success.LITERAL_BEST: none, "iepf:paper": true}
    told = success._verdict(parted, cornered)
    assert "more corners than IEPF does not hold with the best parameters" in told
    assert "recall 0.00 against 1.00" in told


class _Told(Extractor):
    """Knows the truth."""

    def __init__(self, frames):
        super().__init__("pdbs")
        self.frames = frames

    def batch(self, ranges, **fields):
        if len(ranges) == len(self.frames):
            return [frame.truth for frame in self.frames]
        return super().batch(ranges, **fields)


@pytest.mark.slow
class TestRuns:
    """Each with one frame; the choice of parameters is made once for all of them."""

    setting = Setting(frames=1)

    def test_every_method_takes_part_and_liu_twice_each(self):
        names = list(every_method(self.setting, silent))
        assert [name for name in METHODS if name != "liu"] == names[4:]
        assert [name.split(",")[0] for name in names[:4]] == [
            "liu:paper",
            "liu:paper",
            "liu",
            "liu",
        ]
        assert list(feature_methods(self.setting, silent)) == [n for n in names if n != "pdbs"]
        drawn = list(drawn_methods(self.setting, silent))
        assert drawn == ["pdbs, fitted" if name == "pdbs" else name for name in names[2:]]

    def test_table_3_has_the_numbers_of_the_papers_text(self):
        findings = success.run(self.setting, silent)
        partition, corners, ratios = findings.tables
        assert [row[1] for row in partition.rows] == [0.9511, 0.9511, 0.8355, 0.8355]
        assert [row[1] for row in corners.rows] == [0.9262] * 4 + [0.7251] * 2
        assert ratios.columns == ("", "paper", "here")
        assert any("0.61 to 0.70" in text for text in findings.text)
        assert "The recording of the arena is not there." in findings.text
        json.dumps(findings.to_dict())

    def test_all_methods_have_a_table_for_each_sensor(self, monkeypatch):
        some = {name: SENSORS[name] for name in ("lms181", "ld19")}
        monkeypatch.setattr(all_methods, "SENSORS", some)
        findings = all_methods.run(self.setting, silent)
        assert [table.title.split(":")[0] for table in findings.tables] == list(some)
        for table in findings.tables:
            rows = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
            assert rows["pdbs"]["corner F1"] is None
            assert rows["pdbs"]["partition"] > 0.5
            assert rows["region_growing"]["corner F1"] > 0.6
        json.dumps(findings.to_dict())

    def test_repeatability_of_the_logs_that_are_there(self, tmp_path, monkeypatch, data_dir):
        monkeypatch.setattr(repeatability, "PAIRS_A_FRAME", 2)
        setting = Setting(frames=1, data=data_dir)
        findings = repeatability.run(setting, silent)
        assert [table.title.split(":")[0] for table in findings.tables] == list(repeatability.LOGS)
        for found in findings.numbers.values():
            assert 0 <= found["ransac"]["corners_repeated"] <= found["ransac"]["corners_expected"]
        empty = repeatability.run(Setting(frames=1, data=tmp_path), silent)
        assert not empty.tables
