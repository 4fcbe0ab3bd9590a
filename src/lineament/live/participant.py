"""Taking part in a DDS domain by Cyclone DDS, and the names that ROS 2 has on the wire."""

import os
import re

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant

from ..errors import LineamentError, one_line
from .raw_dds import RawTopic

#: The highest domain whose ports are below 65536.
LAST_DOMAIN = 232

#: Others are searched at their ports, since loopback seldom has multicast. CYCLONEDDS_URI is
#: appended, as by ROS 2's own binding.
_LOCALHOST = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>,"""

#: Hashes of definitions by type (REP 2016, from Iron on; the definitions of Humble are equal).
_HASHES = {
    "DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "Empty": "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312",
    "LaserScan": "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    "MarkerArray": "86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    "MultiEchoLaserScan": "ba5eac341cd5bbb2701527aa4568e8baec172b69cadb9a1945d6f149d087ee48",
    "OccupancyGrid": "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
    "Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "PoseArray": "af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0",
    "PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "PoseWithCovarianceStamped": "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    "TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}


class Participant:
    """A participant in a DDS domain: 0 to 232, by default that of ROS_DOMAIN_ID.

    With `localhost` it stays on this computer, over loopback, with or without multicast. Otherwise
    Cyclone DDS chooses the interface. CYCLONEDDS_URI holds in both cases.
    """

    def __init__(self, domain: int | None = None, *, localhost: bool = False) -> None:
        self.domain = _domain_of_environment() if domain is None else domain
        if not 0 <= self.domain <= LAST_DOMAIN:
            raise LineamentError(f"domain is {domain}, expected 0 to {LAST_DOMAIN}")
        self._configured: Domain | None = None
        try:
            if localhost:
                configuration = _LOCALHOST + os.environ.get("CYCLONEDDS_URI", "")
                self._configured = Domain(self.domain, configuration)
            self.entity = DomainParticipant(self.domain)
        except DDSException:
            raise LineamentError(
                f"DDS cannot start in domain {self.domain}, expected a network, a domain that "
                "this process does not use yet and, in CYCLONEDDS_URI, nothing or a configuration"
            ) from None

    def topic(self, topic: str, kind: str) -> RawTopic:
        """Open a topic of ROS 2; LineamentError if `topic` is not a valid name."""
        if not re.fullmatch(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", topic, re.ASCII):
            raise LineamentError(
                f"topic is {one_line(topic)!r}, expected a name as in ROS 2: /front/scan"
            )
        return RawTopic(self.entity, wire_topic(topic), wire_type(kind))

    def close(self) -> None:
        """Leave the domain, and close all that is open in it; others see it at once."""
        for entity in (self.entity, self._configured):
            if entity is not None:
                # What the last reference would do, whoever else has one; a second time, nothing.
                entity.__del__()


def _domain_of_environment() -> int:
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not re.fullmatch("[0-9]+", text) or int(text) > LAST_DOMAIN:
        raise LineamentError(f"ROS_DOMAIN_ID is {text!r}, expected 0 to {LAST_DOMAIN}")
    return int(text)


def type_hash(kind: str) -> str:
    """Hash by which ROS 2 identifies the definition of a type: ``RIHS01_...``."""
    return f"RIHS01_{_HASHES[kind.rpartition('/')[2]]}"


def wire_topic(topic: str) -> str:
    """Name of a topic in DDS: ``rt/front/scan``."""
    return "rt/" + topic.removeprefix("/")


def wire_type(kind: str) -> str:
    """Name of a type in DDS: ``sensor_msgs::msg::dds_::LaserScan_``."""
    return kind.replace("/msg/", "::msg::dds_::") + "_"


def ros_type(type_name: str) -> str:
    """Name in ROS 2 of a type in DDS; the name of another type stays as it is.

    Examples
    --------
    >>> ros_type("sensor_msgs::msg::dds_::LaserScan_"), ros_type("Shape")
    ('sensor_msgs/msg/LaserScan', 'Shape')
    """
    package, is_ros, name = type_name.partition("::msg::dds_::")
    return f"{package}/msg/{name.removesuffix('_')}" if is_ros else type_name
