"""Settings, status and counters of a network: plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.sync import SyncCounters

if TYPE_CHECKING:
    from regolithd.drivers.canopen.nmt import NmtState
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.master.boot_error import BootReason
    from regolithd.drivers.master.cia402 import DriveState
    from regolithd.drivers.master.events import Identity


class NodePhase(StrEnum):
    """Phase of a node, as its supervisor sees it."""

    BOOTING = "booting"
    OPERATIONAL = "operational"
    LOST = "lost"  # was operational before
    FAILED = "failed"  # could not be booted


@dataclass(frozen=True, slots=True)
class NodeStatus:
    """Present status of one node."""

    node: NodeDescription
    phase: NodePhase = NodePhase.BOOTING
    nmt_state: NmtState | None = None  # last reported
    heard_ns: int | None = None  # time of its last heartbeat or boot-up
    identity: Identity | None = None
    reason: BootReason | None = None  # of its last failed boot
    text: str = ""
    drive_state: DriveState | None = None  # motor controllers only
    boots: int = 0  # number of successful boots
    emergencies: int = 0


@dataclass(frozen=True, slots=True)
class NetworkSettings:
    """Settings of a network. Times in seconds, `gear_ratio` in motor turns per wheel turn."""

    nodes: tuple[NodeDescription, ...]
    sync_rate_Hz: float = 2.0
    gear_ratio: float = 1400.0
    master_id: int = 127
    master_heartbeat_s: float = 0.1
    master_lost_after_s: float = 0.5  # then the drives stop by themselves (0x1016, 0x6007)
    node_heartbeat_s: float = 0.2
    node_lost_after_s: float = 0.7
    sdo_timeout_s: float = 1.0
    boot_up_timeout_s: float = 3.0
    other_node_ids: frozenset[int] = frozenset()  # on the bus, and nobody's to boot: no intruders
    retry_after_s: float = 5.0  # of a node that could not be booted and sends nothing; doubles up to `retry_at_most_s`
    retry_at_most_s: float = 30.0


@dataclass(slots=True)
class NetworkCounters:
    """Counters of a network."""

    sync: SyncCounters = field(default_factory=SyncCounters)
    heartbeats_sent: int = 0
    heartbeats_failed: int = 0
    sdo_transfers: int = 0
    sdo_failures: int = 0
