"""The CANopen master: boots, supervises and commands the nodes of one bus.

    async with open_bus("socketcan", "can0") as bus, asyncio.TaskGroup() as tasks:
        network = Network(bus, settings, on_frames=record, on_signals=acquire, on_event=publish)
        tasks.create_task(network.run())
        await network.settled()
        await network.enable()
        await network.set_speed((0.29,) * 6)

`run` is the bus's only reader, and the only one that decodes: each batch of frames goes to `on_frames` as received, and
to `on_signals` as decoded. Cancelling `run` stops the network: the drives are stopped and disabled, then every node is
set to pre-operational.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from regolithd.drivers.can.bus import Bus, BusState
from regolithd.drivers.canopen.emcy import Emergency
from regolithd.drivers.canopen.heartbeat import produce_heartbeat
from regolithd.drivers.canopen.nmt import NmtCommand
from regolithd.drivers.canopen.sync import produce_sync
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import NodeState, Reading, Sync
from regolithd.drivers.devices.motor_controller import STATUSWORD
from regolithd.drivers.errors import DriverError
from regolithd.drivers.master.boot_configuration import CONSUMER_HEARTBEAT, monitors_master
from regolithd.drivers.master.cia402 import DriveState
from regolithd.drivers.master.drive import Drive
from regolithd.drivers.master.events import (
    BusStateChanged,
    DriveStateChanged,
    MotionStopped,
    NetworkEvent,
    NodeEmergency,
    NodeLost,
)
from regolithd.drivers.master.heartbeat_consumer import HeartbeatConsumer
from regolithd.drivers.master.intruders import IntruderWatch
from regolithd.drivers.master.motion import Motion, each
from regolithd.drivers.master.remote_node import RemoteNode
from regolithd.drivers.master.status import NetworkCounters, NetworkSettings, NodePhase, NodeStatus
from regolithd.drivers.master.supervisor import Supervisor

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.canopen.sdo_client import SdoClient
    from regolithd.drivers.devices.decoding.signals import Signal
    from regolithd.drivers.devices.node import NodeDescription

__all__ = ["Network", "NetworkCounters", "NetworkSettings", "NodePhase", "NodeStatus"]

_LEAVE_TIMEOUT_S = 2.0
"""Time to stop and disable the drives at the end; they have been told to stop even where they do not confirm it."""
_LAST_COMMANDS_TIMEOUT_S = 0.4  # where the transmit queue is full, or the link down, commands would wait for each node
_BUS_STATES = {
    BusState.ACTIVE: "the bus is error active",
    BusState.WARNING: "many errors on the bus: check the terminators (60 Ω between the wires), cable length and plugs",
    BusState.PASSIVE: "the controller is error passive: is any other node powered, and is the bit rate right?",
    BusState.OFF: "bus-off: the controller left the bus. `ip link set {channel} type can restart-ms 100` recovers it",
    BusState.DOWN: "the link is down or the adapter is gone: `ip link set {channel} up`, or plug it in",
}


class Network:
    """Boots, supervises and commands the nodes of one bus. One task runs `run`; commands may come from any task.

    Parameters
    ----------
    bus
        An open bus, which `run` alone reads.
    on_frames
        Called with each batch of frames, in order, before they are decoded. Must not block.
    on_signals
        Called with the signals of a batch of frames, in order. Must not block.
    on_event
        Called with each event as it happens. Must not block.

    Attributes
    ----------
    decoder
        Decodes the frames, and counts those that it cannot decode.
    intruders
        Watches for nodes that are not configured, and for a second master.
    """

    def __init__(
        self,
        bus: Bus,
        settings: NetworkSettings,
        *,
        on_frames: Callable[[Sequence[Frame]], None] = lambda _batch: None,
        on_signals: Callable[[Sequence[Signal]], None] = lambda _signals: None,
        on_event: Callable[[NetworkEvent], None] = lambda _event: None,
    ) -> None:
        self.bus = bus
        self.settings = settings
        self.decoder = Decoder(settings.nodes, master_id=settings.master_id)
        self.intruders = IntruderWatch(
            {node.node_id for node in settings.nodes} | settings.other_node_ids, master_id=settings.master_id
        )
        self._heartbeats = HeartbeatConsumer(settings.node_lost_after_s)
        self._counters = NetworkCounters()
        self._on_frames = on_frames
        self._on_signals = on_signals
        self._on_event = on_event
        self._sdo_clients: dict[int, SdoClient] = {}  # by the COB-ID of the answers
        self._supervisors: dict[int, Supervisor] = {}
        self._drives: dict[int, Drive] = {}
        self._bus_state = bus.state
        self._stop_cause: NodeLost | DriveStateChanged | None = None
        self._stop_requested = asyncio.Event()
        for node in settings.nodes:
            self._add(node)
        self._motion = Motion(self._drives, self._status, gear_ratio=settings.gear_ratio)

    @property
    def status(self) -> Mapping[int, NodeStatus]:
        """Status of each node, by node-ID."""
        return {node_id: self._status(node_id) for node_id in self._supervisors}

    @property
    def counters(self) -> NetworkCounters:
        """Counters of SYNC, heartbeat and SDO."""
        clients = [supervisor.remote.sdo for supervisor in self._supervisors.values()]
        self._counters.sdo_transfers = sum(client.transfers for client in clients)
        self._counters.sdo_failures = sum(client.failures for client in clients)
        return self._counters

    async def run(self) -> None:
        """Read the bus, boot and supervise the nodes, produce SYNC and heartbeat; until cancelled."""
        settings = self.settings
        async with asyncio.TaskGroup() as lasting:
            reader = lasting.create_task(self._read())
            beat = lasting.create_task(
                produce_heartbeat(self.bus, settings.master_id, settings.master_heartbeat_s, self._count_heartbeat)
            )
            try:
                async with asyncio.TaskGroup() as tasks:
                    tasks.create_task(produce_sync(self.bus, settings.sync_rate_Hz, self._counters.sync))
                    tasks.create_task(self._heartbeats.run())
                    tasks.create_task(self._stop_when_requested())
                    for supervisor in self._supervisors.values():
                        tasks.create_task(supervisor.run())
            finally:
                await self._leave()
                reader.cancel()
                beat.cancel()

    async def settled(self) -> None:
        """Wait until each node is operational or has failed its first boot."""
        for supervisor in self._supervisors.values():
            await supervisor.remote.changed.until(lambda supervisor=supervisor: supervisor.attempts > 0)  # type: ignore[misc]

    async def enable(self) -> None:
        """Bring all drives to operation enabled, standing still; a fault is reset first.

        Raises
        ------
        DriveError
            A drive is not on the bus, or does not reach the state; the message names both. No drive stays enabled.
        """
        await self._motion.enable()

    async def set_speed(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """Turn the wheels at these speeds [rad/s at the wheel, index k − 1 for wheel k]; one RPDO per drive.

        Raises
        ------
        DriveError
            A drive is not in operation enabled, or cannot turn so fast (0x607F), or the wheels were stopped since;
            nothing has been sent then.
        BusError
            It could not be sent; all drives are stopped, or stop by themselves without the master's heartbeat.
        """
        await self._motion.set_speed(wheel_speed_rad_s)

    async def quick_stop(self) -> None:
        """Stop all wheels with the quick-stop ramp, now, and wait for standstill; then they are locked.

        Raises
        ------
        DriveError
            A drive that is on the bus does not stop. The others are stopped even where one is lost.
        """
        await self._motion.quick_stop()

    async def disable(self) -> None:
        """Disable the motors' voltage; wheels that turn are stopped first. Raises as `quick_stop` does."""
        await self._motion.disable()

    def _add(self, node: NodeDescription) -> None:
        node_id = node.node_id
        remote = RemoteNode(self.bus, node, sdo_timeout_s=self.settings.sdo_timeout_s)
        self._supervisors[node_id] = Supervisor(remote, self.settings, self._heartbeats, self._emit)
        self._sdo_clients[remote.answer_cob_id] = remote.sdo
        if node.device.commanded:
            self._drives[node_id] = Drive(self.bus, remote)

    def _status(self, node_id: int) -> NodeStatus:
        status = self._supervisors[node_id].status
        drive = self._drives.get(node_id)
        return status if drive is None else replace(status, drive_state=drive.state)

    async def _read(self) -> None:
        async for batch in self.bus:
            if batch:
                self._on_frames(batch)
                self._on_signals(self._decode(batch))
            if self.bus.state is not self._bus_state:
                self._bus_state = self.bus.state
                text = _BUS_STATES[self._bus_state].format(channel=self.bus.channel)
                self._emit(BusStateChanged(time.time_ns(), self._bus_state, f"{self.bus.channel}: {text}"))

    def _decode(self, batch: Sequence[Frame]) -> list[Signal]:
        """Return the signals of a batch, after the nodes that they come from have taken them."""
        signals: list[Signal] = []
        decode, sdo_clients = self.decoder.decode, self._sdo_clients
        for frame in batch:
            signal = decode(frame)
            if signal is not None:
                signals.append(signal)
                if not frame.sent:
                    self._take(signal, frame)
            elif frame.sent:
                continue
            elif frame.can_id in sdo_clients and frame.ordinary:
                sdo_clients[frame.can_id].handle(frame)
            else:
                self._watch(frame)
        return signals

    def _watch(self, frame: Frame) -> None:
        event = self.intruders.take(frame)
        if event is not None:
            self._emit(event)

    def _take(self, signal: Signal, frame: Frame) -> None:
        match signal:
            case Reading(node_id=node_id) if node_id in self._drives:
                self._take_statusword(self._drives[node_id], signal)
            case NodeState(node_id=node_id):
                self._supervisors[node_id].remote.take_state(signal)
            case Emergency(node_id=node_id):
                self._take_emergency(self._supervisors[node_id], signal)
            case Sync():
                self._watch(frame)
            case _:
                pass

    def _take_emergency(self, supervisor: Supervisor, emergency: Emergency) -> None:
        node = supervisor.remote.node
        supervisor.count_emergency()
        said = "error reset" if emergency.cleared else f"error 0x{emergency.code:04X}: {emergency.text}"
        text = f"node {node.node_id} ({node.kind}): {said}"
        self._emit(NodeEmergency(emergency.time_ns, node.node_id, emergency, text))

    def _take_statusword(self, drive: Drive, reading: Reading) -> None:
        statusword = next((value for quantity, value in reading.values if quantity is STATUSWORD), None)
        if statusword is None:
            return  # its diagnostic TPDO
        before = drive.reported
        state = drive.take_statusword(int(statusword))
        if state is not before:
            text = f"drive {drive.node_id}: {before} → {state}"
            self._emit(DriveStateChanged(reading.time_ns, drive.node_id, state, text))

    def _count_heartbeat(self, sent: bool) -> None:
        self._counters.heartbeats_sent += sent
        self._counters.heartbeats_failed += not sent

    def _emit(self, event: NetworkEvent) -> None:
        if isinstance(event, NodeLost) and event.node_id in self._drives:
            self._drives[event.node_id].forget()
        if self._motion.moving and isinstance(event, NodeLost | DriveStateChanged) and self._ends_motion(event):
            self._stop_cause = event
            self._stop_requested.set()
        self._on_event(event)

    def _ends_motion(self, event: NodeLost | DriveStateChanged) -> bool:
        if isinstance(event, NodeLost):
            return self._supervisors[event.node_id].remote.node.required
        return event.state is not DriveState.ENABLED

    async def _stop_when_requested(self) -> None:
        """Stop all wheels when one is lost: a rover that drags an unpowered wheel digs itself in."""
        while True:
            await self._stop_requested.wait()
            self._stop_requested.clear()
            event = self._stop_cause
            if event is None or not self._motion.moving:
                continue
            outcome = "all others are stopped"
            try:
                await self._motion.quick_stop(event.text)
            except DriverError as error:
                outcome = str(error)
            self._on_event(MotionStopped(time.time_ns(), event.node_id, f"motion stopped: {event.text}; {outcome}"))

    async def _leave(self) -> None:
        """Stop and disable the drives, end their heartbeat consumers, and set every node to pre-operational."""
        with suppress(DriverError, TimeoutError):
            async with asyncio.timeout(_LEAVE_TIMEOUT_S):
                try:
                    await self.disable()
                finally:
                    live = [drive.remote for drive in self._motion.live() if monitors_master(drive.remote.node)]
                    await each(remote.sdo.write(CONSUMER_HEARTBEAT, 1, bytes(4)) for remote in live)
        with suppress(TimeoutError):
            async with asyncio.timeout(_LAST_COMMANDS_TIMEOUT_S):
                for supervisor in self._supervisors.values():
                    with suppress(DriverError):
                        await supervisor.remote.send_command(NmtCommand.ENTER_PRE_OPERATIONAL)
