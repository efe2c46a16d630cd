"""The messages about the CAN bus and its nodes: `node/…`, `emcy` and `event`."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field

from regolithd.daemon.messages.header import Header, NodeNumber, Time, WheelNumber
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.master.status import NodePhase  # noqa: TC001  # pydantic reads it at run time

if TYPE_CHECKING:
    NodeKind = str
else:
    NodeKind = StrEnum("NodeKind", {each.kind.upper().replace("-", "_"): each.kind for each in DEVICES})
    NodeKind.__doc__ = "A node's device profile."


class IdentityReport(BaseModel):
    """The identity that a node reports: objects 0x1000 (device type) and 0x1018 (identity object)."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    device_type: int
    vendor: int
    product: int
    revision: int
    serial: int


class NodeMessage(Header):
    """The state of one node, published whenever it changes."""

    node_id: NodeNumber
    kind: NodeKind
    wheel: WheelNumber | None
    required: bool
    phase: NodePhase
    nmt_state: str | None
    """NMT state of its last heartbeat (CiA 301)."""
    drive_state: str | None
    """State of the power drive system (CiA 402); motor controllers only."""
    heard: Time | None
    """Time of its last heartbeat."""
    identity: IdentityReport | None
    reason: str | None
    """Code of the reason why it could not be booted."""
    text: str
    """The same reason as text, with what to do."""
    boots: int
    """How often it has booted in this session."""
    emergencies: int
    """EMCY messages in this session, with those that say that an error is reset (code 0x0000)."""


class EmergencyMessage(Header):
    """An EMCY message of a node, decoded."""

    node_id: NodeNumber
    kind: NodeKind | None
    wheel: WheelNumber | None
    code: Annotated[str, Field(pattern="^0x[0-9A-F]{4}$")]
    """Emergency error code; 0x0000: error reset, no error."""
    register_bits: tuple[str, ...]
    """Bits that are set in the error register (object 0x1001)."""
    vendor_bytes: Annotated[str, Field(pattern="^[0-9a-f]{10}$")]
    cleared: bool
    text: str
    suppressed: int = 0
    """EMCY messages of this node since the preceding one here that were not published: they came too often."""


class EventMessage(Header):
    """An event on the bus, as text for a person."""

    kind: str
    """`node-booted`, `node-boot-failed`, `node-lost`, `node-returned`, `drive-state-changed`, `motion-stopped`,
    `bus-state-changed`, `soil-change`, `node-emergency`, `unexpected-node`, `unexpected-master`."""
    node_id: NodeNumber | None
    text: str
    suppressed: int = 0
    """Events of this kind and node since the preceding one here that were not published: they came too often."""
