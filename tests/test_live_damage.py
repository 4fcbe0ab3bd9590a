"""Thousands of messages that were damaged, through the whole of a node: none of them ends it."""

from __future__ import annotations

import struct
from random import Random

import pytest
from mutations import damaged

import lineament as ln
from lineament.live import FoxgloveSink, LiveConfig, Node, Pipeline, Received, RosSink
from lineament.live.decoding import received_odometry, received_scan
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Message, Moment
from lineament.simulation import SENSORS, drive, room

#: What the fields of a message may hold that no scanner means.
NUMBERS = (0, -0.0, 1e-45, 1e-38, 1e-7, 0.1, 1, -1, 5, 6.2831855, 1e6, 1e15, -1e20, 1e30, 3.4e38)
NUMBERS += (float("inf"), float("-inf"), float("nan"))
STAMPS = ((-1, 0), (2**31 - 1, 2**32 - 1), (-(2**31), 10**9), (5, 999_999_999), (5, 0))
#: Where the geometry of a scan in the frame `laser` begins, and where its ranges do.
GEOMETRY, RANGES = 24, 56


class Taken:
    """Takes messages as a publisher does, and sees that they are bytes."""

    unsent = n = 0

    def advertise(self, topic: str, kind: str) -> None:
        assert topic.startswith("/")
        assert kind

    def publish(self, message: Message) -> None:
        assert isinstance(message.data, bytes)
        self.n += 1

    def listeners(self, topic: str) -> int:
        return len(topic)

    def close(self) -> None:
        pass


class Damaging:
    """A source of messages of two scanners and an odometry, most of them damaged."""

    lost, publishers = 0, 1

    def __init__(self, n: int, seed: int) -> None:
        self._left, self._chance = n, Random(seed)
        self._sound = sound_messages()

    @property
    def ended(self) -> bool:
        return not self._left

    def receive(self, timeout: float) -> list[Received]:
        assert timeout > 0
        self._left -= 1
        data, other = self._chance.choices(self._sound, k=2)
        if self._chance.random() < 0.8:
            data = self._damaged(data, other)
        name = self._chance.choice("ab")
        scan = received_scan(name, data, "cdr", "sensor_msgs/LaserScan")
        return [received_odometry("o", self._odometry(), "cdr"), scan]

    def problems(self) -> list[str]:
        return []

    def close(self) -> None:
        pass

    def _damaged(self, data: bytes, other: bytes) -> bytes:
        chance, changed = self._chance, bytearray(data)
        n = (len(data) - RANGES - 4) // 4
        way = chance.random()
        if way < 0.3:
            for at in chance.sample(range(GEOMETRY, RANGES - 4, 4), chance.choice((1, 1, 2))):
                struct.pack_into("<f", changed, at, chance.choice(NUMBERS))
        elif way < 0.6:
            for i in chance.choices(range(n), k=chance.choice((1, 5, 50, n))):
                number = chance.choice((*NUMBERS, chance.uniform(0, 40)))
                struct.pack_into("<f", changed, RANGES + 4 * i, number)
        elif way < 0.7:
            changed[RANGES : RANGES + 4 * n] = n * struct.pack("<f", chance.choice(NUMBERS))
        elif way < 0.8:
            times = chance.choice((1e-5, 0.1, -1e-4, 1e20)), chance.choice((0.1, -0.1, 1e30))
            struct.pack_into("<2f", changed, GEOMETRY + 12, *times)
        else:
            return damaged(data, chance, other)
        if chance.random() < 0.2:
            struct.pack_into("<iI", changed, 4, *chance.choice(STAMPS))
        return bytes(changed)

    def _odometry(self) -> bytes:
        # Aligned as CDR has it: the pose begins at a multiple of 8.
        head = struct.pack("<iII8sI5s3x", 5, 0, 5, b"odom", 5, b"base")
        pose = struct.pack("<7d", *[0.0] * 6, 1.0)
        speeds = self._chance.choices((0.0, 1.0, -0.5, 30.0, 1e3, 1e300, float("nan")), k=3)
        twist = struct.pack("<6d", *speeds[:2], 0.0, 0.0, 0.0, speeds[2])
        return b"\0\1\0\0" + head + pose + bytes(288) + twist + bytes(288)


def sound_messages() -> list[bytes]:
    make, messages = RosMessages("cdr"), []
    for i, scan in enumerate(drive(room(), [(-2, 0), (0, 0)], SENSORS["lms181"], speed=1, rate=10)):
        scan = ln.LaserScan(
            *(scan.ranges, scan.angle_min, scan.angle_increment),
            range_max=30.0,
            time_increment=(0.0, 1e-4, -1e-4)[i % 3],
        )
        message = make.scan("/scan", Moment(5, 10**8 * (i % 10), "laser", "map"), scan)
        assert message.data[12:22] == b"\6\0\0\0laser\0"
        (n,) = struct.unpack_from("<I", message.data, RANGES - 4)
        assert n == len(scan)
        messages.append(message.data)
    return messages


@pytest.mark.slow
@pytest.mark.parametrize(
    "config",
    [
        LiveConfig(),
        LiveConfig(track=True, deskew="scans"),
        LiveConfig(deskew="/odom", laser_pose=(0.2, 0.1, 1.0)),
        LiveConfig(track=True, method="liu", noise=0.01),
    ],
    ids=["optimal", "scans", "odom", "liu"],
)
def test_no_message_ends_a_node(config):
    taken, told = Taken(), []
    sinks = [RosSink(taken, RosMessages("cdr"), "/scan", "lineament", tells_scan=True)]
    try:
        from lineament.output.foxglove import FoxgloveMessages
    except ImportError:
        pass
    else:
        sinks.append(FoxgloveSink(taken, FoxgloveMessages(), "/scan"))
    n = 800
    report = Node(Damaging(n, 3), Pipeline(config), sinks, tell=told.append).run()
    assert report.total_scans > n // 4
    assert report.total_malformed > n // 10
    assert report.total_scans <= n
    assert taken.n >= 3 * report.total_scans
    # Who tells nonsense is told of once, in a line.
    faults = [line.partition(" makes no sense: ")[0] for line in told if "sense" in line]
    assert sorted(faults) == ["a scan of a", "a scan of b", "an odometry of o"]
    assert not any("\n" in line for line in told)
