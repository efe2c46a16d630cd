"""A network and a virtual rover on a bus in this process."""

from __future__ import annotations

import asyncio
import itertools
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading
from regolithd.drivers.master.network import Network, NetworkSettings
from regolithd.drivers.virtual.plant import Bench
from regolithd.drivers.virtual.rover import KAPVIK, VirtualRover

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Sequence

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.decoding.signals import Signal
    from regolithd.drivers.devices.device import Quantity
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.master.events import NetworkEvent
    from regolithd.drivers.virtual.plant import Plant

_CHANNELS = itertools.count()
TIMEOUT_S = 20.0


async def until(condition: Callable[[], object], what: str, timeout_s: float = TIMEOUT_S) -> None:
    """Wait until a condition holds; fail with `what` after the timeout."""
    try:
        async with asyncio.timeout(timeout_s):
            while not condition():  # noqa: ASYNC110  # the condition has no event
                await asyncio.sleep(0.01)
    except TimeoutError:
        pytest.fail(f"not within {timeout_s:g} s: {what}")


def settings(nodes: Sequence[NodeDescription], **changes: object) -> NetworkSettings:
    """Return settings for a test: short intervals, and long timeouts for a loaded machine."""
    quick = {"sync_rate_Hz": 20.0, "boot_up_timeout_s": 1.0, "sdo_timeout_s": 0.5, "retry_after_s": 0.5}
    slow = {"node_lost_after_s": 1.0, "master_lost_after_s": 2.0}
    return NetworkSettings(nodes=tuple(nodes), **(quick | slow | changes))


@dataclass
class Rig:
    """A running network and the virtual rover that it runs."""

    rover: VirtualRover
    bus: Bus
    network: Network = field(init=False)
    running: asyncio.Task[None] = field(init=False)
    decoder: Decoder = field(init=False)
    events: list[NetworkEvent] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    signals: list[Signal] = field(default_factory=list)

    def start(self, tasks: asyncio.TaskGroup, wanted: NetworkSettings) -> None:
        """Run a network, and keep its events."""
        self.decoder = Decoder(wanted.nodes)
        self.network = Network(self.bus, wanted, on_frames=self.take, on_event=self.events.append)
        self.running = tasks.create_task(self.network.run())

    def take(self, batch: Sequence[Frame]) -> None:
        """Keep and decode frames."""
        self.frames.extend(batch)
        self.signals.extend(filter(None, map(self.decoder.decode, batch)))

    def events_of(self, kind: type, **fields: object) -> list[NetworkEvent]:
        """Return the events of a class whose fields are these."""
        return [
            event
            for event in self.events
            if isinstance(event, kind) and all(getattr(event, name) == value for name, value in fields.items())
        ]

    def readings(self, node_id: int) -> list[Reading]:
        """Return what one node has measured so far."""
        return [signal for signal in self.signals if isinstance(signal, Reading) and signal.node_id == node_id]

    def latest(self, node_id: int, quantity: Quantity) -> float:
        """Return the newest value of a quantity; NaN before the first."""
        values = (value for reading in reversed(self.readings(node_id)) for q, value in reading.values if q is quantity)
        return next(values, float("nan"))

    async def wait_for_event(self, kind: type, **fields: object) -> NetworkEvent:
        """Wait for an event that has not been waited for before, and return it."""
        await until(lambda: self.events_of(kind, **fields), f"{kind.__name__} {fields}; told: {self.events}")
        event = self.events_of(kind, **fields)[0]
        self.events.remove(event)
        return event

    async def until_transfers(self, node_id: int, count: int) -> None:
        """Wait until so many SDO transfers have begun with a node."""
        sdo = self.network._supervisors[node_id].remote.sdo
        await until(lambda: sdo.transfers >= count, f"{count} SDO transfers with node {node_id}")

    async def until_attempts(self, node_id: int, count: int) -> None:
        """Wait until a node has been tried so often."""
        supervisor = self.network._supervisors[node_id]
        await until(lambda: supervisor.attempts >= count, f"{count} attempts to boot node {node_id}")

    async def stop(self) -> None:
        """Stop the network as a daemon does: cancel it, and wait."""
        self.running.cancel()
        await asyncio.wait([self.running])


@asynccontextmanager
async def rig(
    nodes: Sequence[NodeDescription] = KAPVIK,
    *,
    plant: Plant | None = None,
    faults: Sequence[str] = (),
    known: Sequence[NodeDescription] | None = None,
    **changes: object,
) -> AsyncIterator[Rig]:
    """Run a virtual rover with these nodes, with `faults` from the start, and a network that knows `known`."""
    channel = f"test-{next(_CHANNELS)}"
    described = nodes if known is None else known
    async with AsyncExitStack() as stack:
        rover_bus = await stack.enter_async_context(open_bus("virtual", channel))
        bus = await stack.enter_async_context(open_bus("virtual", channel))
        tasks = await stack.enter_async_context(asyncio.TaskGroup())
        rover = VirtualRover(plant or Bench(), nodes)
        serving = tasks.create_task(rover.run(rover_bus))
        await asyncio.sleep(0)  # the nodes are powered now, and take commands
        for line in faults:
            assert rover.inject_fault(line) == "ok", line
        running = Rig(rover, bus)
        running.start(tasks, settings(described, **changes))
        try:
            yield running
        finally:
            await running.stop()
            serving.cancel()
