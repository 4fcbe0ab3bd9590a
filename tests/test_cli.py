"""The real commands, over a matrix of inputs: what they write, say and return."""

import ast
import gzip
import json
import os
import subprocess
import sys
from contextlib import suppress
from types import SimpleNamespace

import click
import matplotlib.image
import numpy as np
import pyarrow.parquet as pq
import pytest
from bulk_logs import corner_log
from lineament_lab.reproduce import EXPERIMENTS, Setting
from text_logs import FLASER, flaser, zipped

import lineament as ln
from lineament.cli import run
from lineament.cli.options import reading
from lineament.logs import save_npz
from lineament.logs.base import ECHOES, ReadOptions
from lineament.output import canvas


@pytest.fixture
def npz(tmp_path):
    """A log of a wall that comes nearer, each scan with its own stamp and pose."""
    bearings = np.linspace(-0.5, 0.5, 61)
    shape = np.where(bearings < -0.49, np.nan, 1 / np.cos(bearings))
    scans = [
        ln.LaserScan(
            (3.0 - 0.01 * k) * shape,
            angles=bearings,
            range_max=30.0,
            stamp=10.0 + 0.1 * k,
            pose=(0.01 * k, 0.0, 0.0),
        )
        for k in range(7)
    ]
    save_npz(tmp_path / "wall.npz", scans)
    return tmp_path / "wall.npz"


def save_benchmark(path, scores):
    """One scan of a wall, and made-up scores of methods."""
    azimuth = np.linspace(-0.5, 0.5, 31)[np.newaxis]
    np.savez(
        path,
        azimuth=azimuth,
        radius=3.0 / np.cos(azimuth),
        beams=np.array([31]),
        radius_limits=np.array([[0.0, 30.0]]),
        max_vertices=np.array([10, 20]),
        methods=np.array(list(scores)),
        **dict.fromkeys(("rmse", "f", "fnr"), np.array([list(scores.values())])),
    )
    return path


@pytest.fixture
def benchmark(tmp_path):
    return save_benchmark(tmp_path / "bench.npz", {"ple": [0.1, 0.2], "iepf": [0.3, 0.4]})


def test_extract_writes_a_table_and_says_what_it_found(npz, tmp_path, capsys):
    out = tmp_path / "features.parquet"
    assert run(["extract", str(npz), "-o", str(out)]) == 0
    table = pq.read_table(out)
    segments = table.filter(np.array(table["kind"].to_pylist()) == "segment")
    assert segments["scan"].to_pylist() == list(range(7))
    said = capsys.readouterr().out
    assert "  7 scans, 1.6 % of beams invalid, 0 faults skipped\n" in said
    assert "  7 segments, 0 corners, 0 edges, 0 arcs, 14 breakpoints\n" in said
    assert "scans/s" in said


@pytest.mark.parametrize(
    ("options", "extractor"),
    [
        ("", ln.Extractor()),
        ("--set max_missing=4", ln.Extractor(max_missing=4)),
        (
            "-m liu:paper --noise 0.02 --set response=relative",
            ln.Extractor("liu:paper", noise=ln.RangeNoise(0.02), response="relative"),
        ),
    ],
)
def test_options_of_method_and_noise_arrive(options, extractor, npz, tmp_path, capfd):
    out = tmp_path / "features.jsonl"
    assert run(["extract", str(npz), "-o", str(out), "-q", *options.split()]) == 0
    assert capfd.readouterr() == ("", "")
    lines = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    found = [{"pose": list(scan.pose), **extractor(scan).to_dict()} for scan in ln.open_log(npz)]
    known = {"topic": "ranges"}
    assert lines == [{"scan": k, **known, **features} for k, features in enumerate(found)]


#: Command, exit status, and words of the line that says what is wrong.
WRONG = [
    ("extract none.log -o f.parquet", 1, "none.log: there is no such"),
    ("extract wall.npz bench.npz -o f.parquet", 1, "is no folder, expected one for 2 logs"),
    ("extract *.bag -o f.parquet", 1, "*.bag: holds no log"),
    ("extract wall.npz -o f.csv --resume", 2, "--resume: expected a"),
    ("extract wall.npz -o f.csv --format csv", 2, "--format: expected a"),
    ("extract . -o ./ --threads 1 --processes 1", 2, "one of --"),
    ("extract . -o ./ --threads 0", 2, "--threads"),
    ("extract empty.log -o f.parquet", 1, "empty.log: is empty"),
    ("extract text.log -o f.parquet", 1, "text.log: is no"),
    ("extract short.log -o f.parquet", 1, "short.log:2: "),
    ("extract cut.log.gz -o f.parquet", 1, "cut.log.gz:"),
    (f"extract wall.npz -o {300 * 'a'}.csv", 1, "aaa.csv: cannot be written: "),
    ("extract wall.npz -o f.xls", 2, "f.xls: expected a folder or"),
    ("extract wall.npz -o f", 2, "expected a folder or an ending"),
    ("extract wall.npz -o f.parquet -m lui", 2, "'lui'"),
    ("extract wall.npz -o f.parquet -m liu:x", 2, "'liu:x'"),
    ("extract wall.npz -o f.parquet --set a=1", 2, "'a'"),
    ("extract wall.npz -o f.parquet --set a", 2, "NAME=VALUE"),
    ("extract wall.npz -o f.parquet --set evidence=wide", 2, "evidence is 'wide', expected a num"),
    ("extract wall.npz -o f.parquet --noise -1", 2, "--noise"),
    ("extract wall.npz -o f.parquet --topic x", 1, "topic 'x'"),
    ("extract -o f.parquet", 2, "LOGS"),
    ("extract wall.npz", 2, "--output"),
    ("extract --nonsense", 2, "--nonsense"),
    ("nonsense", 2, "nonsense"),
    ("info none.log", 1, "none.log: there is no such"),
    ("info other.npz", 1, "other.npz: expected the key"),
    ("info wall.npz --echo second", 2, "--echo"),
    ("info wall.npz --ring -1", 2, "--ring"),
    ("info wall.npz --limit size=1", 2, "limit 'size' is unknown, expected one of beams, points"),
    ("info wall.npz --limit beams", 2, "'beams': expected NAME=VALUE"),
    ("info wall.npz --limit beams=1e6", 2, "limit beams is '1e6', expected a whole number"),
    ("info wall.npz --limit scans=6", 1, "wall.npz: has 7 scans, more than the limit of 6"),
    ("plot wall.npz --scan 7 -o p.png", 1, "has no scan 7"),
    ("plot wall.npz --scan -1 -o p.png", 1, "has no scan -1"),
    ("plot wall.npz -o p.gif", 2, "p.gif"),
    ("plot wall.npz -o p.png -m x", 2, "'x'"),
    ("warmup -m lui", 2, "method 'lui' is unknown"),
    ("view wall.npzx --no-browser", 1, "there is no such"),
    ("view wall.npz -m lui", 2, "method 'lui' is unknown"),
    ("view wall.npz --set a=1", 2, "'a'"),
    ("view wall.npz --port 70000", 2, "70000"),
    ("view wall.npz -m pdbs --no-browser --host 256.1.1.1", 1, "cannot listen there"),
    ("view wall.npz -m pdbs --topic scan", 1, "has no topic 'scan'"),
    ("live --from wall.npz --ros 0 --domain 233", 2, "--domain"),
    ("live --from wall.npz --ros 0 --depth 0", 2, "--depth"),
    ("live --from wall.npz --ros 0 --depth 1001", 2, "--depth"),
    ("live --from wall.npz --ros 0 --foxglove 65536", 2, "--foxglove"),
    ("compare wall.npz -o a.txt", 2, "expected an ending of .html, .png"),
    ("compare wall.npz -o a.png -m lui", 2, "method 'lui' is unknown"),
    ("compare wall.npz -o a.png --scan 99 -m pdbs", 1, "expected 0 to 6"),
    ("compare wall.npz", 2, "--output"),
    ("reproduce -o out --only fig0", 2, "experiment 'fig0' is unknown"),
    ("reproduce -o out --frames 0", 2, "--frames"),
    ("reproduce -o out --seed -1", 2, "--seed"),
    ("reproduce -o out --data no/where", 2, "no/where"),
    ("reproduce -o out --museum no.bag", 2, "no.bag"),
    ("reproduce -o out --seeds 0", 2, "--seeds"),
    ("bench ple --data bench.npz -m pdbs", 2, "max_vertices"),
    ("bench ple --data bench.npz -m iepf -m hough --json a.json", 2, "one -m"),
    ("bench ple --data no.npz -m iepf", 1, "no.npz"),
    ("simulate -o a.npz --moving --speed 0", 2, "speed"),  # WORLD is the building
    ("simulate palace -o a.npz", 2, "world is 'palace', expected one of building, room"),
    ("simulate building -o a.npz --sensor sonar", 2, "sensor is 'sonar', expected one of paper"),
    ("simulate building -o a.npz --noise -1", 2, "sigma"),
    ("simulate hall -o a.npz --moving", 2, "moving needs the building"),
    ("simulate room -o a.npz --rate 0", 2, "rate is 0"),
    ("simulate room -o a.npz --rate inf", 2, "rate is inf"),
    ("simulate room -o a.xyz", 2, "a.xyz"),
    # Options that would change nothing.
    ("plan a.svg -o b.dxf --dark", 2, "--dark: expected a picture, .png or .pdf, not .dxf"),
    ("plan a.svg -o b.dxf --resolution 1", 2, "--resolution: expected a grid, .yaml, not .dxf"),
    ("plan a.yaml -o b.yaml --resolution 1", 2, "a.yaml is a grid, whose cells are kept"),
    ("plan wall.svg -o b.yaml --resolution nan", 2, "resolution is nan m a cell, expected 0.0001"),
    ("plan wall.svg -o b.yaml --resolution 50", 2, "resolution is 50 m a cell, expected 0.0001"),
    ("info wall.svg --scale 0.001", 2, "--scale: is of a log, but wall.svg is a plan"),
    ("extract a.bag -o b.csv --topic /a --topic /b", 2, "--topic: expected one, not /a and /b"),
    ("view a.bag --layers A", 2, "--layers: is of the plan of --map, which is not given"),
    ("simulate room -o a.npz --speed 2", 2, "--speed: the scanner stands in world 'room'"),
    ("map a.bag -o b.svg --odometry /o --no-odometry", 2, "expected none beside --no-odometry"),
    (
        "locate a.bag --map a.svg -o b.csv --odometry /o --no-odometry",
        2,
        "--odometry /o: expected none beside --no-odometry",
    ),
    (
        "calibrate a.bag --topic /a --against /b --track 0.4",
        2,
        "--track: is of wheels, expected none beside --against",
    ),
    (
        "calibrate a.bag --topic /a --against /b --odometry /o",
        2,
        "--odometry: is of wheels, expected none beside --against",
    ),
    ("extract a.bag -o b.csv --set evidence=6 --set evidence=24", 2, "evidence is given twice"),
    ("info a.bag --limit beams=6 --limit beams=24", 2, "'beams=24': beams is given twice"),
    ("merge a.bag -o b.csv --mounting a=0,0,0 --mounting a=1,0,0", 2, "a is given twice"),
    ("extract a.bag -o out/ --format pdf", 2, "--format .pdf: expected one of .parquet, .csv"),
]


@pytest.mark.parametrize(("command", "status", "words"), WRONG)
@pytest.mark.usefixtures("npz", "benchmark")
def test_bad_input_gets_one_clear_line(command, status, words, tmp_path, monkeypatch, refused):
    whole = gzip.compress("".join(flaser([2.0] * 181) for _ in range(99)).encode())
    (tmp_path / "cut.log.gz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "empty.log").touch()
    (tmp_path / "text.log").write_text("It was a dark and stormy night.\n" * 9)
    (tmp_path / "short.log").write_text(flaser([2.0] * 181) + "FLASER 181 2.0 2.0\n")
    np.savez(tmp_path / "other.npz", radius=np.ones(3))
    before = set(tmp_path.rglob("*"))
    monkeypatch.chdir(tmp_path)
    assert words in refused(command, status)
    assert set(tmp_path.rglob("*")) == before


def test_keep_going_delivers_the_whole_scans_and_counts_the_rest(tmp_path, capsys):
    log, out = tmp_path / "broken.log", tmp_path / "f.jsonl"
    good = [flaser([2.0] * 181, stamp=float(k)) for k in range(3)]
    log.write_text(good[0] + "FLASER 181 1 2 3\n" + good[1] + "FLASER x\n" + good[2])
    assert run(["extract", str(log), "-o", str(out)]) == 1
    assert not out.exists()
    capsys.readouterr()
    assert run(["extract", str(log), "-o", str(out), "--keep-going"]) == 0
    stamps = [json.loads(line)["stamp"] for line in out.read_text().splitlines()]
    assert stamps == [0.0, 1.0, 2.0]
    said = capsys.readouterr().out
    assert "2 faults skipped" in said
    assert "broken.log:2" in said


@pytest.mark.slow
def test_plot_draws_methods_side_by_side_and_stages(npz, tmp_path, capsys):
    one, two, trace, dark = (tmp_path / f"{name}.png" for name in ("one", "two", "trace", "dark"))
    base = ["plot", str(npz), "--scan", "3"]
    assert run([*base, "-o", str(one)]) == 0
    assert run([*base, "-o", str(two), "-m", "liu", "-m", "liu:paper"]) == 0
    assert run([*base, "-o", str(trace), "--trace"]) == 0
    assert run([*base, "-o", str(dark), "--dark"]) == 0
    assert len({path.read_bytes() for path in (one, two, trace, dark)}) == 4
    assert f"wall.npz · scan 3 · 10.30 s -> {one}\n" in capsys.readouterr().out
    assert matplotlib.image.imread(one)[..., :3].mean() > 0.8
    assert matplotlib.image.imread(dark)[..., :3].mean() < 0.2
    svg = tmp_path / "dark.svg"
    assert run([*base, "-o", str(svg), "--dark", "--trace"]) == 0
    assert canvas.DARK.paper in svg.read_text(encoding="utf-8")
    assert "#ffffff" not in svg.read_text(encoding="utf-8")


@pytest.mark.slow
def test_demo_on_a_log_makes_table_and_page(npz, tmp_path, capsys):
    folder = tmp_path / "deep" / "demo"
    assert run(["demo", str(npz), "-o", str(folder)]) == 0
    pictures = {f"{name}.png" for name in ("scan", "trace", "methods", "map")}  # no corner
    assert {p.name for p in folder.iterdir()} == {"features.parquet", "index.html", *pictures}
    assert run(["extract", str(npz), "-q", "-o", str(tmp_path / "f.parquet")]) == 0
    tables = [pq.read_table(path) for path in (folder / "features.parquet", tmp_path / "f.parquet")]
    assert tables[0].equals(tables[1])
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 2 * 4  # on white and on black
    assert page.index("<figure") < page.index("<dl>")
    assert str(folder / "index.html") in capsys.readouterr().out
    # Without poses there is no map, but scans; that of another log is removed.
    assert (folder / "map.png").exists()
    log = corner_log(tmp_path / "still.npz", 2)
    assert run(["demo", str(log), "-q", "-o", str(folder)]) == 0
    pictures = {path.stem for path in folder.glob("*.png")}
    assert pictures == {"scan", "corner", "trace", "methods", "scans"}


@pytest.mark.parametrize("name", ["scan.png", "map.png", "drive.npz", "index.html"])
def test_demo_spares_files_that_it_did_not_make(name, tmp_path, refused):
    own = tmp_path / name
    own.write_text("mine")
    said = refused(["demo", "-q", "-o", tmp_path])
    assert f"{own}: is of no demo and would be replaced" in said
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.slow
def test_demo_simulates_a_drive_of_its_own(tmp_path):
    assert run(["demo", "-q", "-o", str(tmp_path)]) == 0
    log = ln.open_log(tmp_path / "drive.npz")
    assert len(log) > 100
    table = pq.read_table(tmp_path / "features.parquet")
    assert set(table["scan"].to_pylist()) == set(range(len(log)))
    assert {"segment", "corner", "breakpoint", "cluster"} <= set(table["kind"].to_pylist())


def start(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "lineament", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=options.pop("stderr", subprocess.PIPE),
        text=True,
        **options,
    )


@pytest.mark.parametrize(
    ("argument", "status"), [("--help", 0), ("--version", 0), ("", 2), ("x", 2)]
)
def test_help_version_and_status_of_the_real_program(argument, status):
    process = start(*argument.split())
    out, errors = process.communicate(timeout=60)
    assert process.returncode == status
    assert "Traceback" not in errors
    assert ("Commands:" in out + errors) == (argument in ("--help", ""))


@pytest.mark.slow
@pytest.mark.parametrize("output", [["{}.parquet"], ["out/", "--processes", "1"]])
def test_memory_does_not_grow_with_the_log(output, tmp_path):
    # Through a small process: a child's peak begins with that of the process it is forked from.
    code = (
        "import resource, subprocess, sys; "
        "subprocess.run([sys.executable, '-m', 'lineament', *sys.argv[1:]], check=True); "
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    line, peaks = flaser(np.linspace(2.0, 3.0, 181)), []
    for scans in (3_000, 30_000):
        (tmp_path / f"{scans}.log").write_text(line * scans)
        arguments = ["extract", f"{scans}.log", "-q", "-o", output[0].format(scans), *output[1:]]
        command = [sys.executable, "-c", code, *arguments]
        peaks.append(int(subprocess.check_output(command, text=True, cwd=tmp_path)))
    assert peaks[1] < 1.15 * peaks[0]


def test_progress_is_a_bar_on_a_terminal_and_lines_elsewhere(monkeypatch, capsys):
    from lineament.cli import progress

    assert list(progress.tracker(quiet=True)(range(3), "x", range(3))) == [0, 1, 2]
    clock = iter(np.arange(100.0))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    assert list(progress.tracker(quiet=False)(range(4), "reading", range(4))) == [0, 1, 2, 3]
    with progress.status(quiet=False) as show:
        for about in "abcd":
            show(about)
    lines = ["reading: 2/4, 1.0/s, 2 s left", "reading: 4/4, 1.0/s, 0 s left", "b", "d"]
    assert capsys.readouterr().err.splitlines() == lines
    assert progress._pace(994, 1000, 100.0) == "9.9/s, 1 s left"
    assert progress._pace(1000, 900, 100.0) == "10/s, 0 s left"
    assert progress._pace(0, 900, 100.0) == ""


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="pseudo-terminals are not everywhere")
def test_progress_bar_on_a_real_terminal(tmp_path):
    log = tmp_path / "long.npz"
    np.savez(log, ranges=np.full((200_000, 3), 2.0), angle_min=0.0, angle_increment=0.1)
    main, terminal = os.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    process = start("info", log, stderr=terminal, env=environment)
    os.close(terminal)
    shown = b""
    with suppress(OSError):  # where the process ends, on Linux
        while read := os.read(main, 65536):
            shown += read
    os.close(main)
    process.communicate(timeout=60)
    assert b"long.npz" in shown
    assert b"200000/200000" in shown


@pytest.fixture
def two_logs(tmp_path):
    return [str(corner_log(tmp_path / f"{name}.npz", 4 + k)) for k, name in enumerate("ab")]


def test_several_logs_go_into_a_folder(two_logs, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["extract", *two_logs, "-o", f"{out}/", "--threads", "1"]
    assert run(arguments) == 0
    said = capsys.readouterr().out
    assert f"2 logs -> {out}/\n  2 done, 0 failed, 0 whole before\n  9 scans, " in said
    parts = sorted(str(path.relative_to(out)) for path in out.rglob("*.parquet"))
    assert parts == ["log=a.npz/part-0.parquet", "log=b.npz/part-0.parquet"]
    # Without --resume all is done again; a folder that is there needs no slash.
    assert run([*arguments[:4], str(out), "--threads", "2"]) == 0
    assert "2 done" in capsys.readouterr().out
    assert run([*arguments, "--resume"]) == 0
    assert "0 done, 0 failed, 2 whole before" in capsys.readouterr().out
    assert run([*arguments, "--format", "jsonl"]) == 0
    assert len(list(out.rglob("part-0.jsonl"))) == 2


def test_logs_that_fail_are_counted_in_one_line(two_logs, tmp_path, capfd):
    out = tmp_path / "out"
    given = [two_logs[0], "/none.bag", "/none.npz"]
    assert run(["extract", *given, "-q", "-o", f"{out}/", "--processes", "1"]) == 1
    output, errors = capfd.readouterr()
    assert output == ""
    assert errors == f"lineament: 2 of 3 logs failed, see {out}/_manifest.jsonl\n"
    assert (out / "log=a.npz" / "part-0.parquet").exists()


@click.command()
@reading
def show(reading):
    click.echo(reading)


def test_options_become_what_open_log_takes(capsys):
    show.main([], standalone_mode=False)
    given = ["--topic", "/scan", "--echo", "last", "--ring", "0", "--poses", "/odom"]
    given += ["--scale", "0.001", "--laser-pose", "1", "2", "3"]
    given += ["--mask", "-1", "0.5", "--mask", "3", "-3"]
    limits = ["--limit", "beams=3", "--limit", "ratio=1_000"]
    show.main([*given, "--keep-going", *limits], standalone_mode=False)
    plain, all_given = map(ast.literal_eval, capsys.readouterr().out.splitlines())
    options = {"topic": None, "keep_going": False, **vars(ReadOptions()), "limits": None}
    # Nothing is deskewed by a command that reads a log so.
    assert {**plain, "stamp": "first"} == options
    read = {"topic": "/scan", "keep_going": True, "echo": "last", "ring": 0, "pose_topic": "/odom"}
    read |= {"limits": {"beams": 3, "ratio": 1000}, "scale": 0.001, "laser_pose": (1.0, 2.0, 3.0)}
    assert all_given == read | {"mask": ((-1.0, 0.5), (3.0, -3.0))}
    for option in show.params:
        if option.name == "echo":
            assert tuple(option.type.choices) == ECHOES


def test_info_of_what_is_behind_archives_and_addresses(tmp_path, capsys, refused):
    fsspec = pytest.importorskip("fsspec")
    (tmp_path / "a.zip").write_bytes(zipped(**{"x.log": FLASER, "y.log": FLASER}))
    fsspec.filesystem("memory").pipe("/cli/a.log", FLASER)
    for log in (f"{tmp_path}/a.zip/y.log", "memory://cli/a.log"):
        assert run(["info", log]) == 0
        out = capsys.readouterr().out
        assert out.startswith(f"log      {log} (carmen: FLASER)\n")
        assert "ranges   1.50 to 2.50 m, median 2.00 m, 66.7 % valid" in out
    line = f"holds several logs, expected a log file: {tmp_path}/a.zip/x.log"
    assert line in refused(["info", str(tmp_path / "a.zip")])


def test_warmup_takes_methods_and_says_how_long(monkeypatch, capsys):
    with monkeypatch.context() as patched:
        clock = SimpleNamespace(perf_counter=iter((1.0, 3.5)).__next__)
        patched.setattr("lineament.tasks.warmup.time", clock)
        assert run(["warmup"]) == 0
    assert capsys.readouterr().out == "kernels ready after 2.50 s\n"
    assert run(["warmup", "-q", "-m", "pdbs", "-m", "liu"]) == 0
    assert capsys.readouterr() == ("", "")


def test_reproduce_runs_what_is_asked_for_on_the_recordings_of_the_environment(
    tmp_path, monkeypatch, capsys, refused
):
    calls = []

    def report(output, *asked):
        calls.append(asked[:2])
        return output / "index.html"

    monkeypatch.setattr("lineament_lab.reproduce.report.reproduce", report)
    monkeypatch.setenv("LINEAMENT_DATA", str(tmp_path))
    given = ["reproduce", "-o", str(tmp_path), "--only", "fig5", "--frames", "1", "--seed", "2"]
    assert run(given) == 0
    assert capsys.readouterr().out == f"{tmp_path}/index.html\n"
    monkeypatch.setenv("LINEAMENT_DATA", str(tmp_path / "nowhere"))
    assert "nowhere" in refused(given, 2)
    monkeypatch.delenv("LINEAMENT_DATA")
    assert run(["reproduce", "-o", str(tmp_path), "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    names = list(EXPERIMENTS)
    assert calls == [(["layers"], Setting(1, 2, tmp_path)), (names, Setting(10, 0, None))]


def test_bench_ple_prints_means_beside_the_authors(benchmark, tmp_path, capsys):
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


@pytest.mark.parametrize(
    ("name", "options", "count"), [("a.npz", [], 45), ("a.log.gz", ["--scans", "4"], 4)]
)
def test_simulate_records_a_drive(name, options, count, tmp_path):
    out = tmp_path / name
    given = ["simulate", "building", "--sensor", "lms181", "--rate", "0.5", "--moving", "-q"]
    assert run([*given, "-o", str(out), *options]) == 0
    scans = list(ln.open_log(out))
    assert len(scans) == count
    assert len(scans[0]) == 181
    assert len({scan.pose for scan in scans}) == count


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
