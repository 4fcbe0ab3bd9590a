"""The commands that compare, measure and simulate: what they write, say and return."""

import json

import numpy as np
import pytest

import lineament as ln
from lineament.cli import run
from lineament.logs import save_npz


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "wall.npz"
    bearings = np.linspace(-0.5, 0.5, 61)
    scan = ln.LaserScan(3.0 / np.cos(bearings), angle_min=-0.5, angle_increment=1 / 60)
    save_npz(path, [scan] * 3)
    return path


@pytest.fixture
def benchmark(tmp_path):
    """One scan of a wall, and made-up scores of two methods."""
    path = tmp_path / "bench.npz"
    azimuth = np.linspace(-0.5, 0.5, 31)[np.newaxis]
    scores = np.array([[[0.1, 0.2], [0.3, 0.4]]])
    np.savez(
        path,
        azimuth=azimuth,
        radius=3.0 / np.cos(azimuth),
        beams=np.array([31]),
        radius_limits=np.array([[0.0, 30.0]]),
        max_vertices=np.array([10, 20]),
        methods=np.array(["ple", "iepf"]),
        **dict.fromkeys(("rmse", "f", "fnr"), scores),
    )
    return path


def test_compare_writes_and_tells(log, tmp_path, capsys):
    out = tmp_path / "a.html"
    given = ["compare", str(log), "--scan", "1", "-m", "pdbs", "-m", "liu", "-o", str(out)]
    assert run(given) == 0
    assert out.stat().st_size > 1000
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("method")
    assert [line.split()[0] for line in lines[1:]] == ["pdbs", "liu"]


def test_compare_is_quiet_if_it_is_to_be(log, tmp_path, capsys):
    out = tmp_path / "a.png"
    assert run(["compare", str(log), "-m", "pdbs", "-o", str(out), "--quiet"]) == 0
    assert out.stat().st_size > 1000
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")


@pytest.mark.parametrize(
    ("options", "status", "about"),
    [
        (["-o", "a.txt"], 2, "expected an ending of .html, .png"),
        (["-o", "a.png", "-m", "lui"], 2, "method 'lui' is unknown"),
        (["-o", "a.png", "--scan", "99", "-m", "pdbs"], 1, "expected 0 to 2"),
        (["-o", "no/where/a.png", "-m", "pdbs"], 1, "does not exist"),
        ([], 2, "--output"),
    ],
)
def test_compare_says_in_a_line_what_is_wrong(
    log, tmp_path, monkeypatch, capsys, options, status, about
):
    monkeypatch.chdir(tmp_path)
    assert run(["compare", str(log), *options]) == status
    said = capsys.readouterr().err
    assert about in said
    assert said.count("\n") == 1
    assert not (tmp_path / "a.png").exists()


@pytest.mark.slow
def test_reproduce_writes_page_and_figures(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("LINEAMENT_DATA", raising=False)
    out = tmp_path / "report"
    assert run(["reproduce", "-o", str(out), "--only", "fig5", "--frames", "1"]) == 0
    assert capsys.readouterr().out.strip() == str(out / "index.html")
    figures = json.loads((out / "figures.json").read_text(encoding="utf-8"))
    assert list(figures["experiments"]) == ["layers"]
    assert figures["recordings"] is False


@pytest.mark.parametrize(
    ("options", "about"),
    [
        (["--only", "fig1"], "experiment 'fig1' is unknown"),
        (["--frames", "0"], "--frames"),
        (["--seed", "-1"], "--seed"),
        (["--data", "no/where"], "--data"),
    ],
)
def test_reproduce_with_wrong_options(tmp_path, capsys, options, about):
    out = tmp_path / "report"
    assert run(["reproduce", "-o", str(out), *options]) == 2
    said = capsys.readouterr().err
    assert about in said
    assert said.count("\n") == 1
    assert not out.exists()


def test_reproduce_takes_the_recordings_of_the_environment(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LINEAMENT_DATA", str(tmp_path / "nowhere"))
    assert run(["reproduce", "-o", str(tmp_path / "report")]) == 2
    assert "nowhere" in capsys.readouterr().err


def test_bench_ple_tells_means_beside_the_authors(benchmark, tmp_path, capsys):
    out = tmp_path / "scores.json"
    given = ["bench", "ple", "--data", str(benchmark), "-m", "iepf"]
    assert run([*given, "--json", str(out)]) == 0
    said = capsys.readouterr().out
    assert "bench.npz: rmse" in said
    assert "iepf (authors)     0.3     0.4" in said
    scores = json.loads(out.read_text(encoding="utf-8"))
    assert scores["method"] == "iepf"
    # Its own, not those of the authors' method of the same name.
    assert max(scores["mean"]["rmse"]) < 1e-6
    assert scores["authors"]["rmse"]["iepf"] == [0.3, 0.4]
    assert [row["max_vertices"] for row in scores["scans"][0]] == [10, 20]
    assert run([*given, "-q"]) == 0
    assert capsys.readouterr().out == ""


def test_bench_ple_with_wrong_options(benchmark, tmp_path, capsys):
    given = ["bench", "ple", "--data", str(benchmark)]
    wrong = (
        ([*given, "-m", "pdbs"], 2, "max_vertices"),
        ([*given, "-m", "iepf", "-m", "hough", "--json", "a.json"], 2, "one -m"),
        (["bench", "ple", "--data", str(tmp_path / "no.npz"), "-m", "iepf"], 1, "no.npz"),
    )
    for options, status, about in wrong:
        assert run(options) == status
        said = capsys.readouterr().err
        assert about in said
        assert said.count("\n") == 1


@pytest.mark.parametrize("name", ["a.npz", "a.log.gz"])
def test_simulate_records_a_drive(tmp_path, name):
    out = tmp_path / name
    given = ["simulate", "building", "--sensor", "lms181", "--rate", "0.5", "--moving", "-q"]
    assert run([*given, "-o", str(out), "--scans", "4"]) == 0
    scans = list(ln.open_log(out))
    assert len(scans) == 4
    assert len({scan.pose for scan in scans}) == 4
    assert len(scans[0]) == 181


def test_simulated_scene_is_seen_from_one_place_with_the_noise_asked_for(tmp_path):
    out = tmp_path / "a.npz"
    given = ["simulate", "hall", "--seed", "3", "--scans", "20", "--sensor", "paper"]
    assert run([*given, "--noise", "0.05", "--dropout", "0.2", "-q", "-o", str(out)]) == 0
    scans = list(ln.open_log(out))
    assert len({scan.pose for scan in scans}) == 1
    ranges = np.array([np.where(scan.valid, scan.ranges, np.nan) for scan in scans])
    assert np.nanmedian(np.nanstd(ranges, axis=0)) == pytest.approx(0.05, rel=0.1)
    assert np.isnan(ranges).mean() == pytest.approx(0.2, abs=0.02)
    again = tmp_path / "b.npz"
    run([*given, "--noise", "0.05", "--dropout", "0.2", "-q", "-o", str(again)])
    assert again.read_bytes() == out.read_bytes()


@pytest.mark.parametrize(
    ("options", "about"),
    [
        ([], "WORLD"),
        (["palace"], "world is 'palace', expected one of building, room"),
        (["building", "--sensor", "sonar"], "sensor is 'sonar', expected one of paper"),
        (["building", "--noise", "-1"], "sigma"),
        (["building", "--speed", "0"], "speed"),
        (["hall", "--moving"], "moving needs the building"),
        (["room", "--rate", "0"], "rate is 0"),
        (["room", "--rate", "inf"], "rate is inf"),
        (["room", "-o", "a.xyz"], "a.xyz"),
    ],
)
def test_simulate_with_wrong_options(tmp_path, monkeypatch, capsys, options, about):
    monkeypatch.chdir(tmp_path)
    assert run(["simulate", "-o", "a.npz", *options]) == 2
    said = capsys.readouterr().err
    assert about in said
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir())
