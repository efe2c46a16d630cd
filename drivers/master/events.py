"""The events that the network reports: boot, loss and return of nodes, emergencies, drive and bus states.

Each event is a frozen dataclass with a time (ns, CLOCK_REALTIME) and a `text` that describes it. A
consumer matches on the class:

    match event:
        case NodeBooted(node_id=node_id, identity=identity): …
        case NodeBootFailed(reason=reason, text=text, remedy=remedy): …
        case NodeLost(): …
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.drivers.can.bus import BusState
    from regolithd.drivers.canopen.emcy import Emergency
    from regolithd.drivers.master.boot_error import BootReason
    from regolithd.drivers.master.cia402 import DriveState


@dataclass(frozen=True, slots=True)
class Identity:
    """A node's identity: objects 0x1000 and 0x1018."""

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
    """The node could not be booted; it is tried again when it sends something, and from time to time."""

    time_ns: int
    node_id: int
    reason: BootReason
    text: str
    remedy: str


@dataclass(frozen=True, slots=True)
class NodeLost:
    """An operational node is lost: its heartbeat stopped, it restarted, or it left operational."""

    time_ns: int
    node_id: int
    text: str


@dataclass(frozen=True, slots=True)
class NodeReturned:
    """A node that was lost, or had failed to boot, sends again; it is booted anew."""

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
    """The CiA 402 state in a drive's statusword has changed."""

    time_ns: int
    node_id: int
    state: DriveState
    text: str


@dataclass(frozen=True, slots=True)
class MotionStopped:
    """The wheels were turning, and the network stopped them, because a node was lost or a drive faulted."""

    time_ns: int
    node_id: int
    text: str


@dataclass(frozen=True, slots=True)
class BusStateChanged:
    """The link or the controller's error state changed."""

    time_ns: int
    state: BusState
    text: str


@dataclass(frozen=True, slots=True)
class UnexpectedNode:
    """A node that the configuration does not know sends on the bus."""

    time_ns: int
    node_id: int
    text: str


@dataclass(frozen=True, slots=True)
class UnexpectedMaster:
    """Somebody else produces SYNC or the master's heartbeat, or sends NMT commands."""

    time_ns: int
    text: str
    remedy: str


NodeEvent = NodeBooted | NodeBootFailed | NodeLost | NodeReturned | NodeEmergency | DriveStateChanged
NetworkEvent = NodeEvent | MotionStopped | BusStateChanged | UnexpectedNode | UnexpectedMaster
