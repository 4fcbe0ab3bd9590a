"""Taking part in a DDS domain, by Cyclone DDS."""

from __future__ import annotations

import os
import re

from cyclonedds.core import DDSException, Entity
from cyclonedds.domain import Domain, DomainParticipant

from ..errors import LineamentError, one_line
from .raw_dds import RawTopic
from .ros_names import wire_topic, wire_type

__all__ = ["Participant", "close_entity"]

#: The highest domain whose ports are below 65536.
LAST_DOMAIN = 232

#: Others are asked for at their ports, for loopback seldom has multicast. What CYCLONEDDS_URI says
#: comes behind, as with ROS 2's own binding.
_LOCALHOST = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>,"""


class Participant:
    """Takes part in a DDS domain, for one source and publishers.

    Parameters
    ----------
    domain : int, optional
        Number of the domain, 0 to 232. Without, that of the environment (ROS_DOMAIN_ID), else 0.
    localhost : bool
        Talk to this computer only, over loopback, with multicast or without. Otherwise Cyclone
        DDS chooses the interface. What CYCLONEDDS_URI says in the environment holds in both cases.

    Raises
    ------
    LineamentError
        If the domain is no such number, or if Cyclone DDS cannot begin: without a network, with a
        faulty configuration, or with `localhost` in a domain that this process already uses.
    """

    def __init__(self, domain: int | None = None, *, localhost: bool = False) -> None:
        self.domain = _checked(domain)
        self._configured: Domain | None = None
        try:
            if localhost:
                configuration = _LOCALHOST + os.environ.get("CYCLONEDDS_URI", "")
                self._configured = Domain(self.domain, configuration)
            self.entity = DomainParticipant(self.domain)
        except DDSException:
            raise LineamentError(
                f"DDS cannot begin in domain {self.domain}, expected a network, a domain that "
                "this process does not use yet and, in CYCLONEDDS_URI, nothing or a configuration"
            ) from None

    def topic(self, topic: str, kind: str) -> RawTopic:
        """Open a topic of ROS 2.

        Raises
        ------
        LineamentError
            If `topic` is no name of a topic.
        """
        if not re.fullmatch(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", topic, re.ASCII):
            raise LineamentError(
                f"topic is {one_line(topic)!r}, expected a name as in ROS 2: /front/scan"
            )
        return RawTopic(self.entity, wire_topic(topic), wire_type(kind))

    def close(self) -> None:
        """Leave the domain with all that is open in it; others see it at once."""
        close_entity(self.entity)
        if self._configured is not None:
            close_entity(self._configured)


def close_entity(entity: Entity) -> None:
    """Delete an entity of Cyclone DDS now, whoever still refers to it."""
    # It is what the last reference would do, and does nothing a second time.
    entity.__del__()


def _checked(domain: int | None) -> int:
    if domain is None:
        text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
        told, number = (
            f"ROS_DOMAIN_ID is {text!r}",
            int(text) if re.fullmatch("[0-9]+", text) else -1,
        )
    else:
        told, number = f"domain is {domain}", domain
    if not 0 <= number <= LAST_DOMAIN:
        raise LineamentError(f"{told}, expected 0 to {LAST_DOMAIN}")
    return number
