"""The report of experiments: what they are called, what is written, and that it comes out again."""

import json
from html.parser import HTMLParser

import numpy as np
import pytest

from lineament import LaserScan, LineamentError
from lineament import reproduce as experiments
from lineament.evaluation.counts import plain
from lineament.evaluation.ple import Benchmark, BenchmarkResult
from lineament.evaluation.ple import benchmark as ple
from lineament.logs import save_npz
from lineament.output.canvas import figure_bytes, new_figure
from lineament.reproduce import (
    ALIASES,
    EXPERIMENTS,
    Figure,
    Findings,
    Setting,
    Table,
    experiment_names,
    recordings,
    scenes,
)
from lineament.reproduce.findings import cell_text
from lineament.reproduce.noise_points import _near
from lineament.reproduce.report import benchmark_tables, reproduce, write_report


def quiet(about):
    del about


def findings():
    table = Table(
        "Corners < 0.1 m", ("method", "paper", "here"), (("liu", "lost", np.nan),), "One."
    )
    figure = Figure("fig1", 'a "b" & c', figure_bytes(new_figure(1, 1)))
    numbers = {"f1": np.float64(0.5), "errors": np.array([1.0, np.inf]), "n": np.int64(3)}
    return Findings("Noise & more", ("All is <well>.",), (table,), (figure,), numbers)


class _Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.text, self.links, self.places = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.tags.append(tag)
        self.links += [given["href"]] if "href" in given else []
        self.places += [given["id"]] if "id" in given else []

    def handle_data(self, data):
        self.text.append(data)


def test_names_are_those_of_the_experiments_and_of_the_paper():
    assert experiment_names([]) == list(EXPERIMENTS)
    assert experiment_names(["fig12", "noise", "fig2"]) == ["noise", "similarity"]
    with pytest.raises(ValueError, match="experiment 'fig1' is unknown, expected one of: noise, "):
        experiment_names(["fig1"])
    assert not set(ALIASES) & set(EXPERIMENTS)


def test_report_is_one_page_and_one_file_of_numbers(tmp_path):
    page = write_report(tmp_path, {"noise": findings()}, Setting(frames=3, seed=5))
    parsed = _Page(page.read_text(encoding="utf-8"))
    assert parsed.links == ["#noise"]
    assert parsed.places == ["noise"]
    assert {"All is <well>.", "Corners < 0.1 m", "lost", "–", 'a "b" & c'} <= set(parsed.text)
    assert not {"well", "script", "link"} & set(parsed.tags)
    assert "http" not in page.read_text(encoding="utf-8")
    figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert (figures["frames"], figures["seed"], figures["recordings"]) == (3, 5, False)
    noise = figures["experiments"]["noise"]
    assert noise["numbers"] == {"f1": 0.5, "errors": [1.0, None], "n": 3}
    assert noise["tables"][0]["rows"] == [["liu", "lost", None]]
    assert noise["figures"] == {"fig1": 'a "b" & c'}


def test_cells():
    shown = [cell_text(c) for c in (None, "liu", 3, 0.5, np.float64(12.345), 12345.6, 1e-5, 0.0)]
    assert shown == ["–", "liu", "3", "0.5", "12.3", "12346", "1.00e-05", "0"]
    assert plain((np.bool_(True), {1: np.nan})) == [True, {"1": None}]
    with pytest.raises(ValueError, match="row of 1 cells, expected 2"):
        Table("A", ("b", "c"), (("d",),))
    with pytest.raises(ValueError, match=r"has columns .*'b'.*, then .*'c'"):
        Table.of_records("A", [{"b": 1}, {"c": 1}])


@pytest.mark.parametrize("field", [{"frames": 0}, {"seed": -1}])
def test_setting_is_checked(field):
    with pytest.raises(ValueError, match=next(iter(field))):
        Setting(**field)


def test_recordings_that_are_not_there_are_left_out(tmp_path):
    assert Setting().recording("a.log") is None
    assert Setting(data=tmp_path).recording("a.log") is None
    (tmp_path / "a.log").touch()
    assert Setting(data=tmp_path).recording("a.log") == tmp_path / "a.log"


def test_nothing_is_run_for_a_folder_that_cannot_be(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(LineamentError, match="cannot make this folder"):
        reproduce(tmp_path / "file", ["noise"])
    with pytest.raises(ValueError, match="unknown"):
        reproduce(tmp_path / "folder", ["fig1"])
    assert not (tmp_path / "folder").exists()


def test_near_marks_beams_around():
    marks = np.array([0, 0, 0, 1, 0, 0, 0], dtype=bool)
    assert np.flatnonzero(_near(marks, 1, 2)).tolist() == [2, 3, 4, 5]


def test_benchmark_table_tells_the_authors_method_of_the_same_name():
    scores = np.zeros((1, 1), ple._SCORE)
    scores["rmse"] = 0.25
    scores["area_error"] = scores["iou"] = np.nan
    given = {"rmse": np.array([[[0.5], [0.75]]])}
    benchmark = Benchmark("real.npz", (None,), (10,), ("ple", "iepf"), given)
    results = [BenchmarkResult(benchmark, name, scores) for name in ("iepf", "liu")]
    tables = benchmark_tables(results)
    assert [t.title.split(": ")[1] for t in tables] == ["vertices", "rmse", "f", "fnr"]
    rmse = tables[1]
    assert rmse.columns == ("method", "J = 10")
    assert rmse.rows == (
        ("iepf", 0.25),
        ("liu", 0.25),
        ("ple (authors)", 0.5),
        ("iepf (authors)", 0.75),
    )


@pytest.mark.slow
def test_noise_comes_out_again_and_says_what_the_filter_does():
    told = []
    first, again = (
        experiments.run_experiments(["fig3"], Setting(frames=1), told.append)["noise"]
        for _ in range(2)
    )
    assert json.dumps(first.to_dict(), allow_nan=False) == json.dumps(again.to_dict())
    assert told[0] == "noise (1/1): starting"
    ranges = first.numbers["ranges"]
    assert ranges["planes"]["raw"] == pytest.approx(0.01, rel=0.1)
    assert ranges["planes"]["filtered"] < 0.6 * ranges["planes"]["raw"]
    assert ranges["edges"]["filtered"] > 2 * ranges["edges"]["raw"]
    assert ranges["more than 1.2 m"]["off_after"] == 1.0


@pytest.mark.slow
def test_perfect_lines_have_the_noise_as_similarity_error():
    found = experiments.run_experiments(["fig12"], Setting(frames=1), quiet)["similarity"]
    (scores,) = found.numbers.values()
    true, pdbs = scores["the true lines"], scores["pdbs, fitted"]
    # The distance to the line is the error of the range, shortened by the incidence.
    assert 0.004 < true["similarity_mean"] < 0.01 * np.sqrt(2 / np.pi)
    assert true["similarity_maximum"] < 0.06
    assert pdbs["similarity_mean"] > scores["iepf"]["similarity_mean"]
    assert found.tables[0].columns[1] == "largest, paper"


@pytest.mark.slow
def test_scenes_draw_recordings_where_they_are(data_dir, monkeypatch):
    monkeypatch.setattr(scenes, "KINDS", ("corridor",))
    monkeypatch.setattr(recordings, "LOGS", dict([*recordings.LOGS.items()][:1]))
    found = scenes.run(Setting(frames=1, data=data_dir), quiet)
    assert [figure.name for figure in found.figures] == ["fig11-corridor", "fig11-intel-lab"]
    for table in found.tables:
        assert [row[0] for row in table.rows][:2] == [
            "liu, paper’s numbers",
            "liu, best of Figure 9",
        ]


def test_recorded_scans_are_spread_over_the_log(tmp_path, monkeypatch):
    scans = [LaserScan([1.0, 1.0], 0.0, 0.1, stamp=float(i)) for i in range(10)]
    save_npz(tmp_path / "a.npz", scans)
    monkeypatch.setattr(recordings, "LOGS", {"A": "a.npz", "B": "b.npz"})
    setting = Setting(data=tmp_path)
    chosen = {
        count: [scan.stamp for scan in dict(recordings.recorded_scans(setting, count))["A"]]
        for count in (1, 2, 3, 20)
    }
    assert chosen[1] == [5.0]
    assert chosen[2] == [2.0, 7.0]
    assert chosen[3] == [1.0, 4.0, 7.0]
    assert chosen[20] == [float(i) for i in range(10)]
