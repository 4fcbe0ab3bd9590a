"""What is fuzzed besides the readers: methods, writers, the viewer's API, the node's messages.

A target makes an input by chance (`make`), which can be pickled, and checks what becomes of it
(`check`): it returns the outcome in a word or two, and raises whatever breaks a promise.
"""

import dataclasses
import json
import math
import time
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from random import Random
from typing import Any, ClassVar
from xml.etree import ElementTree

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import ros_bags
from equality import assert_sound
from in_memory import Given, Taken
from live_driving import received_scan
from mutations import damaged
from test_optimal_properties import assert_sound as assert_optimal_sound
from test_optimal_properties import hostile_scans
from worlds import degenerate_scans, random_scan

from lineament import Extractor, LaserScan, RangeNoise, open_log
from lineament.features import TABLES
from lineament.live import FoxgloveSink, LiveConfig, Node, Pipeline, RosSink
from lineament.live.received import ODOMETRY, Received
from lineament.logs import save_log
from lineament.methods import get_method, method_names
from lineament.output import ENDINGS, open_writer
from lineament.output.ros_messages import RosMessages
from lineament.rosmsg.poses import odometry
from lineament.view import Session
from lineament.view.api import _ROUTES, RequestError, answer

NOISES = (None, None, RangeNoise(0.01), RangeNoise(0.0), RangeNoise(0.002, 0.01, 1e-3, 0.01))


def any_scan(chance: Random, most: int = 400) -> LaserScan:
    """Make a scan of anything, from a room to no measurement at all."""
    rng = np.random.default_rng(chance.getrandbits(64))
    n = chance.choice((*range(9), *(chance.randrange(9, most) for _ in range(9)), 4 * most))
    kind = chance.random()
    if kind < 0.35:
        return random_scan(
            chance.getrandbits(32), None if chance.random() < 0.5 else min(max(n, 2), 400)
        )
    if kind < 0.4:
        return chance.choice(list(degenerate_scans().values()))
    ranges = chance.choice(list(hostile_scans(max(n, 1), rng).values()))[:n].copy()
    for _ in range(chance.choice((0, 0, 1, 3))):  # a piece of another scan
        at = chance.randrange(n + 1)
        other = chance.choice(list(hostile_scans(max(n, 1), rng).values()))[: n - at]
        size = chance.randrange(n + 1)
        ranges[at : at + size] = other[:size]
    limits = chance.choice(({}, {}, {"range_min": 0.1, "range_max": 30.0}, {"range_max": 5.0}))
    full = 2 * math.pi / max(n, 1)
    if chance.random() < 0.2 and n:
        steps = 10.0 ** rng.uniform(-6, 0, n)
        return LaserScan(ranges, angles=np.cumsum(steps) * min(1.0, 6.0 / steps.sum()), **limits)
    step = chance.choice((full, full, 1e-9, 1e-4, 0.005, full / 2))
    return LaserScan(ranges, -math.pi, min(step, full), **limits)


def any_method(chance: Random) -> Any:
    """Make a method: a preset, or one with a few parameters of any legal value."""
    name = chance.choice(method_names())
    if chance.random() < 0.6:
        return get_method(name)
    given = {}
    fields = [field for field in dataclasses.fields(get_method(name)) if "bounds" in field.metadata]
    for field in chance.sample(fields, min(len(fields), chance.choice((1, 1, 2, 3)))):
        bounds = field.metadata["bounds"]
        if bounds.choices:
            given[field.name] = chance.choice(list(bounds.choices))
        elif bounds.kind is bool:
            given[field.name] = chance.random() < 0.5
        elif bounds.kind is int:
            given[field.name] = chance.choice((0, 1, 2, 3, 5, 8, 40))
        else:
            given[field.name] = float(field.default * 10.0 ** chance.uniform(-2, 2))
    try:
        return get_method(name, **given)
    except ValueError:
        return get_method(name)


class Target:
    """What is fuzzed."""

    def close(self) -> None:
        """Close what is open."""


class Methods(Target):
    """Any scan by any method, with any parameters: its features are sound."""

    def __init__(self, _: Path) -> None:
        self._kept = lru_cache(100)(Extractor)

    def make(self, chance: Random) -> tuple[Any, Any, LaserScan]:
        return any_method(chance), chance.choice(NOISES), any_scan(chance)

    def check(self, made: tuple[Any, Any, LaserScan]) -> str:
        method, noise, scan = made
        extractor = self._kept(method, noise=noise)
        features = extractor(scan)
        if method.name == "optimal":
            assert_optimal_sound(scan, features, extractor)
        else:
            assert_sound(features, scan, method)
        again = extractor(scan)
        for name in TABLES:  # whatever the buffers held before
            assert features[name].tobytes() == again[name].tobytes(), name
        return f"{method.name}: {'found' if any(features.counts().values()) else 'nothing'}"


class Writers(Target):
    """Scans and features of anything, in every format, read again."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._extract = Extractor("optimal")

    def make(self, chance: Random) -> tuple[str, list[LaserScan]]:
        endings = [*ENDINGS, *(".parquet", ".csv", ".jsonl") * 3, *("npz", "log") * 4]
        endings.remove(".rrd")  # whose writer keeps a thread for each file
        scan = any_scan(chance, 60)
        while not len(scan):  # which ROS has none of
            scan = any_scan(chance, 60)
        scans = [scan.with_pose((float(k), chance.uniform(-9, 9), 0.5)) for k in range(2)]
        return chance.choice(endings), scans

    def check(self, made: tuple[str, list[LaserScan]]) -> str:
        ending, scans = made
        path = self._folder / f"written{ending}"
        path.unlink(missing_ok=True)
        if ending in ("npz", "log"):
            return self._saved(path.with_suffix(f".{ending}"), scans)
        found = [self._extract(scan) for scan in scans]
        with open_writer(path) as writer:
            for features, scan in zip(found, scans, strict=True):
                writer.write(features, scan)
        rows = sum(one.to_arrow().num_rows for one in found)
        if ending == ".parquet":
            assert pyarrow.parquet.read_table(path).num_rows == rows
        elif ending == ".csv":
            assert pyarrow.csv.read_csv(path).num_rows == rows if rows else path.stat().st_size
        elif ending == ".jsonl":
            text = path.read_text("utf-8").splitlines()
            lines = [json.loads(line, parse_constant=_refuse) for line in text]
            assert [len(line["segments"]) for line in lines] == [len(one.segments) for one in found]
        elif ending == ".svg":
            ElementTree.parse(path)
        elif ending == ".ros2.mcap":
            if scans[0].is_regular:  # else its points are a cloud
                with np.errstate(over="ignore"):
                    for scan, own in zip(open_log(path), scans, strict=True):
                        ranges = [one.ranges.astype(np.float32) for one in (scan, own)]
                        np.testing.assert_array_equal(*ranges)
        else:
            assert path.stat().st_size > 100
        return ending

    def _saved(self, path: Path, scans: list[LaserScan]) -> str:
        path.unlink(missing_ok=True)
        try:
            save_log(path, scans)
        except ValueError:
            assert not path.exists()
            return f"{path.suffix}: refused"
        for scan, own in zip(open_log(path), scans, strict=True):
            where = own.valid
            assert (scan.valid == where).all()
            np.testing.assert_array_equal(scan.ranges[where], own.ranges[where])
            np.testing.assert_allclose(scan.angles, own.angles, atol=1e-9)
            assert scan.pose == own.pose
        return f"{path.suffix}: the same"


class Viewer(Target):
    """Requests to the page's server: strict JSON, or 400 or 404 and one line."""

    NEEDED: ClassVar = {path: names for path, (_, names) in _ROUTES.items()}
    PATHS = (*NEEDED, "/api", "/", "/../etc/passwd")
    NAMES = ("i", "method", "beam", "first", "step", "count", "log", "x", "")
    VALUES = ("0", "1", "3", "-1", "99999", "9" * 30, "1.5", "nan")
    VALUES += ("", "optimal", "liu", "%00", "é")

    def __init__(self, folder: Path) -> None:
        rng = np.random.default_rng(0)
        scans = [
            LaserScan(row, -0.5, 0.005, stamp=float(k))
            for k, row in enumerate(hostile_scans(61, rng).values())
        ]
        logs = folder / "viewed"
        logs.mkdir()
        save_log(logs / "bare.npz", scans)
        save_log(logs / "posed.npz", [one.with_pose((one.stamp, -1.0, 0.5)) for one in scans])
        extractors = {name: Extractor(name) for name in ("optimal", "liu")}
        extractors["exact"] = Extractor("optimal", noise=RangeNoise(0.0))
        self._session = Session(logs, extractors)
        for number in range(2):
            self._session.log(number).wait(60)

    def close(self) -> None:
        self._session.__exit__()

    def make(self, chance: Random) -> str:
        values = {
            "log": str(chance.randrange(2)),
            "i": str(chance.randrange(20)),
            "method": chance.choice(("optimal", "liu", "exact")),
            "beam": str(chance.randrange(61)),
            "first": str(chance.randrange(20)),
            "step": str(chance.randrange(1, 5)),
            "count": str(chance.randrange(1, 33)),
        }
        path = chance.choice((*self.NEEDED, "/api/scan", "/api/trace", "/api/trace"))
        good = {name: values[name] for name in self.NEEDED[path]}
        for _ in range(chance.choice((0, 0, 1, 2))):
            good[chance.choice(self.NAMES)] = chance.choice(self.VALUES)
        query = "&".join(f"{name}={value}" for name, value in good.items())
        if chance.random() < 0.1:
            path = chance.choice(self.PATHS)
        text = f"{path}?{query}"
        if chance.random() < 0.2:
            text = damaged(text.encode(), chance, query.encode()).decode("latin-1")
        return text

    def check(self, made: str) -> str:
        refused = None
        try:
            reply = answer(self._session, made)
            if not reply.startswith(b"PK"):  # else a log
                json.loads(reply, parse_constant=_refuse)
        except RequestError as error:
            refused = error
        if refused is None:
            return "answered"
        assert refused.status in (400, 404)
        assert "\n" not in str(refused)
        return str(refused.status)


class Messages(Target):
    """Messages of scans and of odometry, damaged, to a node that publishes what it finds."""

    TYPES = ("LaserScan", "MultiEchoLaserScan", "Odometry")
    #: What a message may hold that no scanner means.
    ODD = (0.0, -0.0, 1e-45, 1e-38, 1e-7, 0.1, 1.0, -1.0, 5.0, 6.2831855, 1e6, 1e15, -1e20, 1e36)
    ODD += (math.inf, -math.inf, math.nan)
    FIELDS = ("angle_min", "angle_increment", "range_min", "range_max")
    FIELDS += ("time_increment", "scan_time")
    OPTIONS = (
        {},
        {"track": True, "deskew": "scans"},
        {"deskew": "/odom", "laser_pose": (0.2, 0.1, 1.0)},
        {"track": True, "method": "liu", "noise": 0.01},
    )

    def __init__(self, _: Path) -> None:
        self._pipelines = [Pipeline(LiveConfig(**options)) for options in self.OPTIONS]

    def make(self, chance: Random) -> tuple[int, str, str, bytes]:
        ros = chance.choice((1, 2, 2))
        kind = chance.choice((*self.TYPES, "LaserScan", "LaserScan"))
        messages = ros_bags.Messages(ros)
        rng = np.random.default_rng(chance.getrandbits(32))
        ranges = random_scan(chance.getrandbits(16), chance.choice((3, 61, 181))).ranges.copy()
        n = len(ranges)
        spoilt = chance.sample(range(n), chance.choice((0, 0, 1, n // 2, n)))
        ranges[spoilt] = chance.choices(self.ODD, k=len(spoilt))
        stamps = (0.0, 1.0, 5.0 + rng.random(), 1.7e9, 2**31 - 1.0)
        stamp = chance.choice(stamps if ros == 1 else (*stamps, -1.0, -(2.0**31)))
        if kind == "LaserScan":
            names = chance.sample(self.FIELDS, chance.choice((0, 0, 1, 2)))
            fields = {name: chance.choice(self.ODD) for name in names}
            message = messages.scan(stamp, ranges, rng.random(n), **fields)
        elif kind == "Odometry":
            message = messages.odometry(stamp, *rng.normal(size=3))
            speeds = (1.5, 0.0, -0.5, 30.0, 1e3, 1e300, math.nan)
            message.twist.twist.linear.x, message.twist.twist.angular.z = chance.choices(
                speeds, k=2
            )
        else:
            message = messages.echoes(stamp, [[r, r + 1] for r in ranges[:9]])
        store = ros_bags.store(ros)
        serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
        data = bytes(serialize(message, message.__msgtype__))
        if chance.random() < 0.7:
            data = damaged(data, chance, data)
        return chance.randrange(len(self.OPTIONS)), kind, "ros1" if ros == 1 else "cdr", data

    def check(self, made: tuple[int, str, str, bytes]) -> str:
        option, kind, encoding, data = made
        if kind == "Odometry":
            received = Received("o", partial(odometry, data, encoding), time.monotonic(), ODOMETRY)
        else:
            received = received_scan("a", data, encoding, kind)
        lines: list[str] = []
        config = LiveConfig(log="played.npz")
        sinks = [RosSink(Taken(), RosMessages("cdr"), config)]
        with suppress(ImportError):
            from lineament.output.foxglove import FoxgloveMessages

            sinks.append(FoxgloveSink(Taken(), FoxgloveMessages(), config))
        node = Node(Given([received]), self._pipelines[option], sinks, write=lines.append)
        total = node.run().total
        assert all(line.isprintable() for line in lines), lines
        assert total.malformed == sum("makes no sense" in line for line in lines)
        if kind != "Odometry":
            assert total.scans + total.malformed == 1
        return f"{kind}: {'malformed' if total.malformed else 'taken'}"


def _refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is no JSON")
