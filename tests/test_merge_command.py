"""`lineament merge`: the scans of two topics of a log become one set of features."""

import itertools
import math

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
import ros_bags

from lineament import Extractor
from lineament.cli import run
from lineament.logs import open_log
from lineament.motion.rig import Rig
from lineament.output import ENDINGS
from lineament.scan.poses import compose
from lineament.simulation import SENSORS, drive_poses, room
from lineament.tasks.merging import merge_log

#: Where the scanners of the log are on the robot.
MOUNTINGS = {"/front": (0.3, 0.25, math.pi / 4), "/rear": (-0.3, -0.25, -3 * math.pi / 4)}
GIVEN = ["--topic", "/front", "--topic", "/rear"]
RIG = Rig(tuple(MOUNTINGS), unsure=(0.0, 0.0))
WAY, SPEED, RATE = [(-2, -1), (0.5, -1), (0.5, 0.5)], 0.8, 20.0


def made(
    folder, *, mountings=MOUNTINGS, late=0.0, missing=(), frames=True, odometry=True, kind="mcap"
):
    """Write a drive through a room, on which the two scanners take turns, each at 10 Hz."""
    messages, sensor, items = ros_bags.Messages(ros_bags.ros_of(kind)), SENSORS["utm30lx"], []
    if frames:
        items.append(("/tf_static", 0, messages.mountings(mountings)))
    stamps, poses = drive_poses(WAY, SPEED, 1.0, RATE)
    turns = itertools.cycle(mountings)
    for i, (stamp, pose) in enumerate(zip(stamps.tolist(), poses.tolist(), strict=True)):
        topic = next(turns)
        if odometry:
            items.append(("/odom", int(stamp * 1e9), messages.odometry(stamp, *pose)))
        if i in missing:
            continue
        at = compose(tuple(pose), mountings[topic])
        ranges = sensor.scan(room(), at, np.random.default_rng(i)).ranges
        stamp += late * (topic != "/front")
        fields = {"angle_min": sensor.angle_min, "angle_increment": sensor.angle_increment}
        scan = messages.scan(stamp, ranges, frame=topic[1:], **fields)
        items.append((topic, int(stamp * 1e9), scan))
    return ros_bags.write(folder, kind, items)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return made(tmp_path_factory.mktemp("log"))


def corners_off(path, world):
    """Return how far each corner in a table is from the nearest of the room."""
    table = pyarrow.parquet.read_table(path).to_pandas().query("kind == 'corner'")
    away = table[["x", "y"]].to_numpy()[:, None] - world.segments[:, :2]
    return np.linalg.norm(away, axis=2).min(axis=1)


def test_a_log_becomes_a_table_in_the_frame_of_the_robot(log, tmp_path, capsys):
    out = tmp_path / "f.parquet"
    assert run(["merge", str(log), *GIVEN, "-o", str(out)]) == 0
    said = capsys.readouterr().out
    scans = len(open_log(log, "/front"))
    assert f"  {scans} scans of /front: 0 without /rear within 0.055 s\n" in said
    table = pyarrow.parquet.read_table(out)
    metadata = pyarrow.parquet.read_metadata(out).metadata
    assert metadata[b"lineament.frame_ids"] == b'["base_link"]'
    assert set(table["scan"].to_pylist()) == set(range(scans))
    alone = [len(Extractor()(scan).segments) for scan in open_log(log)]
    segments = table["kind"].to_pylist().count("segment")
    assert max(alone) * scans / 2 < segments < sum(alone)


def test_poses_place_it_and_undo_the_motion_in_between(log, tmp_path):
    out, extractor = tmp_path / "f.parquet", Extractor(noise=0.01)
    still = merge_log(log, out, RIG, extractor).features
    done = merge_log(log, out, RIG, extractor, world=True, pose_topic="/odom")
    assert done.unplaced == 0
    assert done.features["segments"] < 0.8 * still["segments"]
    off = corners_off(out, room())
    assert np.median(off) < 0.02
    assert (off < 0.1).mean() > 0.95


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_format_holds_it(log, tmp_path, ending):
    out = tmp_path / f"f{ending}"
    assert run(["merge", str(log), *GIVEN, "--poses", "/odom", "-q", "-o", str(out)]) == 0
    assert out.stat().st_size > 100
    if ending == ".csv":
        assert pyarrow.csv.read_csv(out).num_rows > 100


def test_a_mounting_that_is_given_goes_before_that_of_the_log(log, tmp_path, capsys):
    counts = []
    for where in (None, "-0.3,-0.25,-135", "2,0,-135"):
        given = [*GIVEN, "--poses", "/odom", "-o", str(tmp_path / "f.csv")]
        given += [] if where is None else ["--mounting", f"/rear={where}"]
        assert run(["merge", str(log), *given]) == 0
        counts.append(capsys.readouterr().out.splitlines()[2])
    assert counts[0] == counts[1] != counts[2]


def test_scans_without_a_partner_are_counted_and_stay(tmp_path, capsys):
    log = made(tmp_path, missing=(5, 7, 9), kind="rosbag1")
    out = tmp_path / "f.jsonl"
    assert run(["merge", str(log), *GIVEN, "-o", str(out)]) == 0
    assert ": 2 without /rear within 0.055 s" in capsys.readouterr().out
    assert len(out.read_text().splitlines()) == len(open_log(log, "/front"))
    # The second of two topics is merged into the first one's scans.
    assert run(["merge", str(log), *GIVEN[2:], *GIVEN[:2], "-o", str(out)]) == 0
    assert ": 0 without /front" in capsys.readouterr().out
    given = [*GIVEN, "--tolerance", "0.2"]
    assert run(["merge", str(log), *given, "-o", str(out)]) == 0
    assert ": 0 without /rear within 0.2 s" in capsys.readouterr().out


def test_a_scanner_that_hangs_upside_down(tmp_path):
    log = made(tmp_path, odometry=False)
    turned = tmp_path / "turned"
    turned.mkdir()
    messages, items = ros_bags.Messages(2), []
    fixed, half = messages.mountings(MOUNTINGS), MOUNTINGS["/rear"][2] / 2
    rotation = fixed.transforms[1].transform.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = math.cos(half), math.sin(half), 0.0, 0.0
    items.append(("/tf_static", 0, fixed))
    for topic, scan in open_log(log).items():
        seen = scan.turned_over() if topic == "/rear" else scan
        items.append((topic, int(scan.stamp * 1e9), messages.of(seen)))
    other = ros_bags.write(turned, "mcap", items)
    found = [
        merge_log(path, tmp_path / "f.csv", RIG, Extractor(noise=0.01)).features
        for path in (log, other)
    ]
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("given", "status", "error"),
    [
        ([], 2, "expected the topics of two scanners or more\n"),
        (GIVEN[:2], 2, "expected the topics of two scanners or more: /front alone\n"),
        (GIVEN[:2] * 2, 2, "topics are /front, /front, expected each of them once\n"),
        ([*GIVEN[:2], "--topic", "/side"], 1, "/side"),
        ([*GIVEN, "--mounting", "/side=0,0,0"], 2, "of /side, expected one of /front, /rear\n"),
        ([*GIVEN, "--mounting", "/rear=0,0"], 2, "expected /rear=X,Y,DEGREES\n"),
        ([*GIVEN, "--mounting", "/rear=0,0,west"], 2, "expected /rear=X,Y,DEGREES\n"),
        ([*GIVEN, "--mounting", "/rear=0,nan,0"], 2, "expected three finite numbers\n"),
        ([*GIVEN, "--mounting", "/rear"], 2, "expected NAME=VALUE\n"),
        ([*GIVEN, "--tolerance", "nan"], 2, "'--tolerance': nan is not a number\n"),
        ([*GIVEN, "--unsure", "nan", "0"], 2, "'--unsure': nan is not a number\n"),
        ([*GIVEN, "--base-frame", "body"], 1, "--mounting /front=X,Y,DEGREES\n"),
        ([*GIVEN, "--laser-pose", "0", "0", "0"], 2, "expected --mounting TOPIC=X,Y,DEGREES"),
        ([*GIVEN, "--world"], 1, "no scan has a pose"),
    ],
)
def test_wrong_usage_is_one_line(log, tmp_path, refused, given, status, error):
    line = refused(["merge", str(log), *given, "-q", "-o", str(tmp_path / "f.csv")], status)
    assert error in f"{line}\n"
    assert not any(tmp_path.iterdir())


def test_an_output_that_cannot_be_written(log, tmp_path, refused):
    for given in (["-o", "f.xls"], ["-o", "f.svg", "--world"]):
        assert refused(["merge", str(log), *GIVEN, *given], 2)
    assert refused(["merge", str(log), *GIVEN, "-o", str(tmp_path / "no" / "f.csv")])


def test_a_log_that_does_not_say_where_the_scanners_are(tmp_path, refused):
    log = made(tmp_path, frames=False)
    given = ["merge", str(log), *GIVEN, "-q", "-o", str(tmp_path / "f.csv")]
    line = refused(given)
    assert "no transforms lead from base_link to front" in line
    assert line.endswith("expected /tf_static, or --mounting /front=X,Y,DEGREES")
    given += ["--mounting", "/front=0.3,0.25,45", "--mounting", "/rear=-0.3,-0.25,-135"]
    assert run(given) == 0


def test_two_clocks_are_an_error(tmp_path, refused):
    log, out = made(tmp_path, late=1000.0), tmp_path / "f.csv"
    line = refused(["merge", str(log), *GIVEN, "-q", "-o", str(out)])
    assert "no scan of /rear is within 0.055 s of one of /front" in line
    assert not out.exists()


def test_stamps_that_stand_still_need_a_tolerance(tmp_path, refused):
    line = f"LASER 9{9 * ' 2'} 0 0 0 0 0 0 5 robot 5\n"
    (tmp_path / "two.log").write_text("".join(f"{kind}{line}" for kind in "FRFR"))
    given = ["merge", str(tmp_path / "two.log"), "--topic", "FLASER", "--topic", "RLASER"]
    given += ["--mounting", "FLASER=.2,0,0", "--mounting", "RLASER=-.2,0,180", "-q"]
    given += ["-o", str(tmp_path / "f.csv")]
    assert "has no time from scan to scan, expected a tolerance" in refused(given)
    assert run([*given, "--tolerance", "0"]) == 0
