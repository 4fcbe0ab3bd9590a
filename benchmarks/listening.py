"""Topics of ROS 2 as another program hears them, each message as it came."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from dds_peer import CONFIGURATION, KINDS, idl, made

__all__ = ["Listener", "idl", "made", "take_part"]


def take_part(domain: int) -> tuple[Domain, DomainParticipant]:
    """Take part in a domain over loopback, as long as both that are returned are kept."""
    return Domain(domain, CONFIGURATION.format(lease="10s")), DomainParticipant(domain)


class Listener:
    """Hears topics, given with the names of their types: messages are not taken apart."""

    def __init__(self, domain: int, topics: dict[str, str]) -> None:
        self._domain, participant = take_part(domain)
        qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000))
        self._waiting, self._readers = WaitSet(participant), {}
        for topic, kind in topics.items():
            name = kind.rpartition("/")[2]
            known = idl(f"{KINDS[name]}/msg/{name}")
            known.deserialize = classmethod(_kept)
            reader = DataReader(participant, Topic(participant, f"rt{topic}", known), qos)
            state = ViewState.Any | SampleState.NotRead | InstanceState.Any
            self._waiting.attach(ReadCondition(reader, state))
            self._readers[topic] = reader

    def hear(self) -> list[tuple[str, bytes]]:
        """Wait for a tenth of a second at most; topics and messages, in CDR."""
        self._waiting.wait(duration(milliseconds=100))
        return [
            (topic, sample.data)
            for topic, reader in self._readers.items()
            for sample in reader.take(100)
            if hasattr(sample, "data")  # What has none tells that a publisher has gone.
        ]


def _kept(kind: Any, data: bytes, **_: Any) -> Any:
    message = kind.__new__(kind)
    message.data = data
    return message
