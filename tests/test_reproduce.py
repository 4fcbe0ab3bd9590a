"""The report of experiments: names, what is written, and that it can be repeated."""

import copy
import json
import math
import re
from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from lineament_lab.evaluation.counts import plain
from lineament_lab.evaluation.ple import Benchmark, BenchmarkResult
from lineament_lab.evaluation.ple import benchmark as ple
from lineament_lab.reproduce import (
    EXPERIMENTS,
    Figure,
    Findings,
    Setting,
    Table,
    experiment_names,
    noise,
    run_experiments,
)
from lineament_lab.reproduce.claims import bands, claims, verdicts
from lineament_lab.reproduce.experiment import WORDS, Experiment, Measured, MissingError
from lineament_lab.reproduce.findings import cell_text, cells, dot_chart, median_of
from lineament_lab.reproduce.prose import prose
from lineament_lab.reproduce.report import benchmark_tables, reproduce, write_report
from lineament_lab.reproduce.seeds import Spread, merged
from selenium.webdriver.common.keys import Keys
from test_view_page import new_browser
from test_view_page import pytestmark as in_a_browser

from lineament import LineamentError
from lineament.output.canvas import figure_bytes, new_figure


def findings():
    table = Table(
        "Corners < 0.1 m", ("method", "paper", "here"), (("liu", "lost", np.nan),), "One."
    )
    figure = Figure("fig1", 'a "b" & c', figure_bytes(new_figure(1, 1)))
    numbers = {"f1": np.float64(0.5), "errors": np.array([1.0, np.inf]), "n": np.int64(3)}
    return Findings("Noise & more", ("All is <well>.",), (table,), (figure,), numbers)


def test_names_are_those_of_the_experiments_and_of_the_paper():
    assert experiment_names([]) == list(EXPERIMENTS)
    assert experiment_names(["fig12", "noise", "fig2"]) == ["noise", "similarity"]
    assert experiment_names(["repeatability"]) == ["real"]
    others = [other for names in EXPERIMENTS.values() for other in names]
    with pytest.raises(ValueError, match="'fig0' is unknown, expected one of: ") as caught:
        experiment_names(["fig0"])
    assert str(caught.value).partition(": ")[2].split(", ") == [*EXPERIMENTS, *others]
    assert len({*EXPERIMENTS, *others}) == len(EXPERIMENTS) + len(others)


def test_report_is_one_page_and_one_file_of_numbers(tmp_path):
    setting = Setting(frames=3, seed=5, seeds=2)
    page = write_report(tmp_path, {"extra": findings()}, setting)
    text = page.read_text(encoding="utf-8")
    assert re.findall(r'<a href="(.*?)"', text) == ["#verdicts", "#extra"]
    assert re.findall(r' id="(.*?)"', text) == ["verdicts", "extra", "fig1"]
    places = [claim.place for _, claim in claims()]
    for shown in ("All is <well>.", "Corners < 0.1 m", "lost", "–", 'a "b" & c', *places):
        assert f">{escape(shown)}<" in text
    assert not any(wrong in text for wrong in ("<well", "<link", "http"))
    figures = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert (figures["frames"], figures["seeds"], figures["recordings"]) == (3, [5, 6], False)
    assert set(figures["verdicts"].values()) == {""}
    noise = figures["experiments"]["extra"]
    assert noise["numbers"] == {"f1": 0.5, "errors": [1.0, None], "n": 3}
    assert noise["tables"][0]["rows"] == [["liu", "lost", None]]
    assert noise["figures"] == {"fig1": 'a "b" & c'}


def test_cells():
    shown = [cell_text(c) for c in (None, "liu", 3, 0.5, np.float64(12.345), 12345.6, 1e-5, 0.0)]
    assert shown == ["–", "liu", "3", "0.5", "12.3", "12346", "1.00e-05", "0"]
    assert plain((np.bool_(True), {1: np.nan})) == [True, {"1": None}]
    table = Table.of_numbers("A", {"x": {"n": 2}}, {"n [mm]": "n", "m": "m"}, "", "b")
    assert (table.columns, table.rows) == (("b", "n [mm]", "m"), (("x", 2000.0, None),))
    given = {"length": 0.5, "text": "lost", "none": None}
    columns = {"[m]": "length", "a [mm]": "length", "of b [%]": "length", "a": ("length", 2)}
    units = {"[µs]": "length", "[mrad]": "length", "[°]": "length", "[%]": "text", "b": "none"}
    assert list(cells(given, columns | units)) == [
        *(0.5, 500.0, 50.0, 1.0, 5e5, 500.0, pytest.approx(90 / math.pi), "lost", None)
    ]
    of_two = Table.of_numbers("A", {("x", "y"): {"n": 2}}, {"n": "n"}, first=("a", "b"))
    assert (of_two.columns, of_two.rows) == (("a", "b", "n"), (("x", "y", 2),))


@pytest.mark.parametrize("field", [{"frames": 0}, {"seed": -1}, {"seeds": 0}])
def test_setting_is_checked(field):
    with pytest.raises(ValueError, match=next(iter(field))):
        Setting(**field)


def test_recordings_that_are_missing_are_left_out(tmp_path):
    files = {"A": "a.log", "B": "b.log"}
    assert Setting().recordings(files) == Setting(data=tmp_path).recordings(files) == {}
    (tmp_path / "a.log").touch()
    assert Setting(data=tmp_path).recordings(files) == {"A": tmp_path / "a.log"}


def test_chart_draws_what_is_finite():
    numbers = {"one": {"a": {"f1": 1.0}, "b": {"f1": np.nan, "t": 3}}, "other": {"b": {"f1": 2}}}
    f1, time = dot_chart(numbers, {"F1 [%]": "f1", "time": "t"}, ["time"]).axes
    assert [tick.get_text() for tick in f1.get_yticklabels()] == ["b", "a"]
    drawn = [np.asarray(line.get_xdata(), float) for line in f1.lines]
    np.testing.assert_array_equal(drawn, [[np.nan, 100.0], [200.0, np.nan]])
    assert (f1.get_xscale(), time.get_xscale()) == ("linear", "log")


@pytest.mark.parametrize(("label", "lines"), [("errors of all corners.", 1),
                                              ("errors of some corners.", 2)])  # fmt: skip
def test_labels_of_a_chart_have_lines_of_22_letters(label, lines):
    figure = dot_chart({"one": {"a": {"f1": 1.0}}}, {label: "f1"}, [])
    assert len(figure.axes[0].get_xlabel().split("\n")) == lines


class TestEngine:
    """An experiment of nothing: it measures the seed, and draws what it measured."""

    def declared(self, ran, once=False):
        def measure(setting, progress):
            ran.append(setting.seed)
            progress("measuring")
            drawn = Figure("fig", f"seed {setting.seed}", b"")
            return Measured({"n": setting.seed, "all": {"a": np.float64(1)}}, lambda: [drawn])

        def report(n, setting):
            table = Table.of_numbers("T", {"a": n}, {"n": "n"})
            return (f"{n['n']:.0f} of {setting.frames} frames",), (table,)

        return Experiment("Nothing", measure, report, once=once)

    def test_seeds_are_pooled_before_they_are_reported_and_the_first_is_drawn(self):
        ran, reports = [], []
        found = self.declared(ran).run(Setting(9, 3, seeds=3), reports.append, "nothing")
        assert ran == [3, 4, 5]
        assert found.title == "Nothing"
        assert found.text == ("4 (3–5) of 9 frames",)
        assert found.figures == (Figure("fig", "seed 3", b""),)
        assert (
            repr(found.numbers) == "{'n': Spread([3.0, 4.0, 5.0]), 'all': {'a': np.float64(1.0)}}"
        )
        assert found.tables[0].rows[0][1].values == (3.0, 4.0, 5.0)
        seeds = [f"nothing, seed {seed}" for seed in (3, 4, 5)]
        whats = ("starting", "measuring")
        assert reports == [*(f"{s}: {what}" for s in seeds for what in whats), "nothing: drawing"]

    def test_what_no_seed_changes_is_measured_once(self):
        ran, reports = [], []
        self.declared(ran, once=True).run(Setting(1, 3, seeds=2), reports.append, "nothing")
        assert ran == [3]
        assert reports[0] == "nothing: starting"

    def test_what_is_missing_is_said(self):
        def measure(*_):
            raise MissingError("no recordings")

        found = Experiment("A bag", measure, print).run(Setting(), print, "bag")
        assert found == Findings("A bag", ("The recordings are missing: nothing is measured.",))

    def test_experiments_run_by_their_names(self, monkeypatch):
        ran, reports = [], []
        monkeypatch.setattr(noise, "EXPERIMENT", self.declared(ran))
        found = run_experiments(["fig2"], Setting(1, 3, seeds=2), reports.append)
        assert (list(found), ran) == (["noise"], [3, 4])
        assert reports[2] == "noise (1/1), seed 4: starting"


def test_every_section_of_prose_is_of_a_page():
    """Each has a name of its own, which the code says, and paragraphs without line breaks."""
    folder = files("lineament_lab.reproduce")
    names = re.findall(r"^# (.+)$", (folder / "text.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(names) == len(set(names))
    assert set(EXPERIMENTS) <= set(names)
    code = "".join(path.read_text(encoding="utf-8") for path in Path(str(folder)).glob("*.py"))
    assert [name for name in names if f'"{name}"' not in code] == []
    assert not [p for name in ("page", "liu", "rivals") for p in prose(name) if "\n" in p]
    assert prose("two_corners", scans=20)[0].count(" with 20 scans from each place") == 1


def test_claims_are_those_of_the_paper_in_its_order():
    places = [claim.place for _, claim in claims()]
    figures = [*(1, "2, 3"), *range(4, 14)]
    assert places == [
        *(f"Figure{'s' * (k == '2, 3')} {k}" for k in figures),
        *("Table 1", "Table 2", "Table 3: partition", "Table 3: corners", "Table 3: time"),
    ]


def test_nothing_is_run_for_a_folder_that_cannot_be(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(LineamentError, match="cannot make this folder"):
        reproduce(tmp_path / "file", ["noise"])
    with pytest.raises(ValueError, match="unknown"):
        reproduce(tmp_path / "folder", ["fig0"])
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
    assert tables[1].columns == ("method", "J = 10")
    authors = ("ple (authors)", 0.5), ("iepf (authors)", 0.75)
    assert tables[1].rows == (("iepf", 0.25), ("liu", 0.25), *authors)


class TestSeeds:
    def test_spread_calculates_seed_by_seed_and_compares_by_median(self):
        one, other = Spread([1.0, 5.0, 3.0]), Spread([2.0, 4.0, 8.0])
        assert (float(one), one < other, max(one, other)) == (3.0, True, other)
        assert (other - one).values == (1.0, -1.0, 5.0)
        assert (1 - one).values == (0.0, -4.0, -2.0)
        assert (one - 1).values == (0.0, 4.0, 2.0)
        assert (10 * one).values == (one * 10).values == (10.0, 50.0, 30.0)
        assert (other / one).values == (2.0, 0.8, 8 / 3)
        assert math.isnan((one / Spread([0.0, 1.0, 1.0])).values[0])
        assert (1 / Spread([2.0, 4.0])).values == (0.5, 0.25)
        assert (one + other).values == (other + one).values == (3.0, 9.0, 11.0)
        assert (1 + one + 1).values == (3.0, 7.0, 5.0)
        assert abs(-one).values == one.values
        assert abs(one - other).values == (1.0, 1.0, 5.0)
        assert copy.deepcopy(one).values == one.values
        assert repr(one) == "Spread([1.0, 5.0, 3.0])"

    @pytest.mark.parametrize(
        ("values", "text"),
        [
            ([0.5, 0.25, 0.75], "0.50 (0.25–0.75)"),
            ([0.5, 0.501], "0.50"),
            ([-1.0, 1.0], "0.00 (-1.00 to 1.00)"),
            ([0.5, math.nan, 0.25], "0.38 (0.25–0.50, 2 of 3 seeds)"),
            ([math.nan, 2.0], "2.00 (1 of 2 seeds)"),
            ([math.nan, math.nan], "nan"),
        ],
    )
    def test_spread_is_written_as_median_and_range(self, values, text):
        assert f"{Spread(values):.2f}" == text

    def test_cells_and_json_of_a_spread(self):
        assert cell_text(Spread([0.12345, 0.2, 3000.0])) == "0.2 (0.123–3000)"
        assert cell_text(Spread([math.nan] * 2)) == "–"
        assert plain({"a": Spread([1.0, math.nan])}) == {"a": {"median": 1.0, "seeds": [1.0, None]}}

    @pytest.mark.parametrize(
        ("values", "expected"),
        [
            ([1, 1, 1], 1),
            ([1, None, 3], Spread([1, math.nan, 3])),
            ([math.nan, math.nan], math.nan),
            ([None, None], None),
            ([{"a": 1}, {"b": 2}], {"a": Spread([1, math.nan]), "b": Spread([math.nan, 2])}),
            ([{"log": {"a": 1}}, {}], {"log": {"a": 1}}),
            ([(1, "x"), (2, "x")], [Spread([1, 2]), "x"]),
            ([np.array([1.0, 2.0]), np.array([1.0, 4.0])], [1.0, Spread([2.0, 4.0])]),
            ([[1], [1, 2]], [[1], [1, 2]]),
            ([True, True], True),
            (["radius", "k", "k"], "k (so in 2 of 3 seeds)"),
            ([None, "k", "k"], "k"),
        ],
    )
    def test_merging_by_kind(self, values, expected):
        assert repr(merged(values)) == repr(expected)

    def test_recordings_are_read_with_the_first_seed_only(self, tmp_path):
        settings = Setting(2, 7, tmp_path, seeds=3).by_seed()
        assert [(s.seed, s.data, s.seeds, s.frames) for s in settings] == [
            *((7, tmp_path, 1, 2), (8, None, 1, 2), (9, None, 1, 2)),
        ]

    def test_a_table_as_text_has_columns_flush_right_but_the_first(self):
        text = str(Table("T", ("m", "n", "F1"), (("liu", 1500.25, None), ("b", 0.00001, "x"))))
        assert text.splitlines() == [
            *("m           n  F1", "liu      1500   –", "b    1.00e-05   x"),
        ]  # fmt: skip

    def test_median_is_an_item_and_the_lower_one_of_two(self):
        assert median_of(["ccc", "a", "bb"], len) == "bb"
        assert median_of(["ccc", "a", "bb", "dddd"], len) == "bb"


#: Of some experiments, by name.
NUMBERS = {
    "definitions": {
        "fig1": {"off": 0.01},
        "fig4": {"ratio": 2.0, "beyond": 0.0},
        "fig6": {"off": 0.5},
        "fig7": {"off": 0.0},
        "fig8": {"sum": 1.0, "stage": 1.0},
    },
    "layers": {
        "paper": {"liu:paper": {"success": 1.0}, "pdbs, fixed": {"success": 1.0}},
        "utm30lx": {
            "liu:paper": {"success": Spread([0.9, 0.8])},
            "pdbs, fixed": {"success": Spread([0.8, 0.9])},
        },
        "example": {
            "true features": {"clusters": 11, "corners": 5},
            "liu:paper": {"clusters": 11, "corners": Spread([1, 4])},
            "liu:figure9": {"clusters": 11, "corners": 5},
            "liu": {"clusters": 11, "corners": 5},
            "blind cut, shared steps": {"clusters": 9, "corners": 5},
        },
    },
}


class TestVerdicts:
    """Verdicts follow from numbers, over all seeds."""

    def found(self, numbers):
        return {name: Findings("", (), numbers=of) for name, of in numbers.items()}

    def judged(self, numbers):
        judged = verdicts(self.found(numbers))
        return {one.claim.place: (one.here, one.verdict) for one in judged}

    def test_each_is_one_of_the_words_or_not_run(self):
        judged = self.judged(NUMBERS)
        assert {word for _, word in judged.values()} - set(WORDS) == {""}
        assert judged["Figure 1"][1] == judged["Figure 4"][1] == judged["Figure 8"][1] == "holds"
        assert judged["Figure 6"][1] == "does not"
        assert judged["Table 1"][1] == "undecided"
        assert judged["Figure 12"] == ("", "")
        # No better with its scanner, better with one of two seeds with the other.
        assert judged["Figure 5"] == (
            "Clusters right, its scanner: 100 %, PDBS 100 %; mixed pixels: 85 (80–90) %, "
            "PDBS 85 (80–90) %",
            "in part",
        )
        about = "11 and 2 (1–4) (beside it: liu:figure9 11 and 5, liu 11 and 5)"
        assert judged["Figure 10"] == (f"A scene with as many: {about}", "in part")

    def test_a_verdict_says_where_blind_cuts_hold_as_well(self):
        numbers = copy.deepcopy(NUMBERS)
        example = numbers["layers"]["example"]
        example["blind cut, shared steps"] = {"clusters": 11, "corners": 5}
        assert self.judged(numbers)["Figure 10"][1] == "in part; blind cuts, too"
        example["liu:paper"] = {"clusters": 11, "corners": 5}
        assert self.judged(numbers)["Figure 10"][1] == "holds; blind cuts, too"
        example["liu:paper"] = {"clusters": 9, "corners": 9}
        assert self.judged(numbers)["Figure 10"][1] == "does not"

    @pytest.mark.parametrize(
        ("figure", "number", "value"),
        [("fig1", "off", 0.03), ("fig4", "ratio", 0.9), ("fig4", "beyond", 0.2),
         ("fig6", "off", 0.03), ("fig7", "off", 0.1), ("fig8", "stage", 1.1)],
    )  # fmt: skip
    def test_a_definition_does_not_hold_where_one_of_its_numbers_is_off(
        self, figure, number, value
    ):
        numbers = copy.deepcopy(NUMBERS)
        numbers["definitions"]["fig6"]["off"] = 0.0
        place = f"Figure {figure[3:]}"
        assert self.judged(numbers)[place][1] == "holds"
        numbers["definitions"][figure][number] = value
        assert self.judged(numbers)[place][1] == "does not"

    def test_the_same_is_not_better(self):
        numbers = copy.deepcopy(NUMBERS)
        numbers["layers"]["utm30lx"] = numbers["layers"]["paper"]
        assert self.judged(numbers)["Figure 5"][1] == "does not"

    @pytest.mark.parametrize(
        ("letter", "other_reading", "word", "alike"),
        [
            (0.02, 0.01, "holds", "2"),
            (-0.1, 0.02, "does not", "1"),
            (Spread([0.03, -0.07]), -0.1, "in part", "0 (0–1)"),
            (-1e-9, -1e-9, "does not", "0"),
        ],
    )
    def test_figure_9_is_judged_by_the_letter_with_all_readings_beside(
        self, letter, other_reading, word, alike
    ):
        leads = {"tangent, half-width 2": letter, "tangent, half-width 8": other_reading}
        peaks = {
            "repetition": {reading: {"lead": lead} for reading, lead in leads.items()},
            "half_sum": {reading: {"lead": 0.03} for reading in leads},
        }
        here, found = self.judged({"repetition": {"peaks": peaks}})["Figure 9"]
        assert here.startswith("Of 2 readings, within 0.03 of the largest there: ")
        assert f": {alike} by AR of two views" in here
        assert "; 2 by ½ (precision + recall)" in here
        assert found == word

    @pytest.mark.parametrize(
        ("means", "word"),
        [
            *(([None], "undecided"), ([2.3, None], "holds")),
            *(([2.3, 2.25], "in part"), ([2.0], "does not")),
        ],
    )
    def test_table_2_is_of_what_is_found(self, means, word):
        places = [{"mean": mean, "found": 0.4 + 0.2 * (mean is not None)} for mean in means]
        others = dict.fromkeys(("liu:figure9", "liu"), places)
        blind = {"blind cut, shared steps": [{"mean": 2.0, "found": 0.4}]}
        found = {"places": {"liu:paper": places} | others | blind}
        judged = self.judged({"two_corners": found})
        assert judged["Table 2"][1] == word
        known = [mean for mean in means if mean is not None] or [0]
        assert f"{min(known):.3f} to {max(known):.3f} m" in judged["Table 2"][0] or known == [0]
        shares = [100 * place["found"] for place in places]
        assert f"{min(shares):.0f} to {max(shares):.0f} %" in judged["Figure 13"][0]
        found = {place["found"] >= 0.5 for place in places}
        words = {frozenset([True]): "holds", frozenset([False]): "does not"}
        assert judged["Figure 13"][1] == words.get(frozenset(found), "in part")

    def test_table_3_compares_what_the_paper_compares(self):
        def of(partition, recall):
            return {"many": {"partition_success": partition, "corner_recall_0.10": recall}}

        numbers = {
            "success": {
                "liu:paper, no corners": of(0.8, 0),
                "pdbs, fixed 0.3 m": of(0.9, 0),
                "liu:paper": of(0, 0.65),
                "liu:figure9": of(0, 0.7),
                "liu": of(0, 0.2),
                "blind cut, shared steps": of(0, 0.7),
                "iepf:paper": of(0, 0.6),
                "iepf:paper, in clusters": of(0, 0.7),
                "ratios": {
                    "partition: liu ÷ PDBS": (0.3, 0.2, Spread([0.3, 0.35])),
                    "corners: liu ÷ IEPF": (1.75, 1.5, 1.8),
                },
            },
            "sensitivity": {
                "bands": {
                    "clusters": {"low": Spread([80, 70]), "high": Spread([90, 95])},
                    "recall": {"low": 0, "high": 1},
                }
            },
        }
        judged, found = self.judged(numbers), self.found(numbers)
        assert judged["Table 3: partition"][1] == "does not"
        assert bands(found)["Table 3: partition"] == "70–95 %"
        assert bands({}) == {}
        assert judged["Table 3: corners"][1] == "in part"
        assert judged["Table 3: time"] == ("0.30 of PDBS, 1.75 of IEPF", "in part")
        # Rounds within a factor of two of the paper's ratio decide nothing.
        for low, word in ((1.43, "holds"), (1.45, "in part")):
            numbers["success"]["ratios"]["corners: liu ÷ IEPF"] = (1.75, low, 1.8)
            assert self.judged(numbers)["Table 3: time"][1] == word
        numbers["success"]["ratios"]["partition: liu ÷ PDBS"] = (0.3, Spread([0.3, 0.3]), 0.36)
        numbers["success"]["ratios"]["corners: liu ÷ IEPF"] = (0.75, 0.71, 0.8)
        assert self.judged(numbers)["Table 3: time"][1] == "undecided"


class TestInABrowser:
    """The page in headless Chromium: sorted by keyboard, as wide as the window, in the dark."""

    pytestmark = in_a_browser

    @pytest.fixture
    def driver(self, tmp_path):
        cells = ("b", 10.0), ("c", None), ("a", Spread([9, 8]))
        rows = tuple((*two, *[0.125] * 20) for two in cells)
        table = Table("T", ("method", "n", *(f"a long name {k}" for k in range(20))), rows)
        picture = Figure("wide", "A wide picture.", figure_bytes(new_figure(9, 2)))
        found = {"extra": Findings("Extra", ("A text.",), (table,), (picture,))}
        page = write_report(tmp_path, found, Setting(seeds=1))
        with new_browser(tmp_path / "profile") as browser:
            browser.driver.get(page.as_uri())
            yield browser.driver

    def first_column(self, driver):
        rows = driver.find_elements("css selector", "#extra ~ .table tbody tr")
        return "".join(row.find_element("tag name", "td").text for row in rows)

    def test_columns_sort_up_down_and_back(self, driver):
        name, number = driver.find_elements("css selector", "#extra ~ .table th button")[:2]
        orders = []
        for button in (number, number, number, name, number):
            button.send_keys(Keys.ENTER)
            orders.append(self.first_column(driver))
        # What is missing is last, whichever way.
        assert orders == ["abc", "bac", "bca", "abc", "abc"]
        sorted_by = driver.find_elements("css selector", "th[aria-sort]")
        assert [th.text.split()[0] for th in sorted_by] == ["n"]

    @pytest.mark.parametrize("width", [400, 1400])
    def test_nothing_is_wider_than_the_window(self, driver, width):
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        root = "return document.documentElement."
        assert driver.execute_script(root + "scrollWidth") <= width
        image = driver.find_element("tag name", "img").size
        assert image["width"] >= 600  # legible: it scrolls where the window is narrower
        assert image["width"] / image["height"] > 3

    def test_dark_and_print(self, driver):
        def colors(media, scheme):
            features = [{"name": "prefers-color-scheme", "value": scheme}]
            given = {"media": media, "features": features}
            driver.execute_cdp_cmd("Emulation.setEmulatedMedia", given)
            body = driver.find_element("tag name", "body")
            return [body.value_of_css_property(name) for name in ("background-color", "color")]

        white = "rgba(255, 255, 255, 1)"
        assert colors("", "light")[0] == colors("print", "dark")[0] == white
        assert colors("print", "dark")[1] == "rgba(0, 0, 0, 1)"
        assert colors("", "dark") == ["rgba(13, 17, 23, 1)", "rgba(230, 237, 243, 1)"]
        card = driver.find_element("class name", "card")
        assert card.value_of_css_property("background-color") == white
