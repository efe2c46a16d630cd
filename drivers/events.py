"""What happens to the nodes and the bus, as `drivers.network` tells it while it happens.

Each event is a frozen dataclass with a time (ns, CLOCK_REALTIME) and a `text` for the person who reads it at night.
A consumer matches on the class:

    match event:
        case NodeBooted(node_id=node_id, identity=identity): …
        case NodeBootFailed(reason=reason, text=text, cure=cure): …
        case NodeLost(): …
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drivers.bus import BusState
    from drivers.cia402 import DriveState
    from drivers.signals import Emergency


class BootReason(StrEnum):
    """Why a node could not be booted. The letter is CiA 302-2's, where it has one for the same thing."""

    NO_BOOT_UP = "no-boot-up"  # E/F: silent after the NMT reset
    NO_SDO_ANSWER = "no-sdo-answer"  # B: no answer for 0x1000
    WRONG_DEVICE_TYPE = "wrong-device-type"  # C: 0x1000 is another profile's
    WRONG_VENDOR = "wrong-vendor"  # D: 0x1018:01
    WRONG_PRODUCT = "wrong-product"  # M: 0x1018:02
    WRONG_REVISION = "wrong-revision"  # N: 0x1018:03
    WRONG_SERIAL = "wrong-serial"  # O: 0x1018:04
    CONFIGURATION_REFUSED = "configuration-refused"  # J: the node aborted a write
    CONFIGURATION_NOT_KEPT = "configuration-not-kept"  # J: it took a write, but reads back something else
    FELL_SILENT = "fell-silent"  # J: it stopped answering in the middle
    RESTARTED = "restarted"  # it booted up again in the middle
    MALFORMED_ANSWER = "malformed-answer"  # its SDO answers are not CiA 301's
    NO_HEARTBEAT = "no-heartbeat"  # K: it was told to produce one
    NOT_OPERATIONAL = "not-operational"  # it does not enter operational
    BUS_DOWN = "bus-down"  # nothing can be sent


@dataclass(frozen=True, slots=True)
class Identity:
    """Who a node says it is: 0x1000 and 0x1018."""

    device_type: int
    vendor: int
    product: int
    revision: int
    serial: int


@dataclass(frozen=True, slots=True)
class NodeBooted:
    """The node is configured and operational."""

    time_ns: int
    node_id: int
    identity: Identity
    text: str


@dataclass(frozen=True, slots=True)
class NodeBootFailed:
    """The node could not be booted; it is tried again when it is heard, and from time to time."""

    time_ns: int
    node_id: int
    reason: BootReason
    text: str
    cure: str


@dataclass(frozen=True, slots=True)
class NodeLost:
    """An operational node is so no more: its heartbeat stopped, it restarted, or it left operational."""

    time_ns: int
    node_id: int
    text: str


@dataclass(frozen=True, slots=True)
class NodeReturned:
    """A node that was lost, or had failed to boot, is heard again; it is now booted anew."""

    time_ns: int
    node_id: int
    text: str


@dataclass(frozen=True, slots=True)
class NodeEmergency:
    """A node sent an EMCY message."""

    time_ns: int
    node_id: int
    emergency: Emergency
    text: str


@dataclass(frozen=True, slots=True)
class DriveStateChanged:
    """A drive's statusword says another state of CiA 402 than before."""

    time_ns: int
    node_id: int
    state: DriveState
    text: str


@dataclass(frozen=True, slots=True)
class MotionStopped:
    """The wheels were turning, and the network stopped them by itself, because a node was lost or a drive faulted."""

    time_ns: int
    node_id: int
    text: str


@dataclass(frozen=True, slots=True)
class BusStateChanged:
    """The link or the controller's error state changed."""

    time_ns: int
    state: BusState
    text: str


NodeEvent = NodeBooted | NodeBootFailed | NodeLost | NodeReturned | NodeEmergency | DriveStateChanged
NetworkEvent = NodeEvent | MotionStopped | BusStateChanged
