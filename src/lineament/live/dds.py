"""ROS 2 without ROS: its topics over DDS, by Cyclone DDS."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import InstanceState, ReadCondition, WaitSet
from cyclonedds.qos import Policy, Qos

from ..errors import one_line
from ..output.scene import Message
from .decoding import received_odometry, received_scan
from .participant import Participant, close_entity
from .raw_dds import ANY_STATE, RawReader, RawWriter
from .received import Received
from .ros_names import HASHES, ros_type, wire_topic, wire_type

__all__ = ["DdsPublisher", "DdsSource", "Participant"]

NANO = 1_000_000_000
SCAN, ODOMETRY = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"
#: A writer waits this long for a slow reader [ns], then gives the message up.
PATIENCE = NANO // 1000
#: Publishers that are looked at in one go.
MOST_PUBLISHERS = 1000
#: What the standard calls the policy of reliability.
_RELIABILITY = 11


class DdsSource:
    """Scans, and odometry where it is wanted, from topics of ROS 2.

    Parameters
    ----------
    participant : Participant
        Who listens.
    topic : str
        Topic of the scans.
    kind : {"sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan"}
        Its type.
    echo : {"first", "last", "strongest"}
        Which echo of each beam, where there are several.
    odometry : str, optional
        Topic of ``nav_msgs/msg/Odometry``.
    reliability : {"best-effort", "reliable"}
        Best effort matches any publisher. A reliable one sends again what the network has lost.
    depth : int
        How many messages of a topic may wait for `receive`. If more come, best effort counts the
        newest as lost; reliable forgets the oldest.

    Raises
    ------
    LineamentError
        If a topic has no name of ROS 2.
    """

    #: A robot may always publish again.
    ended = False

    def __init__(
        self,
        participant: Participant,
        topic: str,
        kind: str = SCAN,
        *,
        echo: str = "first",
        odometry: str | None = None,
        reliability: str = "best-effort",
        depth: int = 64,
    ) -> None:
        open_topic = partial(_Subscription, participant, reliability=reliability, depth=depth)
        scan = partial(received_scan, encoding="cdr", kind=kind.replace("/msg/", "/"), echo=echo)
        self._scans = open_topic(topic, kind, scan)
        self._topics = [self._scans]
        if odometry is not None:
            # Before the scans, which find the motion that came with them.
            motion = partial(received_odometry, encoding="cdr")
            self._topics.insert(0, open_topic(odometry, ODOMETRY, motion))
        self._arrivals = WaitSet(participant.entity)
        for subscription in self._topics:
            self._arrivals.attach(subscription.condition)
        self._found = BuiltinDataReader(participant.entity, BuiltinTopicDcpsPublication)

    @property
    def publishers(self) -> int:
        """How many publishers of scans there are. One that is killed counts until its lease ends.

        It is the publisher that tells how long that is: 10 s unless it is configured.
        """
        return int(self._scans.reader.get_subscription_matched_status().current_count)

    @property
    def lost(self) -> int:
        """Scans that came and found no place. What the network loses best effort does not know."""
        reader = self._scans.reader
        return int(
            reader.get_sample_rejected_status().total_count
            + reader.get_sample_lost_status().total_count
        )

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` [s] for messages; give all that came: odometry, then scans.

        A signal does not end the wait: it is handled when the wait is over.
        """
        self._arrivals.wait(round(max(timeout, 0.0) * NANO))
        return [message for subscription in self._topics for message in subscription.take()]

    def problems(self) -> list[str]:
        """Tell, one line each, what was found since the last call that keeps messages away."""
        found = _publishers(self._found)
        return [line for topic in self._topics for line in topic.problems(found)]

    def close(self) -> None:
        """End the subscriptions; publishers see it at once."""
        for entity in (self._arrivals, self._found, *(topic.reader for topic in self._topics)):
            close_entity(entity)


class _Subscription:
    """A topic that is listened to."""

    def __init__(
        self,
        participant: Participant,
        topic: str,
        kind: str,
        make: Callable[[str, bytes], Received],
        *,
        reliability: str,
        depth: int,
    ) -> None:
        self._topic, self._kind, self._make = topic, kind, make
        qos = _reader_qos(kind, reliability, depth)
        self.reader = RawReader(participant.entity, participant.topic(topic, kind), qos, depth)
        self.condition = ReadCondition(self.reader, ANY_STATE)

    def take(self) -> list[Received]:
        return [self._make(f"{publisher:x}", data) for data, publisher in self.reader.take_raw()]

    def problems(self, found: list[tuple[str, str]]) -> list[str]:
        name = wire_topic(self._topic)
        lines = [
            f"{self._topic} is published as {one_line(ros_type(kind))}, expected {self._kind}"
            for topic, kind in found
            if topic == name and kind != wire_type(self._kind)
        ]
        status = self.reader.get_requested_incompatible_qos_status()
        if status.total_count_change:
            why = (
                "as best effort, expected reliable"
                if status.last_policy_id == _RELIABILITY
                else f"with another QoS policy {status.last_policy_id}, expected the default"
            )
            lines.append(f"{self._topic} is published {why}")
        return lines


class DdsPublisher:
    """Publishes messages to topics of ROS 2, reliably; who comes later has what comes later.

    Parameters
    ----------
    participant : Participant
        Who publishes.
    depth : int
        How many of the newest messages of a topic are kept for a reader that is behind. One that
        does not read at all holds nobody up: it misses messages.

    Attributes
    ----------
    unsent : int
        Messages that could not be sent.
    """

    def __init__(self, participant: Participant, depth: int = 1) -> None:
        self._participant, self._depth = participant, depth
        self._writers: dict[str, RawWriter] = {}
        self.unsent = 0

    def advertise(self, topic: str, kind: str) -> None:
        """Tell of a topic before there is a message for it.

        Raises
        ------
        LineamentError
            If `topic` is no name of a topic.
        """
        self._writer(topic, kind)

    def listeners(self, topic: str) -> int:
        """How many listen to a topic; 0 for one that is not advertised."""
        if topic not in self._writers:
            return 0
        return self._writers[topic].listeners

    def publish(self, message: Message) -> None:
        """Send a message in CDR.

        Raises
        ------
        LineamentError
            If its topic has no name of ROS 2.
        """
        if not self._writer(message.topic, message.kind).write_raw(message.data):
            self.unsent += 1

    def close(self) -> None:
        """End the topics; listeners see it at once."""
        for writer in self._writers.values():
            close_entity(writer)
        self._writers.clear()

    def _writer(self, topic: str, kind: str) -> RawWriter:
        if topic not in self._writers:
            participant = self._participant
            qos = _qos(
                kind,
                Policy.Reliability.Reliable(PATIENCE),
                Policy.History.KeepLast(self._depth),
            )
            self._writers[topic] = RawWriter(
                participant.entity, participant.topic(topic, kind), qos
            )
        return self._writers[topic]


def _reader_qos(kind: str, reliability: str, depth: int) -> Qos:
    if reliability == "reliable":
        # Not to keep all: that would make the publisher wait.
        return _qos(kind, Policy.Reliability.Reliable(PATIENCE), Policy.History.KeepLast(depth))
    return _qos(
        kind,
        Policy.Reliability.BestEffort,
        Policy.History.KeepAll,
        Policy.ResourceLimits(max_samples=depth),
    )


def _qos(kind: str, *policies: object) -> Qos:
    type_hash = f"typehash={HASHES[kind]};".encode()
    return Qos(*policies, Policy.Durability.Volatile, Policy.Userdata(type_hash))


def _publishers(reader: BuiltinDataReader) -> list[tuple[str, str]]:
    """Topics and types of the publishers that are new."""
    try:
        found = reader.take(MOST_PUBLISHERS)
    except Exception:  # The binding raises this, bare, for one that it cannot describe.
        return []
    return [
        (endpoint.topic_name, endpoint.type_name)
        for endpoint in found
        if endpoint.sample_info.instance_state == InstanceState.Alive
    ]
