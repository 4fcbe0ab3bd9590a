"""Features in the frame of the poses: covariances of poses, and `extract --world`."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
import ros_bags
from handmade import arc, corner, edge, features, segment

import lineament as ln
from lineament.cli import run
from lineament.logs import open_log, save_npz
from lineament.mapping import LineMap
from lineament.simulation import SENSORS, drive, room
from lineament.tasks.bulk import Manifest
from lineament.tasks.extract import extract_log, in_world

POSE, SPREAD = (3.0, -1.0, 2.5), np.array([[4, 1, 0.5], [1, 9, -0.6], [0.5, -0.6, 1.0]]) * 1e-4
FOUND = features(
    100,
    segments=[segment((1, -4), (2, 3), 0, 9), segment((3, 0), (-1, -5), 10, 30)],
    corners=[corner(2.0, 3.0, sigma=0.02), corner(-6.0, 0.1)],
    edges=[edge(2.0, 3.0, sigma=0.03)],
    arcs=[arc(1.0, 4.0, 0.3, 40, 50)],
)


@pytest.mark.slow
def test_covariances_with_that_of_the_pose_hold_by_monte_carlo():
    """Of 20 000 draws a variance is known to 1 %: white, what was drawn has unit covariance."""
    known, rng, n = FOUND.transform(*POSE, SPREAD), np.random.default_rng(1), 20_000
    still = FOUND.transform(*POSE)
    errors: dict[str, list] = {"segments": [], "corners": [], "edges": [], "arcs": []}
    for pose in rng.multivariate_normal(POSE, SPREAD, n):
        moved = FOUND.transform(*pose)
        for name in ("corners", "edges"):
            errors[name].append(moved[name]["position"] - still[name]["position"])
        center = moved.arcs["center"] - still.arcs["center"]
        errors["arcs"].append(np.column_stack((center, np.zeros(len(center)))))
        # Of a segment: how far its line is off at the old centroid, and its turn.
        angle = moved.segments["angle"]
        normals = np.column_stack((-np.sin(angle), np.cos(angle)))
        off = moved.segments["centroid"] - still.segments["centroid"]
        turn = np.angle(np.exp(1j * (angle - still.segments["angle"])))
        errors["segments"].append(np.column_stack(((normals * off).sum(axis=1), turn)))
    for name, drawn in errors.items():
        for k, expected in enumerate(getattr(known, name)["covariance"]):
            own = getattr(still, name)["covariance"][k]
            white = np.linalg.inv(np.linalg.cholesky(expected))
            found = own + np.cov(np.transpose([one[k] for one in drawn]))
            np.testing.assert_allclose(white @ found @ white.T, np.eye(len(own)), atol=0.05)


def test_a_pose_that_is_known_exactly_adds_nothing():
    for name in ("segments", "corners", "edges", "arcs"):
        exact = getattr(FOUND.transform(*POSE, np.zeros((3, 3))), name)
        np.testing.assert_array_equal(exact, getattr(FOUND.transform(*POSE), name))


@pytest.mark.parametrize(
    "wrong", [np.eye(2), np.diag([1, 1, -1e-3]), np.eye(3) * math.nan, np.arange(9).reshape(3, 3)]
)
def test_what_is_no_covariance_of_a_pose_is_refused(wrong):
    scan = ln.LaserScan([2.0] * 5, -0.02, 0.01)
    for call in (lambda: FOUND.transform(*POSE, wrong), lambda: scan.with_pose(POSE, wrong)):
        with pytest.raises(ValueError, match=r"covariance of the pose is .*, expected"):
            call()


@pytest.fixture
def log(tmp_path):
    scans = list(drive(room(), [(-2, 0), (2, 0)], SENSORS["lms181"], speed=1.0, rate=4))
    scans[3] = scans[3].with_pose(None)
    save_npz(tmp_path / "drive.npz", scans)
    return tmp_path / "drive.npz"


@pytest.mark.parametrize("ending", ["parquet", "csv", "jsonl"])
def test_a_log_in_the_world(tmp_path, log, ending, capsys):
    path = tmp_path / f"world.{ending}"
    assert run(["extract", str(log), "-o", str(path), "--world"]) == 0
    assert "  1 scans without a pose left out\n" in capsys.readouterr().out
    scans, extract = list(open_log(log)), ln.Extractor()
    expected = [in_world(extract(scan), scan) for scan in scans]
    corners = np.concatenate([one.corners["position"] for one in expected])
    # The walls of the room stand still, wherever the scanner is: at ±3 m and ±2 m.
    assert len(corners) > 20
    if ending == "jsonl":
        lines = [json.loads(line) for line in path.read_text().splitlines()]
        assert [line["frame_id"] for line in lines] == ["map"] * len(scans)
        assert lines[3]["segments"] == lines[3]["corners"] == []
        assert "pose" not in lines[3]
        found = [corner["position"] for line in lines for corner in line["corners"]]
    else:
        read = pq.read_table if ending == "parquet" else pyarrow.csv.read_csv
        rows = [row for row in read(path).to_pylist() if row["kind"] == "corner"]
        assert 3 not in {row["scan"] for row in rows}
        assert {row["scan"]: row["pose_x"] for row in rows}[7] == scans[7].pose[0]
        found = [(row["x"], row["y"]) for row in rows]
        if ending == "parquet":
            metadata = pq.read_metadata(path).metadata
            assert json.loads(metadata[b"lineament.frame_ids"]) == ["map"]
            assert metadata[b"lineament.scans"] == b"%d" % len(scans)
    np.testing.assert_array_equal(found, corners)


def test_many_logs_in_the_world(tmp_path, log):
    out = tmp_path / "out"
    command = ["extract", str(log), "-o", f"{out}/", "--threads", "1", "-q"]
    assert run(command) == 0
    before = pq.read_table(out)
    assert run([*command, "--world", "--resume"]) == 0  # it is another table: not kept
    after = pq.read_table(out)
    assert before.schema.equals(after.schema)
    assert after.num_rows < before.num_rows
    assert 3 not in set(after["scan"].to_pylist())
    (row,) = Manifest(out).rows.values()
    assert row.unplaced == sum(scan.pose is None for scan in open_log(log)) > 0


def test_the_world_needs_poses_and_a_table(tmp_path, log, refused):
    save_npz(tmp_path / "bare.npz", [scan.with_pose(None) for scan in open_log(log)])
    target = tmp_path / "a.parquet"
    said = refused(["extract", tmp_path / "bare.npz", "-o", target, "--world"])
    assert "bare.npz: no scan has a pose, expected poses" in said
    assert not target.exists()
    for output in (tmp_path / "a.svg", f"{tmp_path}/out/"):
        options = ["--format", "ros2.mcap"] if str(output).endswith("/") else []
        said = refused(["extract", log, "-o", output, "--world", *options], 2)
        assert "--world: expected a table, .parquet, .csv, .jsonl, not" in said
    with pytest.raises(ValueError, match="world is for tables"):
        extract_log(log, tmp_path / "a.svg", ln.Extractor(), world=True)


SIX = np.diag([4.0, 9.0, 7.0, 7.0, 7.0, 1.0]) * 1e-4
SIX[0, 5] = SIX[5, 0] = 1e-4
PLANE = SIX[np.ix_((0, 1, 5), (0, 1, 5))]


@pytest.mark.parametrize("kind", ["rosbag1", "mcap"])
@pytest.mark.parametrize("maker", ["odometry", "pose_with_covariance"])
def test_poses_of_a_bag_have_their_covariance(tmp_path, kind, maker):
    messages = ros_bags.Messages(ros_bags.ros_of(kind))

    def pose(stamp, six):
        message = getattr(messages, maker)(stamp, stamp, 0.0, 0.0)
        message.pose.covariance[:] = six.ravel()
        return "/pose", round(stamp * 1e9), message

    items = [pose(1.0, SIX), pose(2.0, 3 * SIX), pose(3.0, 0 * SIX), pose(4.0, -SIX)]
    stamps = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
    items += [("/scan", round(t * 1e9), messages.scan(t, [1.0, 2.0])) for t in stamps]
    path = ros_bags.write(tmp_path, kind, sorted(items, key=lambda item: item[1]))
    known = [
        scan.pose_covariance for scan in open_log(path, pose_topic="/pose", laser_pose=(0, 0, 0))
    ]
    for found, times in zip(known[:4], (1.0, 1.0, 2.0, 3.0), strict=True):
        np.testing.assert_allclose(found, times * PLANE)
    # None: next to one that is all 0, or that is none, it is not known.
    assert [known[i] is None for i in (4, 5, 6)] == [True] * 3
    scan = open_log(path, pose_topic="/pose", laser_pose=(0, 0, 0))[2]
    assert scan.with_pose((0, 0, 0)).pose_covariance is None
    twist = (1.0, 0.0, 0.0)
    np.testing.assert_array_equal(ln.deskew(scan, twist).pose_covariance, scan.pose_covariance)
    moved = in_world(FOUND, scan)
    expected = FOUND.transform(*scan.pose, 2 * PLANE)
    np.testing.assert_allclose(moved.corners["covariance"], expected.corners["covariance"])


def code(language):
    """Return the code of a language in the part of the docs about Parquet."""
    text = (Path(__file__).parents[1] / "docs" / "formats.md").read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text.split("\n## ")[1], re.DOTALL)


@pytest.fixture
def world(tmp_path, log, monkeypatch):
    """Stand where the docs have their files; return the corners, by pyarrow."""
    monkeypatch.chdir(tmp_path)
    for target in ("world.parquet", "features.parquet", "out/"):
        assert run(["extract", str(log), "-o", target, "--world", "-q"]) == 0
    rows = pq.read_table("world.parquet").to_pylist()
    corners = [row for row in rows if row["kind"] == "corner"]
    walls: dict[int, float] = {}
    for row in rows:
        if row["kind"] == "segment":
            walls[row["scan"]] = walls.get(row["scan"], 0.0) + row["length"]
    return corners, walls


def test_docs_on_pandas(world):
    pytest.importorskip("pandas", reason="pandas is not installed")
    corners, walls = world
    found = {}
    for text in code("python"):
        exec(text, found)
    assert found["corners"]["sd_x"].tolist() == [row["cov_00"] ** 0.5 for row in corners]
    assert found["walls"].to_dict() == pytest.approx(walls)


@pytest.mark.slow
@pytest.mark.usefixtures("world")
@pytest.mark.parametrize("version", [2, 3])
def test_docs_on_tables_of_two_versions(version):
    pd = pytest.importorskip("pandas", reason="pandas is not installed")
    table = pd.read_parquet("features.parquet").astype({"kind": object, "corner": object})
    kinds, is_edge = table["kind"].tolist(), table["kind"] == "edge"
    assert 0 < is_edge.sum() < len(table)
    if version == 2:
        table.loc[is_edge, "kind"] = "corner"
        table.loc[is_edge, "corner"] = "edge"
        table.drop(columns=["segment", "side"]).to_parquet("features.parquet")
    exec(code("python")[-1], found := {})
    assert found["table"]["kind"].tolist() == kinds
    assert len(LineMap.read("features.parquet").walls) > 0


def test_docs_on_duckdb(world):
    duckdb = pytest.importorskip("duckdb", reason="DuckDB is not installed")
    corners, walls = world
    first, second = (text for text in code("sql")[0].split(";") if text.strip())
    names = "scan", "pose_x", "pose_y", "pose_theta", "x", "y"
    assert [row[:6] for row in duckdb.sql(first).fetchall()] == [
        tuple(row[name] for name in names) for row in corners
    ]
    assert {scan: length for _, scan, length in duckdb.sql(second).fetchall()} == pytest.approx(
        walls
    )
