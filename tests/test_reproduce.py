"""The report of experiments: names, what is written, and that it can be repeated."""

import json
from html.parser import HTMLParser

import numpy as np
import pytest

from lineament import LineamentError
from lineament.evaluation.counts import plain
from lineament.evaluation.ple import Benchmark, BenchmarkResult
from lineament.evaluation.ple import benchmark as ple
from lineament.output.canvas import figure_bytes, new_figure
from lineament.reproduce import (
    EXPERIMENTS,
    Figure,
    Findings,
    Setting,
    Table,
    experiment_names,
)
from lineament.reproduce.findings import cell_text, dot_chart
from lineament.reproduce.report import benchmark_tables, reproduce, write_report


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
    assert experiment_names(["repeatability"]) == ["real"]
    others = [other for names in EXPERIMENTS.values() for other in names]
    assert len({*EXPERIMENTS, *others}) == len(EXPERIMENTS) + len(others)


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
    table = Table.of_numbers("A", {"x": {"n": 2}}, {"n [mm]": ("n", 1e3), "m": ("m", 1)}, "", "b")
    assert (table.columns, table.rows) == (("b", "n [mm]", "m"), (("x", 2000.0, None),))
    with pytest.raises(ValueError, match=r"has columns .*'b'.*, then .*'c'"):
        Table.of_records("A", [{"b": 1}, {"c": 1}])


@pytest.mark.parametrize("field", [{"frames": 0}, {"seed": -1}])
def test_setting_is_checked(field):
    with pytest.raises(ValueError, match=next(iter(field))):
        Setting(**field)


def test_recordings_that_are_missing_are_left_out(tmp_path):
    files = {"A": "a.log", "B": "b.log"}
    assert Setting().recordings(files) == Setting(data=tmp_path).recordings(files) == {}
    (tmp_path / "a.log").touch()
    assert Setting(data=tmp_path).recordings(files) == {"A": tmp_path / "a.log"}


def test_chart_draws_what_is_finite(monkeypatch):
    shown = []
    monkeypatch.setattr("lineament.reproduce.findings.canvas.figure_bytes", shown.append)
    numbers = {"one": {"a": {"f1": 1.0}, "b": {"f1": np.nan, "t": 3}}, "other": {"b": {"f1": 2}}}
    dot_chart(numbers, {"F1 [%]": ("f1", 100), "time": ("t", 1)}, ["time"])
    f1, time = shown[0].axes
    assert [tick.get_text() for tick in f1.get_yticklabels()] == ["b", "a"]
    drawn = [np.asarray(line.get_xdata(), float) for line in f1.lines]
    np.testing.assert_array_equal(drawn, [[np.nan, 100.0], [200.0, np.nan]])
    assert (f1.get_xscale(), time.get_xscale()) == ("linear", "log")


def test_nothing_is_run_for_a_folder_that_cannot_be(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(LineamentError, match="cannot make this folder"):
        reproduce(tmp_path / "file", ["noise"])
    with pytest.raises(ValueError, match="unknown"):
        reproduce(tmp_path / "folder", ["fig1"])
    assert not (tmp_path / "folder").exists()


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
