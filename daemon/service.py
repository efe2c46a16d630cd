"""The running daemon: one task for each thing that is owned, all in one group, cancelled together.

    bus ─▶ record frames ▸ decode ▸ acquire ▸ torque ▸ smooth ▸ slip ▸ estimate ─▶ record, publish

| task | owns |
|---|---|
| network | the bus: reads it, boots and supervises the nodes, sends SYNC and heartbeat |
| recording | the files |
| each outlet | its connection, or its socket |
| watchdog | systemd's attention: fed only while all others answer |

What comes from the bus goes through the whole pipeline within the network's task, a few hundred microseconds for each
SYNC, so nothing can fall behind or overtake. To stop is to be cancelled: the drives stop first, then the recording is
closed and the outlets say goodbye.
"""

from __future__ import annotations

import asyncio
import json
import time
from contextlib import AsyncExitStack
from dataclasses import asdict
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol

from daemon.estimate import SHIPPED_MODEL
from daemon.estimate import Network as TerrainNetwork
from daemon.notify import READY, STOPPING, WATCHDOG, notify, watchdog_period_s
from daemon.pulse import Pulses
from daemon.recording.recorder import FLUSH_S, Recorder
from daemon.replay import Chain
from drivers.bus import open_bus
from drivers.network import Network, NetworkSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from daemon.config import Configuration
    from daemon.snapshot import Estimate
    from drivers.bus import Bus
    from drivers.events import NetworkEvent
    from drivers.frame import Frame

NETWORK, RECORDING = "network", "recording"
PATIENCE_S = 5.0
WATCH_S = 0.5


class Outlet(Protocol):
    """Where estimates and events go. Neither call may block; `run` does what takes time, and beats its pulse."""

    def estimate(self, estimate: Estimate) -> None:
        """Take one more estimate."""

    def event(self, event: NetworkEvent) -> None:
        """Take one more event of the bus."""

    async def run(self) -> None:
        """Do the work until cancelled."""


class Service:
    """Everything that runs for one rover. `outlets` may be added until `run`.

    Attributes
    ----------
    configuration, terrain
        What it was started with.
    chain
        From frames to estimates, with its counters.
    recorder
        The recording, or None where it is switched off.
    network
        The nodes; commands may come from any task of the group.
    pulses
        Who has answered lately.
    """

    def __init__(self, configuration: Configuration, bus: Bus) -> None:
        self.configuration = configuration
        self.terrain = TerrainNetwork(configuration.estimator.model or SHIPPED_MODEL)
        self.chain = Chain(configuration, self.terrain)
        self.recorder = _recorder(configuration, self.terrain) if configuration.recording.enabled else None
        self.network = Network(
            bus, network_settings(configuration), on_frames=self._take_frames, on_event=self._take_event
        )
        self.pulses = Pulses()
        self.outlets: list[Outlet] = []

    async def run(self) -> None:
        """Run until cancelled; then stop the drives, close the recording, and let the outlets say goodbye."""
        try:
            async with asyncio.TaskGroup() as outlets:
                tasks = [outlets.create_task(outlet.run()) for outlet in self.outlets]
                if self.recorder:
                    tasks.append(outlets.create_task(self._record(self.recorder)))
                tasks.append(outlets.create_task(self._watch()))
                try:
                    await self.network.run()
                finally:
                    for task in tasks:
                        task.cancel()
        finally:
            if self.recorder:
                self.recorder.close()

    def _take_frames(self, batch: Sequence[Frame]) -> None:
        self.pulses.beat(NETWORK)
        if self.recorder:
            self.recorder.frames(batch)
        for estimate in self.chain.feed(batch):
            if self.recorder:
                self.recorder.estimate(estimate)
            for outlet in self.outlets:
                outlet.estimate(estimate)

    def _take_event(self, event: NetworkEvent) -> None:
        if self.recorder:
            self.recorder.event(event.time_ns, event_json(event))
        for outlet in self.outlets:
            outlet.event(event)

    async def _record(self, recorder: Recorder) -> None:
        self.pulses.expect(RECORDING, PATIENCE_S)
        while True:
            recorder.flush()
            self.pulses.beat(RECORDING)
            await asyncio.sleep(FLUSH_S)

    async def _watch(self) -> None:
        """Feed the watchdog while every task answers; let it bite when one does not."""
        self.pulses.expect(NETWORK, PATIENCE_S)
        notify(f"{READY}\nSTATUS=acquiring at {self.configuration.sync.rate_Hz:g} Hz")
        period_s = watchdog_period_s()
        produced = -1
        try:
            while True:
                sync = self.network.counters.sync
                tried = sync.produced + sync.failed + sync.skipped
                if tried != produced:  # a dead link brings no frames, but the network goes on trying
                    produced = tried
                    self.pulses.beat(NETWORK)
                silent = self.pulses.silent()
                if silent:
                    notify(f"STATUS=no answer from {', '.join(silent)}")
                elif period_s is not None:
                    notify(WATCHDOG)
                await asyncio.sleep(min(WATCH_S, period_s or WATCH_S))
        finally:
            notify(STOPPING)


def network_settings(configuration: Configuration) -> NetworkSettings:
    """Return what the drivers' network is to be."""
    nodes = configuration.nodes
    return NetworkSettings(
        nodes=nodes.described(),
        sync_rate_Hz=configuration.sync.rate_Hz,
        gear_ratio=configuration.drivetrain.ratio,
        master_heartbeat_s=nodes.heartbeat_ms / 2000,
        master_lost_after_s=nodes.heartbeat_timeout_ms / 1000,
        node_heartbeat_s=nodes.heartbeat_ms / 1000,
        node_lost_after_s=nodes.heartbeat_timeout_ms / 1000,
    )


def event_json(event: NetworkEvent) -> bytes:
    """Return an event as JSON: the name of its class, its time, and what it tells."""
    return json.dumps({"event": type(event).__name__, **asdict(event)}, default=_plain).encode()


def _plain(value: Any) -> Any:  # noqa: ANN401  # whatever an event may hold
    if isinstance(value, bytes):
        return value.hex()
    return value.value if isinstance(value, Enum) else str(value)


def _recorder(configuration: Configuration, terrain: TerrainNetwork) -> Recorder:
    metadata = {
        "configuration": configuration.model_dump_json(),
        "model_version": terrain.card.version,
        "started_ns": str(time.time_ns()),
    }
    return Recorder(configuration.recording, configuration.bus.channel, metadata)


async def serve(configuration: Configuration, equip: Callable[[Service], None]) -> None:
    """Open the bus and run the service until cancelled. `equip` adds the outlets.

    Raises
    ------
    BusOpenError
        The bus cannot be opened.
    ModelError
        The network cannot be used.
    """
    bus_settings = configuration.bus
    async with AsyncExitStack() as opened:
        bus = await opened.enter_async_context(
            open_bus(bus_settings.interface, bus_settings.channel, bitrate=bus_settings.bitrate)
        )
        service = Service(configuration, bus)
        equip(service)
        await service.run()
