"""`view` but its page: the server and its answers, the log that is kept, the command."""

import http.client
import json
import signal
import socket
import subprocess
import sys
import threading
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import partial
from importlib.resources import files
from queue import SimpleQueue
from types import SimpleNamespace
from unittest.mock import Mock
from urllib.request import urlopen

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from text_logs import flaser

from lineament import Extractor, LaserScan
from lineament.errors import LineamentError, LogError
from lineament.explain.explain import explain
from lineament.logs import open_log, save_npz
from lineament.view import Session, ViewServer, serve
from lineament.view.api import RequestError, answer
from lineament.view.store import ScanStore


def walls(count, beams=31):
    """Scans of a wall that comes nearer, each with three invalid beams; every third has no pose."""
    bearings = np.linspace(-0.5, 0.5, beams)
    for k in range(count):
        ranges = (3.0 - 0.01 * k) / np.cos(bearings)
        ranges[:3] = np.nan, np.inf, 0.0
        scan = LaserScan(
            ranges, -0.5, 1.0 / (beams - 1), range_max=30.0, stamp=10 + 0.1 * k, frame_id="laser"
        )
        yield scan if k % 3 == 1 else scan.with_pose((5.0, 7.0 + 0.01 * k, np.pi / 2))


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "wall.npz"
    save_npz(path, walls(9))
    return path


@contextmanager
def read(*paths, **options):
    """Yield a session that has read its log."""
    with Session(*paths, **options) as session:
        assert session.wait(60)
        yield session


@pytest.fixture
def session(log):
    extractors = {"pdbs": Extractor("pdbs"), "tight": Extractor("pdbs", noise_factor=1.0)}
    with read(log, extractors) as session:
        yield session


@contextmanager
def served(session, host="127.0.0.1"):
    with ViewServer(session, host) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def server(session):
    with served(session) as server:
        yield server


def ask(server, target, method="GET", **headers):
    """Status, headers and body of the answer to one request."""
    host = "127.0.0.1" if server.host == "0.0.0.0" else server.host
    with closing(http.client.HTTPConnection(host, server.server_port, timeout=30)) as connection:
        connection.request(method, target, headers=headers)
        reply = connection.getresponse()
        return reply.status, reply.headers, reply.read()


def asked(server, target):
    status, _, body = ask(server, target)
    return status, json.loads(body)


# The answers.


def test_the_log_and_how_far_it_was_read(server, log):
    about = {"name": str(log), "logs": ["wall.npz"], "methods": ["pdbs", "tight"]}
    assert asked(server, "/api/logs") == (200, about)
    read = {"format": "npz", "scans": 9, "total": 9, "posed": 6, "complete": True, "error": ""}
    read |= {"skipped": 0, "faults": [], "compiling": ""}
    assert asked(server, "/api/log?log=0") == (200, read)


def test_a_scan_comes_with_its_features(server, log):
    status, found = asked(server, "/api/scan?log=0&i=4&method=pdbs")
    scan = open_log(log).scan(4)
    features = Extractor("pdbs")(scan).to_dict()
    assert status == 200
    assert {name: found[name] for name in features} == features
    assert (found["index"], found["method"], found["beams"]) == (4, "pdbs", 31)
    assert found["topic"] == "ranges"
    assert found["ranges"][:3] == [None, None, None]
    assert found["ranges"][3:] == scan.ranges[3:].tolist()
    assert (found["angle_min"], found["angle_increment"]) == (-0.5, 1.0 / 30)
    assert found["range_max"] == 30.0


def test_a_trace_is_the_explanation_of_its_beam(server, log):
    status, found = asked(server, "/api/trace?log=0&i=4&method=tight&beam=20")
    expected = explain(Extractor("pdbs", noise_factor=1.0).trace(open_log(log).scan(4)), 20)
    assert status == 200
    assert (found["index"], found["method"], found["beam"]) == (4, "tight", 20)
    assert found["summary"] == expected.summary
    assert found["steps"] == [list(step) for step in expected.steps]


def test_stamps_come_in_blocks(server):
    stamps = [10 + 0.1 * k for k in range(9)]
    assert asked(server, "/api/stamps?log=0&first=0&count=4096")[1]["stamps"] == stamps
    seventh = {"first": 7, "stamps": stamps[7:8]}
    assert asked(server, "/api/stamps?log=0&first=7&count=1")[1] == seventh
    assert asked(server, "/api/stamps?log=0&first=99&count=1")[1]["stamps"] == []


def test_poses_and_points_of_the_drive(server, log):
    scans = list(open_log(log))
    _, found = asked(server, "/api/poses?log=0&first=4&count=2")
    assert found == {"first": 4, "poses": [[None] * 3, list(scans[5].pose)]}
    for first, step, count, expected in ((0, 3, 2, [0, 3]), (2, 1, 2, [2, 3]), (1, 2, 32, [3, 5])):
        _, found = asked(server, f"/api/drive?log=0&first={first}&step={step}&count={count}")
        assert [scan["index"] for scan in found["scans"]] == expected  # 1, 4 and 7 have no pose
    # A quarter turn: ahead is up, and the wall stays where it is.
    points = np.reshape(found["scans"][1]["points"], (-1, 2))
    expected = [5.0, 7.05] + scans[5].points[3:, ::-1] * [-1.0, 1.0]
    np.testing.assert_allclose(points, expected, atol=6e-4)
    np.testing.assert_allclose(points[:, 1], 10.0, atol=6e-4)


@pytest.mark.parametrize("beams", [1, 360, 361, 5000])
def test_a_scan_behind_others_has_few_points(tmp_path, beams):
    path = tmp_path / "many.npz"
    save_npz(path, [LaserScan(np.ones(beams), 0.0, 1e-3, pose=(0, 0, 0))])
    with read(path, {}) as session:
        (scan,) = session.drive(0, 0, 1, 32)["scans"]
    assert len(scan["points"]) == 2 * len(range(0, beams, -(-beams // 360)))


@pytest.mark.parametrize("index", [0, 1])
def test_a_scan_is_saved_as_a_log(server, log, index, tmp_path):
    status, headers, body = ask(server, f"/api/npz?log=0&i={index}")
    assert (status, headers["Content-Type"]) == (200, "application/octet-stream")
    path = tmp_path / "saved.npz"
    path.write_bytes(body)
    (scan,) = open_log(path)
    assert_scans_equal(scan, open_log(log).scan(index))
    assert scan.ranges.tobytes() == open_log(log).scan(index).ranges.tobytes()


# Several logs.


@pytest.fixture
def folder(tmp_path):
    """Logs of 1 to 6 scans in two folders and an archive, and one that is broken."""
    for k in range(1, 6):
        (tmp_path / f"day{k % 2}").mkdir(exist_ok=True)
        save_npz(tmp_path / f"day{k % 2}" / f"wall{k}.npz", walls(k))
    save_npz(tmp_path / "wall6.npz", walls(6))
    with zipfile.ZipFile(tmp_path / "more.zip", "w") as archive:
        for name in ("a.npz", "b.npz"):
            archive.write(tmp_path / "wall6.npz", name)
    (tmp_path / "wall6.npz").write_bytes((tmp_path / "wall6.npz").read_bytes()[:500])
    return tmp_path


NAMES = ["day0/wall2.npz", "day0/wall4.npz", "day1/wall1.npz", "day1/wall3.npz", "day1/wall5.npz"]
NAMES += ["more.zip/a.npz", "more.zip/b.npz", "wall6.npz"]


def test_a_folder_is_a_list_of_logs_that_are_opened_when_asked_for(folder):
    with Session(folder, {"pdbs": Extractor("pdbs")}) as session, served(session) as server:
        assert session._open == {}
        _, found = asked(server, "/api/logs")
        assert found == {"name": f"{folder} (8 logs)", "logs": NAMES, "methods": ["pdbs"]}
        for number, count in ((3, 3), (0, 2), (5, 6), (2, 1), (3, 3), (4, 5)):
            session.log(number)
            assert session.wait(30)
            assert asked(server, f"/api/log?log={number}")[1]["scans"] == count
        # Four are open; the one that nobody asked for the longest was closed.
        assert list(session._open) == [5, 2, 3, 4]
        closed = session.log(5)
        assert asked(server, "/api/log?log=0")[0] == 200
        assert list(session._open) == [3, 4, 5, 0]
        status, found = asked(server, "/api/log?log=7")
        assert status == 404
        assert "wall6.npz: " in found["error"]
        assert asked(server, "/api/log?log=8")[0] == 404
    assert session._open == {}
    with pytest.raises(IndexError):
        closed.store.item(0)


def test_a_session_takes_many_paths_and_one_bad_log_is_an_error(folder, tmp_path):
    with Session([folder / "day0", folder / "wall6.npz"], {}) as session:
        assert session.logs()["logs"] == ["day0/wall2.npz", "day0/wall4.npz", "wall6.npz"]
    with pytest.raises(LogError, match=r"wall6\.npz: "):
        Session(folder / "wall6.npz", {})
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match="holds no log"):
        Session(tmp_path / "empty", {})


# Bad questions.


@pytest.mark.parametrize(
    ("target", "status", "words"),
    [
        ("/api/scan?log=0", 400, "parameter i is missing"),
        ("/api/scan?log=0&i=0", 400, "parameter method is missing"),
        ("/api/scan?log=0&i=x&method=pdbs", 400, "i is 'x', expected a whole number"),
        ("/api/scan?log=0&i=-1&method=pdbs", 400, "i is '-1'"),
        ("/api/scan?log=0&i=%EF%BC%91&method=pdbs", 400, "expected a whole number"),
        (f"/api/scan?log=0&i={'9' * 5000}&method=pdbs", 400, "expected a whole number"),
        ("/api/scan?log=0&i=9&method=pdbs", 404, "scan 9 is not there: 0 to 8 have been read"),
        ("/api/scan?log=0&i=0&method=lui", 404, "'lui' is not there, expected one of: pdbs, "),
        ("/api/scan?log=0&i=0&i=1&method=pdbs", 400, "a parameter is given twice"),
        ("/api/scan?log=0&i=0&method=pdbs&x=1", 400, "'x' is unknown, expected log, i, method"),
        ("/api/logs?x=", 400, "parameter 'x' is unknown, expected none"),
        ("/api/trace?log=0&i=0&method=pdbs&beam=31", 404, "beam is 31, expected a whole number"),
        ("/api/trace?log=0&i=9&method=pdbs&beam=0", 404, "scan 9 is not there"),
        ("/api/stamps?log=0&first=0&count=0", 400, "count is 0, expected 1 to 4096"),
        ("/api/poses?log=0&first=0&count=4097", 400, "count is 4097"),
        ("/api/drive?log=0&first=0&step=1&count=33", 400, "count is 33, expected 1 to 32"),
        ("/api/drive?log=0&first=0&step=0&count=1", 400, "step is 0, expected a whole number ≥ 1"),
        ("/api/npz?log=0&i=9", 404, "scan 9 is not there: 0 to 8 have been read"),
        ("/api/log?log=1", 404, "log 1 is not there, expected a whole number from 0 to 0"),
        ("/api/log?log=wall.npz", 400, "log is 'wall.npz', expected a whole number"),
        ("/api/log?path=wall.npz", 400, "parameter 'path' is unknown, expected log"),
        ("/api/scan?" + "&".join(f"a{k}=1" for k in range(99)), 400, "makes no sense"),
        ("/api/", 404, "'/api/' is not there"),
        ("/style.css/../../secret", 404, "is not there"),
        ("/%2e%2e/store.py", 404, "is not there"),
        ("/static/index.html", 404, "is not there"),
    ],
)
def test_a_bad_question_gets_one_clear_line(server, target, status, words, capfd):
    found, answered = asked(server, target)
    assert (found, list(answered)) == (status, ["error"])
    assert words in answered["error"]
    assert "\n" not in answered["error"]
    assert capfd.readouterr() == ("", "")


@given(st.text(max_size=40))
def test_any_target_has_an_answer_or_a_refusal(target):
    with pytest.raises(RequestError):
        answer(SimpleNamespace(extractors={}), "/" + target)


# The server.


def test_the_page_and_nothing_else_is_served(server):
    there = {f"/{file.name}" for file in (files("lineament.view") / "static").iterdir()}
    assert there | {"/"} == set(server.page)
    kinds = {}
    for name in server.page:
        status, headers, body = ask(server, name)
        kinds[name] = headers["Content-Type"]
        assert status == 200
        assert body == server.page[name]
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
    assert kinds["/"].startswith("text/html")
    assert kinds["/main.js"].startswith("text/javascript")
    status, headers, body = ask(server, "/", "HEAD")
    assert (status, body) == (200, b"")
    assert int(headers["Content-Length"]) == len(server.page["/"])


def test_colours_are_those_of_the_figures(server):
    from lineament.output.canvas import DARK, LIGHT

    light, _, dark = server.page["/style.css"].decode().partition("@media")
    for style, theme in ((light, LIGHT), (dark, DARK)):
        for name, color in (
            ("corner", theme.corner),
            ("edge", theme.edge),
            ("break", theme.breakpoint),
            ("arc", theme.arc),
            ("clusters", " ".join(theme.palette)),
        ):
            assert f"--{name}: {color};" in style


@pytest.mark.parametrize(
    ("bound", "host", "status"),
    [
        ("127.0.0.1", "localhost", 200),
        ("127.0.0.1", "LOCALHOST:1234", 200),
        ("127.0.0.1", "[::1]:80", 200),
        ("127.0.0.1", "evil.example:8000", 403),
        ("127.0.0.1", "localhost.evil.example", 403),
        ("127.0.0.1", "192.168.0.7", 403),
        ("127.0.0.1", "localhost@evil.example", 403),
        ("127.0.0.1", "[", 403),
        ("127.0.0.1", "", 403),
        ("127.0.0.2", "127.0.0.2", 200),
        ("127.0.0.2", "127.0.0.3", 403),
        ("0.0.0.0", "192.168.0.7:80", 200),
        ("0.0.0.0", "robot.example", 403),
        ("0.0.0.0", "", 403),
    ],
)
def test_requests_by_another_name_are_refused(session, bound, host, status):
    with served(session, bound) as server:
        name = "localhost" if bound == "0.0.0.0" else bound
        assert server.address == f"http://{name}:{server.server_port}/"
        for target in ("/api/log?log=0", "/"):
            assert ask(server, target, Host=host)[0] == status


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "BREW"])
def test_other_methods_are_refused_as_json(server, method):
    status, headers, body = ask(server, "/api/log?log=0", method)
    assert status == 501
    assert headers["Content-Type"].startswith("application/json")
    assert "Unsupported method" in json.loads(body)["error"]


@pytest.mark.parametrize(
    "raw",
    [
        b"\r\n\r\n",
        b"nonsense\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /\xff HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 300 + b"\r\n",
        b"GET /" + b"a" * 70000,
        b"\0" * 99,
    ],
)
def test_garbage_and_broken_connections_leave_the_server_alive(server, raw, capfd):
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=5) as line:
        line.sendall(raw)
    assert asked(server, "/api/log?log=0")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_a_scan_that_breaks_a_method_breaks_nothing_else(session, capfd):
    def broken(_):
        raise RuntimeError("no\nluck")

    session.extractors["tight"] = broken
    with served(session) as server:
        answered = asked(server, "/api/scan?log=0&i=0&method=tight")
        assert answered == (500, {"error": "RuntimeError: no luck"})
        assert asked(server, "/api/scan?log=0&i=0&method=pdbs")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_many_at_once_get_what_one_gets(server):
    targets = [
        f"/api/scan?log=0&i={k % 9}&method={name}" for k in range(12) for name in ("pdbs", "tight")
    ]
    alone = [asked(server, target) for target in targets]
    with ThreadPoolExecutor(len(targets)) as pool:
        assert list(pool.map(partial(asked, server), targets)) == alone


def test_a_port_that_is_taken_is_one_line(session):
    with ViewServer(session) as server, pytest.raises(LineamentError, match="cannot listen there"):
        ViewServer(session, port=server.server_port)


# The log that is kept.


def assert_scans_equal(*scans):
    names = "ranges angles is_regular angle_min angle_increment range_min range_max stamp scan_time"
    names = (*names.split(), "time_increment", "frame_id", "pose", "intensities")
    np.testing.assert_equal(*({name: getattr(scan, name) for name in names} for scan in scans))


def test_a_log_that_breaks_off_is_shown_as_far_as_it_goes(write):
    lines = [flaser([2.0] * 181, stamp=stamp) for stamp in (1, 2, 3, 4)]
    lines[2] = lines[2].replace(" 181 ", " 190 ")
    path = write("".join(lines), "broken.log")
    with read(path, {"pdbs": Extractor("pdbs")}) as session:
        facts = session.facts(0)
        assert facts["scans"] == 2
        assert "broken.log:3: " in facts["error"]
        assert session.scan(0, 1, "pdbs")["stamp"] == 2
    with read(path, {"pdbs": Extractor("pdbs")}, keep_going=True) as session:
        facts = session.facts(0)
        assert (facts["scans"], facts["error"], facts["skipped"]) == (3, "", 1)
        assert session.scan(0, 2, "pdbs")["stamp"] == 4


def any_scans():
    yield from walls(3)
    bearings = np.array([0.0, 0.1, 0.3])
    yield LaserScan([1.0, np.nan, 1 / 3], angles=bearings, range_min=0.1, pose=(1.0, 2.0, 0.1))
    yield LaserScan([], 0.0, 0.1, scan_time=0.1, time_increment=1e-5, stamp=1e9 + 1e-6)
    yield LaserScan([5.0], 0.0, 0.0, frame_id="läser", range_max=np.inf, intensities=[1 / 3])
    yield LaserScan([1e300, -np.inf], angles=[0.0, 1e-9])


@pytest.mark.parametrize("capacity", [0, 2000, 1 << 20])
def test_a_store_gives_every_scan_whatever_room_there_is(capacity):
    scans = list(any_scans())
    items = [(f"scan{k}", scan) for k, scan in enumerate(scans)]
    with closing(ScanStore(lambda: items, capacity=capacity)) as kept:
        kept.fill(items)
        assert len(kept) == len(scans)
        for index in (0, 5, 2, 2, 3, 1, 0, 6, 4):
            topic, scan = kept.item(index)
            assert topic == f"scan{index}"
            assert_scans_equal(scan, scans[index])
        assert (len(kept._starts), -1 in kept._starts) == (len(scans), capacity < 1 << 20)
        assert kept._end <= capacity
        for index in (-1, len(scans)):
            with pytest.raises(IndexError):
                kept.item(index)
        assert kept.stamps(2, 99) == [scan.stamp for scan in scans[2:]]
        assert kept.posed == 3
        poses = [scan.pose or (np.nan,) * 3 for scan in scans]
        np.testing.assert_equal(kept.poses(1, 2), poses[1:3])
        np.testing.assert_equal(kept.poses(2, 99), poses[2:])


def test_a_full_disk_is_less_room_and_no_failure(monkeypatch):
    items = [("scan", scan) for scan in walls(4)]
    with closing(ScanStore(lambda: items)) as kept:
        kept.fill(items[:2])

        full = Mock(wraps=kept._file)
        full.write.side_effect = OSError(28, "No space left on device")
        monkeypatch.setattr(kept, "_file", full)
        kept.fill(items[2:])
        for index, (_, scan) in enumerate(items):
            assert_scans_equal(kept.item(index)[1], scan)


def test_a_closed_store_ends_its_reading():
    kept = ScanStore(lambda: ())

    def endless():
        while True:
            yield "scan", next(walls(1))

    reader = threading.Thread(target=kept.fill, args=(endless(),))
    reader.start()
    while len(kept) < 3:
        time.sleep(0.001)
    kept.close()
    reader.join(30)
    assert not reader.is_alive()


# The command.


@pytest.mark.parametrize(
    ("host", "name"),
    [("127.0.0.1", "127.0.0.1"), ("localhost", "localhost"), ("0.0.0.0", "localhost")],
)
def test_serving_names_the_address_warns_and_opens_the_page(host, name, log, monkeypatch, capsys):
    opened, lines = SimpleQueue(), []
    monkeypatch.setattr("webbrowser.open", opened.put)
    monkeypatch.setattr(ViewServer, "serve_forever", lambda _: None)
    serve(Session(log, {"pdbs": Extractor("pdbs")}), host, write=lines.append)
    address = opened.get(timeout=30)
    port = int(address.removeprefix(f"http://{name}:").removesuffix("/"))
    assert port > 1023  # any that is free
    assert lines == [f"{log}: look at {address} (Ctrl-C ends it)"]
    serve(Session(log, {"pdbs": Extractor("pdbs")}), host, browser=False, write=lines.append)
    assert opened.empty()
    assert ("is not loopback" in capsys.readouterr().err) == (host == "0.0.0.0")


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a child there")
@pytest.mark.slow
def test_the_command_writes_its_address_and_ends_quietly(log):
    command = [sys.executable, "-m", "lineament", "view", str(log), "-m", "pdbs", "--no-browser"]
    with subprocess.Popen(
        [*command, "--host", "0.0.0.0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        line = process.stdout.readline()
        port = int(line.split("http://localhost:")[1].split("/")[0])
        with urlopen(f"http://127.0.0.1:{port}/api/log?log=0", timeout=30) as reply:
            assert json.load(reply)["format"] == "npz"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert out == ""
    lines = [line for line in err.splitlines() if line]
    assert lines[0].startswith("lineament: 0.0.0.0 is not loopback")
    assert lines[1:] == ["lineament: stopped"]
