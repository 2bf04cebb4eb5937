"""Settings by which ROS 2 nodes find each other, read from the environment variables of ROS."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final
from xml.sax.saxutils import quoteattr

from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value

RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
LOCALHOST_ONLY: Final = "ROS_LOCALHOST_ONLY"
PEERS: Final = "ROS_STATIC_PEERS"

_RANGES: Final = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
_OTHERS: Final = {  # variables by which the middleware of a node cannot be reached through plain DDS
    "ROS_DISCOVERY_SERVER": "nodes that use a discovery server are not found by other means",
    "FASTDDS_BUILTIN_TRANSPORTS": "with SHM, Fast DDS uses shared memory only, which pretouch does not read; use UDPv4",
    "RMW_IMPLEMENTATION": "rmw_zenoh_cpp does not use DDS",
}
_CYCLONE: Final = "CYCLONEDDS_URI"  # the configuration of the DDS library
_MOST_PARTICIPANTS: Final = 119  # per computer and domain; a higher number would use the ports of the next domain
_LOOPBACK: Final = "127.0.0.1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Discovery(Value):
    """Settings by which ROS 2 nodes find each other.

    Args:
        reach: value of ROS_AUTOMATIC_DISCOVERY_RANGE: "SUBNET", "LOCALHOST", "OFF" or "SYSTEM_DEFAULT".
        is_localhost_only: whether ROS_LOCALHOST_ONLY is set; then only the loopback interface is used.
        peers: addresses in ROS_STATIC_PEERS.
        cyclone: value of CYCLONEDDS_URI.
        variables: the variables that are set, and others that can prevent discovery, as texts such as
            "ROS_STATIC_PEERS=192.0.2.7".
    """

    reach: str = "SUBNET"
    is_localhost_only: bool = False
    peers: tuple[str, ...] = ()
    cyclone: str = ""
    variables: tuple[str, ...] = ()

    @property
    def configuration(self) -> str | None:
        """The configuration of the DDS library; None for its default.

        The node is also announced to this computer by unicast, because nodes with the range LOCALHOST do not listen to
        multicast. They announce themselves to the first ports of this computer, so the node takes one of those. With
        Fast DDS, such nodes are found in both cases; with Cyclone DDS 11, only if they are started later, or if the
        range is LOCALHOST here too.
        """
        if self.reach == "SYSTEM_DEFAULT":
            return None
        general = ""
        if self.is_localhost_only:
            general = f'<Interfaces><NetworkInterface address="{_LOOPBACK}"/></Interfaces>'
        elif self.reach == "LOCALHOST":
            general = "<AllowMulticast>false</AllowMulticast>"
        peers = "".join(f"<Peer address={quoteattr(peer)}/>" for peer in (_LOOPBACK, *self.peers))
        own = (
            f'<CycloneDDS><Domain id="any"><General>{general}</General><Discovery>'
            f"<ParticipantIndex>auto</ParticipantIndex>"
            f"<MaxAutoParticipantIndex>{_MOST_PARTICIPANTS}</MaxAutoParticipantIndex>"
            f"<Peers>{peers}</Peers></Discovery></Domain></CycloneDDS>"
        )
        return f"{own},{self.cyclone}" if self.cyclone else own

    def join(self, domain: int) -> tuple[Any, ...]:
        """Join a DDS domain.

        Args:
            domain: its number.

        Returns:
            The participant first; the other objects only need to live as long as it.

        Raises:
            DDSException: the domain cannot be joined.
        """
        from cyclonedds.core import DDSException  # noqa: PLC0415 - an extra
        from cyclonedds.domain import Domain, DomainParticipant  # noqa: PLC0415

        if self.configuration is None:
            return (DomainParticipant(domain),)
        try:
            configured = Domain(domain, self.configuration)
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:  # this process uses the domain already
                raise
            return (DomainParticipant(domain),)
        return DomainParticipant(domain), configured


def discovery_settings(environment: Mapping[str, str] | None = None) -> Discovery:
    """Read how ROS 2 nodes find each other.

    Args:
        environment: the environment variables; None for those of this process.

    Returns:
        The settings, with the meaning that ROS gives to the variables: ROS_LOCALHOST_ONLY=1 takes precedence over the
        other two, and static peers are ignored if the range is OFF.

    Raises:
        InvalidInputError: the range is none of the four that ROS defines, or OFF, which hides all topics.

    Examples:
        >>> discovery_settings({"ROS_STATIC_PEERS": "192.0.2.7;arm.local"}).peers
        ('192.0.2.7', 'arm.local')
    """
    values = os.environ if environment is None else environment
    names = (RANGE, LOCALHOST_ONLY, PEERS, _CYCLONE, *_OTHERS)
    variables = tuple(f"{name}={values[name]}" for name in names if values.get(name))
    if values.get(LOCALHOST_ONLY) == "1":
        return Discovery(
            reach="LOCALHOST", is_localhost_only=True, cyclone=values.get(_CYCLONE, ""), variables=variables
        )
    reach = values.get(RANGE) or "SUBNET"
    if reach not in _RANGES:
        raise InvalidInputError(f"{RANGE}: found {reach!r}, expected one of {', '.join(_RANGES)}")
    if reach == "OFF":
        raise InvalidInputError(
            f"{RANGE}: the value OFF hides the topics of all other programs, so no topic can be read; set SUBNET, or "
            "LOCALHOST for a node on this computer, here and for the node"
        )
    peers = tuple(part.strip() for part in values.get(PEERS, "").split(";") if part.strip())
    return Discovery(reach=reach, peers=peers, cyclone=values.get(_CYCLONE, ""), variables=variables)


def undiscovered(settings: Discovery) -> str:
    """Return a sentence on the settings that can hide a publisher.

    Args:
        settings: the settings of this program.
    """
    here = f"Here, {', '.join(settings.variables)}." if settings.variables else "None of them is set here."
    remarks = [remark for name, remark in _OTHERS.items() if any(v.startswith(f"{name}=") for v in settings.variables)]
    details = f" {'; '.join(remarks)}." if remarks else ""
    return (
        f"If the node runs, check these variables here and where it was started: ROS_DOMAIN_ID, {RANGE}, "
        f"{LOCALHOST_ONLY}, {PEERS}. A node that only uses shared memory (FASTDDS_BUILTIN_TRANSPORTS=SHM), a discovery "
        f"server (ROS_DISCOVERY_SERVER) or Zenoh (RMW_IMPLEMENTATION) is not found. {here}{details}"
    )
