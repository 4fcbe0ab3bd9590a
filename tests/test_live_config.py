import importlib
import inspect
import math
import re
from dataclasses import MISSING, fields

import pytest

from lineament.errors import LineamentError
from lineament.limits import LIMITS
from lineament.live import LiveConfig, read_config

_NAME, _TWO = "expected a name of letters, digits, _ and /", {"merge": ("/a",)}


#: What would change nothing unless something else is given, too.
NEEDED = {
    "a log": {"log_topic": "/b", "poses": "/odom", "ring": 0, "keep_going": True, "rate": 2.0,
              "loop": True},
    "several topics": {"mountings": {"/a": (0, 0, 0)}, "unsure": (0.1, 0.1), "tolerance": 0.3},
    "a map": {"layers": "A", "units": "mm", "judge": "amcl_pose"},
    "a map or mapping": {"odometry": "odom", "map_frame": "m", "odom_frame": "o",
                         "transform_tolerance": 0.5, "broadcast": False},
    "a map, mapping or several topics": {"base_frame": "base_footprint"},
    "a dock": {"dock_shape": "a.dxf"},
    "foxglove": {"host": "0.0.0.0"},
}  # fmt: skip


@pytest.mark.parametrize(
    ("topic", "namespace", "name"),
    [
        ("scan", "", "/scan"),
        ("scan", "/", "/scan"),
        ("scan", "robot", "/robot/scan"),
        ("front/scan", "/fleet/robot/", "/fleet/robot/front/scan"),
        ("/scan", "robot", "/scan"),
    ],
)
def test_topics_are_named_as_ros_does(topic, namespace, name):
    assert LiveConfig(namespace=namespace).resolved(topic) == name
    assert LiveConfig(topic=topic, namespace=namespace).scan_topic == name


def test_odometry_is_a_topic_in_the_namespace():
    config = LiveConfig(namespace="robot", deskew="odom")
    assert config.odometry_topic == "/robot/odom"
    assert LiveConfig(deskew="scans").odometry_topic is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"type": "Image"}, "type is 'Image', expected one of LaserScan, MultiEchoLaserScan"),
        ({"echo": "middle"}, "echo is 'middle', expected one of first, last, strongest"),
        ({"reliability": "sure"}, "reliability is 'sure', expected one of best-effort, reliable"),
        ({"ros": 3}, "ros is 3, expected one of 0, 1, 2"),
        ({"ros": 0}, "ros is 0, which leaves nothing to listen to; expected a log"),
        *(({"topic": name}, f"topic is {name!r}, {_NAME}") for name in ("a b", "", "/a//b", "/")),
        ({"topic": "scan/"}, f"topic is 'scan/', {_NAME}"),
        ({"topic": 7}, "topic is 7, expected a text"),
        ({"name": "a/b"}, "name is 'a/b', expected no /: use namespace for that"),
        ({"namespace": "r\n"}, f"namespace is 'r\\n', {_NAME}"),
        ({"deskew": "up!"}, f"deskew is 'up!', {_NAME}"),
        ({"deskew": "poses"}, "deskew is 'poses', which only a log has; expected a topic, or"),
        ({"odometry": "odom", "log": "a.bag"}, "odometry is 'odom', but a log is played; expected"),
        ({"odometry": "odom", "deskew": "o"}, "deskew is 'o', and odometry 'odom', expected one"),
        ({"odom_frame": "/map"}, "two of map_frame, odom_frame and base_frame are one, expected"),
        ({"map_frame": "a b"}, f"map_frame is 'a b', {_NAME}"),
        ({"judge": "a", "map": "b", "log": "c", "poses": "/d"}, "poses are not used with judge"),
        ({"judge": "a", "map": "b", "log": "c", "deskew": "poses"}, "poses are not used with jud"),
        ({"deskew": "odom", "log": "a.bag"}, "deskew is 'odom', but a log is played; expected"),
        ({"map": "/map", "log": "a.bag"}, "map is '/map', a topic, but a log is played; expected"),
        ({"map": "/map", "units": "mm"}, "layers and units are of a DXF, expected none for '/map'"),
        ({"map": "map", "layers": "A"}, "layers and units are of a DXF, expected none for 'map'"),
        ({"noise": 10**400}, "0, expected 0 to 1000"),
        ({"noise": float("inf")}, "noise is inf, expected 0 to 1000"),
        ({"depth": 0}, "depth is 0, expected 1 to 1000"),
        ({"depth": True}, "depth is True, expected a whole number"),
        ({"depth": 2.5}, "depth is 2.5, expected a whole number"),
        ({"depth": None}, "depth is None, expected a whole number"),
        ({"rate": float("nan")}, "rate is nan, expected 0 to"),
        ({"laser_pose": (1.0, 2.0)}, "laser_pose is (1.0, 2.0), expected three finite numbers"),
        ({"laser_pose": (1, 2, "x")}, "laser_pose is (1, 2, 'x'), expected three finite numbers"),
        ({"laser_pose": (10**400, 0, 0)}, "0, 0, 0), expected three finite numbers"),
        ({"laser_pose": (-math.inf, 0, 0)}, "laser_pose is (-inf, 0, 0), expected three finite"),
        ({"dock": ()}, "dock is (), expected two finite numbers"),
        ({"dock": (1.0, math.nan)}, "dock is (1.0, nan), expected two finite numbers"),
        ({"dock": 7}, "dock is 7, expected two numbers"),
        ({"dock": (1, 2), "dock_track": 0}, "dock and dock_track are given, expected one of them"),
        ({"track": 1}, "track is 1, expected true or false"),
        ({"parameters": 3}, "parameters is 3, expected a table"),
        ({"limits": {"none": 3}}, "limit 'none' is unknown, expected one of "),
        ({"merge": ("scan",)}, "topics are /scan, /scan, expected each of them once"),
        ({"merge": ("a b",)}, f"merge is ('a b',), {_NAME}"),
        ({"merge": "rear"}, "merge is 'rear', expected names"),
        ({"merge": (7,)}, f"merge is (7,), {_NAME}"),
        ({**_TWO, "mountings": {"/b": (0, 0, 0)}}, "the mounting is of /b, expected one of"),
        ({**_TWO, "mountings": {"/a": (0, 0)}}, "mounting of /a is (0, 0), expected"),
        ({**_TWO, "mountings": {"/a": (0, 0, 90)}}, "mounting of /a has theta = 90 rad, more than"),
        ({**_TWO, "unsure": (-1, 0)}, "unsure is (-1, 0), expected two numbers"),
        ({**_TWO, "unsure": (1,)}, "unsure is (1,), expected two finite numbers"),
        ({**_TWO, "tolerance": -1}, "tolerance is -1, expected 0 to 10"),
        ({**_TWO, "deskew": "scans"}, "deskew is 'scans', expected odometry or poses"),
        ({**_TWO, "laser_pose": (1, 0, 0)}, "laser_pose is of one scanner"),
        ({**_TWO, "upside_down": True}, "upside_down is of one scanner"),
        ({**_TWO, "log": "a.bag", "log_topic": "/b"}, "log_topic is of one scanner"),
        ({"map": "a.dxf", "mapping": "b.dxf"}, "map and mapping are given"),
        ({"judge": "/amcl_pose", "mapping": "b.dxf"}, "judge and mapping are given"),
        *(
            ({name: value}, f"{name} is {value!r}, expected {needed} as well")
            for needed, given in NEEDED.items()
            for name, value in given.items()
        ),
        *(
            ({name: ""}, f"{name} is empty, expected a text, or no {name}")
            for name in ("map", "mapping", "log", "log_topic", "poses", "dock_shape", "judge")
        ),
        ({"mapping": "b.png"}, "mapping is 'b.png', expected an ending of .dxf"),
    ],
)
def test_what_makes_no_sense_is_named(given, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        LiveConfig(**given)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("topic = ", "is not TOML"),
        ("\udcff\udcfe", "is not TOML"),
        (f"a = {'[' * 5000}", "is not TOML"),
        (f"noise = {'9' * 5000}", "is not TOML"),
        ("tropic = '/scan'", "has 'tropic', expected one of topic, merge"),
        ('from = "a.log"', "has 'from', expected one of topic"),
        (None, "cannot be read: No such file"),
    ],
)
def test_a_file_that_makes_no_sense_is_one_line(tmp_path, content, message):
    path = tmp_path / "live.toml"
    if content is not None:
        path.write_bytes(content.encode(errors="surrogateescape"))
    with pytest.raises(LineamentError, match=message) as caught:
        read_config(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_file_is_as_long_as_a_line_of_a_log_at_most(tmp_path):
    path = tmp_path / "live.toml"
    path.write_bytes(b"#" * LIMITS.line)
    assert read_config(path) == {}
    path.write_bytes(b"#" * (LIMITS.line + 1))
    with pytest.raises(LineamentError, match=f"it has more than {LIMITS.line} bytes"):
        read_config(path)


#: What a robot relies on: what holds where nothing is said, how long is waited, how much is kept.
DEFAULTS = {
    "topic": "scan", "merge": (), "unsure": (0.01, math.radians(0.5)), "tolerance": 0.15,
    "namespace": "", "name": "lineament", "type": "LaserScan", "echo": "first",
    "stamp": "first", "scale": 1.0, "ros": 2, "localhost": False, "reliability": "best-effort",
    "depth": 10, "method": "optimal", "deskew": "off", "laser_pose": (0.0, 0.0, 0.0),
    "upside_down": False, "mask": (), "track": False, "layers": "", "keep_going": False,
    "rate": 1.0, "loop": False, "host": "127.0.0.1", "map_frame": "map", "odom_frame": "odom",
    "base_frame": "base_link", "transform_tolerance": 1.0, "broadcast": True,
}  # fmt: skip
BOUNDS = {"depth": (1, 1000), "rate": (0, 1e6), "noise": (0, 1000), "scale": (1e-9, 1e9),
          "domain": (0, 232), "foxglove": (0, 65535), "dock_track": (0, 2147483647),
          "transform_tolerance": (0, 10), "tolerance": (0, 10)}  # fmt: skip
FRACTIONS = "rate", "noise", "transform_tolerance", "tolerance"
TIMES_AND_SIZES = {
    "counters": {"_MOST": 4096},
    "dds": {"PATIENCE": 10**6, "MOST_PUBLISHERS": 1000},
    "foxglove": {"_BACKLOG": 64},
    "frames": {"_MOST_FRAMES": 1000, "_MOST_POSES": 1000, "GAP": 0.5, "LATE": 0.2,
               "_SET_BACK": 1.0},
    "localiser": {"_MOST_SCANNERS": 8, "_SENT": 50},
    "node": {"_WAIT": 0.1, "_EACH": 1.0, "_PATIENCE": 2.0, "_MOST_FAULTY": 64},
    "participant": {"LAST_DOMAIN": 232},
    "pipeline": {"_LATEST": 2147483647_999999999, "_MOST_PUBLISHERS": 8, "_OLDEST": 0.5,
                 "_LONGEST": 1.0},
    "raw_dds": {"_DATA": 2},
    "received": {"MANY": 20, "_MOST_PUBLISHERS": 64, "FARTHEST": 1e9},
    "replay": {"_LEAP": 10.0, "_STEP": 0.1, "_PUNCTUAL": 0.01, "_MOST": 64},
    "ros1": {"_PATIENCE": 3.0, "_LEAP": 10000},
}  # fmt: skip


def test_what_holds_where_nothing_is_said():
    defaults = {f.name: f.default for f in fields(LiveConfig) if f.default is not MISSING}
    assert {name: value for name, value in defaults.items() if value is not None} == DEFAULTS
    empty = LiveConfig()
    assert (empty.parameters, empty.limits, empty.mountings) == ({}, {}, {})


@pytest.mark.parametrize("name", BOUNDS)
def test_numbers_are_taken_up_to_their_bounds(name):
    given = {"map": "a.dxf", "log": "a.npz", "merge": ("/b",)}
    for bound, beyond in zip(BOUNDS[name], (-math.inf, math.inf), strict=True):
        is_whole = isinstance(bound, int) and name not in FRACTIONS
        off = bound + int(math.copysign(1, beyond)) if is_whole else math.nextafter(bound, beyond)
        assert getattr(LiveConfig(**given, **{name: bound}), name) == bound
        with pytest.raises(ValueError, match=f"{name} is "):
            LiveConfig(**given, **{name: off})


@pytest.mark.parametrize("name", TIMES_AND_SIZES)
def test_how_long_is_waited_and_how_much_is_kept(name):
    if name in ("dds", "raw_dds", "participant", "foxglove"):
        pytest.importorskip("foxglove" if name == "foxglove" else "cyclonedds")
    room = "rosmsg" if name == "frames" else "live"
    module = importlib.import_module(f"lineament.{room}.{name}")
    kept = {key: getattr(module, key) for key in TIMES_AND_SIZES[name]}
    assert kept == TIMES_AND_SIZES[name]
    if name == "raw_dds":  # what Cyclone DDS is told of a type: a byte long at least, no key
        assert list(module._ONE_BYTE) == [0x0101 << 16, 0, 0]


@pytest.mark.parametrize(
    ("of", "given"),
    [("dds.DdsSource", {"depth": 64}), ("dds.DdsPublisher", {"depth": 1}),
     ("foxglove.FoxgloveServer", {"port": 8765}), ("replay.ReplaySource", {"rate": 1.0}),
     ("ros1.Ros1Publisher", {"depth": 10}), ("received.Inbox.put", {"missing": 0}),
     ("counters.Counters.report", {"lost": 0, "unsent": 0})],
)  # fmt: skip
def test_numbers_that_need_not_be_given(of, given):
    name, *path = of.split(".")
    if name in ("dds", "foxglove"):
        pytest.importorskip("cyclonedds" if name == "dds" else "foxglove")
    made = importlib.import_module(f"lineament.live.{name}")
    for part in path:
        made = getattr(made, part)
    defaults = {p.name: p.default for p in inspect.signature(made).parameters.values()}
    numbers = {key: value for key, value in defaults.items() if type(value) in (int, float)}
    assert numbers == given
