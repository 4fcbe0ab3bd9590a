"""ROS 2 without ROS: its topics over DDS, by Cyclone DDS."""

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import InstanceState, ReadCondition, WaitSet
from cyclonedds.qos import Policy, Qos

from ..errors import one_line
from ..output.scene import Message
from ..scan.fields import NANO
from .config import LiveConfig
from .participant import Participant, ros_type, type_hash, wire_topic, wire_type
from .publisher import Publisher
from .raw_dds import ANY_STATE, RawReader, RawWriter
from .received import SCAN, Received, Wanted, wanted

#: A writer waits this long for a slow reader [ns], then drops the message.
PATIENCE = NANO // 1000
#: Publishers that are examined at once.
MOST_PUBLISHERS = 1000
#: Number of the reliability policy in the standard.
_RELIABILITY = 11


class DdsSource:
    """Scans, and odometry where it is wanted, from topics of ROS 2.

    Best effort matches any publisher; a reliable one sends again what the network has lost. Up to
    `depth` messages of a topic wait for `receive`. Beyond, best effort counts the newest as lost,
    and reliable forgets the oldest.
    """

    #: A robot may always publish again.
    ended = False

    def __init__(self, participant: Participant, config: LiveConfig, depth: int = 64) -> None:
        topics = [
            _Subscription(participant, one, config.reliability, depth) for one in wanted(config)
        ]
        self._scans = [one for one in topics if one.is_scan]
        # The scans come last, which need what came with them; of several, those of the first.
        self._topics = [*(one for one in topics if not one.is_scan), *self._scans[::-1]]
        self._arrivals = WaitSet(participant.entity)
        for subscription in self._topics:
            self._arrivals.attach(subscription.condition)
        self._found = BuiltinDataReader(participant.entity, BuiltinTopicDcpsPublication)

    @property
    def publishers(self) -> int:
        """Number of publishers of scans.

        One that is killed counts until its lease ends, 10 s unless it is configured otherwise.
        """
        status = [one.reader.get_subscription_matched_status() for one in self._scans]
        return sum(int(one.current_count) for one in status)

    @property
    def lost(self) -> int:
        """Scans that came when the depth was used up. Losses of the network are not known."""
        return sum(
            int(
                one.reader.get_sample_rejected_status().total_count
                + one.reader.get_sample_lost_status().total_count
            )
            for one in self._scans
        )

    def receive(self, timeout: float) -> list[Received]:
        """Wait up to `timeout` [s] for messages; return all that came: scans last.

        A signal does not end the wait: it is handled when the wait is over.
        """
        self._arrivals.wait(round(max(timeout, 0.0) * NANO))
        # Scans are taken first, and returned last: what was sent before them has come by then.
        taken = [subscription.take() for subscription in self._topics[::-1]]
        return [message for messages in taken[::-1] for message in messages]

    def problems(self) -> list[str]:
        """Return what was found since the last call that keeps messages away, a line each."""
        found = _publishers(self._found)
        return [line for topic in self._topics for line in topic.problems(found)]


class _Subscription:
    """A topic that is listened to."""

    def __init__(
        self, participant: Participant, wanted: Wanted, reliability: str, depth: int
    ) -> None:
        self._wanted, self.is_scan = wanted, wanted.what == SCAN
        self._kind = kind = wanted.kind.replace("/", "/msg/")
        policies = [Policy.Reliability.BestEffort, Policy.History.KeepLast(depth)]
        if wanted.is_command or reliability == "reliable":
            # Not to keep all of what is reliable: that would make the publisher wait.
            policies[0] = Policy.Reliability.Reliable(PATIENCE)
        elif self.is_scan:
            policies[1:] = Policy.History.KeepAll, Policy.ResourceLimits(max_samples=depth)
        opened = participant.topic(wanted.topic, kind)
        self.reader = RawReader(
            participant.entity, opened, _qos(kind, wanted.is_latched, *policies), depth
        )
        self.condition = ReadCondition(self.reader, ANY_STATE)

    def take(self) -> list[Received]:
        return [
            self._wanted.received(f"{publisher:x}", data, "cdr")
            for data, publisher in self.reader.take_raw()
        ]

    def problems(self, found: list[tuple[str, str]]) -> list[str]:
        name = self._wanted.topic
        lines = [
            f"{name} is published as {one_line(ros_type(kind))}, expected {self._kind}"
            for topic, kind in found
            if topic == wire_topic(name) and kind != wire_type(self._kind)
        ]
        status = self.reader.get_requested_incompatible_qos_status()
        if status.total_count_change:
            expected = "transient local (latched)" if self._wanted.is_latched else "the default"
            why = (
                "as best effort, expected reliable"
                if status.last_policy_id == _RELIABILITY
                else f"with another QoS policy {status.last_policy_id}, expected {expected}"
            )
            lines.append(f"{name} is published {why}")
        return lines


class DdsPublisher(Publisher):
    """Publishes messages in CDR to topics of ROS 2, reliably; volatile, unless they are latched.

    The newest `depth` messages of a topic are kept for a slow reader. One that does not read at all
    delays nobody: it misses messages.
    """

    def __init__(self, participant: Participant, depth: int = 1) -> None:
        super().__init__()
        self._participant, self._depth = participant, depth

    def _open(self, topic: str, kind: str) -> RawWriter:
        is_latched = topic in self._latched
        history = Policy.History.KeepLast(1 if is_latched else self._depth)
        qos = _qos(kind, is_latched, Policy.Reliability.Reliable(PATIENCE), history)
        participant = self._participant
        return RawWriter(participant.entity, participant.topic(topic, kind), qos)

    def _send(self, topic: RawWriter, message: Message) -> None:
        self.unsent += not topic.write_raw(message.data)

    def _count(self, topic: RawWriter) -> int:
        return topic.listeners


def _qos(kind: str, is_latched: bool, *policies: object) -> Qos:
    identity = Policy.Userdata(f"typehash={type_hash(kind)};".encode())
    durability = Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile
    return Qos(*policies, durability, identity)


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
