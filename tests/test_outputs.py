"""What commands write: nothing that they read, nothing late, nothing by halves, and status 3."""

import os
import sys

import click
import numpy as np
import pyarrow.parquet as pq
import pytest
from test_cli import save_benchmark
from test_output import files_up_to, resource

import lineament as ln
from lineament import LineamentError, LineamentWarning
from lineament.cli import cli, run
from lineament.cli.options import Place
from lineament.files import check_outputs, spare_inputs, written_beside
from lineament.logs import open_log, save_log
from lineament.mapping import LineMap
from lineament.simulation import SENSORS, drive, room, scene
from lineament.tasks.extract import extract_log
from lineament.tasks.mapping import tum_written


def names_of(folder):
    return sorted(path.name for path in folder.iterdir())


def complaints(err):
    """Lines on stderr but those of the progress and the compiler, which a slow machine has."""
    return [line for line in err.splitlines() if line.startswith("lineament: ")]


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A log of a room, its plan, one scan of a benchmark, and a link to each; all read below."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    at = [(-2 + 0.1 * k, 0.2, 0.3) for k in range(4)]
    scans = [SENSORS["utm30lx"].scan(room(), pose, rng, k / 10) for k, pose in enumerate(at)]
    save_log(tmp_path / "log.npz", scans)
    LineMap.from_lines(room().segments).write(tmp_path / "plan.dxf")
    save_benchmark(tmp_path / "bench.npz", {"ple": [0.1, 0.2]})
    return tmp_path


@pytest.fixture
def idle(files, monkeypatch):  # noqa: ARG001  (they are made first)
    """Whoever extracts, simulates or maps has begun to work."""

    def work(*given, **named):  # noqa: ARG001
        raise AssertionError("this is work")

    monkeypatch.setattr(ln.Extractor, "__call__", work)
    monkeypatch.setattr("lineament.simulation.sensor.Sensor.scan", work)
    monkeypatch.setattr("lineament_lab.reproduce.report.run_experiments", work)
    monkeypatch.setattr("lineament_lab.evaluation.ple.run_benchmark", work)


# Every command


#: What each command reads and writes, by the names of its parameters.
READ_AND_WRITTEN = {
    "bench ple": ("data", "output"),
    "calibrate": ("log", "output"),
    "compare": ("log", "output"),
    "demo": ("log", "output"),
    "extract": ("logs", "output"),
    "info": ("log", ""),
    "live": ("config map dock_shape log", "mapping"),
    "locate": ("log plan", "output picture"),
    "map": ("log onto", "output picture poses"),
    "merge": ("log", "output"),
    "plan": ("plan", "output"),
    "plot": ("log", "output"),
    "reproduce": ("data museum", "output"),
    "simulate": ("", "output"),
    "view": ("logs plan", ""),
}
#: Each of what is read with each of what is written; {} is another name of what is read.
SAME = {
    "bench ple data output": "bench ple --data bench.npz -m iepf --json {}.json",
    "calibrate log output": "calibrate log.npz -o {}.png",
    "compare log output": "compare log.npz -o {}.html",
    "demo log output": "demo log.npz -o out",
    "extract logs output": "extract log.npz -o {}.parquet",
    "live log mapping": "live --from log.npz --ros 0 --mapping {}.svg",
    # A configuration has another ending, and of two plans one is given; shapes are read first.
    "live config mapping": "",
    "live map mapping": "",
    "live dock_shape mapping": "",
    "locate log output": "locate log.npz --map plan.dxf -o {}.tum",
    "locate log picture": "locate log.npz --map plan.dxf -o a.csv --picture {}.png",
    "locate plan output": "locate log.npz --map plan.dxf -o {}.csv",
    "locate plan picture": "locate log.npz --map plan.dxf -o a.csv --picture {}.pdf",
    "map log output": "map log.npz -o {}.dxf",
    "map log picture": "map log.npz -o m.svg --picture {}.png",
    "map onto picture": "map log.npz --onto plan.dxf -o m.svg --picture {}.pdf",
    "map log poses": "map log.npz -o m.svg --poses {}.tum",
    "map onto output": "map log.npz --onto plan.dxf -o {}.dxf",
    "map onto poses": "map log.npz --onto plan.dxf -o m.svg --poses {}.tum",
    "merge log output": "merge log.npz --topic /front --topic /rear -o {}.csv",
    "plan plan output": "plan plan.dxf -o {}.dxf",
    "plot log output": "plot log.npz -o {}.png",
    # It reads recordings by their names in that folder, and writes none of them.
    "reproduce data output": "",
    "reproduce museum output": "reproduce --museum log.npz -o out",
}


def commands(group, before=()):
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        if isinstance(command, click.Group):
            yield from commands(command, (*before, name))
        else:
            yield " ".join((*before, name)), command


def test_no_command_is_forgotten():
    found = {
        name: {option.name for option in command.params if isinstance(option.type, Place)}
        for name, command in commands(cli)
    }
    known = {name: set(" ".join(both).split()) for name, both in READ_AND_WRITTEN.items()}
    assert {name: places for name, places in found.items() if places} == known
    assert set(SAME) == {
        f"{name} {source} {target}"
        for name, (read, written) in READ_AND_WRITTEN.items()
        for source in read.split()
        for target in written.split()
    }


@pytest.mark.parametrize("link", [os.symlink, os.link])
@pytest.mark.parametrize("case", [case for case, command in SAME.items() if command])
@pytest.mark.usefixtures("idle")
def test_an_output_that_is_an_input_is_refused(files, refused, case, link):
    command = SAME[case].format("link")
    *_, source, _ = case.split()
    read = {"data": "bench.npz", "onto": "plan.dxf", "plan": "plan.dxf"}.get(source, "log.npz")
    target = command.split()[-1]
    if target == "out":
        target = "out/index.html"
        (files / "out").mkdir()
    link(files / read, files / target)
    before = (files / read).read_bytes()
    assert refused(command) == f"lineament: {target}: would replace {read}, which is read"
    assert (files / read).read_bytes() == (files / target).read_bytes() == before
    assert not (files / "m.svg").exists()


@pytest.mark.parametrize(
    ("command", "target"),
    [
        ("bench ple --data bench.npz -m iepf --json {}", "a.json"),
        ("compare log.npz -o {}", "a.html"),
        ("demo log.npz -o {}", "out"),
        ("demo log.npz -o {}", "out/scan.png"),
        ("extract log.npz -o {}", "a.parquet"),
        ("extract log.npz -o {}/", "out"),
        ("locate log.npz --map plan.dxf -o {}", "a.tum"),
        ("locate log.npz --map plan.dxf -o a.csv --picture {}", "a.svg"),
        ("map log.npz -o {}", "a.dxf"),
        ("map log.npz -o m.svg --poses {}", "a.tum"),
        ("map log.npz -o m.svg --picture {}", "a.png"),
        ("live --from log.npz --ros 0 --mapping {}", "a.svg"),
        ("plot log.npz -o {}", "a.png"),
        ("reproduce -o {}", "out"),
        ("reproduce -o {}", "out/figures.json"),
        ("simulate hall -o {}", "a.npz"),
        ("simulate hall -o {}", "a.log"),
    ],
)
@pytest.mark.usefixtures("idle")
def test_what_cannot_be_written_is_refused_before_any_work(files, refused, command, target):
    folder, _, name = target.rpartition("/")
    harms = []
    if target == "out":  # a folder: a file is in its place
        (files / "out").touch()
        harms.append((command.format("out"), "cannot make this folder"))
    elif not command.startswith("extract"):  # for which a folder is a data set
        (files / target).mkdir(parents=True)
        harms.append((command.format(folder or name), "is a folder"))
    if not folder and target != "out":  # in a folder that is missing, or a file
        harms.append((command.format(f"none/{target}"), "none does not exist"))
        harms.append((command.format(f"log.npz/{target}"), "log.npz does not exist"))
    before = sorted(files.rglob("*"))
    for line, problem in harms:
        assert problem in refused(line)
        assert sorted(files.rglob("*")) == before


@pytest.mark.parametrize(
    "command",
    [
        "demo none.log -o out",
        "extract none.log -o a.csv",
        "locate none.log --map plan.dxf -o a.csv",
        "map none.log -o a.svg",
        "plot none.log -o a.png",
        "compare none.log -o a.png",
    ],
)
@pytest.mark.usefixtures("idle")
def test_a_log_that_is_missing_is_named_before_kernels_are_compiled(files, refused, command):
    before = names_of(files)
    assert "none.log: there is no such file" in refused(command)
    assert names_of(files) == before


@pytest.mark.usefixtures("files", "idle")
def test_a_map_names_the_smallest_extra_before_the_drive(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    line = "map needs scipy, which is not installed: pip install 'lineament[mapping]'"
    assert line in refused("map log.npz -o a.svg")


@pytest.mark.usefixtures("idle")
def test_two_outputs_are_two_files(files, refused):
    (files / "b.tum").symlink_to("a.dxf")
    for poses in ("a.dxf", "./b.tum"):
        with pytest.raises(LineamentError, match=r"would replace a\.dxf, which is written too$"):
            check_outputs(["a.dxf", poses])
    line = refused("map log.npz -o a.dxf --poses b.tum")
    assert "b.tum: would replace a.dxf, which is written too" in line
    assert not (files / "a.dxf").exists()


# Names of one file


def test_a_file_is_known_by_all_its_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "day" / "bag").mkdir(parents=True)
    for name in ("a.log", "day/a.zip", "day/bag/metadata.yaml", "day/bag/bag_0.mcap"):
        (tmp_path / name).touch()
    (tmp_path / "other").symlink_to("day")
    (tmp_path / "dangling.log").symlink_to("gone.log")
    for output, source in (
        ("a.log", "./a.log"),
        (tmp_path / "a.log", "day/../a.log"),
        ("other/a.zip", "day/a.zip"),
        ("day/a.zip", "day/a.zip/inside/a.log"),
        ("day/bag/metadata.yaml", "day/bag"),
        ("day/bag/bag_0.mcap", "other/bag/"),
        ("day/bag/bag_0.mcap", "day/bag/bag_0.mcap"),
        ("gone.log", "dangling.log"),
        ("a.log", f"file://{tmp_path}/a.log"),
        ("day/a.zip", f"zip://b.log::file://{tmp_path}/day/a.zip"),
    ):
        with pytest.raises(LineamentError, match=r"would replace .*, which is read$") as caught:
            spare_inputs([output], ["b.log", source])
        assert str(caught.value) == f"{output}: would replace {source}, which is read"
    others = ["b.log", "day/b.zip", "day/bag/features.mcap", "day/bag/features.parquet"]
    spare_inputs(others, ["a.log", "day/a.zip/b.log", "day/bag", "s3://day/b.zip", 300 * "a"])


def test_a_data_set_does_not_replace_a_log(files, refused):
    part = files / "out" / "log=log.npz" / "part-0.parquet"
    part.parent.mkdir(parents=True)
    part.symlink_to(files / "log.npz")
    before = (files / "log.npz").read_bytes()
    line = f"{part}: would replace {files}/log.npz, which is read"
    assert line in refused("extract log.npz -o out/")
    assert (files / "log.npz").read_bytes() == before
    part.unlink()
    # Its parts, which may be logs themselves, are none of the next run.
    given = ["extract", ".", "-o", "out/", "--format", "ros2.mcap", "--threads", "1", "-q"]
    (files / "bench.npz").unlink()
    assert run(given) == 0
    parts = {path: path.read_bytes() for path in files.glob("out/*/part-0.ros2.mcap")}
    assert "part-0.ros2.mcap, which is read" in refused(given)
    assert {path: path.read_bytes() for path in parts} == parts


@pytest.mark.parametrize("ending", [".npz", ".log"])
def test_a_log_is_not_saved_over_itself_while_it_is_read(files, ending):
    path = files / f"a{ending}"
    save_log(path, open_log("log.npz"))
    before, again = path.read_bytes(), files / f"link{ending}"
    again.symlink_to(path)
    with pytest.raises(LineamentError, match=r"link.*would replace .*a\..*, which is read"):
        save_log(again, open_log(path))
    assert path.read_bytes() == before
    save_log(path, list(open_log(path))[:2])  # on purpose
    assert len(open_log(path)) == 2


def test_poses_without_times_are_warned_of(tmp_path):
    path, poses = tmp_path / "a.tum", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]
    said = pytest.warns(LineamentWarning, match="all rows have the stamp 0, as the scans")
    with said, tum_written(path, [0.0, 0.0], poses):
        pass
    with tum_written(path, [0.0, 1.0], poses):
        pass
    assert len(path.read_text().splitlines()) == 2


def test_a_file_that_is_read_only_stays(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    path.write_text("kept")
    monkeypatch.setattr(os, "access", lambda _, mode: mode != os.W_OK)  # root may write all
    with pytest.raises(LineamentError, match=r"a\.txt: is read-only"):
        check_outputs([path])
    with pytest.raises(LineamentError, match="is read-only"), written_beside(path):
        pass
    assert (path.read_text(), names_of(tmp_path)) == ("kept", ["a.txt"])


@pytest.mark.slow
@pytest.mark.skipif(resource is None, reason="no limits of files on this system")
def test_a_full_disk_leaves_map_and_poses_or_none(files, refused):
    assert run(["map", "log.npz", "-o", "b.svg", "--poses", "b.tum", "-q"]) == 0
    assert (files / "b.tum").stat().st_size < 1000 < (files / "b.svg").stat().st_size
    for size, name in ((100, "a.tum"), (1000, "a.svg")):
        with files_up_to(size):
            line = refused("map log.npz -o a.svg --poses a.tum -q")
        assert line.startswith(f"lineament: {name}: cannot be written: ")
    assert not set(names_of(files)) & {"a.tum", "a.svg"}


# Nothing found


def sparse(stamp):
    """A scan of three measurements far from each other: no feature."""
    ranges = np.full(90, np.inf)
    ranges[[10, 40, 80]] = 2.0, 5.0, 3.0
    return ln.LaserScan(ranges, 0.0, 0.02, range_max=30.0, stamp=stamp, pose=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("target", ["a.parquet", "out/"])
@pytest.mark.usefixtures("files")
def test_no_feature_is_status_3(capsys, target):
    save_log("bare.log", [sparse(k) for k in range(3)])
    given = ["-o", target, "-q", *(["--threads", "1"] if target == "out/" else [])]
    for log, status, said in (
        ("bare.log", 3, ["lineament: {}: no feature in 3 scans, expected some"]),
        ("log.npz", 0, []),
    ):
        assert run(["extract", log, *given]) == status
        name = log if target == "a.parquet" else target
        assert complaints(capsys.readouterr().err) == [line.format(name) for line in said]
    if target == "a.parquet":
        assert run(["extract", "bare.log", *given]) == 3
        assert pq.read_table(target)["kind"].to_pylist().count("segment") == 0  # It is written.
    else:
        assert run(["extract", "bare.log", "log.npz", *given, "--resume"]) == 0


def test_no_wall_is_status_3(files, refused):
    save_log("bare.log", [sparse(k) for k in range(3)])
    line = refused("map bare.log -o a.svg --poses a.tum -q", 3)
    assert line == "lineament: bare.log: no walls are seen in 3 key frames, expected some"
    assert not set(names_of(files)) & {"a.svg", "a.tum"}


#: Metres of the units that a plan may be drawn in.
UNITS = {"ft": 0.3048, "in": 0.0254, "cm": 0.01, "m": 1.0}
#: Units that a plan is drawn in, and those that are said: tried often, and seldom.
OFTEN, SELDOM = [("m", "mm")], [("ft", "m"), ("in", "m"), ("cm", "m"), ("m", "ft")]


@pytest.mark.parametrize(
    ("drawn", "given"), [*OFTEN, *(pytest.param(*two, marks=pytest.mark.slow) for two in SELDOM)]
)
def test_never_located_is_status_3_and_names_the_units_of_the_plan(files, capsys, drawn, given):
    LineMap.from_lines(room().segments / UNITS[drawn]).write(files / "drawn.dxf")
    command = f"locate log.npz --map drawn.dxf -o a.tum -q --units {given}".split()
    assert run(command) == 3
    *size, never = complaints(capsys.readouterr().err)
    shows = f"shows where the scans were if it is drawn in {drawn}: --units {drawn}"
    assert never == f"lineament: log.npz: never located: drawn.dxf: {shows}"
    # A room of 6 m, of 20 if feet are taken for metres, may be one; 600, 1.8 and 0.006 m are none.
    assert [said.endswith("drawn in other units? (units=, --units)") for said in size] == (
        [True] if (drawn, given) in (("cm", "m"), ("m", "ft"), ("m", "mm")) else []
    )
    assert (files / "a.tum").read_text() == ""
    assert run([*command[:-1], drawn]) == 0
    assert complaints(capsys.readouterr().err) == []
    assert len((files / "a.tum").read_text().splitlines()) == 4


@pytest.mark.parametrize("factor", [1, 1000])
def test_odometry_in_millimetres_is_a_line(files, capsys, factor):
    scans = []
    for k in range(4):
        scan = open_log(files / "log.npz").scan(0)
        scans.append(scan.with_pose((factor * 0.02 * k, 0.0, 0.0)).stamped(0, k * 100_000_000))
    save_log("mm.npz", scans)
    run(["locate", "mm.npz", "--map", "plan.dxf", "-o", "a.csv"])
    assert ("faster than 10 m/s: is it in millimetres?" in capsys.readouterr().err) == (factor > 1)
    run(["locate", "mm.npz", "--map", "plan.dxf", "--no-odometry", "-o", "a.csv"])
    assert "faster than" not in capsys.readouterr().err


@pytest.mark.parametrize(("way", "pose"), [(4, 0), (4, 1), (0, 0)])
def test_odometry_that_stands_while_the_scanner_moves_is_a_line(files, capsys, way, pose):
    plan = files / "plan.dxf"
    driven = list(drive(room(), [(-2, 0), (2, 0)], SENSORS["lms181"], speed=1, rate=2))
    seen = driven if way else driven[:1] * len(driven)
    save_log("still.npz", [s.with_pose((0.1 * pose * k, 0, 0)) for k, s in enumerate(seen)])
    for command in (f"locate still.npz --map {plan} -o a.csv", "map still.npz -o a.svg"):
        run(command.split())
        line = (
            "still.npz: its odometry stands still, and the scanner does not: --no-odometry leaves"
        )
        assert (line in capsys.readouterr().err) == (way > 0 and pose == 0)


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize("is_posed", [False, True])
@pytest.mark.parametrize("command", ["extract a.npz -o a.csv", "map a.npz -o a.svg"])
def test_a_laser_pose_that_moves_no_pose_is_a_line(capsys, command, is_posed):
    driven = list(drive(room(), [(-2, 0), (2, 0)], SENSORS["lms181"], speed=1, rate=2))
    save_log("a.npz", [scan if is_posed else scan.with_pose(None) for scan in driven])
    for given in ([], ["--laser-pose", "0.1", "0", "0"]):
        assert run([*command.split(), *given]) == 0
        said = "a.npz: no scan has a pose: laser_pose moves none" in capsys.readouterr().err
        assert said == (bool(given) and not is_posed)


@pytest.mark.parametrize(("headings", "said"), [((0, 91, 183, 274), 3), ((0, 2, 4, -1.5), 0)])
def test_headings_in_degrees_are_a_line(files, capsys, headings, said):
    scan = open_log(files / "log.npz").scan(0)
    save_log("turned.npz", [scan.with_pose((0.0, 0.0, float(turn))) for turn in headings])
    for command in ("locate turned.npz --map plan.dxf -o a.csv", "map turned.npz -o a.svg"):
        run(command.split())
        line = "lineament: turned.npz: headings of its odometry jump by more than a turn, 3 times: "
        assert capsys.readouterr().err.count(f"{line}are they in degrees?") == (said > 0)
        run([*command.split(), "--no-odometry"])
        assert "odometry" not in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes on Linux alone")
def test_names_that_are_no_text_are_written_and_drawn(files):
    odd = os.fsdecode(b"\xff")
    (files / "log.npz").rename(files / f"{odd}.npz")
    for command in (
        *(f"extract {odd}.npz -o {odd}{ending}" for ending in (".csv", ".parquet", ".svg")),
        f"locate {odd}.npz --map plan.dxf -o {odd}.csv --picture {odd}.png",
        f"plot {odd}.npz -o {odd}.pdf",
    ):
        assert run([*command.split(), "-q"]) == 0
    names = {f"{odd}{ending}" for ending in (".csv", ".parquet", ".svg", ".png", ".pdf")}
    assert names <= set(names_of(files))
    (files / odd).mkdir()
    with pytest.raises(LineamentError, match=r"written: its path is not text in UTF-8$"):
        extract_log(f"{odd}.npz", f"{odd}/a.csv", ln.Extractor())


@pytest.mark.parametrize("ending", [".dxf", ".parquet"])
def test_a_plan_of_another_building_says_the_usual_causes(files, capsys, ending):
    walls = [[0, 0, 30, 0], [30, 0, 30, 4], [30, 4, 12, 9], [12, 9, 0, 0]]
    LineMap.from_lines(walls).write(files / f"other{ending}")
    assert run(f"locate log.npz --map other{ending} -o a.csv".split()) == 3
    said = capsys.readouterr()
    assert said.out.count("never located") == 1
    (line,) = complaints(said.err)
    or_units = ", or in other units (--units)" if ending == ".dxf" else ""
    assert f"never located: other{ending}: is it another building{or_units}?" in line


@pytest.mark.slow
def test_hardly_located_in_the_wrong_units_is_a_warning(files, capsys):
    # Two places, the one that was seen for longer drawn in feet, the other in metres.
    other, at = scene("room", 3)
    away = other.segments + 60.0
    LineMap.from_lines([*room().segments / UNITS["ft"], *away]).write(files / "both.dxf")
    seen = SENSORS["utm30lx"].scan(other, at, np.random.default_rng(1), -100.0)
    save_log("both.npz", [scan.with_pose(None) for scan in (seen, *3 * [*open_log("log.npz")])])
    assert run(["locate", "both.npz", "--map", "both.dxf", "-o", "a.csv"]) == 0
    said = capsys.readouterr()
    assert "13 scans: 7.7 % located" in said.out
    line = "both.dxf: shows where the scans were if it is drawn in ft: --units ft"
    assert complaints(said.err) == [f"lineament: {line}"]


def test_a_plan_of_no_size_is_a_warning(files, capsys):
    drawn = [*room().segments, [600.0, 0.0, 600.0, 1.0]]
    LineMap.from_lines(drawn).write(files / "wide.dxf")
    assert run(["locate", "log.npz", "--map", "wide.dxf", "-o", "a.csv", "-q"]) == 0
    (said,) = complaints(capsys.readouterr().err)
    assert "wide.dxf: is 603 m x " in said
    assert said.endswith("is it drawn in other units? (units=, --units)")


def test_what_is_no_plan_says_how_to_make_one(files, refused):
    (files / "plan.ifc").touch()
    line = refused("locate log.npz --map plan.ifc -o a.tum")
    assert line.endswith("not .ifc: `lineament map LOG -o plan.dxf` makes one of a drive")
