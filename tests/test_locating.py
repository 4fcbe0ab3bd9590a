"""A log on a plan: followed, lost where it is carried away, found again; the command and live."""

import json
import math
import re
import struct

import numpy as np
import pyarrow.parquet as pq
import pytest
from in_memory import Taken
from lineament_lab.evaluation.arena import archived_scans
from test_view import read

import lineament as ln
from lineament.cli import run
from lineament.errors import LineamentError
from lineament.live import LiveConfig
from lineament.live.counters import Counts, Report
from lineament.live.pipeline import Pipeline
from lineament.live.sinks import FoxgloveSink, RosSink
from lineament.logs import save_npz
from lineament.mapping import LineMap
from lineament.mapping.evidence import Evidence
from lineament.mapping.following import Follower, Whereabouts, follow
from lineament.mapping.refine import combined
from lineament.output.foxglove import FoxgloveMessages
from lineament.output.ros_messages import RosMessages
from lineament.simulation import SENSORS, World, room
from lineament.simulation import drive as drive_scans
from lineament.simulation.buildings import office
from lineament.simulation.wheels import Wheels
from lineament.tasks import locate as locate_task
from lineament.tasks.mapping import map_log
from lineament.view.api import answer

SEED, SIZE, RATE = 1, (40.0, 24.0), 4.0


@pytest.fixture(scope="module")
def storey():
    return office(SEED, SIZE)


@pytest.fixture(scope="module")
def drive(storey):
    """Scans with odometry, and where they were taken."""
    scans, truth = storey.drive(
        SENSORS["utm30lx"], seed=SEED, speed=1.0, rate=RATE, people=6, wheels=Wheels()
    )
    return [scan for scan, _ in zip(scans, range(200), strict=False)], truth[:200]


def plan_of(world: World) -> LineMap:
    return LineMap.from_lines(world.segments)


def bare(scan, stamp):
    """The same scan at another time, without odometry."""
    return scan.with_pose(None).stamped("first", round(1e9 * stamp))


def followed(scans, plan, odometry=True):
    follower, extract = Follower(plan), ln.Extractor()
    return [follower(extract(scan), scan.pose if odometry else None) for scan in scans]


def errors(found, truth):
    """Errors of the poses that are located: place, turn, NEES."""
    rows = []
    for where, true in zip(found, truth, strict=True):
        off = np.subtract(where.pose, true)
        off[2] = math.remainder(off[2], 2 * math.pi)
        if where:
            nees = off @ np.linalg.solve(where.covariance, off) / 3
            rows.append((math.hypot(off[0], off[1]), abs(off[2]), nees))
    return np.array(rows).reshape(-1, 3).T


@pytest.mark.slow
@pytest.mark.parametrize("odometry", [True, False])
def test_followed_from_the_first_metres_on(storey, drive, odometry):
    scans, truth = drive
    found = followed(scans[:80], plan_of(storey.plan), odometry)
    place, turn, nees = errors(found, truth[:80])
    assert len(place) > 0.9 * len(found)
    assert place.max() < 0.1
    assert turn.max() < math.radians(1)
    assert np.median(place) < 0.005
    assert nees.mean() < 1.2
    looks = [where for where in found if where.location is not None]
    assert len(looks) < 0.8 * len(found)


@pytest.mark.slow
def test_a_map_of_a_drive_is_a_plan_whose_doors_are_open(tmp_path):
    """`lineament map`, then `locate` with the same furniture: nothing passes through walls."""
    place = office(4, (30, 20))
    scans, _ = place.drive(SENSORS["utm30lx"], seed=1, rate=4, people=3)
    scans = [bare(scan, scan.stamp) for scan, _ in zip(scans, range(120), strict=False)]
    save_npz(tmp_path / "log.npz", scans)
    map_log(tmp_path / "log.npz", tmp_path / "plan.dxf")
    found = followed(scans[::2], LineMap.read(tmp_path / "plan.dxf", sigma=0.01))
    assert sum(map(bool, found)) > 0.95 * len(found)
    assert np.mean([where.evidence.contradicted for where in found]) < 0.01


@pytest.mark.slow
def test_scans_that_say_how_long_they_sweep_are_deskewed(storey):
    """At 1 m/s, sweeps of 25 ms: what is seen moves by 25 mm."""
    scans = list(drive_scans(storey.world, storey.waypoints[:3], SENSORS["utm30lx"],
                             speed=1.0, rate=5, seed=3, moving=True))  # fmt: skip
    plan = plan_of(storey.plan)
    found = [where for _, where in follow(scans, plan, ln.Extractor())]
    place, _, nees = errors(found, [scan.pose for scan in scans])
    skewed, _, _ = errors(followed(scans, plan), [scan.pose for scan in scans])
    assert len(place) == len(scans)
    assert np.median(place) < 0.002
    assert nees.mean() < 1.1
    assert np.median(skewed) > 0.004
    # Without odometry what was seen last says how it moves, and a turn begins at once.
    found = [where for _, where in follow(scans, plan, ln.Extractor(), odometry=False)]
    _, _, nees = errors(found, [scan.pose for scan in scans])
    assert nees.mean() < 0.45  # 0.52 where the change is in no covariance


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["mirrored", "another"])
def test_never_located_on_a_plan_of_another_building(storey, drive, kind):
    other = storey.mirrored() if kind == "mirrored" else office(SEED + 50, SIZE).plan
    found = followed(drive[0][:80], plan_of(other))
    assert not any(found)
    assert {where.verdict for where in found} <= {"not on this map", "ambiguous"}


def test_carried_away_lost_at_once_and_found_again(storey, drive):
    """Stamps go on, wheels are not asked: only the walls say that it is elsewhere."""
    scans, truth = drive
    kept = [*range(60), *range(130, 200)]
    joined = [bare(scans[k], i / RATE) for i, k in enumerate(kept)]
    found = followed(joined, plan_of(storey.plan))
    place, _, _ = errors(found, [truth[k] for k in kept])
    assert place.max() < 0.2  # wherever it is located, there is no old pose
    lost = [not where for where in found]
    assert not any(lost[20:60])
    assert lost[60] or found[60].location is not None
    assert not any(lost[-10:])


def test_a_gap_is_lost_time(storey, drive):
    scans, truth = drive
    kept = [*range(20), *range(100, 140)]
    joined = [bare(scans[k], scans[k].stamp + 60 * (k > 20)) for k in kept]
    found = followed(joined, plan_of(storey.plan))
    place, _, _ = errors(found, [truth[k] for k in kept])
    assert place.max() < 0.2
    assert found[20].location is not None
    assert any(found[-10:])


def test_combined_poses_claim_no_more_than_the_better_of_the_two():
    narrow, wide = np.diag((1e-4, 1.0, 1e-4)), np.diag((4e-4, 1e-4, 4e-4))
    pose, covariance = combined(((0, 0, math.pi - 0.01), narrow), ((0.01, 0.5, -math.pi), wide))
    assert 0 <= pose[0] <= 0.01
    assert pose[1] == pytest.approx(0.5, abs=0.01)
    assert abs(math.remainder(pose[2] - math.pi, 2 * math.pi)) <= 0.01
    diagonal = np.diag(covariance)
    assert (diagonal >= np.minimum(np.diag(narrow), np.diag(wide)) - 1e-12).all()
    same, spread = combined(((1.0, 2.0, 3.0), narrow), ((1.0, 2.0, 3.0), narrow))
    assert same == pytest.approx((1.0, 2.0, 3.0))
    np.testing.assert_allclose(spread, narrow)


@pytest.fixture
def files(tmp_path):
    """Scans of a room, and its plan as DXF."""
    place, sensor, rng = room(), SENSORS["utm30lx"], np.random.default_rng(0)
    scans = [sensor.scan(place, (-2 + 0.1 * k, 0.2, 0.3), rng) for k in range(12)]
    scans = [bare(scan, k / 10) for k, scan in enumerate(scans)]
    save_npz(tmp_path / "log.npz", scans)
    save_npz(tmp_path / "one.npz", scans[:1])
    plan_of(place).write(tmp_path / "plan.dxf")
    return tmp_path


@pytest.mark.parametrize("log", ["log", "one"])
@pytest.mark.parametrize("ending", ["tum", "csv", "parquet"])
def test_the_command(files, capsys, log, ending):
    out = files / f"poses.{ending}"
    status = run(["locate", f"{files / log}.npz", "--map", str(files / "plan.dxf"), "-o", str(out)])
    said = capsys.readouterr()
    scans = 12 if log == "log" else 1
    assert status == 0
    assert all(line.endswith(" left") for line in said.err.splitlines())  # The progress alone.
    assert f" {scans} scan{'s' if scans > 1 else ''}: 100.0 % located" in said.out
    assert "located first in scan 0, after 0.0 s, lost 0 times since" in said.out
    if ending == "parquet":
        table = pq.read_table(out)
        assert table["verdict"].to_pylist() == ["located"] * scans
        x = table["x"].to_numpy()
        assert (table["cov_xx"].to_numpy() > 0).all()
    elif ending == "csv":
        x = np.genfromtxt(out, delimiter=",", names=True, encoding="utf-8")["x"].reshape(-1)
    else:
        rows = np.loadtxt(out, ndmin=2)
        x = rows[:, 1]
        assert rows.shape == (scans, 8)
        np.testing.assert_allclose(2 * np.arctan2(rows[:, 6], rows[:, 7]), 0.3, atol=0.01)
    np.testing.assert_allclose(x, -2 + 0.1 * np.arange(scans), atol=0.02)


@pytest.mark.parametrize(("poses", "ending"), [("tum", "png"), ("csv", "svg"), ("parquet", "pdf")])
def test_the_command_draws_the_way(files, poses, ending, monkeypatch):
    given = ["locate", str(files / "log.npz"), "--map", str(files / "plan.dxf"), "-q"]
    out, picture = files / f"poses.{poses}", files / f"where.{ending}"
    given += ["-o", str(out), "--picture", str(picture)]
    assert run(given) == 0
    assert picture.read_bytes()[:5] in (b"\x89PNG\r", b"<?xml", b"%PDF-")
    assert out.stat().st_size > 0
    for path in (out, picture):
        path.unlink()
    monkeypatch.setattr("lineament.output.canvas.save", fail)
    assert run(given) == 1
    assert not {out, picture} & set(files.iterdir())  # both files, or none


def fail(*_given):
    raise LineamentError("the disk is full")


def test_the_picture_shows_where_the_way_is_not_known(monkeypatch):
    """A step has the lesser verdict of its ends; nothing is drawn where no pose is known."""
    verdicts = {
        0: "ambiguous", 1: "located", 2: "located", 3: "not on this map", 4: "ambiguous",
        5: "located", 6: "direction unobserved", 7: "located", 8: "not on this map",
    }  # fmt: skip
    evidence = Evidence(0.0, 1.0, 0.0, 0.0, 100)
    places = [
        Whereabouts(verdict, (float(k), 0.0, 0.0), 1e-4 * np.eye(3), evidence)
        for k, verdict in verdicts.items()
    ]
    saved = []
    monkeypatch.setattr("lineament.output.canvas.save", lambda figure, _: saved.append(figure))
    locate_task.draw(places, plan_of(room()), "a.png", "title", "about")
    (axes,) = saved[0].axes
    drawn = {
        of.get_label(): [tuple(path.vertices[:, 0].tolist()) for path in of.get_paths()]
        for of in axes.collections
    }
    assert {name: drawn[name] for name in drawn if not name.startswith("_")} == {
        "located": [(1.0, 2.0)],
        "not located": [(2.0, 5.0)],
        "direction unobserved": [(5.0, 6.0), (6.0, 7.0)],
    }
    spots = {line.get_label(): line.get_xdata() for line in axes.lines}
    assert spots == {"located first": [1.0], "located last": [7.0]}
    locate_task.draw(places[:1], plan_of(room()), "a.png", "title", "about")
    (axes,) = saved[1].axes
    assert not axes.lines  # Never located: the plan alone.


def test_a_clock_that_is_set_back_takes_no_time(files, capsys):
    scans = list(ln.open_log(files / "log.npz"))
    blind = ln.LaserScan(
        np.full(len(scans[0]), np.inf), scans[0].angle_min, scans[0].angle_increment
    )
    seen = [blind, blind, *scans[:3], *[blind] * 40]
    stamps = [20.0, 14.0, 14.5, 3.0, *np.arange(3.1, 90.0, 0.1)]
    save_npz(files / "log.npz", [bare(scan, at) for scan, at in zip(seen, stamps, strict=False)])
    options = ["--map", str(files / "plan.dxf"), "-o", str(files / "poses.csv")]
    assert run(["locate", f"{files}/log.npz", *options]) == 0
    assert "located first in scan 3, after 0.5 s, lost once since" in capsys.readouterr().out


@pytest.mark.parametrize("odometry", [True, False])
def test_a_robot_is_followed_by_the_order_of_scans_whose_clock_goes_back(files, odometry):
    """As clocks of real logs do, by tenths of a second: each scan is located as before."""
    truth = [(-2 + 0.1 * k, 0.2, 0.3) for k in range(12)]
    late = [0.5 * k - 0.7 * (k % 3 == 2) for k in range(12)]
    rows = zip(ln.open_log(files / "log.npz"), late, truth, strict=True)
    scans = [bare(scan, at).with_pose(pose) for scan, at, pose in rows]
    found = followed(scans, plan_of(room()), odometry)
    assert [where.verdict for where in found] == ["located"] * 12
    assert found[2].location is None  # not looked for anew
    off = [math.dist(where.pose[:2], at[:2]) for where, at in zip(found, truth, strict=True)]
    assert max(off) < 0.02


def test_a_picture_does_not_replace_the_image_of_the_grid(files, refused):
    plan_of(room()).write(files / "map.yaml")
    about = (files / "map.yaml").read_text().replace("map.pgm", "map.png")
    (files / "map.yaml").write_text(about)
    (files / "map.pgm").rename(files / "map.png")
    before = (files / "map.png").read_bytes()
    given = ["locate", files / "log.npz", "--map", files / "map.yaml", "-o", files / "a.csv"]
    assert "map.png: would replace" in refused([*given, "--picture", files / "map.png"])
    assert (files / "map.png").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        ("view --layers doors", 1, "no layer is doors"),
        ("locate -o a.tum --layers doors", 1, "no layer is doors"),
        ("locate -o a.tum --map none.dxf", 1, "none.dxf: No such file"),
        ("locate -o a.txt", 2, "expected an ending of .tum, .csv, .parquet"),
        ("locate -o a.tum --picture a.gif", 2, "a.gif: expected an ending of .png,"),
    ],
)
def test_one_line_for_what_cannot_be_done(files, refused, monkeypatch, arguments, status, words):
    monkeypatch.chdir(files)
    command, *rest = arguments.split()
    assert words in refused([command, "log.npz", "--map", "plan.dxf", *rest], status)
    assert not (files / "a.tum").exists()


@pytest.mark.parametrize("layers", ["", "walls,segments,*"])
def test_live_publishes_pose_and_verdict(files, layers):
    config = LiveConfig(map=str(files / "plan.dxf"), layers=layers)
    publisher, pipeline = Taken(), Pipeline(config)
    sink = RosSink(publisher, RosMessages("cdr"), config)
    assert publisher.kinds["/scan/pose"] == "geometry_msgs/msg/PoseWithCovarianceStamped"
    sink.diagnose(Report(1.0, Counts(), Counts(), (0, 0), 0, {}, 0), (1, 2))
    assert len(publisher.messages) == 1
    for scan in ln.open_log(files / "log.npz"):
        frame = pipeline("a", scan)
        sink.publish(frame)
    assert frame.where.verdict == "located"
    of_pose = publisher.data("/scan/pose")
    assert len(of_pose) == 12
    assert b"map\0" in of_pose[0]
    publisher.messages.clear()
    sink.diagnose(Report(1.0, Counts(scans=1), Counts(), (0, 0), 0, {}, 0), (1, 2))
    _, of_plan = publisher.messages
    assert b"lineament: /scan/pose\0" in of_plan.data
    assert b"located, without where the scanner is mounted\0" in of_plan.data
    sink.publish(pipeline("b", ln.LaserScan(np.full(9, np.inf), -1.0, 0.1, stamp=9.0)))
    assert not publisher.data("/scan/pose")


def test_foxglove_shows_the_pose_on_the_plan(files):
    config = LiveConfig(map=str(files / "plan.dxf"))
    publisher, pipeline = Taken(), Pipeline(config)
    sink = FoxgloveSink(publisher, FoxgloveMessages(), config)
    sink.publish(pipeline("a", next(iter(ln.open_log(files / "log.npz")))))
    (transform,) = publisher.data("/tf")
    x, y = struct.unpack("<dxd", re.search(rb"\x09(.{17})", transform, re.S)[1])
    assert (x, y) == pytest.approx((-2, 0.2), abs=0.02)
    sink.publish(pipeline("b", ln.LaserScan(np.full(9, np.inf), -1.0, 0.1, stamp=9.0)))
    assert len(publisher.data("/tf")) == 1
    publisher.messages.clear()
    sink.diagnose(Report(1.0, Counts(), Counts(), (0, 0), 0, {}, 0), (1, 2))
    assert [message.topic for message in publisher.messages] == ["/scan/plan"]


def test_the_viewer_locates_logs_on_a_plan(files):
    plan = LineMap.read(files / "plan.dxf")
    with read(files / "log.npz", {"optimal": ln.Extractor()}, plan) as session:
        walls = json.loads(answer(session, "/api/plan"))["walls"]
        np.testing.assert_allclose(walls, plan.ends.reshape(-1, 4), atol=1e-4)
        scan = json.loads(answer(session, "/api/scan?log=0&i=3&method=optimal"))
        assert scan["where"]["verdict"] == "located"
        assert scan["where"]["explained"] > 0.8
        assert np.shape(scan["where"]["covariance"]) == (3, 3)
        np.testing.assert_allclose(scan["pose"], (-1.7, 0.2, 0.3), atol=0.02)
        poses = json.loads(answer(session, "/api/poses?log=0&first=0&count=12"))["poses"]
        np.testing.assert_allclose(poses, [(-2 + 0.1 * k, 0.2, 0.3) for k in range(12)], atol=0.02)
    elsewhere = LineMap.from_lines([[0, 0, 9, 0], [9, 0, 9, 1], [9, 1, 0, 1], [0, 1, 0, 0]])
    with read(files / "one.npz", {"optimal": ln.Extractor()}, elsewhere) as session:
        scan = json.loads(answer(session, "/api/scan?log=0&i=0&method=optimal"))
        assert (scan["pose"], scan["where"]["covariance"]) == (None, None)
    with read(files / "one.npz", {"optimal": ln.Extractor()}) as session:
        assert json.loads(answer(session, "/api/plan")) == {"walls": []}
        assert json.loads(answer(session, "/api/scan?log=0&i=0&method=optimal"))["where"] is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "typical"), [("jackal_static_data", 0.01), ("jackal_mocap_02171554", 0.015)]
)
def test_the_arena(data_dir, name, typical, tmp_path):
    """Kidnapped to the first scan; the fitted walls are the plan."""
    path = data_dir / "truth" / f"{name}.npz"
    if not path.exists():
        pytest.skip(f"no {path}")
    scans = archived_scans(path)[::2]
    LineMap.from_lines(np.load(path)["gt_segments"]).write(tmp_path / "plan.dxf")
    plan = LineMap.read(tmp_path / "plan.dxf", sigma=0.005)
    place, _, _ = errors(followed(scans, plan, False), [scan.pose for scan in scans])
    assert len(place) > 0.9 * len(scans)
    assert np.median(place) < typical
    assert (place < 0.2).mean() > 0.99
