"""The virtual rover: all nodes, and the plant that they measure, on one bus.

    async with open_bus("virtual", "demo") as bus:
        await VirtualRover(plant).run(bus)

One task receives and sends for all nodes. At each SYNC the plant is measured once, so that all nodes report the same
instant. All waiting frames are read before any deadline is checked: after a pause of the process itself, the master's
heartbeat is not taken for lost.
"""

from __future__ import annotations

import asyncio
import heapq
import itertools
import json
import time
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id
from regolithd.drivers.devices.motor_controller import VirtualMotorController
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.registry import DEVICES
from regolithd.drivers.errors import BusError
from regolithd.drivers.virtual.fault_injection import inject_fault
from regolithd.drivers.virtual.node import VirtualNode
from regolithd.drivers.virtual.plant import WHEELS
from regolithd.drivers.virtual.real_nodes import RealNodes

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable

    from regolithd.drivers.can.bus import Bus
    from regolithd.drivers.virtual.plant import Array, Plant

KAPVIK = tuple(
    NodeDescription(device.default_node_id + (wheel or 0), device, wheel, required=device.per_wheel)
    for device in DEVICES
    for wheel in (range(WHEELS) if device.per_wheel else (None,))
)
"""One device of each kind for the body, or six, with their default node-IDs."""

MOVING_STEP_NS = 20_000_000
"""Interval at which the drives' ramps are advanced between SYNCs."""
IDLE_STEP_NS = 200_000_000
LONGEST_STEP_S = 5.0
"""A clock step is limited to this, in either direction."""


class VirtualRover:
    """All nodes of a rover.

    Parameters
    ----------
    plant
        The simulated rover.
    nodes
        The nodes on the bus.
    virtual
        Node-IDs of those that are virtual; None: all. The plant follows what the others, real ones, report.
    follow_loads
        Called before each measurement with the loads [N] of real load cells, shape (6,), NaN where there is none.
    on_frame
        Called with each frame that another node sent.
    monotonic_ns, wall_ns
        Clocks for deadlines, and for the frames' kernel times.
    """

    def __init__(
        self,
        plant: Plant,
        nodes: Iterable[NodeDescription] = KAPVIK,
        *,
        virtual: Collection[int] | None = None,
        follow_loads: Callable[[Array], None] = lambda _load_N: None,
        on_frame: Callable[[Frame], None] = lambda _frame: None,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._plant = plant
        self._monotonic_ns = monotonic_ns
        self._wall_ns = wall_ns
        self._at_once: list[Frame] = []
        self._later: list[tuple[int, int, Frame]] = []
        self._order = itertools.count()
        described = tuple(nodes)
        ids = {each.node_id for each in described} if virtual is None else set(virtual)
        self.nodes = {each.node_id: VirtualNode(each, self._emit) for each in described if each.node_id in ids}
        self._real = RealNodes(each for each in described if each.node_id not in ids)
        self._follow_loads = follow_loads
        self._on_frame = on_frame
        self._drives = [node.device for node in self.nodes.values() if isinstance(node.device, VirtualMotorController)]
        self._time_s = 0.0
        self._advanced_ns: int | None = None  # by the wall clock, as is `_sync_ns`
        self._step_due = 0
        self._sync_ns: int | None = None
        self._bus_counts: Counter[str] = Counter()

    # Behaviour, without input or output

    def power_on(self, now: int) -> None:
        """Switch every node on."""
        for node in self.nodes.values():
            node.power_on(now)

    def take(self, frame: Frame, now: int) -> None:
        """Let all nodes see a frame."""
        if frame.sent or frame.error:
            return
        self._real.take(frame)
        self._on_frame(frame)
        if any(frame.can_id == node.sync_cob_id for node in self.nodes.values()):
            self._bus_counts["sync"] += 1
            self._step(frame.time_ns, now)
            interval_ns = frame.time_ns - self._sync_ns if self._sync_ns is not None else 0
            self._sync_ns = frame.time_ns
            self._step_due = now + max(IDLE_STEP_NS, 3 * interval_ns)
        elif frame.can_id < cob_id.ERROR_CONTROL:
            self._advance(frame.time_ns)  # what a command changes begins now, not at the last step
        for node in self.nodes.values():
            node.receive(frame, now)

    def tick(self, now: int) -> None:
        """Do what is due at `now`."""
        if now >= self._step_due:
            self._step(self._wall_ns(), now)
            self._step_due = now + (MOVING_STEP_NS if any(drive.busy for drive in self._drives) else IDLE_STEP_NS)
        for node in self.nodes.values():
            due = node.due()
            if due is not None and now >= due:
                node.tick(now)

    def due(self) -> int:
        """Return when `tick` (or `outgoing`) has something to do next."""
        moments = [due for node in self.nodes.values() if (due := node.due()) is not None]
        if self._later:
            moments.append(self._later[0][0])
        return min([self._step_due, *moments])

    def outgoing(self, now: int) -> list[Frame]:
        """Return and remove the frames that are due."""
        frames, self._at_once = self._at_once, []
        while self._later and self._later[0][0] <= now:
            frames.append(heapq.heappop(self._later)[2])
        return frames

    def inject_fault(self, line: str) -> str:
        """Execute a command of `virtual.fault_injection` and return its answer; the command `counts` returns JSON."""
        return (
            json.dumps(self.counts())
            if line.split() == ["counts"]
            else inject_fault(self.nodes, line, self._monotonic_ns())
        )

    def counts(self) -> dict[str, dict[str, int]]:
        """Return the numbers of received and sent messages: `bus` for all nodes, then each node by its ID."""
        return {"bus": dict(self._bus_counts)} | {str(node.id): dict(node.counts) for node in self.nodes.values()}

    def _emit(self, due: int, can_id: int, data: bytes) -> None:
        frame = Frame(0, can_id, data)
        if due:
            heapq.heappush(self._later, (due, next(self._order), frame))
        else:
            self._at_once.append(frame)

    def _step(self, wall_ns: int, now: int) -> None:
        """Advance all nodes to `wall_ns` and let them measure the plant."""
        self._advance(wall_ns)
        self._follow_loads(self._real.load_N)
        measurement = self._plant.measure(self._time_s, self._motor_speeds())
        for node in self.nodes.values():
            node.measure(measurement, now)

    def _advance(self, wall_ns: int) -> None:
        """Advance the devices to `wall_ns`."""
        elapsed_s = 0.0 if self._advanced_ns is None else (wall_ns - self._advanced_ns) / 1e9
        if self._advanced_ns is not None and -LONGEST_STEP_S < elapsed_s <= 0:
            return  # the frame came while the clock was being read
        elapsed_s = min(max(elapsed_s, 0.0), LONGEST_STEP_S)
        self._advanced_ns = wall_ns
        self._time_s += elapsed_s
        for node in self.nodes.values():
            node.advance(elapsed_s)

    def _motor_speeds(self) -> Array:
        speeds = np.nan_to_num(self._real.motor_speed_rad_s)
        for drive in self._drives:
            if drive.wheel is not None:
                speeds[drive.wheel] = drive.direction * drive.speed_rad_s
        return speeds

    # The bus

    async def run(self, bus: Bus) -> None:
        """Serve the bus until cancelled."""
        self.power_on(self._monotonic_ns())
        while True:
            for frame in await self._receive(bus):
                self.take(frame, self._monotonic_ns())
            self.tick(self._monotonic_ns())
            await self._send(bus, self.outgoing(self._monotonic_ns()))

    async def _receive(self, bus: Bus) -> list[Frame]:
        """Return the frames that have arrived; empty once something else is due."""
        for timeout_s in ((self.due() - self._monotonic_ns()) / 1e9, 0.0):
            try:
                async with asyncio.timeout(max(timeout_s, 0.0)):
                    return await bus.receive()
            except TimeoutError:
                continue  # once more, without waiting: frames may have arrived with the deadline
        return []

    async def _send(self, bus: Bus, frames: list[Frame]) -> None:
        for frame in frames:
            try:
                await bus.send(frame)
                self._bus_counts["sent"] += 1
            except BusError:
                self._bus_counts["unsent"] += 1  # the frame is lost, as it would be for a real node
