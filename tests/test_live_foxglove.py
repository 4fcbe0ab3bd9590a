"""The WebSocket server for Foxglove, seen by a client that shares nothing with it."""

from __future__ import annotations

import base64
import math
import socket
import struct
import time
from collections.abc import Callable, Iterator

import pytest
from foxglove_client import FoxgloveClient
from protobuf import decode, messages_of

import lineament as ln
from lineament import LineamentError
from lineament.live.foxglove import FoxgloveServer
from lineament.output.foxglove import FoxgloveMessages
from lineament.output.markers import markers_of
from lineament.output.scene import Message, Moment, layers_of

DEADLINE = 30.0
MOMENT = Moment(5, 500_000_000, "laser", "map")


@pytest.fixture
def server() -> Iterator[FoxgloveServer]:
    server = FoxgloveServer(port=0, name="test")
    yield server
    server.close()


@pytest.fixture
def client(server: FoxgloveServer) -> Iterator[FoxgloveClient]:
    client = FoxgloveClient(port_of(server))
    yield client
    client.close()


def port_of(server: FoxgloveServer) -> int:
    return int(server.address.rpartition(":")[2])


def until(ask: Callable[[], object]) -> None:
    end = time.monotonic() + DEADLINE
    while not ask():
        assert time.monotonic() < end, f"{ask} was never true"
        time.sleep(0.01)


def wall_of_five_beams() -> tuple[ln.LaserScan, Message]:
    """A scan of a wall 2 m ahead, and the scene of what is found in it."""
    scan = ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01)
    layers = layers_of(markers_of(ln.extract(scan), scan))
    return scan, FoxgloveMessages().features("/scan/features", MOMENT, layers)


def read(client: FoxgloveClient, topic: str) -> dict:
    """Take a message, by the schema that the server told."""
    channel = client.channels[topic]
    number, data = client.take_message()
    assert number == channel["id"]
    assert channel["encoding"] == channel["schemaEncoding"] == "protobuf"
    schema = messages_of(base64.b64decode(channel["schema"]))
    return decode(data, f".{channel['schemaName']}", schema)


def test_scene_is_read_by_another_client(server, client):
    assert client.server["op"] == "serverInfo"
    assert client.server["name"] == "test"
    _, message = wall_of_five_beams()
    server.advertise(message.topic, message.kind)
    client.subscribe(message.topic)
    until(lambda: server.listeners(message.topic) == 1)
    server.publish(message)
    scene = read(client, message.topic)
    entities = {entity["id"]: entity for entity in scene["entities"]}
    assert list(entities) == ["segments", "arcs", "corners", "edges", "ellipses"]
    wall = entities["segments"]
    assert wall["frame_id"] == "laser"
    assert wall["timestamp"] == {"seconds": 5, "nanos": 500_000_000}
    (line,) = wall["lines"]
    ends = [(end.get("x", 0.0), end.get("y", 0.0)) for end in line["points"]]
    assert ends == [pytest.approx((2.0, -0.04), abs=1e-3), pytest.approx((2.0, 0.04), abs=1e-3)]


@pytest.mark.parametrize(("stamp", "told"), [((-1, 5), 0), ((2**32 - 1, 2**32 - 1), 2**31 + 3)])
def test_a_stamp_that_is_none_is_the_first_or_the_last(server, client, stamp, told):
    message = FoxgloveMessages().transform("/tf", Moment(*stamp, "laser", "map"), (0.0, 0.0, 0.0))
    server.advertise(message.topic, message.kind)
    client.subscribe(message.topic)
    until(lambda: server.listeners(message.topic) == 1)
    server.publish(message)
    assert read(client, "/tf")["timestamp"].get("seconds", 0) == told


def test_scan_and_pose_beside_it(server, client):
    make = FoxgloveMessages()
    scan, _ = wall_of_five_beams()
    sent = [make.transform("/tf", MOMENT, (1.0, 2.0, math.pi)), make.scan("/scan", MOMENT, scan)]
    for message in sent:
        server.advertise(message.topic, message.kind)
        client.subscribe(message.topic)
    until(lambda: all(server.listeners(message.topic) for message in sent))
    for message in sent:
        server.publish(message)
    transform, told = read(client, "/tf"), read(client, "/scan")
    assert transform["translation"] == {"x": 1.0, "y": 2.0}
    assert transform["rotation"]["z"] == pytest.approx(1.0)
    assert told["ranges"] == [2.0] * 5


def test_first_message_advertises_its_topic(server, client):
    _, message = wall_of_five_beams()
    assert server.listeners(message.topic) == 0
    server.publish(message)
    client.subscribe(message.topic)
    until(lambda: server.listeners(message.topic))
    server.publish(message)
    assert len(read(client, message.topic)["entities"]) == 5


def test_listeners_come_and_go(server, client):
    server.advertise("/scan", "LaserScan")
    client.subscribe("/scan")
    until(lambda: server.listeners("/scan") == 1)
    other = FoxgloveClient(port_of(server))
    other.subscribe("/scan")
    until(lambda: server.listeners("/scan") == 2)
    client.unsubscribe("/scan")
    until(lambda: server.listeners("/scan") == 1)
    other.close()
    until(lambda: server.listeners("/scan") == 0)


def test_viewer_that_stands_still_delays_nobody(server, client):
    server.advertise("/scan", "LaserScan")
    client.subscribe("/scan")
    until(lambda: server.listeners("/scan"))
    for k in range(300):  # far more than what sockets hold
        server.publish(Message("/scan", "LaserScan", struct.pack("<I", k) + bytes(1_000_000)))
    kept = [-1]
    while kept[-1] != 299:
        kept += struct.unpack_from("<I", client.take_message()[1])
    assert kept == sorted(kept)
    assert len(kept) < 300
    assert server.listeners("/scan") == 1


def test_client_sees_the_end(client, server):
    server.close()
    with pytest.raises((EOFError, ConnectionError)):
        client.take_message()  # texts are passed over
    server.publish(wall_of_five_beams()[1])  # nobody is there


def test_port_that_is_taken():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(LineamentError, match=rf"^Foxglove .* 127.0.0.1, port {port}: Address"):
            FoxgloveServer(port=port)


@pytest.mark.parametrize(("host", "port"), [("nobody.invalid", 0), ("127.0.0.1", 70_000)])
def test_address_that_is_none(host, port):
    with pytest.raises(
        LineamentError, match=rf"^Foxglove cannot be served at {host}, port {port}: "
    ):
        FoxgloveServer(host, port)
