"""The nodes of one bus: booted, supervised and commanded.

    async with open_bus("socketcan", "can0") as bus, asyncio.TaskGroup() as tasks:
        network = Network(bus, settings, on_frames=pipeline.feed, on_event=publish)
        tasks.create_task(network.run())
        await network.settled()
        await network.enable()
        await network.set_speed((0.29,) * 6)

`run` is the bus's only reader. Each batch of frames goes to `on_frames` first – recording and snapshots – and then to
the nodes' own conversations. Cancelling `run` is the way to stop: the drives are stopped and disabled, then every node
is put back into pre-operational.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from drivers.bus import Bus
    from drivers.cia402 import DriveState
    from drivers.events import BootReason, Identity, NetworkEvent
    from drivers.frame import Frame
    from drivers.nmt import NmtState
    from drivers.signals import NodeDescription


class NodePhase(StrEnum):
    """Where a node is in its life under this master."""

    BOOTING = "booting"
    OPERATIONAL = "operational"
    LOST = "lost"  # was operational, is not heard any more
    FAILED = "failed"  # could not be booted


@dataclass(frozen=True, slots=True)
class NodeStatus:
    """What is known of one node at this moment."""

    node: NodeDescription
    phase: NodePhase
    nmt_state: NmtState | None = None  # as it last said
    heard_ns: int | None = None  # time of its last heartbeat or boot-up
    identity: Identity | None = None
    reason: BootReason | None = None  # of its last failed boot
    text: str = ""
    drive_state: DriveState | None = None  # motor controllers only
    boots: int = 0  # how often it was booted
    emergencies: int = 0


@dataclass(frozen=True, slots=True)
class NetworkSettings:
    """What the network is to be. Times in seconds, `gear_ratio` in motor turns per wheel turn."""

    nodes: tuple[NodeDescription, ...]
    sync_rate_Hz: float = 2.0
    gear_ratio: float = 1400.0
    master_id: int = 127
    master_heartbeat_s: float = 0.1
    master_lost_after_s: float = 0.5  # then the drives stop by themselves (0x1016, 0x6007)
    node_heartbeat_s: float = 0.2
    node_lost_after_s: float = 0.7
    sdo_timeout_s: float = 0.5
    boot_up_timeout_s: float = 3.0
    retry_after_s: float = 5.0  # a node that could not be booted, and stays silent


@dataclass(slots=True)
class SyncCounters:
    """How the SYNC producer keeps its time; jitter is how late a SYNC was sent against its schedule."""

    produced: int = 0
    skipped: int = 0  # the loop was late by a whole period: that SYNC was left out, never sent in a burst
    failed: int = 0  # could not be sent: link down or queue full
    last_late_ns: int = 0
    worst_late_ns: int = 0
    mean_late_ns: float = 0.0


@dataclass(slots=True)
class NetworkCounters:
    """What the network counts of itself."""

    sync: SyncCounters = field(default_factory=SyncCounters)
    heartbeats_sent: int = 0
    sdo_transfers: int = 0
    sdo_failures: int = 0


class Network:
    """Boots, supervises and commands the nodes of one bus. One task runs `run`; commands may come from any task.

    Parameters
    ----------
    bus
        An open bus, which `run` alone reads.
    on_frames
        Called with each batch of frames, in order, before anything else is done with them. Must not block.
    on_event
        Called with each event as it happens. Must not block.
    """

    def __init__(
        self,
        bus: Bus,
        settings: NetworkSettings,
        *,
        on_frames: Callable[[Sequence[Frame]], None] = lambda _batch: None,
        on_event: Callable[[NetworkEvent], None] = lambda _event: None,
    ) -> None:
        self.bus = bus
        self.settings = settings
        self.counters = NetworkCounters()
        self._on_frames = on_frames
        self._on_event = on_event

    @property
    def status(self) -> Mapping[int, NodeStatus]:
        """What is known of each node, by node-ID."""
        return {node.node_id: NodeStatus(node, NodePhase.BOOTING) for node in self.settings.nodes}

    async def run(self) -> None:
        """Read the bus, boot and supervise the nodes, produce SYNC and heartbeat; until cancelled."""
        async for batch in self.bus:
            self._on_frames(batch)

    async def settled(self) -> None:
        """Wait until each node is operational or has failed its first boot."""

    async def enable(self) -> None:
        """Bring all drives to operation enabled, standing still; a fault is reset first.

        Raises
        ------
        DriveError
            A drive is not on the bus, or does not get there; the message names it and its state.
        """
        raise NotImplementedError

    async def set_speed(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """Turn the wheels at these speeds [rad/s at the wheel, index k − 1 for wheel k]; one RPDO per drive.

        Raises
        ------
        DriveError
            A drive is not in operation enabled.
        """
        raise NotImplementedError

    async def quick_stop(self) -> None:
        """Stop all wheels with the quick-stop ramp, now; a drive that is lost does not keep the others from it."""
        raise NotImplementedError

    async def disable(self) -> None:
        """Take the power off the motors; wheels that turn are stopped first."""
        raise NotImplementedError
