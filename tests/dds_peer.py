"""Another program on the same topics: it knows lineament by what is on the wire only.

It has types of its own and takes orders, one line of JSON each, on its standard input: the name of
a function below and its arguments. It answers each with one line of JSON.
"""

from __future__ import annotations

import ctypes
import json
import sys
import time
from dataclasses import asdict
from typing import Any, get_args, get_type_hints

import dds_types
from cyclonedds.core import DDSException, Entity
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.internal import DDS
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

CONFIGURATION = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><LeaseDuration>{lease}</LeaseDuration>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""


class Peer:
    """What the orders are about."""

    def __init__(self, domain: int, lease: str) -> None:
        self._domain = Domain(domain, CONFIGURATION.format(lease=lease))
        self._participant = DomainParticipant(domain)
        self._writers: dict[str, Any] = {}
        self._readers: dict[str, Any] = {}

    def publish(self, topic: str, kind: str, reliable: bool = True) -> None:
        """Begin to publish."""
        known = Topic(self._participant, topic, getattr(dds_types, kind))
        self._writers[topic] = DataWriter(self._participant, known, _qos(reliable))

    def listen(self, topic: str, kind: str, reliable: bool = True, depth: int = 10) -> None:
        """Begin to listen; the newest messages wait until they are taken, `depth` of them."""
        known = Topic(self._participant, topic, getattr(dds_types, kind))
        self._readers[topic] = DataReader(self._participant, known, _qos(reliable, depth))

    def garble(self, topic: str, kind: str) -> None:
        """Begin to publish bytes under the name of a type."""
        self._writers[topic] = GarbageWriter(self._participant, topic, kind)

    def listeners(self, topic: str) -> int:
        return int(self._writers[topic].get_publication_matched_status().current_count)

    def write(self, topic: str, message: dict[str, Any]) -> None:
        writer = self._writers[topic]
        writer.write(_made(writer.data_type, message))

    def write_bytes(self, topic: str, data: str) -> None:
        self._writers[topic].write(bytes.fromhex(data))

    def write_scans(self, topic: str, n: int, rate: float, beams: int) -> None:
        """Write scans that carry their number as their stamp."""
        scan = dds_types.LaserScan(
            header=dds_types.Header(dds_types.Time(0, 0), "laser"),
            angle_min=-1.0,
            angle_max=1.0,
            angle_increment=2.0 / (beams - 1),
            time_increment=0.0,
            scan_time=0.025,
            range_min=0.1,
            range_max=30.0,
            ranges=[2.0] * beams,
            intensities=[],
        )
        start = time.perf_counter()
        for i in range(n):
            scan.header.stamp.sec = i
            self._writers[topic].write(scan)
            time.sleep(max(0.0, start + (i + 1) / rate - time.perf_counter()))

    def take(self, topic: str) -> list[dict[str, Any]]:
        """Take what has come."""
        messages = self._readers[topic].take(10_000)
        return [asdict(m) for m in messages if isinstance(m, IdlStruct)]

    def user_data(self, topic: str) -> list[str]:
        """What the publishers of a topic tell of themselves."""
        reader = self._readers[topic]
        found = [reader.get_matched_publication_data(handle) for handle in reader.matched_pub]
        return [endpoint.qos[Policy.Userdata].data.decode() for endpoint in found]


class _Meta(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_uint32))


class _Description(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_uint32) for name in ("size", "alignment", "flags", "n_keys")),
        ("name", ctypes.c_char_p),
        ("keys", ctypes.c_void_p),
        ("n_operations", ctypes.c_uint32),
        ("operations", ctypes.POINTER(ctypes.c_uint32)),
        ("meta", ctypes.c_char_p),
        ("information", _Meta),
        ("mapping", _Meta),
        ("representations", ctypes.c_uint32),
    )


class _Piece(ctypes.Structure):
    _fields_ = (("base", ctypes.c_char_p), ("size", ctypes.c_size_t))


class GarbageWriter(DataWriter[Any]):
    """Writes any bytes: the binding itself refuses what does not fit the type."""

    def __init__(self, participant: DomainParticipant, name: str, kind: str) -> None:
        library = DDS._dll_handle
        one_byte = (ctypes.c_uint32 * 3)(0x01_01_00_00, 0, 0)
        type_name = getattr(dds_types, kind).__idl_typename__.encode()
        description = _Description(1, 1, 0, 0, type_name, None, 2, one_byte)
        topic = Topic.__new__(Topic)
        topic.data_type, topic._keepalive_entities = bytes, [participant]
        made = library.dds_create_topic(
            participant._ref, ctypes.byref(description), name.encode(), None, None
        )
        Entity.__init__(topic, made)
        super().__init__(participant, topic, _qos(reliable=True))
        self._sertype = ctypes.c_void_p()
        library.dds_get_entity_sertype(self._ref, ctypes.byref(self._sertype))
        library.ddsi_serdata_from_ser_iov.restype = ctypes.c_void_p

    def write(self, data: bytes) -> None:
        library, piece = DDS._dll_handle, _Piece(data, len(data))
        size = ctypes.c_size_t(len(data))
        serialised = library.ddsi_serdata_from_ser_iov(
            self._sertype, 2, ctypes.c_size_t(1), ctypes.byref(piece), size
        )
        if not serialised:
            raise ValueError(data)
        result = library.dds_writecdr(self._ref, ctypes.c_void_p(serialised))
        if result:
            raise DDSException(result)


def _qos(reliable: bool, depth: int = 10) -> Qos:
    reliability = Policy.Reliability.Reliable(duration(seconds=1))
    if not reliable:
        reliability = Policy.Reliability.BestEffort
    return Qos(reliability, Policy.Durability.Volatile, Policy.History.KeepLast(depth))


def _made(kind: Any, value: Any) -> Any:
    """Make a message of dictionaries and lists."""
    if isinstance(kind, type) and issubclass(kind, IdlStruct):
        hints = get_type_hints(kind, include_extras=True)
        return kind(**{name: _made(hint, value[name]) for name, hint in hints.items()})
    if isinstance(value, list):
        element = get_args(kind)[1].subtype
        return [_made(element, item) for item in value]
    return value


def main() -> None:
    domain, lease = sys.argv[1:]
    peer = Peer(int(domain), lease)
    print(json.dumps("ready"), flush=True)
    for line in sys.stdin:
        order, *arguments = json.loads(line)
        print(json.dumps(getattr(peer, order)(*arguments)), flush=True)


if __name__ == "__main__":
    main()
