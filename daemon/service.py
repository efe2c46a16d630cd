"""The running daemon: one task for each resource, all in one task group, cancelled together.

    bus ─▶ record frames ▸ decode ▸ acquire ▸ torque ▸ smooth ▸ slip ▸ estimate ▸ posterior ─▶ record, publish

| task | owns |
|---|---|
| network | the bus: reads it, boots and supervises the nodes, sends SYNC and heartbeat |
| recording | the files |
| each sink | its connection, or its socket |
| watchdog | systemd's watchdog, fed only while all other tasks report that they run |

Frames go through the whole pipeline within the network's task, a few hundred microseconds for each SYNC, so estimates
come in order and without a queue. Cancelling `run` is the way to stop: the drives stop first, then the sinks finish and
the recording is closed.
"""

from __future__ import annotations

import asyncio
import json
import time
from contextlib import AsyncExitStack
from dataclasses import asdict
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol

from regolithd.daemon.health.event_throttle import EventThrottle
from regolithd.daemon.health.liveness import TaskLiveness
from regolithd.daemon.health.sd_notify import READY, STOPPING, WATCHDOG, notify, watchdog_period_s
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.recording.eds_files import eds_metadata
from regolithd.daemon.recording.recorder import FLUSH_S, Recorder
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.errors import BusOpenError
from regolithd.drivers.master.network import Network, NetworkSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.onnx_models import OnnxModels
    from regolithd.daemon.pipeline.snapshot import Estimate
    from regolithd.daemon.pipeline.terrain_network import AbsentTerrainNetwork, TerrainNetwork
    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.decoding.signals import Signal
    from regolithd.drivers.master.events import NetworkEvent

NETWORK, RECORDING = "network", "recording"
TASK_TIMEOUT_S = 5.0
"""The network and recording tasks count as hung when they have not reported for this long."""
WATCHDOG_POLL_S = 0.5
BUS_RETRY_S = 2.0


class Sink(Protocol):
    """A receiver of estimates and events. Neither call may block; `run` does what takes time, and reports liveness."""

    def estimate(self, estimate: Estimate) -> None:
        """Take one more estimate."""

    def event(self, event: NetworkEvent) -> None:
        """Take one more event of the bus."""

    async def run(self) -> None:
        """Do the work until cancelled."""


class Service:
    """The daemon of one rover: bus, pipeline, recording and sinks. `sinks` may be added until `run`.

    Attributes
    ----------
    configuration, models
        The configuration, and the ONNX models that it names.
    chain
        From frames to estimates, with its counters.
    recorder
        The recording, or None where it is switched off.
    liveness
        When each task last reported that it runs.
    bus_problem
        Why the bus cannot be opened; empty where it is open.
    """

    def __init__(self, configuration: Configuration, models: OnnxModels) -> None:
        self._network: Network | None = None
        self.configuration = configuration
        self.models = models
        self.chain = Chain(configuration, models)
        self.recorder = (
            _recorder(configuration, models.terrain, self._unit_frames) if configuration.recording.enabled else None
        )
        self._recorded_events = EventThrottle()
        self.liveness = TaskLiveness()
        self.bus_problem = ""
        self.sinks: list[Sink] = []
        self._opened = asyncio.Event()
        self._syncs_tried = -1

    @property
    def network(self) -> Network | None:
        """The CANopen network, or None while the bus is not open; commands may come from any task."""
        return self._network

    async def opened(self) -> Network:
        """Wait until the bus is open, and return the network."""
        await self._opened.wait()
        assert self._network is not None  # noqa: S101  # set before the event
        return self._network

    async def run(self) -> None:
        """Run until cancelled; then stop the drives, let the sinks finish, and close the recording."""
        try:
            async with asyncio.TaskGroup() as group:
                tasks = [group.create_task(sink.run()) for sink in self.sinks]
                if self.recorder:
                    tasks.append(group.create_task(self._record(self.recorder)))
                tasks.append(group.create_task(self._feed_watchdog()))
                try:
                    await self._run_network()
                finally:
                    for task in tasks:
                        task.cancel()
        finally:
            if self.recorder:
                self._record_summaries(self.recorder)
                self.recorder.close()

    async def _run_network(self) -> None:
        async with AsyncExitStack() as opened:
            bus = await self._open_bus(opened)
            self._network = Network(
                bus,
                network_settings(self.configuration),
                on_frames=self._take_frames,
                on_signals=self._take_signals,
                on_event=self._take_event,
            )
            self._opened.set()
            await self._network.run()

    async def _open_bus(self, opened: AsyncExitStack) -> Bus:
        """Open the bus; while that fails, `bus_problem` says why, and it is tried again every `BUS_RETRY_S`."""
        settings = self.configuration.bus
        while True:
            try:
                bus = await opened.enter_async_context(
                    open_bus(settings.interface, settings.channel, bitrate=settings.bitrate)
                )
            except BusOpenError as error:
                self.bus_problem = str(error)
                await asyncio.sleep(BUS_RETRY_S)
            else:
                self.bus_problem = ""
                return bus

    def _unit_frames(self) -> list[Frame]:
        return self._network.decoder.unit_frames if self._network else []

    def _take_frames(self, batch: Sequence[Frame]) -> None:
        self.liveness.beat(NETWORK)
        if self.recorder:
            self.recorder.frames(batch)

    def _take_signals(self, signals: Sequence[Signal]) -> None:
        for estimate in self.chain.take(signals):
            if self.recorder:
                self.recorder.estimate(estimate)
            for sink in self.sinks:
                sink.estimate(estimate)

    def _take_event(self, event: NetworkEvent) -> None:
        if self.recorder and self._recorded_events.admits(event, time.monotonic_ns()):
            self.recorder.event(event.time_ns, event_json(event))
        for sink in self.sinks:
            sink.event(event)

    def _record_summaries(self, recorder: Recorder) -> None:
        """Record the newest of the events that came too often; the frames of all are in the log."""
        for event, withheld in self._recorded_events.summaries():
            recorder.event(event.time_ns, event_json(event, suppressed=withheld - 1))

    async def _record(self, recorder: Recorder) -> None:
        self.liveness.expect(RECORDING, TASK_TIMEOUT_S)
        while True:
            self._record_summaries(recorder)
            recorder.flush()
            self.liveness.beat(RECORDING)
            await asyncio.sleep(FLUSH_S)

    async def _feed_watchdog(self) -> None:
        """Feed systemd's watchdog while every task reports; otherwise let it expire, and name the tasks in STATUS."""
        period_s = watchdog_period_s()
        pause_s = min(WATCHDOG_POLL_S, period_s or WATCHDOG_POLL_S)
        try:
            while self._network is None:
                # systemd is to wait for the bus without a time limit, and to show why.
                notify(f"EXTEND_TIMEOUT_USEC=10000000\nSTATUS=waiting for the bus. {self.bus_problem}")
                await asyncio.sleep(pause_s)
            self.liveness.expect(NETWORK, TASK_TIMEOUT_S)
            notify(f"{READY}\nSTATUS=acquiring at {self.configuration.sync.rate_Hz:g} Hz")
            while True:
                self._check_sync_progress(self._network)
                if overdue := self.liveness.overdue():
                    notify(f"STATUS=no answer from {', '.join(overdue)}")
                elif period_s is not None:
                    notify(WATCHDOG)
                await asyncio.sleep(pause_s)
        finally:
            notify(STOPPING)

    def _check_sync_progress(self, network: Network) -> None:
        """Report the network task as running while its SYNC counters increase: a link that is down brings no frames."""
        sync = network.counters.sync
        tried = sync.produced + sync.failed + sync.skipped
        if tried != self._syncs_tried:
            self._syncs_tried = tried
            self.liveness.beat(NETWORK)


def network_settings(configuration: Configuration) -> NetworkSettings:
    """Return the settings of the CANopen network."""
    nodes = configuration.nodes
    nodes = configuration.nodes
    return NetworkSettings(
        nodes=configuration.described(),
        sync_rate_Hz=configuration.sync.rate_Hz,
        gear_ratio=configuration.drivetrain.ratio,
        master_heartbeat_s=nodes.heartbeat_ms / 2000,
        master_lost_after_s=nodes.heartbeat_timeout_ms / 1000,
        node_heartbeat_s=nodes.heartbeat_ms / 1000,
        node_lost_after_s=nodes.heartbeat_timeout_ms / 1000,
        sdo_timeout_s=nodes.sdo_timeout_s,
        boot_up_timeout_s=nodes.boot_timeout_s,
        other_node_ids=frozenset(map(int, configuration.brakes)),
    )


def event_json(event: NetworkEvent, suppressed: int = 0) -> bytes:
    """Return an event as JSON: name of its class, its fields, and how many before it were not recorded, if any."""
    content = {"event": type(event).__name__, **asdict(event)}
    if suppressed:
        content["suppressed"] = suppressed
    return json.dumps(content, default=_plain).encode()


def _plain(value: Any) -> Any:  # noqa: ANN401  # any field of an event
    if isinstance(value, bytes):
        return value.hex()
    return value.value if isinstance(value, Enum) else str(value)


def _recorder(
    configuration: Configuration,
    terrain: TerrainNetwork | AbsentTerrainNetwork,
    preamble: Callable[[], Sequence[Frame]],
) -> Recorder:
    metadata = {
        "configuration": configuration.model_dump_json(),
        "model_version": terrain.card.version,
        "started_ns": str(time.time_ns()),
        **eds_metadata(configuration),
    }
    return Recorder(configuration.recording, configuration.bus.channel, metadata, preamble=preamble)
