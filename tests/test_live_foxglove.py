"""The WebSocket server for Foxglove, seen by a client that shares nothing with it."""

import math
import socket
import struct

import pytest
from foxglove_client import FoxgloveClient
from live_driving import eventually

import lineament as ln
from lineament import LineamentError
from lineament.live.foxglove import FoxgloveServer
from lineament.output.foxglove import FoxgloveMessages
from lineament.output.markers import markers_of
from lineament.output.scene import Message, Moment, layers_of

MOMENT = Moment(5, 500_000_000, "laser", "map")
MAKE = FoxgloveMessages()


@pytest.fixture
def server():
    server = FoxgloveServer(port=0, name="test")
    yield server
    server.close()


@pytest.fixture
def connect(server):
    clients = []

    def connected():
        clients.append(FoxgloveClient(int(server.address.rpartition(":")[2])))
        return clients[-1]

    yield connected
    for client in clients:
        client.close()


@pytest.fixture
def client(connect):
    return connect()


def wall_of_five_beams():
    """A scan of a wall 2 m ahead, and the scene of what is found in it."""
    scan = ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01)
    layers = layers_of(markers_of(ln.extract(scan), scan))
    return scan, MAKE.features("/scan/features", MOMENT, layers)


def received(server, client, *messages):
    """Publish messages to a client that has subscribed to them, and what it reads of them."""
    for message in messages:
        server.advertise(message.topic, message.kind)
        client.subscribe(message.topic)
    eventually(lambda: all(server.listeners(message.topic) == 1 for message in messages))
    for message in messages:
        server.publish(message)
    return [client.take_decoded(message.topic) for message in messages]


def test_scan_pose_and_scene_are_read_by_another_client(server, client):
    assert (client.server["op"], client.server["name"]) == ("serverInfo", "test")
    scan, scene = wall_of_five_beams()
    assert server.listeners(scene.topic) == 0
    server.publish(scene)  # nobody listens yet, but it advertises the topic
    transform = MAKE.transform("/tf", MOMENT, (1.0, 2.0, math.pi))
    sent = transform, MAKE.scan("/scan", MOMENT, scan), scene
    transform, scanned, scene = received(server, client, *sent)
    assert transform["translation"] == {"x": 1.0, "y": 2.0}
    assert transform["rotation"]["z"] == pytest.approx(1.0)
    assert scanned["ranges"] == [2.0] * 5
    assert len(scene["entities"]) == 5
    (line,) = scene["entities"][0]["lines"]
    ends = [(end.get("x", 0.0), end.get("y", 0.0)) for end in line["points"]]
    assert ends == [pytest.approx((2.0, -0.04), abs=1e-3), pytest.approx((2.0, 0.04), abs=1e-3)]


@pytest.mark.parametrize(("stamp", "shown"), [((-1, 5), 0), ((2**32 - 1, 2**32 - 1), 2**31 + 3)])
def test_an_impossible_stamp_is_the_first_or_the_last(server, client, stamp, shown):
    message = MAKE.transform("/tf", Moment(*stamp, "laser", "map"), (0.0, 0.0, 0.0))
    (found,) = received(server, client, message)
    assert found["timestamp"].get("seconds", 0) == shown


def test_listeners_come_and_go(server, client, connect):
    server.advertise("/scan", "LaserScan")
    server.advertise("/points", "PointCloud")
    client.subscribe("/scan")
    eventually(lambda: server.listeners("/scan") == 1)
    other = connect()
    other.subscribe("/scan")
    client.unsubscribe("/scan")
    other.subscribe("/points")
    eventually(lambda: server.listeners("/points") == 1)  # after what came before it
    assert server.listeners("/scan") == 1
    other.close()
    eventually(lambda: server.listeners("/scan") == 0)


def test_viewer_that_stands_still_delays_nobody(server, client):
    server.advertise("/scan", "LaserScan")
    client.subscribe("/scan")
    eventually(lambda: server.listeners("/scan"))
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


def test_addresses_that_cannot_be_served():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(LineamentError, match=rf"^Foxglove .* 127.0.0.1, port {port}: Address"):
            FoxgloveServer(port=port)
    for host, port in (("nobody.invalid", 0), ("127.0.0.1", 70_000)):
        expected = rf"^Foxglove cannot be served at {host}, port {port}: "
        with pytest.raises(LineamentError, match=expected):
            FoxgloveServer(host, port)
