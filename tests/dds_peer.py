"""Another program on the same DDS topics: it knows lineament by what is on the wire only.

Its types are made from the definitions that rosbags has. `live_driving.Remote` runs it in another
process, where one is to be killed or stopped.
"""

import time
from dataclasses import asdict
from functools import cache
from typing import Any, get_args

from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, annotations, make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from ros_bags import store

CONFIGURATION = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><LeaseDuration>{lease}</LeaseDuration>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""

KINDS = {
    **dict.fromkeys(("LaserScan", "MultiEchoLaserScan", "PointCloud2"), "sensor_msgs"),
    **dict.fromkeys(("PoseArray", "PoseStamped", "PoseWithCovarianceStamped"), "geometry_msgs"),
    "MarkerArray": "visualization_msgs",
    **dict.fromkeys(("OccupancyGrid", "Odometry"), "nav_msgs"),
    "TFMessage": "tf2_msgs",
    "DiagnosticArray": "diagnostic_msgs",
    "Empty": "std_msgs",
}


@cache
def idl(kind: str) -> Any:
    """Make the type of Cyclone DDS of a message: ``sensor_msgs/msg/LaserScan``."""
    package, _, name = kind.split("/")
    fields = {field: _field(*form) for field, form in store(2).fielddefs[kind][1]}
    made = make_idl_struct(name, f"{package}::msg::dds_::{name}_", fields)
    return annotations.final(made)


def _field(form: int, content: Any) -> Any:
    """Translate the type of a field, by the numbers of rosbags' `Nodetype`."""
    if form == 1:
        base = {"string": str, "bool": bool, "byte": types.uint8}
        return base.get(content[0]) or getattr(types, content[0])
    if form == 2:
        return idl(content)
    element, size = content
    return types.array[_field(*element), size] if form == 3 else types.sequence[_field(*element)]


class Peer:
    """A participant in a domain, with writers and readers by the names of their topics."""

    def __init__(self, domain: int, lease: str = "10s") -> None:
        self._domain = Domain(domain, CONFIGURATION.format(lease=lease))
        self._participant = DomainParticipant(domain)
        self._writers: dict[str, Any] = {}
        self._readers: dict[str, Any] = {}

    def publish(
        self, topic: str, kind: str, reliable: bool = True, is_latched: bool = False
    ) -> None:
        """Begin to publish."""
        qos = _qos(reliable, is_latched=is_latched)
        self._writers[topic] = DataWriter(self._participant, self._topic(topic, kind), qos)

    def listen(self, topic: str, kind: str, depth: int = 10, is_latched: bool = False) -> None:
        """Begin to listen; the newest messages wait until they are taken, `depth` of them."""
        qos = _qos(True, depth, is_latched)
        self._readers[topic] = DataReader(self._participant, self._topic(topic, kind), qos)

    def garble(self, topic: str, kind: str) -> None:
        """Begin to publish bytes under the name of a type: the binding itself would refuse them."""
        from lineament.live.raw_dds import RawTopic, RawWriter

        name = self._topic(topic, kind).typename
        raw = RawTopic(self._participant, f"rt{topic}", name)
        self._writers[topic] = RawWriter(self._participant, raw, _qos(True))

    def listeners(self, topic: str) -> int:
        return int(self._writers[topic].get_publication_matched_status().current_count)

    def write(self, topic: str, message: dict[str, Any] | bytes) -> None:
        writer = self._writers[topic]
        if isinstance(message, bytes):
            assert writer.write_raw(message)
        else:
            writer.write(made(writer.data_type, message))

    def write_scans(self, topic: str, n: int, rate: float, scan: dict[str, Any]) -> None:
        """Write a scan `n` times, its number as its stamp."""
        message = made(self._writers[topic].data_type, scan)
        start = time.perf_counter()
        for i in range(n):
            message.header.stamp.sec = i
            self._writers[topic].write(message)
            time.sleep(max(0.0, start + (i + 1) / rate - time.perf_counter()))

    def take(self, topic: str) -> list[dict[str, Any]]:
        """Take what has come."""
        messages = self._readers[topic].take(10_000)
        return [asdict(m) for m in messages if isinstance(m, IdlStruct)]

    def user_data(self, topic: str) -> list[str]:
        """What the publishers of a topic say of themselves."""
        reader = self._readers[topic]
        found = [reader.get_matched_publication_data(handle) for handle in reader.matched_pub]
        return [endpoint.qos[Policy.Userdata].data.decode() for endpoint in found]

    def close(self) -> None:
        for entity in (self._participant, self._domain):
            entity.__del__()

    def _topic(self, topic: str, kind: str) -> Topic:
        return Topic(self._participant, f"rt{topic}", idl(f"{KINDS[kind]}/msg/{kind}"))


def _qos(reliable: bool, depth: int = 10, is_latched: bool = False) -> Qos:
    reliability = Policy.Reliability.Reliable(duration(seconds=1))
    if not reliable:
        reliability = Policy.Reliability.BestEffort
    durability = Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile
    return Qos(reliability, durability, Policy.History.KeepLast(depth))


def made(kind: Any, value: Any) -> Any:
    """Make a message from dictionaries and lists; what is missing is 0 or empty."""
    if isinstance(kind, type) and issubclass(kind, IdlStruct):
        given = value or {}
        return kind(**{name: made(t, given.get(name)) for name, t in kind.__annotations__.items()})
    base, form = (get_args(kind) or (kind, None))[:2]
    if isinstance(form, types.sequence):
        return [made(form.subtype, item) for item in value or ()]
    if isinstance(form, types.array):
        return value or [0.0] * form.length
    return base() if value is None else value
